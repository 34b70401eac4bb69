# SPDX-License-Identifier: BSD-3-Clause
"""
Texture by numbers
==================

Control with guides which material appears where: ``python texture_by_numbers.py [FOLDER] [--size 256]``.

* river.png is a river of pebbles through grass. Labels mark the pebbles in the sample and in the output.
* portrait.png is a portrait in gravel. The guides are the smoothed brightness of the gravel, and a photograph.
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

# The sample: a pond of pebbles in darker grass. It is round, so it contains banks in every direction.
grass, pebbles = data.grass()[:half, :half] * 0.7, data.gravel()[:half, :half] * 1.1
row, col = np.indices((half, half)) / half
pond = (np.hypot(row - 0.5, col - 0.5) < 0.36).astype(np.uint8)
sample = np.where(pond, pebbles, grass).clip(0, 255).astype(np.uint8)

# The labels of the output: a river.
row, col = np.indices(shape) / args.size
river = (abs(col - 0.5 - 0.25 * np.sin(2 * np.pi * row)) < 0.12 + 0.03 * np.cos(9 * row)).astype(np.uint8)
picture = simdtex.synthesize(sample, shape, guide=(pond, river), boundary="open", rng=1)
write(folder / "river.png", picture)
contact_sheet(
    [("sample", sample), ("its labels", pond * 255), ("labels wanted", river * 255), ("river", picture)],
    folder / "river-sheet.png",
)

# Map the tones of the photograph to those of the smoothed gravel, so that each has a counterpart in the sample.
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
