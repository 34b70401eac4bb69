# SPDX-License-Identifier: BSD-3-Clause
"""Corner tiles: square tiles with coloured corners, which fit together wherever the colours of shared corners agree.

A set has one tile for each combination of four colours, in a torus that holds each combination once (Lagae and Dutre
2006). So neighbours in the torus fit, and means of its pixels, as in mipmaps, are means of pixels that belong together.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

TORUS = {
    2: "0010,0001,0111,1011",
    3: "020012112,201221022,001112222,112112102,100002211,200221212,110001020,012011020,101020102",
}
"""The colours of the corners of the torus, by their number: every window of 2x2 is in it once."""

CYCLE = {2: "0011", 3: "001021122"}
"""The colours of a row of corners that wraps around, by their number: every pair is in it once."""


def torus(colours: int) -> NDArray[np.intp]:
    """Return the colours of the top left corners of the tiles in the torus, (colours**2, colours**2)."""
    return np.array([[int(letter) for letter in line] for line in TORUS[colours].split(",")])


def corners_of(grid: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the corners (rows, cols, 4) of tiles on a torus: top left, top right, bottom left and bottom right."""
    right = np.roll(grid, -1, 1)
    return np.stack([grid, right, np.roll(grid, -1, 0), np.roll(right, -1, 0)], -1)


def numbers(colours: int) -> NDArray[np.intp]:
    """Return the numbers (colours,) * 4 of the tiles in the torus, row by row, by the colours of their corners."""
    tiles = np.empty([colours] * 4, np.intp)
    tiles[tuple(corners_of(torus(colours)).reshape(-1, 4).T)] = np.arange(colours**4)
    return tiles


def laid(corners: NDArray[np.intp], colours: int) -> NDArray[np.intp]:
    """Return the numbers (m, n) of the tiles of a plane from the colours (m + 1, n + 1) of their corners."""
    return np.asarray(numbers(colours)[tuple(np.moveaxis(corners_of(corners)[:-1, :-1], -1, 0))])


def plane(packed: ArrayLike, corners: ArrayLike, colours: int = 2) -> NDArray[Any]:
    """Return a plane of corner tiles.

    Parameters
    ----------
    packed : (rows, cols) or (rows, cols, channels) array
        The torus of a set of tiles, as `simdtex.tileset` returns it, channels last.
    corners : (m + 1, n + 1) array of int
        The colours, from 0, of the corners of m rows and n columns of tiles.
    colours : int
        The number of colours of the set.

    Returns
    -------
    array of the packed tiles' type
        m rows and n columns of tiles.

    Examples
    --------
    >>> import numpy as np
    >>> from simdtex.jobs.tilesets.corners import plane
    >>> plane(np.zeros((64, 64)), np.zeros((4, 6), int)).shape
    (48, 80)
    """
    image, grid = np.asarray(packed), np.asarray(corners)
    rows, cols = (side // colours**2 for side in image.shape[:2])
    tiles = image.reshape(colours**2, rows, colours**2, cols, *image.shape[2:])
    row, col = np.divmod(laid(grid, colours), colours**2)
    return np.asarray(tiles[row, :, col].swapaxes(1, 2).reshape(len(row) * rows, -1, *image.shape[2:]))
