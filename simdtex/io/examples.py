# SPDX-License-Identifier: BSD-3-Clause
"""The samples of `simdtex demo`, of the live page and of the README: pictures from scikit-image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

EXAMPLES = ("brick", "grass", "gravel")
"""The names of the samples."""

TOP, BOTTOM = (70, 360), (11, 499)
"""First column and width of a rectangle of the wall in the first and in the last row of scikit-image's brick."""

WALL = (264, 216)
"""Rows and columns of that rectangle, seen from the front: bricks 18 pixels wide."""


def example(name: str) -> NDArray[np.uint8]:
    """Return a grey picture (rows, cols) of one of `EXAMPLES`; brick is a wall seen from the front, 264 x 216."""
    from skimage import data

    loaders: Any = data
    picture: NDArray[np.uint8] = getattr(loaders, name)()
    return straightened(picture) if name == "brick" else picture


def straightened(photograph: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the wall in scikit-image's brick without its perspective, which would fit no lattice."""
    from scipy.ndimage import map_coordinates

    row, col = ((np.arange(2 * side) + 0.5) / (2 * side) for side in WALL)  # every pixel is the mean of four
    above, below = ((1 - row) / TOP[1])[:, None], (row / BOTTOM[1])[:, None]  # farther parts look smaller
    x = (above * (TOP[0] + TOP[1] * col) + below * (BOTTOM[0] + BOTTOM[1] * col)) / (above + below)
    y = np.broadcast_to(below * (len(photograph) - 1) / (above + below), x.shape)
    wall = map_coordinates(photograph.astype(np.float64), (y, x), order=1)
    found: NDArray[np.uint8] = np.rint(wall.reshape(WALL[0], 2, WALL[1], 2).mean((1, 3))).astype(np.uint8)
    return found
