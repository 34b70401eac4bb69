# SPDX-License-Identifier: BSD-3-Clause
"""Levels during sampling: their thresholds, their structure, and the sources of their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.methods.multires.analysis import Analysis
from simdtex.methods.multires.options import Options
from simdtex.ops.candidates import Sampled, Structure

ANY = 2**32 - 1
"""The threshold that every difference passes."""

LAUNCH = 4e8
"""The most comparisons of the first launch of a level, if no node fails."""


def thresholds(levels: int, alpha: float, beta: float) -> NDArray[np.float64]:
    """Return T of every level (levels,), the finest first: alpha / k**beta (13), k = 1 at the top."""
    k = np.arange(levels, 0, -1, dtype=np.float64)
    with np.errstate(over="ignore"):
        divisor = (k ** float(beta)).astype(np.float32)  # so that the last bit of a libm does not matter
    return np.full_like(k, inf) if alpha == inf else float(alpha) / divisor.astype(np.float64)


def differences(analysis: Analysis, options: Options) -> NDArray[np.uint32]:
    """Return the largest difference of each feature (levels, M) whose square is not above T Z: (9), (10)."""
    table = thresholds(analysis.levels, options.alpha, options.beta)[:, None]
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.sqrt(table * analysis.energy)
    return np.where(np.isinf(table), ANY, np.minimum(largest, ANY)).astype(np.uint32)


def pixels(shapes: Sequence[tuple[int, int]]) -> int:
    """Return the number of pixels of some levels."""
    return sum(rows * cols for rows, cols in shapes)


def first_launch(analysis: Analysis, level: int) -> int:
    """Return the number of pixels in the first launch of a level."""
    return 1 + int(LAUNCH / (pixels(analysis.shapes[level + 1 :]) * analysis.features.shape[1]))


def lattice(shapes: Sequence[tuple[int, int]], first: int) -> NDArray[np.int32]:
    """Return the lattices of `Structure` and `Sampled`: levels one after another, from level ``first`` on."""
    begins = np.cumsum([0, *(rows * cols * (level >= first) for level, (rows, cols) in enumerate(shapes))])
    ragged = [sum((n % 2**level > 0) << axis for axis, n in enumerate(shapes[0])) for level in range(len(shapes))]
    return np.array([(*shape, *rest) for shape, *rest in zip(shapes, begins, ragged, strict=False)], np.int32)


def structure_of(machine: Machine, analysis: Analysis, options: Options) -> Structure:
    """Return the parents' features, and the largest differences of a candidate's features from them."""
    most = differences(analysis, options)
    return Structure(analysis.features, machine.put(most), machine.put(lattice(analysis.shapes, 1)))


def copied(machine: Machine, shapes: Sequence[tuple[int, int]], own: tuple[int, int]) -> Sampled:
    """Return the top level, filled with copies of the sample's, and empty levels below it."""
    row, col = np.indices(shapes[-1], np.int32)
    top = row % np.int32(own[0]) * np.int32(own[1]) + col % np.int32(own[1])
    source = np.concatenate([np.zeros(pixels(shapes[:-1]), np.int32), top.ravel()])
    counts = np.zeros((source.size, 2), np.int32)
    counts[-top.size :, 0] = 1  # all other levels are still to be counted
    return Sampled(machine.put(source), machine.put(counts), machine.put(lattice(shapes, 0)))


def read_sources(
    machine: Machine, sampled: Sampled, shapes: Sequence[tuple[int, int]], level: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return a level's source (rows, cols) and counts (rows, cols, 2)."""
    begin, end = pixels(shapes[:level]), pixels(shapes[: level + 1])
    source, counts = (machine.get(machine.part(a, begin, end)) for a in (sampled.source, sampled.counts))
    return source.reshape(shapes[level]), counts.reshape(*shapes[level], 2)


def places(source: NDArray[np.int32], cols: int) -> NDArray[np.int32]:
    """Return (row, column) of pixels on a last axis."""
    place = np.empty((*source.shape, 2), np.int32)
    place[..., 0] = row = source // np.int32(cols)
    place[..., 1] = source - row * np.int32(cols)  # quicker than divmod
    return place
