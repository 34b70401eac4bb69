# SPDX-License-Identifier: BSD-3-Clause
"""Penalties on use: of the sample's sites, so that they are used equally often, and of kinds, by the shares asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Launcher, Operation
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid, gathered, sums_around
from simdtex.model.sample import Candidates

LEAST = 32
"""The fewest sites without all neighbours, at the finest level, that are regions of their own."""

CAP = 4.0
"""Excess of use over the fair share above which the penalty is constant."""

STEPS = 2**14
"""Steps of the penalty of a kind in N C sigma^2."""

FEW = 4
"""Sites of a region at which the change of a penalty is half of that of a large region with the same shares."""


@dataclass(frozen=True, eq=False)
class FairUse:
    """The places of a level's candidates, and the fair use of each.

    ``shape`` of the places, (rows, cols) or (layers, rows, cols); ``around``, the number of places from one to the edge
    of its neighbourhood; ``fair`` (places,) int64, the weight of each, 0 if it is no candidate, or None if all are
    equal; ``listed``, whether numbers count the candidates only, or all places; ``wanted`` (regions, kinds) float64,
    the share that is asked of each kind in each region of the output (`Regions`), if any; ``gain``, the most steps that
    the penalty of a kind changes by after a sweep at the temperature 0; ``cold``, whether penalties are multiplied by
    (1 - t)^2, as distances are.
    """

    shape: tuple[int, ...]
    around: int
    fair: NDArray[np.int64] | None = None
    listed: bool = False
    wanted: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    gain: int = 0
    cold: bool = False

    @cached_property
    def due(self) -> tuple[NDArray[np.int64], int]:
        """The fair weight of the square around each place, and of all places."""
        fair = np.ones(self.shape, np.int64) if self.fair is None else self.fair.reshape(self.shape)
        return sums_around(fair, self.around), int(fair.sum())

    def split(self, each: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return counts or penalties of candidates, and those of kinds in regions, which follow them."""
        first = each.size - self.wanted.size
        return each[:first], each[first:]


@dataclass(frozen=True, eq=False)
class Regions:
    """Regions of the output, in which the share of each kind of candidates (category) is controlled.

    ``p`` (kinds, H, W) float64, the probability of each kind that is asked at each pixel of the output; ``of`` (H, W)
    int32, the region of each pixel, -1 without one; ``kinds`` returns the kinds of pixels (n,) of the sample; ``grid``,
    the finest lattice; ``radius``, that of the neighbourhood; ``unit``, a step of a penalty.

    The fewer neighbours a site has, the less it takes to change its kind. So the sites of a region that lack neighbours
    are regions of their own, one for each distance from the border, unless they are fewer than `LEAST` at the finest
    level. These follow all others.
    """

    p: NDArray[np.float64]
    of: NDArray[np.int32]
    kinds: Callable[[NDArray[np.int32]], NDArray[np.intp]]
    grid: Grid
    radius: int
    unit: np.float32

    @cached_property
    def bordered(self) -> NDArray[np.bool_]:
        """Whether the sites of each region that lack neighbours are regions of their own, (regions,)."""
        near = self.of[(self.grid.near_edge(self.radius) > 0) & (self.of >= 0)]
        return np.bincount(near, minlength=int(self.of.max()) + 1) >= LEAST

    def at(self, grid: Grid) -> NDArray[np.int32]:
        """Return the region of each site of a lattice or a window of it."""
        region: NDArray[np.int32] = grid.cut(grid.decimated(self.of))
        ring = grid.near_edge(self.radius) * gathered(self.bordered, region, False)
        apart: NDArray[np.int32] = region + np.int32(len(self.bordered)) * ring
        return apart

    def wanted(self, grid: Grid) -> NDArray[np.float64]:
        """Return the mean of the probabilities at the sites of each region on a lattice, (regions, kinds)."""
        of, p = self.at(grid), grid.decimated(self.p)
        there, most = of >= 0, (1 + self.radius) * len(self.bordered)
        sums = [np.bincount(of[there], plane[there], most) for plane in p]
        return np.stack(sums, 1) / np.maximum(np.bincount(of[there], minlength=most), 1)[:, None]

    def counts(self, field: Field, grid: Grid) -> NDArray[np.int64]:
        """Return the number of sites with t < 1 and a source of each kind in each region, (regions x kinds,)."""
        source, region = grid.latest(field.source), self.at(grid)
        there = (grid.latest(field.temperature) < 1024) & (source >= 0) & (region >= 0)
        cell = region[there] * len(self.p) + self.kinds(source[there])
        return np.bincount(cell, minlength=(1 + self.radius) * len(self.bordered) * len(self.p))

    def costs(self, soft: NDArray[np.float32], penalty: NDArray[np.float32], grid: Grid) -> NDArray[np.float32]:
        """Return costs ``soft`` (kinds or more, H, W) plus ``penalty`` (regions x kinds,); the least of a site is 0."""
        kinds = len(self.p)
        each = penalty.reshape(-1, kinds) * self.unit
        costs = soft[:kinds] + gathered(each.T, self.at(grid), 0)
        return np.concatenate([costs - costs.min(0), soft[kinds:]])


@Operation
def use(machine: Launcher | None, field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    """Return the number of sites with t < 1 whose source is each candidate, (n,), on the host.

    The counts are integers, so the order of counting does not matter, and counts of tiles add up.
    """
    if machine is None:
        known = grid.latest(field.temperature) < 1024
        index = candidates.number_of(grid.latest(field.source)[known])
        return np.bincount(index[index >= 0], minlength=candidates.size).astype(np.int32)
    counts = machine.put(np.zeros(candidates.size, np.int32))
    sites = grid.size
    machine.launch("use", (sites,), sites, field.source, field.temperature, candidates.index_of, counts)
    uses: NDArray[np.int32] = machine.get(counts)
    return uses


def use_penalty(
    counts: NDArray[np.integer],
    fair_use: FairUse,
    rate: float,
    before: NDArray[np.float32] | None = None,
    temperature: float = 0.0,
) -> NDArray[np.float32]:
    """Return penalties during the next sweep, float32: of each candidate, (n,), and of each kind in each region.

    ``counts`` are from `use` and from `Regions`, in this order; ``rate`` is lambda N C sigma^2; ``before`` are the
    penalties during the last sweep, at the beginning of a level those of the kinds; and ``temperature`` is the mean of
    t over the lattice. The penalty of a candidate is lambda N C sigma^2 min(4, max(0, u - 1)), where u is the use of
    the square around it over its fair share, and the mean with that ``before``, so that penalties converge. It is
    infinite at a place without a candidate. If shares of categories are asked, it is multiplied by (1 - t)^2.

    The penalty of a kind, in whole steps, adds up: after a sweep it rises by gain (1 - t)^2 (n - d) / max(n, d, 1)
    M / (M + `FEW`), where n is the number of its sites in the region, d the number that is asked, and M that of all
    sites there. Distances, which the penalty is added to, are multiplied by (1 - t)^2 as well. If the gain was not, all
    sites of a warm lattice would take one kind, and another one in the next sweep.

    Giving all sites the nearest candidates, with every candidate used for the same number of sites, is semi-discrete
    optimal transport, whose dual raises the penalty of candidates that are used too often.
    """
    counts, of_kinds = fair_use.split(counts)
    factor = (1 - temperature) ** 2 if fair_use.cold else 1.0
    before, kept = fair_use.split(np.zeros(fair_use.wanted.size, np.float32) if before is None else before)
    kept = kept + _changes(of_kinds, fair_use, factor) if before.size else kept
    places, total = prod(fair_use.shape), int(counts.sum())
    there = np.ones(places, bool) if fair_use.fair is None else fair_use.fair > 0
    price = np.zeros(places, np.float32)
    if total and rate:
        used = np.zeros(places, np.int64)
        used[there if fair_use.listed else slice(None)] = counts
        around, (due, whole) = sums_around(used.reshape(fair_use.shape), fair_use.around), fair_use.due
        excess = around.astype(np.float64) * whole / (np.maximum(due, 1) * np.float64(total)) - 1
        price = (rate * factor * np.clip(excess, 0, CAP)).astype(np.float32).ravel()
    if fair_use.fair is not None:
        price = price[there] if fair_use.listed else np.where(there, price, np.float32(np.inf))
    return np.append((price + before[: price.size]) / np.float32(2) if before.size else price, kept)


def _changes(counts: NDArray[np.integer], fair_use: FairUse, factor: float) -> NDArray[np.float32]:
    """Return the changes of the penalties of kinds in regions, whole steps, (regions x kinds,)."""
    counts = counts.reshape(fair_use.wanted.shape)
    total = counts.sum(1, keepdims=True)
    due = fair_use.wanted * total
    excess = (counts - due) / np.maximum(np.maximum(counts, due), 1) * total / (total + FEW)
    changes: NDArray[np.float32] = np.rint(fair_use.gain * factor * excess).astype(np.float32).ravel()
    return changes
