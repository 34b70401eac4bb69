# SPDX-License-Identifier: BSD-3-Clause
"""Match-Histogram of Heeger and Bergen (1995), and their description of a texture by histograms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.laplacian import noise
from simdtex.methods.pyramid.matching import distance, inverse_cdf, match_lookup, ranking, sort
from simdtex.methods.pyramid.options import Options
from simdtex.methods.pyramid.pyramids import Transform

Sorted = NDArray[np.int32]
"""(bands, m): the values of each band in ascending order."""


@dataclass(frozen=True)
class Histograms:
    """The histograms of one channel, as sorted values.

    ``pixels`` (1, m) int32; ``subbands`` (bands, m) int32 each, in the order of the pyramid:
    `simdtex.methods.pyramid.pyramids.Transform.make`.
    """

    pixels: Sorted
    subbands: list[Sorted]


def histograms(machine: Machine, channel: NDArray[np.int32], *pyramids: Transform) -> Histograms:
    """Return the histograms of a channel (rows, cols) and of its pyramids, one after another: analysis-pyr."""
    picture = machine.put(channel[None])
    subbands = [band for pyramid in pyramids for band in pyramid.make(picture)]
    values = [np.asarray(machine.get(band)) for band in subbands]
    return Histograms(np.sort(channel.reshape(1, -1)), [np.sort(band.reshape(len(band), -1)) for band in values])


def average(parts: Sequence[Sorted], weights: Sequence[float]) -> Sorted:
    """Return the average of the counts of each value in histograms, band by band.

    ``parts`` (bands, m_i) int32 are sorted, as is the result (bands, m), m the largest m_i; ``weights`` are shares, not
    all 0.
    """
    kept = [(part, float(weight)) for part, weight in zip(parts, weights, strict=True) if weight]
    if len(kept) == 1:
        return kept[0][0]
    m = max(part.shape[1] for part, _ in kept)
    total = sum(weight for _, weight in kept)
    shares = np.concatenate([np.full(part.shape[1], weight / total / part.shape[1]) for part, weight in kept])
    values = np.concatenate([part for part, _ in kept], 1)
    averaged = np.empty((len(values), m), np.int32)
    for band, row in zip(averaged, values, strict=True):
        order = np.argsort(row, kind="stable")
        below = np.cumsum(shares[order])
        at = np.searchsorted(below, (np.arange(m) + 0.5) / m * below[-1])
        band[:] = row[order][np.minimum(at, row.size - 1)]
    return averaged


def averaged(textures: Sequence[Histograms], weights: Sequence[float]) -> Histograms:
    """Return the average of the histograms of two or more textures, see `average`."""
    subbands = zip(*(texture.subbands for texture in textures), strict=True)
    return Histograms(
        average([texture.pixels for texture in textures], weights),
        [average(parts, weights) for parts in subbands],
    )


def spliced(low: Histograms, high: Histograms, split: int) -> Histograms:
    """Return the low frequencies of one texture, and its pixels, with the high frequencies of another.

    ``split`` is the number of subbands from ``high``, which are the finest.
    """
    return Histograms(low.pixels, [*high.subbands[:split], *low.subbands[split:]])


MATCHING = 200
"""About the cost of sorting and matching a value, in multiply-adds, which decides when to wait for the device."""

TIES = 2**20
"""The level in the counter of random numbers for the order of equal values."""


@dataclass(frozen=True)
class Wanted:
    """The target histograms of bands, on a machine.

    ``table`` is sorted values (bands, m), or the inverse of their cumulative distribution (bands, 257), int32;
    ``deviations`` (bands,) are standard deviations.
    """

    table: Array
    deviations: NDArray[np.float64]


class Matcher:
    """Match-Histogram with the options of a run, which notes the distances of histograms.

    ``seed`` is that of the order of equal values. ``moved`` lists the distances that values were moved since the last
    call of `distances`: name of the subband, sums on the machine, and their unit (bands,).
    """

    def __init__(self, machine: Machine, options: Options, seed: int) -> None:
        self._machine, self._options, self._seed = machine, options, seed
        self._first: dict[int, Array] = {}
        self.moved: list[tuple[str, Array, NDArray[np.float64]]] = []

    def wanted(self, values: NDArray[np.int32], pixels: Sorted) -> Wanted:
        """Return the histogram of sorted values (bands, m), for `match`; flat bands have the deviation of `pixels`."""
        deviations = values.std(1, dtype=np.float64)
        deviations[deviations == 0] = pixels.std(dtype=np.float64)
        if self._options.match == "lookup":
            values = np.stack([inverse_cdf(band) for band in values])
        return Wanted(self._machine.put(values), deviations)

    def match(self, name: str, values: Array, wanted: Wanted, together: bool = False) -> Array:
        """Return values (bands, planes, ...) with each band's target histogram, per plane or for all planes."""
        bands, planes, *shape = values.shape
        if together:
            planes, shape = 1, [planes, *shape]
        segments = values.reshape((bands * planes, prod(shape)))
        if self._options.match == "rank":
            matched, moved = ranking(self._machine, segments, self._ties(segments.shape[1]), wanted.table)
        else:
            matched = match_lookup(self._machine, segments, wanted.table)
            moved = distance(self._machine, segments, matched)
        self._machine.sync(MATCHING * bands * planes * prod(shape))
        self.moved.append((name, moved, wanted.deviations * planes * prod(shape)))
        return matched.reshape(values.shape)

    def order(self, segments: Array) -> Array:
        """Return indices of each segment's values (segments, n) in ascending order; equal ones in a random order."""
        return sort(self._machine, segments, self._ties(segments.shape[1]))

    def _ties(self, n: int) -> Array:
        """Return the order of equal values among n values."""
        if n not in self._first:
            bits = noise(self._machine, 1, n, self._seed, TIES)
            itself = self._machine.put(np.arange(n, dtype=np.int32))
            self._first[n] = sort(self._machine, bits, itself).reshape(n)
        return self._first[n]

    def distances(self) -> dict[str, float]:
        """Return how far each subband's values were moved since the last call, mean, in its standard deviations."""
        shifts: dict[str, list[float]] = {}
        for name, moved, scale in self.moved:
            total = np.asarray(self._machine.get(moved)).reshape(len(scale), -1).sum(1)
            shifts.setdefault(name, []).append(float((total / scale).mean()))
        self.moved.clear()
        return {name: float(np.mean(several)) for name, several in shifts.items()}
