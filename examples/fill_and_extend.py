# SPDX-License-Identifier: BSD-3-Clause
"""
Filling holes and extending a picture
=====================================

Fill holes in a picture of gravel, extend it to the right, and make it seamless:
``python fill_and_extend.py [FOLDER] [--size 256]``.

The given pixels do not change; only the missing ones are synthesised.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from skimage import data, draw

import simdtex
from simdtex.io.image import write

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the picture")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

gravel, side = data.gravel()[: args.size, : args.size], args.size
hole = np.zeros(gravel.shape, bool)
hole[draw.ellipse(side // 3, side // 3, side // 8, side // 5)] = True
hole[draw.line(side // 2, side // 2, side - 9, side - 2)] = True

filled = simdtex.fill(gravel, hole, rng=1)
assert (filled[~hole] == gravel[~hole]).all()
wider = simdtex.extend(gravel, right=side // 2, rng=1)
assert (wider[:, :side] == gravel).all()
tile = simdtex.extend(gravel, seamless=True, rng=1)
for label, picture in (("before", gravel), ("after", tile)):
    print(f"seam {label}: {simdtex.quality.seam(picture):.2f} times as strong as the steps between neighbour pixels")

write(folder / "filled.png", filled)
write(folder / "wider.png", wider)
write(folder / "tile.png", tile)
shown = np.where(hole, 255, gravel).astype(np.uint8)
sheet = simdtex.show(shown, filled, wider, titles=["holes", "filled", "continued to the right"])
sheet.savefig(folder / "sheet.png")
sheet = simdtex.show(gravel, tile, titles=["as it is, 3 x 3", "seamless, 3 x 3"], tiled=True)
sheet.savefig(folder / "tile-sheet.png")
print(f"filled.png, wider.png, tile.png and two sheets are in {folder}")
