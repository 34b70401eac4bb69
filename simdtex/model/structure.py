# SPDX-License-Identifier: BSD-3-Clause
"""The structure channel: how far each pixel of a sample is from the sample's edges.

A channel more for equation (12) to match, so that a thin joint is felt before it is seen: Lefebvre and Hoppe (2006).
All sums are of integers, so every machine has the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

REACH = 16
"""Pixels beyond which all distances are alike."""

FLAT = 0.85
"""Share of the pixels whose gradient is no edge."""


def structure(
    pictures: Sequence[NDArray[np.integer]], weight: float, variance: float, top: int
) -> list[NDArray[np.uint16]]:
    """Return the signed distance to the edges of a sample's pictures, as working levels.

    Parameters
    ----------
    pictures : sequence of (C, rows, cols) arrays of integers
        Working levels.
    weight : float
        Standard deviation of the channel, in units of the sample's.
    variance : float
        Of the sample, in working levels squared.
    top : int
        Highest working level.

    Returns
    -------
    list of (rows, cols) uint16 arrays
        One for each picture, on one scale: 0 in the middle of the widest edge; all alike where the sample has no edge,
        or nothing else.

    Notes
    -----
    An edge is where the squared gradient, summed over channels, of a picture smoothed by (1 4 6 4 1)/16 along rows and
    columns exceeds that of `FLAT` of all pixels. Outside, the distance is that to the nearest pixel of an edge; inside,
    minus that to the nearest pixel which is none; neither counts beyond `REACH`. Where the channel would leave 0..top,
    its weight is less. Cost: 4 REACH passes over the sample.
    """
    gradients = [steepness(levels) for levels in pictures]
    every = np.concatenate([gradient.ravel() for gradient in gradients])
    limit = np.partition(every, int(FLAT * (every.size - 1)))[int(FLAT * (every.size - 1))]
    signed = [_signed(gradient > limit) for gradient in gradients]
    least = min(int(one.min()) for one in signed)
    signed = [one - least for one in signed]
    n, total = every.size, sum(int(one.sum()) for one in signed)
    squares, most = sum(int((one * one).sum()) for one in signed), max(int(one.max()) for one in signed)
    spread = sqrt((n * squares - total * total) / n**2)
    if not spread:
        return [np.zeros(one.shape, np.uint16) for one in signed]
    scale = min(weight * sqrt(variance) / spread, top / most)
    return [np.rint(one * scale).astype(np.uint16) for one in signed]


def _signed(edge: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the distance to the edge, below 0 inside it, in 1/256 of a pixel."""
    squared = np.where(edge, -distance(~edge), distance(edge))
    found: NDArray[np.int64] = np.rint(np.sign(squared) * np.sqrt(np.abs(squared).astype(np.float64)) * 256).astype(
        np.int64
    )
    return found


def distance(marked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the squared distance of each pixel from the nearest marked one, at most REACH**2; (rows, cols)."""
    along = np.where(marked, 0, REACH).astype(np.int64)  # by hand: importing SciPy's takes as long as a default run
    for _ in range(REACH):  # along columns first, then every row looks up to REACH to either side
        along[1:] = np.minimum(along[1:], along[:-1] + 1)
        along[:-1] = np.minimum(along[:-1], along[1:] + 1)
    squared = along * along
    nearest = squared.copy()
    for apart in range(1, min(REACH, marked.shape[1] - 1) + 1):
        nearest[:, apart:] = np.minimum(nearest[:, apart:], squared[:, :-apart] + apart * apart)
        nearest[:, :-apart] = np.minimum(nearest[:, :-apart], squared[:, apart:] + apart * apart)
    return nearest


def steepness(levels: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the squared gradient of a picture (C, rows, cols), summed over channels, as of `_gradient`."""
    total = np.zeros(levels.shape[1:], np.int64)
    for channel in levels:
        total += _gradient(channel.astype(np.int64))
    return total


def _gradient(channel: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the squared gradient of a channel smoothed, in (1/256 of a level)^2 per (2 pixels)^2."""
    for axis in (0, 1):
        around = np.pad(channel, [(2, 2) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        n = channel.shape[axis]
        at = [np.take(around, np.arange(k, k + n), axis) for k in range(5)]
        channel = at[0] + at[4] + 4 * (at[1] + at[3]) + 6 * at[2]
    padded = np.pad(channel, 1, mode="edge")
    down, right = padded[2:, 1:-1] - padded[:-2, 1:-1], padded[1:-1, 2:] - padded[1:-1, :-2]
    return down * down + right * right
