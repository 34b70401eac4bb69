# SPDX-License-Identifier: BSD-3-Clause
"""The cost of a candidate: distance, coherence, use, phase on a lattice, data between the sites, kind, and novelty.

`Costs.evaluate` is the only sum of them on the host, as ``kernels/mrf/costs.h`` is on devices.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher
from simdtex.methods.mrf.arithmetic import fma32
from simdtex.methods.mrf.neighbourhood import Near
from simdtex.methods.mrf.square import Square
from simdtex.model.guide import UNKNOWN
from simdtex.model.sample import Candidates

AGAIN = 4
"""Ratio of the penalty for repeating a neighbour's source to that for continuing it, as in kernels/mrf/relax.h."""


class Phased(NamedTuple):
    """Cosines and sines of the phases of a regular sample (`simdtex.model.regularity`).

    The phase difference between candidate and site is the same at every neighbour, so only the site itself is compared.
    ``candidates`` (waves, n rounded up to blocks) float32 by number; ``sites`` (waves, H, W) uint16; ``weight``, the
    factor of their differences, whose square is the number of neighbours that they represent; ``tolerance``, the part
    of the cost that is subtracted, so that all candidates within half a step of a phase cost nothing.
    """

    candidates: Array
    sites: Array
    weight: np.float32
    tolerance: np.float32

    def cost(self, numbers: NDArray[np.integer], sites: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return the cost of the phases of candidates ``numbers`` (slots, S or 1) at sites (S,)."""
        d = np.zeros((len(numbers), sites.size), np.float32)
        for y, x in zip(self.candidates, self.sites.reshape(len(self.sites), -1), strict=True):
            e = (x[sites].astype(np.float32) - y[np.maximum(numbers, 0)]) * self.weight
            d = fma32(e, e, d)
        over: NDArray[np.float32] = np.maximum(d - self.tolerance, np.float32(0))
        return over


class ScatteredData(NamedTuple):
    """Conditioning data between the sites of a level, each compared at its own position.

    ``begin`` (H * W + 1,) int32: the data of the site at pixel index s are begin[s] .. begin[s + 1] - 1; ``reach`` (n,)
    int32 is the pixel offset of each datum in the sample, ``values`` (n, C) uint16 are its grey levels, `UNKNOWN` in
    unknown channels; ``weight`` is the factor of the differences.
    """

    begin: Array
    reach: Array
    values: Array
    weight: np.float32

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
                e = (x.astype(np.float32) - y[place[:, here] + self.reach[datum]].astype(np.float32)) * self.weight
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
    """All costs of a candidate.

    ``penalty`` (n + `simdtex.methods.mrf.square.TAIL` or more,) float32, of `simdtex.methods.mrf.use`; ``discount``, 1
    / (1 + coherence), the factor of the distance of candidates that continue a neighbour's source; ``novelty``, the
    penalty for each neighbour whose source a candidate continues, and `AGAIN` times that for each whose source it is;
    ``phased``, ``scattered`` and ``kinds``.
    """

    penalty: Array
    discount: np.float32 = np.float32(1)
    novelty: np.float32 = np.float32(0)
    phased: Phased | None = None
    scattered: ScatteredData | None = None
    kinds: Kinds | None = None

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels: kernels/mrf/costs.h."""
        return {
            "WAVES": len(self.phased.candidates) if self.phased else 0,
            "SCATTERED": self.scattered.values.shape[1] if self.scattered else 0,
            "KINDS": len(self.kinds.candidates) if self.kinds else 0,
        }

    def arguments(self, machine: Launcher, candidates: Candidates) -> tuple[Any, ...]:
        """Return the arguments ``COSTS`` of kernels after ``at`` and ``levels``."""
        nothing = machine.constant(np.zeros((1, 1), np.int32))
        phased = self.phased or Phased(nothing, nothing, np.float32(0), np.float32(0))
        scattered = self.scattered or ScatteredData(nothing, nothing, nothing, np.float32(0))
        kinds = self.kinds or Kinds(nothing, nothing)
        listed = max(phased.candidates.shape[1], kinds.candidates.shape[1])  # of equal length if there are both
        area = max(prod(phased.sites.shape[1:]), prod(kinds.sites.shape[1:]))
        return (
            *(self.penalty, phased.candidates, listed, phased.sites, area),
            *(phased.weight, phased.tolerance, scattered.begin, scattered.reach, scattered.values, scattered.weight),
            *(candidates.pixels, candidates.plane, candidates.positions),
            *kinds,
        )

    def evaluate(
        self,
        numbers: NDArray[np.integer],
        coherent: NDArray[np.bool_],
        around: Near,
        candidates: Candidates,
        square: Square,
        offsets: NDArray[np.int32],
        terms: dict[str, NDArray[np.float32]] | None = None,
    ) -> NDArray[np.float32]:
        """Return the cost (slots, S) of candidates ``numbers`` (slots, S or 1), infinity in empty slots, in NumPy.

        ``coherent`` (slots, S) are those that continue a neighbour's source. ``terms`` receives the distance of
        equation (12) without guides, and each term that is added to it, by name and in the order of the sum.
        """
        sites, x, u, *_ = around
        cost = whole = square.distance(numbers, x, u, offsets)
        if self.discount != 1:
            cost = np.where(coherent, cost * self.discount, cost)
        if terms is not None:
            there, distance = np.isfinite(whole), whole  # an empty slot is infinitely far
            if candidates.guides:
                distance = square.distance(numbers, x[:, : -candidates.guides], u[:, : -candidates.guides], offsets)
                terms["guide"] = np.subtract(whole, distance, where=there, out=np.zeros_like(whole))
            if self.discount != 1:
                terms["coherence"] = np.subtract(cost, whole, where=there, out=np.zeros_like(whole))
            terms["distance"] = distance
        more = {"use": self.penalty[np.maximum(numbers, 0)]}
        if self.phased:
            more["lattice"] = self.phased.cost(numbers, sites)
        if self.scattered:
            more["data"] = self.scattered.cost(numbers, sites, candidates)
        if self.kinds:
            more["soft"] = self.kinds.cost(numbers, sites)
        if self.novelty:
            times = np.zeros(cost.shape, np.float32)
            pairs = (continuing(candidates, around.source), 1), (candidates.number_of(around.source), AGAIN)
            for repeated, often in pairs:
                for candidate in np.where(repeated < 0, -2, repeated):  # -1 is an empty slot
                    times += np.float32(often) * (numbers == candidate)
            more["novelty"] = self.novelty * times
        for term in more.values():
            cost = cost + term
        if terms is not None:
            terms |= more
        return cost


def continuing(candidates: Candidates, source: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the number of the candidate that continues the source of each neighbour, (N, S); -1 if there is none."""
    p = source - candidates.reach[: len(source), None]
    inside = (source >= 0) & (p >= 0) & (p < candidates.index_of.size)
    return candidates.number_of(np.where(inside, p, np.int32(-1)))
