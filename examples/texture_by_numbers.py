# SPDX-License-Identifier: BSD-3-Clause
"""
Texture by numbers
==================

Guides say what goes where: ``python texture_by_numbers.py [FOLDER] [--size 256]``.

river.png: a river of pebbles winds through grass. Labels say where the sample has pebbles, and where the output is to
have them. portrait.png: a portrait in gravel. The gravel's own smoothed brightness and the photograph are the guides.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage import data
from skimage.transform import resize

import simdtex
from simdtex.io.image import write
from simdtex.report.sheet import contact_sheet

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the textures, twice that of the samples")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)
half, shape = args.size // 2, (args.size, args.size)

# The sample: a pond of pebbles in darker grass. Being round, it shows banks of every direction.
grass, pebbles = data.grass()[:half, :half] * 0.7, data.gravel()[:half, :half] * 1.1
row, col = np.indices((half, half)) / half
pond = (np.hypot(row - 0.5, col - 0.5) < 0.36).astype(np.uint8)
sample = np.where(pond, pebbles, grass).clip(0, 255).astype(np.uint8)

# The output: where the river is to be.
row, col = np.indices(shape) / args.size
river = (abs(col - 0.5 - 0.25 * np.sin(2 * np.pi * row)) < 0.12 + 0.03 * np.cos(9 * row)).astype(np.uint8)
picture = simdtex.synthesize(sample, shape, guide=(pond, river), boundary="open", rng=1)
write(folder / "river.png", picture)
contact_sheet(
    [("sample", sample), ("its labels", pond * 255), ("labels wanted", river * 255), ("river", picture)],
    folder / "river-sheet.png",
)

# The photograph takes on the range of the gravel's smoothed brightness, so that each of its tones has a like.
gravel = data.gravel()[: args.size, : args.size]
tone = gaussian_filter(gravel.astype(float), 2)
photograph = resize(data.camera(), shape, anti_aliasing=True)
wanted = np.interp(photograph, np.quantile(photograph, np.linspace(0, 1, 65)), np.quantile(tone, np.linspace(0, 1, 65)))
portrait = simdtex.synthesize(gravel, shape, guide=(tone, wanted), boundary="open", rng=1)
write(folder / "portrait.png", portrait)
contact_sheet(
    [("gravel", gravel), ("its tones", tone), ("tones wanted", wanted), ("portrait", portrait)],
    folder / "portrait-sheet.png",
)
print(f"river.png, portrait.png and a sheet of each are in {folder}")
