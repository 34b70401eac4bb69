# SPDX-License-Identifier: BSD-3-Clause
"""The structure channel: the distance of each pixel of a sample from the border of its bright or its dark part.

Equation (12) matches it as an additional channel, so that a thin joint has an effect at a distance: Lefebvre and Hoppe
(2006). Its sign distinguishes bright parts from dark ones. All sums are of integers: the same bits on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

REACH = 16
"""The distance in pixels beyond which all distances are equal."""

BINOMIAL = (1, 4, 6, 4, 1)
"""Weights of the smoothing, in 1/16: standard deviation 1."""

BOXES = (19, 21, 21)
"""Widths of the successive running sums of the surroundings: standard deviation 10."""

SQUARINGS = 12
"""Number of squarings of a covariance: its 4096th power gives the first principal component."""


def structure(
    pictures: Sequence[NDArray[np.integer]], weight: float, variance: float, top: int
) -> list[NDArray[np.uint16]]:
    """Return the signed distance to the border between the bright and the dark of a sample, as working levels.

    Parameters
    ----------
    pictures : sequence of (C, rows, cols) arrays of integers
        Working levels.
    weight : float
        Standard deviation of the channel, in units of the sample's.
    variance : float
        Variance of the sample, in working levels squared.
    top : int
        Highest working level.

    Returns
    -------
    list of (rows, cols) uint16 arrays
        One array for each picture, on one scale: 0 in the middle of the widest dark part; constant if no pixel is
        brighter than its surroundings.

    Notes
    -----
    A pixel is bright if the first principal component of the sample, smoothed by (1 4 6 4 1)/16 along rows and columns,
    exceeds the mean of its surroundings, nearly a Gaussian of standard deviation 10. The value of a bright pixel is the
    distance to the nearest dark one, less half a pixel; the value of a dark pixel is minus the distance to the nearest
    bright one, plus half a pixel. Both are limited to `REACH`. If the channel would leave 0..top, its weight is
    reduced. Cost: 4 `REACH` passes over the sample.
    """
    smooth = [np.stack([smoothed(channel) for channel in levels]) for levels in pictures]
    by = principal(smooth)
    signed = []
    for levels in smooth:
        component = np.tensordot(by, levels, 1)
        around, total = surroundings(component)
        signed.append(_signed(component * total > around))
    least = min(int(one.min()) for one in signed)
    signed = [one - least for one in signed]
    n, total = sum(one.size for one in signed), sum(int(one.sum()) for one in signed)
    squares, most = sum(int((one * one).sum()) for one in signed), max(int(one.max()) for one in signed)
    spread = sqrt((n * squares - total * total) / n**2)
    if not spread:
        return [np.zeros(one.shape, np.uint16) for one in signed]
    scale = min(weight * sqrt(variance) / spread, top / most)
    return [np.rint(one * scale).astype(np.uint16) for one in signed]


def principal(pictures: Sequence[NDArray[np.integer]]) -> NDArray[np.int64]:
    """Return the first principal component of pictures (C, rows, cols) of integers: (C,) weights, -127 to 127.

    The weights add up to 0 or more; if both signs do, the first weight is positive. All arithmetic is on integers,
    since the last bits of a library's eigenvectors differ from machine to machine.
    """
    channels = len(pictures[0])
    flat = [one.reshape(channels, -1).astype(np.int64) for one in pictures]
    n = sum(one.shape[1] for one in flat)
    sums = [sum(int(one[a].sum()) for one in flat) for a in range(channels)]
    power = [
        [n * sum(int(one[a] @ one[b]) for one in flat) - sums[a] * sums[b] for b in range(channels)]
        for a in range(channels)
    ]
    for _ in range(SQUARINGS):
        shift = max(0, max(abs(value).bit_length() for row in power for value in row) - 64)
        power = [[value >> shift for value in row] for row in power]
        power = [[sum(x * y for x, y in zip(row, col, strict=True)) for col in power] for row in power]  # symmetric
    largest = max(range(channels), key=lambda a: power[a][a])
    vector = power[largest]
    most = max(map(abs, vector))
    if not most:
        return np.ones(channels, np.int64)
    weights = [(254 * value + most) // (2 * most) for value in vector]  # rounded, halves up
    sign = -1 if sum(weights) < 0 or (sum(weights) == 0 and next(filter(None, weights)) < 0) else 1
    return np.array(weights, np.int64) * sign


def smoothed(channel: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return 256 times a channel (rows, cols) smoothed by `BINOMIAL`; edge pixels continue beyond the border."""
    found = channel.astype(np.int64)
    for axis in (0, 1):
        around = np.pad(found, [(2, 2) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        n = found.shape[axis]
        found = np.zeros_like(found)
        for k, weight in enumerate(BINOMIAL):
            found += weight * np.take(around, np.arange(k, k + n), axis)
    return found


def surroundings(component: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return the sums of each pixel's surroundings (rows, cols), and the sum of their weights.

    The mirror image continues the picture beyond its borders.
    """
    total = 1
    for width in BOXES:
        for axis in (0, 1):
            n, before = component.shape[axis], (width + 1) // 2  # one of them for the differences of running sums
            edges = [(before, width // 2) if a == axis else (0, 0) for a in (0, 1)]
            running = np.pad(component, edges, mode="symmetric").cumsum(axis)
            component = np.take(running, np.arange(width, width + n), axis) - np.take(running, np.arange(n), axis)
            total *= width
    return component, total


def _signed(bright: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the distance to the border between bright and dark, negative in the dark, in 1/256 of a pixel."""
    squared = np.where(bright, distance(~bright), distance(bright))
    apart = np.rint(np.sqrt(squared.astype(np.float64)) * 256).astype(np.int64) - 128
    found: NDArray[np.int64] = np.where(bright, apart, -apart)
    return found


def distance(marked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the squared distance of each pixel from the nearest marked one, at most REACH**2; (rows, cols)."""
    along = np.where(marked, 0, REACH).astype(np.int64)  # not SciPy's, whose import takes as long as a default run
    for _ in range(REACH):  # along columns first, then over up to REACH to either side in a row
        along[1:] = np.minimum(along[1:], along[:-1] + 1)
        along[:-1] = np.minimum(along[:-1], along[1:] + 1)
    squared = along * along
    nearest = squared.copy()
    for apart in range(1, min(REACH, marked.shape[1] - 1) + 1):
        nearest[:, apart:] = np.minimum(nearest[:, apart:], squared[:, :-apart] + apart * apart)
        nearest[:, :-apart] = np.minimum(nearest[:, :-apart], squared[:, apart:] + apart * apart)
    return nearest
