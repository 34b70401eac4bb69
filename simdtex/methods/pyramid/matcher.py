# SPDX-License-Identifier: BSD-3-Clause
"""Match-Histogram of Heeger and Bergen (1995)."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.options import Options
from simdtex.ops.matching import distance, inverse_cdf, match_lookup
from simdtex.ops.noise import noise
from simdtex.ops.ranking import ranking
from simdtex.ops.sort import sort

MATCHING = 200
"""About the cost of sorting and matching a value, in multiply-adds, which decides when to wait for the device."""

TIES = 2**20
"""The level in the counter of random numbers for the order of equal values."""


@dataclass(frozen=True)
class Wanted:
    """The target histograms of bands, on a machine.

    ``table`` is sorted values (bands, m), or the inverse of their cumulative distribution (bands, 257), int32;
    ``deviations`` (bands,) are standard deviations, 1 where there is none.
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

    def wanted(self, values: NDArray[np.int32]) -> Wanted:
        """Return the histogram of sorted values (bands, m), for `match`."""
        deviations = values.std(1, dtype=np.float64)
        deviations[deviations == 0] = 1.0
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
        found: dict[str, list[float]] = {}
        for name, moved, scale in self.moved:
            total = np.asarray(self._machine.get(moved)).reshape(len(scale), -1).sum(1)
            found.setdefault(name, []).append(float((total / scale).mean()))
        self.moved.clear()
        return {name: float(np.mean(several)) for name, several in found.items()}
