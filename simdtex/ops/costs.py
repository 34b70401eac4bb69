# SPDX-License-Identifier: BSD-3-Clause
"""The costs of a candidate in addition to its distance: use, phase on a lattice, data between the sites, and kind."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher
from simdtex.model.guide import UNKNOWN
from simdtex.model.sample import Candidates
from simdtex.ops.arithmetic import fma32


class Phased(NamedTuple):
    """Cosines and sines of the phases of a regular sample (`simdtex.model.regularity`).

    The phase difference between candidate and site is the same at every neighbour, so only the site itself is compared.
    ``candidates`` (waves, n rounded up to blocks) float32 by number; ``sites`` (waves, H, W) uint16; ``certain``, the
    factor of their differences, whose square is the number of neighbours that they represent; ``free``, the part of the
    cost that is subtracted, so that all candidates within half a step of a phase cost nothing.
    """

    candidates: Array
    sites: Array
    certain: np.float32
    free: np.float32

    def cost(self, numbers: NDArray[np.integer], sites: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return the cost of the phases of candidates ``numbers`` (slots, S or 1) at sites (S,)."""
        d = np.zeros((len(numbers), sites.size), np.float32)
        for y, x in zip(self.candidates, self.sites.reshape(len(self.sites), -1), strict=True):
            e = (x[sites].astype(np.float32) - y[np.maximum(numbers, 0)]) * self.certain
            d = fma32(e, e, d)
        over: NDArray[np.float32] = np.maximum(d - self.free, np.float32(0))
        return over


class Scattered(NamedTuple):
    """Conditioning data between the sites of a level, each compared at its own position.

    ``begin`` (H * W + 1,) int32: the data of the site at pixel index s are begin[s] .. begin[s + 1] - 1; ``reach`` (n,)
    int32 is the pixel offset of each datum in the sample, ``values`` (n, C) uint16 are its grey levels, `UNKNOWN` in
    unknown channels; ``certain`` is the factor of the differences.
    """

    begin: Array
    reach: Array
    values: Array
    certain: np.float32

    def cost(
        self, numbers: NDArray[np.integer], sites: NDArray[np.int32], candidates: Candidates
    ) -> NDArray[np.float32]:
        """Return the distance of candidates ``numbers`` (slots, S or 1) from the data around sites (S,)."""
        d = np.zeros((len(numbers), sites.size), np.float32)
        first, end = self.begin[sites], self.begin[sites + 1]
        place = np.broadcast_to(candidates.positions[np.maximum(numbers, 0)], d.shape)
        for k in range(int((end - first).max(initial=0))):
            here = np.flatnonzero(first + k < end)
            datum = (first + k)[here]
            for x, y in zip(self.values[datum].T, candidates.pixels, strict=False):
                e = (x.astype(np.float32) - y[place[:, here] + self.reach[datum]].astype(np.float32)) * self.certain
                e = np.where(x == UNKNOWN, np.float32(0), e)
                d[:, here] = fma32(e, e, d[:, here])
        return d


class Kinds(NamedTuple):
    """The cost of each kind of candidates at each site: soft data (`simdtex.model.given`).

    ``sites`` (kinds, H, W) float32 are the costs, 0 or more; ``candidates`` (kinds of a candidate, n rounded up to
    blocks) uint16 are the kinds of each candidate, by its number.
    """

    candidates: Array
    sites: Array

    def cost(self, numbers: NDArray[np.integer], sites: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return the cost of the kinds of candidates ``numbers`` (slots, S or 1) at sites (S,)."""
        d = np.zeros((len(numbers), sites.size), np.float32)
        for kind in self.candidates:
            d += self.sites.reshape(len(self.sites), -1)[kind[np.maximum(numbers, 0)], sites]
        return d


class Costs(NamedTuple):
    """All costs: the ``penalty`` (n or more,) float32 of `simdtex.ops.use`, ``phased``, ``scattered`` and ``kinds``."""

    penalty: Array
    phased: Phased | None = None
    scattered: Scattered | None = None
    kinds: Kinds | None = None

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels: kernels/common/costs.h."""
        waves = {"WAVES": len(self.phased.candidates)} if self.phased else {}
        kinds = {"KINDS": len(self.kinds.candidates)} if self.kinds else {}
        return waves | kinds | ({"SCATTERED": self.scattered.values.shape[1]} if self.scattered else {})

    def arguments(self, machine: Launcher, candidates: Candidates) -> tuple[Any, ...]:
        """Return the arguments ``COSTS`` of kernels."""
        nothing = machine.constant(np.zeros((1, 1), np.int32))
        phased = self.phased or Phased(nothing, nothing, np.float32(0), np.float32(0))
        scattered = self.scattered or Scattered(nothing, nothing, nothing, np.float32(0))
        kinds = self.kinds or Kinds(nothing, nothing)
        listed = max(phased.candidates.shape[1], kinds.candidates.shape[1])  # of equal length if there are both
        area = max(prod(phased.sites.shape[1:]), prod(kinds.sites.shape[1:]))
        return (
            *(self.penalty, phased.candidates, listed, phased.sites, area),
            *(phased.certain, phased.free, scattered.begin, scattered.reach, scattered.values, scattered.certain),
            *(candidates.pixels, candidates.plane, candidates.positions),
            *kinds,
        )

    def terms(
        self, numbers: NDArray[np.integer], sites: NDArray[np.int32], candidates: Candidates
    ) -> Iterator[tuple[str, NDArray[np.float32]]]:
        """Yield each cost of candidates ``numbers`` (slots, S or 1) by its name, in NumPy."""
        yield "use", self.penalty[np.maximum(numbers, 0)]
        if self.phased:
            yield "lattice", self.phased.cost(numbers, sites)
        if self.scattered:
            yield "data", self.scattered.cost(numbers, sites, candidates)
        if self.kinds:
            yield "soft", self.kinds.cost(numbers, sites)

    def added(
        self,
        d: NDArray[np.float32],
        numbers: NDArray[np.integer],
        sites: NDArray[np.int32],
        candidates: Candidates,
    ) -> NDArray[np.float32]:
        """Return distances (slots, S) plus all costs of candidates ``numbers`` (slots, S or 1), in NumPy."""
        for _, cost in self.terms(numbers, sites, candidates):
            d = d + cost
        return d
