# SPDX-License-Identifier: BSD-3-Clause
"""Repair of a sample that does not wrap around: a piece of the sample, cut where it fits best, covers its edges.

The cut is the least path of Efros and Freeman, "Image quilting for texture synthesis and transfer", SIGGRAPH 2001.
Everything is in integers on the host.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHARE = 8
"""The strip reaches the side divided by this to either side of the seam."""

WIDEST = 64
"""The most pixels to either side of the seam: a wider strip costs more without an effect."""

PLACES = 128
"""The most places of the sample, evenly spaced, from which a strip is tried."""

FITS = 11, 10
"""Edges that differ by at most 11/10 of the difference of inner neighbours are not changed."""

_FAR = np.int64(2**62)


def mend(planes: NDArray[np.int32]) -> NDArray[np.intp]:
    """Return the source of each pixel of a picture that wraps around, made from a picture that does not.

    Columns are first: the picture is rotated by half its width, so that the seam of its left and right edges is in the
    middle. The strip of the picture that fits best is placed over the seam. On either side of the seam the strip ends
    at the path from top to bottom with the least sum of squared differences of the two. Rows are treated in the same
    way, with paths that end where they begin.

    Parameters
    ----------
    planes : (channels, rows, cols) int32 array
        0 to 2**20.

    Returns
    -------
    (rows, cols) int array
        Number of the pixel of ``planes`` at each place, row by row. An axis whose edges already fit, or with fewer than
        16 pixels, is not changed.

    Notes
    -----
    Cost: for each axis at most 128 times a quarter of the picture. Memory: 60 + 20 channels bytes per pixel.
    """
    values = np.moveaxis(planes, 0, -1).astype(np.int64) >> 8  # the squares along any path then fit 64 bits
    place = np.arange(values[..., 0].size).reshape(values.shape[:2])
    if not _fits(values):
        place = _covered(values, place, closed=False)
    values = values.reshape(-1, values.shape[-1])[place].swapaxes(0, 1)
    if _fits(values):
        return place
    return np.ascontiguousarray(_covered(values, place.T, closed=True).T)


def _fits(values: NDArray[np.int64]) -> bool:
    """Return whether the last column fits the first, or there are too few columns."""
    cols = values.shape[1]
    inside, across = int(np.abs(np.diff(values, axis=1)).sum()), int(np.abs(values[:, -1] - values[:, 0]).sum())
    return bool(cols < 2 * SHARE or across * (cols - 1) * FITS[1] <= inside * FITS[0])


def _covered(values: NDArray[np.int64], place: NDArray[np.intp], closed: bool) -> NDArray[np.intp]:
    """Return ``place`` with a strip over the seam of the last column with the first."""
    cols = values.shape[1]
    reach, turn = min(cols // SHARE, WIDEST), cols // 2
    left = turn - reach  # the first column of the strip; the seam is before column `turn`
    there = np.roll(values, turn, 1)[:, left : left + 2 * reach]
    starts = range(0, cols - 2 * reach + 1, -(-cols // PLACES))
    # the least cost of any two paths is good enough to rank places
    least = [sum(int(c.min(1).sum()) for c in _seams(there, values[:, x : x + 2 * reach])) for x in starts]
    best = starts[int(np.argmin(least))]
    first, last = (_path(c, closed)[:, None] for c in _seams(there, values[:, best : best + 2 * reach]))
    col = np.arange(2 * reach)
    rolled = np.roll(place, turn, 1)
    covered = rolled[:, left : left + 2 * reach]
    inside = (col > first) & (col <= reach + last)
    rolled[:, left : left + 2 * reach] = np.where(inside, place[:, best : best + 2 * reach], covered)
    return np.roll(rolled, -turn, 1)


def _seams(there: NDArray[np.int64], strip: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the costs of a cut to the right of each column, for either half, (rows, reach - 1) each."""
    square = ((there - strip) ** 2).sum(-1)
    cost = square[:, :-1] + square[:, 1:]
    reach = strip.shape[1] // 2
    return cost[:, : reach - 1], cost[:, reach:]


def _path(cost: NDArray[np.int64], closed: bool) -> NDArray[np.intp]:
    """Return the column of the least path in each row, (rows,); it moves by 1 at most per row, around if closed."""
    if not closed:
        return _least(cost, None)
    begin = _least(np.concatenate([cost, cost]), None)[len(cost)]  # after one turn the start hardly matters
    return _least(cost, int(begin))


def _least(cost: NDArray[np.int64], begin: int | None) -> NDArray[np.intp]:
    """Return the least path or, with ``begin``, the least of those that begin at this column and end beside it."""
    rows, cols = cost.shape
    total = cost[0].copy()
    if begin is not None:
        total[np.arange(cols) != begin] = _FAR
    back = np.zeros(cost.shape, np.intp)
    for row in range(1, rows):
        padded = np.concatenate([[_FAR], total, [_FAR]])
        near = np.stack([padded[1:-1], padded[:-2], padded[2:]])  # of equals, straight on
        step = near.argmin(0)
        back[row] = np.arange(cols) + np.array([0, -1, 1])[step]
        total = np.minimum(near.min(0) + cost[row], _FAR)
    if begin is not None:
        total[abs(np.arange(cols) - begin) > 1] = _FAR + 1
    path = np.empty(rows, np.intp)
    path[-1] = total.argmin()
    for row in range(rows - 1, 0, -1):
        path[row - 1] = back[row, path[row]]
    return path
