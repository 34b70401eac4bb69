# SPDX-License-Identifier: BSD-3-Clause
"""
Pyramid matching: flat, solid and mixed
=======================================

Synthesise stone with the method ``pyramid``: ``python stone_block.py [FOLDER] [--size 128]``.

* flat.png is a larger picture of the grain.
* iterations.png shows how noise converges to grain.
* solid.png shows a block of the grain, and three slices of it.
* mixed.png is the grain in the colours of wood.
"""

import argparse
import tempfile
from pathlib import Path

from skimage import data
from skimage.transform import downscale_local_mean

import simdtex
from simdtex.io.image import write
from simdtex.report.sheet import contact_sheet, view

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=128, help="side of the sample, half that of the flat texture")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

# Reduce gravel to a quarter of its size: no stone is then larger than the filters.
far = downscale_local_mean(data.gravel(), (4, 4)).astype("uint8")
grain = far[: args.size, : args.size]
pictures = []


def keep(progress):
    """Keep the picture of each iteration."""
    if progress.stage:
        pictures.append((progress.doing, progress.image()))


shape = (2 * args.size, 2 * args.size)
flat, output = simdtex.synthesize(grain, shape, method="pyramid", rng=1, callback=keep, full_output=True)
for iteration in output.statistics["iterations"]:
    print(f"iteration {iteration['iteration']}: level 0 was {iteration['distances']['level 0']:.3f} deviations away")
write(folder / "flat.png", flat)
contact_sheet([("the sample", grain), *pictures], folder / "iterations.png", columns=3)

side = args.size // 2
block = simdtex.synthesize_solid(grain, (side, side, side), rng=1)
view(block, folder / "solid.png")

wood = data.coffee()[266:362, 486:582]
mixed = simdtex.mix([wood, grain], shape, palette=0, pattern=1, channel_axis=-1, rng=1)
write(folder / "mixed.png", mixed)
print(f"flat.png, iterations.png, solid.png and mixed.png are in {folder}")
