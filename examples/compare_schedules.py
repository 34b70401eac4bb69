# SPDX-License-Identifier: BSD-3-Clause
"""
Comparison of schedules
=======================

Run the same job under two built-in schedules and one defined here, and write a report of cost, oscillation and quality:
``python compare_schedules.py [FOLDER] [--size 64]``.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from skimage import data

from simdtex.experiments.comparison import compare
from simdtex.report.schedules import write_comparison
from simdtex.schedules import Partition

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=64, help="side of the textures and of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))


class Wavefront(Partition):
    """Raster order in which all sites without a pending neighbour relax together."""

    name = "wavefront"

    def independent(self, grid, offsets):
        return not grid.torus  # around a seam, two sites of a front may be neighbours

    def groups(self, machine, grid, offsets, order, seed):
        row, col = np.indices((grid.rows, grid.cols))
        return row * (offsets.max() + 1) + col


grass = data.grass()[: args.size, : args.size]
schedules = ["coloring", Wavefront(), "synchronous"]
found = compare(grass, (args.size, args.size), schedules, seeds=[1, 2], order=8, boundary="open", free_sweeps=6)
write_comparison(folder, found)

for entry in found.entries:
    steps, flips = entry.figure("steps").mean, entry.figure("oscillation_free").mean
    kept = "keeps" if entry.independent else "breaks"
    print(f"{entry.name} {kept} equation (14): {steps:.0f} steps, {flips:.2%} of the pixels still flip back")
print(f"the report is {folder / 'index.html'}")
