# SPDX-License-Identifier: BSD-3-Clause
"""The structure channel: how far each pixel of a sample is inside its bright or its dark parts.

A channel more for equation (12) to match, so that a thin joint is felt before it is seen: Lefebvre and Hoppe (2006).
Its sign tells a bright stripe from a dark one. All sums are of integers, so every machine has the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

REACH = 16
"""Pixels beyond which all distances are alike."""

BINOMIAL = (1, 4, 6, 4, 1)
"""Weights of the smoothing, in 1/16: standard deviation 1."""

BOXES = (19, 21, 21)
"""Widths of the running sums, one after another, that make the surroundings: standard deviation 10."""

SQUARINGS = 12
"""Squarings of a covariance: its 4096th power is its first principal component."""


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
        Of the sample, in working levels squared.
    top : int
        Highest working level.

    Returns
    -------
    list of (rows, cols) uint16 arrays
        One for each picture, on one scale: 0 in the middle of the widest dark part; all alike if no pixel is brighter
        than its surroundings.

    Notes
    -----
    A pixel is bright if the first principal component of the sample, smoothed by (1 4 6 4 1)/16 along rows and columns,
    exceeds the mean of its surroundings, which is nearly a Gaussian of standard deviation 10. The distance of a bright
    pixel is that to the nearest dark one, less half a pixel; the distance of a dark pixel is minus that to the nearest
    bright one. Neither counts beyond `REACH`. Where the channel would leave 0..top, its weight is less. Cost: 4 `REACH`
    passes over the sample.
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

    The weights add up to 0 or more; of two that do not, the first is positive. Whole numbers throughout: no library's
    eigenvectors, whose last bits differ from machine to machine.
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
    weights = [(254 * value + most) // (2 * most) for value in vector]  # the nearest; halves up
    sign = -1 if sum(weights) < 0 or (sum(weights) == 0 and next(filter(None, weights)) < 0) else 1
    return np.array(weights, np.int64) * sign


def smoothed(channel: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return 256 times a channel (rows, cols) smoothed by `BINOMIAL`; the outermost pixels stand for all beyond."""
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

    Beyond its borders the picture goes on as its mirror image.
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
    """Return the distance to the border between bright and dark, below 0 in the dark, in 1/256 of a pixel."""
    squared = np.where(bright, distance(~bright), distance(bright))
    apart = np.rint(np.sqrt(squared.astype(np.float64)) * 256).astype(np.int64) - 128
    found: NDArray[np.int64] = np.where(bright, apart, -apart)
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
