# SPDX-License-Identifier: BSD-3-Clause
"""The analysis pyramid of a sample: its bands and local texture measures, De Bonet's equations (5) to (7)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.multires.candidates import Sampled, Structure
from simdtex.methods.multires.mend import mend
from simdtex.methods.multires.options import Options
from simdtex.methods.pyramid.laplacian import FILTER_SIDE, bank, filters, half, laplacian_band, laplacian_reduce
from simdtex.methods.pyramid.stretched import Stretched

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Analysis:
    """The analysis pyramid of a sample.

    Attributes
    ----------
    sample : Stretched
    shapes : list of (int, int)
        Rows and columns of each level.
    bands : list of (channels, rows, cols) int32 arrays of the machine
        L_i, level by level, and last the low-pass residue.
    features : (nodes, M) int32 array of the machine
        F^j of the levels from 1 on (7).
    energy : (levels, M) float64 array
        Z of (10): the mean square of each feature over its level, the variance for the residue.
    torus : bool
        Whether pyramids wrap around.
    place : (rows, cols) int array
        Number of the sample's pixel at each place; a different pixel where the edges are repaired.
    """

    sample: Stretched
    shapes: list[tuple[int, int]]
    bands: list[Array]
    features: Array
    energy: NDArray[np.float64]
    torus: bool
    place: NDArray[np.intp]

    @property
    def levels(self) -> int:
        """Number of levels of the pyramid, with the residue."""
        return len(self.shapes)


def pyramid(machine: Machine, picture: Array, levels: int, torus: bool) -> tuple[list[Array], list[Array]]:
    """Return the Gaussian and the Laplacian pyramid of a picture, (5) and (6).

    Parameters
    ----------
    machine : Machine
    picture : (planes, rows, cols) int32 array of the machine
    levels : int
        1 or more.
    torus : bool
        Whether the picture wraps around, or continues as its mirror image.

    Returns
    -------
    gaussian, laplacian : lists of arrays of the machine
        G_0, G_1, ... and L_0, L_1, ...; the last L is the low-pass residue, the last G.
    """
    gaussian = [picture]
    while len(gaussian) < levels:
        gaussian.append(laplacian_reduce(machine, gaussian[-1], torus))
    bands = [laplacian_band(machine, fine, coarse, torus) for fine, coarse in pairwise(gaussian)]
    return gaussian, [*bands, gaussian[-1]]


def analyse(machine: Machine, pixels: NDArray[Any], options: Options) -> Analysis:
    """Return the bands and features of a sample at every level: the first phase of the paper.

    Parameters
    ----------
    machine : Machine
    pixels : (rows, cols, channels) array
    options : Options
        ``orientations``, ``levels``, ``boundary`` and ``edges`` matter.

    Returns
    -------
    Analysis

    Raises
    ------
    ValueError
        There are more levels than the sample has, or the sample has 2**31 values or more.

    Notes
    -----
    Cost: 45 multiply-adds for every pixel and channel, and 3 for every pixel and filter. Memory on the device: 16 bytes
    for every pixel and channel (and luminance, if there are several channels), 3 for every pixel and feature. For the
    repair of edges see `simdtex.methods.multires.mend.mend`.
    """
    rows, cols, channels = pixels.shape
    width = 1 + 2 * options.orientations
    if rows * cols * max(width, channels) >= 2**31:
        raise ValueError(
            f"a sample of {rows} rows x {cols} columns with {width} features is beyond 2**31 values; give a smaller one"
        )
    sample, torus = Stretched(pixels), options.boundary == "torus"
    place = mend(sample.planes) if options.edges == "mend" else np.arange(rows * cols).reshape(rows, cols)
    if options.edges == "mend":
        sample = Stretched(pixels.reshape(-1, channels)[place])
    shapes = _level_shapes((rows, cols), options.levels)
    fits = [min(shape) >= FILTER_SIDE for shape in shapes]
    taps = bank(options.orientations)
    memory.require(machine, rows * cols * (16 * (channels + (channels > 1)) + 3 * width))

    gaussian, bands = pyramid(machine, machine.put(sample.planes), len(shapes), torus)
    guide = gaussian, bands
    if channels > 1:
        guide = pyramid(machine, machine.put(sample.luminance), len(shapes), torus)
    measured, energy = [np.zeros((0 if len(shapes) > 1 else 1, width), np.int32)], [np.zeros(width)]
    for level in range(1, len(shapes)):
        responses = machine.put(taps if fits[level] else np.zeros_like(taps))  # 0 otherwise, (7)
        measured.append(machine.get(filters(machine, guide[0][level], guide[1][level], responses, torus)))
        energy.append(_energy(measured[-1]))
    residue = slice(None, None, 1 + len(taps))
    energy[-1][residue] = _energy(measured[-1][:, residue], about_mean=True)
    if len(taps) and len(shapes) > 1 and not any(fits[1:]):
        _log.warning(
            "no level above the finest of a sample of %d rows x %d columns is as large as the filters, %d x %d: "
            "candidates are compared by their bands alone",
            *(*shapes[0], FILTER_SIDE, FILTER_SIDE),
        )
    return Analysis(sample, shapes, bands, machine.put(np.concatenate(measured)), np.array(energy), torus, place)


def _level_shapes(shape: tuple[int, ...], levels: int | None) -> list[tuple[int, int]]:
    """Return rows and columns of every level, down to a single pixel or to ``levels`` levels."""
    shapes = [(shape[0], shape[1])]
    while max(shapes[-1]) > 1:
        shapes.append(half(shapes[-1]))
    if levels is not None and levels > len(shapes):
        raise ValueError(f"levels={levels} is too many for this sample; give at most {len(shapes)}")
    return shapes[:levels]


def _energy(features: NDArray[np.int32], about_mean: bool = False) -> NDArray[np.float64]:
    """Return Z (M,): the mean square of each column, or its variance, from sums in integers."""
    n = len(features)
    squares, total = np.zeros((2, features.shape[1]), object)
    for first in range(0, n, 2**20):  # the sum of that many squares fits 64 bits
        block = features[first : first + 2**20].astype(np.int64)
        squares += (block * block).sum(0).astype(object)
        total += block.sum(0).astype(object)
    if about_mean:
        return np.array([(n * s - t * t) / n**2 for s, t in zip(squares, total, strict=True)])
    return np.array([s / n for s in squares])


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


def copied(machine: Machine, shapes: Sequence[tuple[int, int]], shape: tuple[int, int]) -> Sampled:
    """Return the top level, filled with copies of the sample's, and empty levels below it."""
    row, col = np.indices(shapes[-1], np.int32)
    top = row % np.int32(shape[0]) * np.int32(shape[1]) + col % np.int32(shape[1])
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
