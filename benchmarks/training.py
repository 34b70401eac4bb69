# SPDX-License-Identifier: BSD-3-Clause
"""Training images beside the channels of ``channels.py``: a network of thin lines without ends, and lenses.

    python benchmarks/training.py [--side 250] [--seed 1] --out FILE

Writes the three, side by side.
"""

import argparse
from pathlib import Path

import numpy as np
from channels import channels
from scipy.spatial import KDTree

from simdtex.io.image import write

CELL = 1600  # pixels of a cell of the network, on average
LINE = 4  # width of its lines, pixels
STRETCH = 2  # cells are so many times as wide as high
SIZES = ((56, 10), (22, 7))  # lengths and heights of lenses, pixels
SHARE = 0.3  # of lenses


def network(shape, rng=None):
    """Make a network (rows, cols) uint8 of lines about 4 pixels wide, 1, of cells that are twice as wide as high."""
    draw = np.random.default_rng(rng)
    rows, cols = shape
    high = np.array([rows * STRETCH, cols])  # where cells are as high as wide
    least = np.sqrt(CELL * STRETCH) / 2  # between the middles of two cells, so that none is tiny
    middles = np.empty((0, 2))
    for one in draw.uniform(-60, high + 60, (20 * high.prod() // CELL, 2)):
        if not len(middles) or ((middles - one) ** 2).sum(1).min() > least**2:
            middles = np.vstack([middles, one])
    place = np.stack(np.indices(shape), -1) * (STRETCH, 1)
    near, which = KDTree(middles).query(place, 2)
    apart = middles[which[..., 1]] - middles[which[..., 0]]
    # the distance from the line between two middles, across it; the stretch makes it longer down
    across = (near[..., 1] ** 2 - near[..., 0] ** 2) / 2 / np.hypot(apart[..., 0] * STRETCH, apart[..., 1])
    return (across < LINE / 2).astype(np.uint8)


def lenses(shape, rng=None):
    """Make lenses (rows, cols) uint8 of two sizes, 1, that lie apart or run together, tilted by 20 degrees at most."""
    draw = np.random.default_rng(rng)
    image, (row, col) = np.zeros(shape, np.uint8), np.indices(shape)
    while image.mean() < SHARE:
        length, height = SIZES[draw.integers(2)]
        i, j, turn = *draw.uniform(-20, np.add(shape, 20)), np.radians(draw.uniform(-20, 20))
        along = (col - j) * np.cos(turn) + (row - i) * np.sin(turn)
        across = (row - i) * np.cos(turn) - (col - j) * np.sin(turn)
        image[(2 * along / length) ** 2 + (2 * across / height) ** 2 <= 1] = 1
    return image


IMAGES = {"channels": channels, "network": network, "lenses": lenses}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=250)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    made = [make((options.side, options.side), options.seed) for make in IMAGES.values()]
    gap = np.full((options.side, 6), 128, np.uint8)
    write(options.out, np.hstack([255 * made[0], gap, 255 * made[1], gap, 255 * made[2]]))


if __name__ == "__main__":
    main()
