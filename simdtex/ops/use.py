# SPDX-License-Identifier: BSD-3-Clause
"""Penalties on use, so that the sample's sites are used equally often: a site that is used more costs more."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Launcher, Operation
from simdtex.model.lattice import Grid, sums_around
from simdtex.model.sample import Candidates
from simdtex.ops.neighbourhood import Field

CAP = 4.0
"""Excess of use over the fair share above which the penalty is constant."""


@dataclass(frozen=True, eq=False)
class FairUse:
    """The places of a level's candidates, and the fair use of each.

    ``shape`` of the places, (rows, cols) or (layers, rows, cols); ``around``, the number of places from one to the edge
    of its neighbourhood; ``fair`` (places,) int64, the weight of each, 0 if it is no candidate, or None if all are
    equal; ``listed``, whether numbers count the candidates only, or all places; ``kinds`` (places,), the category of
    each, and ``wanted``, the required share of each category in the output, if any; ``strict``, the penalty of a
    category that is used twice too often.
    """

    shape: tuple[int, ...]
    around: int
    fair: NDArray[np.int64] | None = None
    listed: bool = False
    kinds: NDArray[np.intp] | None = None
    wanted: tuple[float, ...] = ()
    strict: float = 0.0

    @cached_property
    def due(self) -> tuple[NDArray[np.int64], int]:
        """The fair weight of the square around each place, and of all places."""
        fair = np.ones(self.shape, np.int64) if self.fair is None else self.fair.reshape(self.shape)
        return sums_around(fair, self.around), int(fair.sum())


@Operation
def use(machine: Launcher | None, field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    """Return the number of sites with t < 1 whose source is each candidate, (n,), on the host.

    The counts are integers, so the order of counting does not matter, and counts of tiles add up.
    """
    if machine is None:
        known = grid.latest(field.temperature) < 1024
        source = grid.latest(field.source)[known]
        number = candidates.index_of[source[source >= 0]]
        return np.bincount(number[number >= 0], minlength=candidates.size).astype(np.int32)
    counts = machine.put(np.zeros(candidates.size, np.int32))
    sites = grid.size
    machine.launch("use", (sites,), sites, field.source, field.temperature, candidates.index_of, counts)
    found: NDArray[np.int32] = machine.get(counts)
    return found


def use_penalty(
    counts: NDArray[np.integer],
    fair_use: FairUse,
    rate: float,
    before: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Return the penalty of each candidate during the next sweep, (n,) float32, to be added to its distance.

    ``counts`` (n,) are from `use`; ``rate`` is lambda N C sigma^2, lambda times the sample's variance times neighbours
    and channels, 0: no penalty; and ``before`` (n or more,) is the penalty during the last sweep. The penalty is
    lambda N C sigma^2 min(4, max(0, u - 1)), where u is the use of the square around a candidate over its fair share.
    With ``before``, the result is the mean of both, so that penalties converge. It is infinite at a place without a
    candidate.

    Penalties are the potentials of a transport problem: giving all output sites the nearest candidates, with every
    candidate used for the same number of sites, is semi-discrete optimal transport, whose dual raises the penalty of
    candidates that are used too often. Cost: some ten passes over the candidates, on the host.
    """
    places, total = prod(fair_use.shape), int(counts.sum())
    there = np.ones(places, bool) if fair_use.fair is None else fair_use.fair > 0
    found = np.zeros(places, np.float32)
    if total and (rate or fair_use.kinds is not None):
        used = np.zeros(places, np.int64)
        used[there if fair_use.listed else slice(None)] = counts
        around, (due, whole) = sums_around(used.reshape(fair_use.shape), fair_use.around), fair_use.due
        excess = around.astype(np.float64) * whole / (np.maximum(due, 1) * np.float64(total)) - 1
        found = (rate * np.clip(excess, 0, CAP)).astype(np.float32).ravel()
        if fair_use.kinds is not None:
            found += _of_kinds(used, fair_use)
    if fair_use.fair is not None:
        found = found[there] if fair_use.listed else np.where(there, found, np.float32(np.inf))
    return found if before is None else (found + before[: found.size]) / np.float32(2)


def _of_kinds(used: NDArray[np.int64], fair_use: FairUse) -> NDArray[np.float32]:
    """Return the penalty of places whose category is used more than its share."""
    assert fair_use.kinds is not None
    counts = np.bincount(fair_use.kinds, used, minlength=len(fair_use.wanted))
    cost = np.zeros(len(fair_use.wanted), np.float32)
    for kind, share in enumerate(fair_use.wanted):
        due = share / sum(fair_use.wanted) * int(used.sum())
        excess = max(0.0, int(counts[kind]) / due - 1) if due else 1.0
        cost[kind] = fair_use.strict * min(1.0, excess)
    return cost[fair_use.kinds]
