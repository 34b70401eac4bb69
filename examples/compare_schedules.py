# SPDX-License-Identifier: BSD-3-Clause
"""
Comparison of schedules
=======================

Run the same job under two built-in schedules and one that is defined here, on one level. The synchronous schedule
relaxes neighbours together, against equation (14): it needs the fewest steps, and the most pixels flip back and forth.
`simdtex.jobs.studies.report.write_comparison` writes the whole report.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data

from simdtex.jobs.studies.comparison import compare
from simdtex.schedules import Partition


class Wavefront(Partition):
    """Raster order in which all sites without a pending neighbour relax together."""

    name = "wavefront"

    def independent(self, grid, offsets):
        return not grid.torus  # around a seam, two sites of a front may be neighbours

    def groups(self, machine, grid, offsets, order, seed):
        row, col = np.indices((grid.rows, grid.cols))
        return row * (offsets.max() + 1) + col


grass = data.grass()[:64, :64]
schedules = ["coloring", Wavefront(), "synchronous"]
found = compare(grass, (64, 64), schedules, seeds=[1], order=8, levels=1, boundary="open", free_sweeps=6)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
for entry in found.entries:
    steps, flips = entry.figure("steps").mean, entry.figure("oscillation_free").mean
    kept = "keeps" if entry.independent else "breaks"
    print(f"{entry.name} {kept} equation (14): {steps:.0f} steps, {flips:.2%} of the pixels still flip back")
    left.bar(entry.name, steps)
    right.bar(entry.name, 100 * flips)
left.set(title="steps", yscale="log")
right.set(title="pixels that flip back, %")
plt.show()
