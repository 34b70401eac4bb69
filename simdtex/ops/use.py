# SPDX-License-Identifier: BSD-3-Clause
"""A price on use: the sample's sites are to be used equally often, and one that is used more costs more."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates
from simdtex.ops.neighbourhood import Field

CAP = 4.0
"""Excess of use over the fair share above which the price grows no more."""


@dataclass(frozen=True, eq=False)
class Market:
    """Who competes for sites: the candidates of a level.

    ``shape`` rows and columns of the places where they lie; ``around`` places from one to the edge of its
    neighbourhood; ``fair`` (places,) int64 how much of each is fair, 0 where there is no candidate, or None where all
    are alike; ``listed`` whether numbers run over the candidates alone, or over all places; ``kinds`` (places,) which
    category each is of, and ``wanted`` the share of each in the output, where somebody asks for shares; ``strict`` what
    one costs that is used twice as often as it is to be.
    """

    shape: tuple[int, int]
    around: int
    fair: NDArray[np.int64] | None = None
    listed: bool = False
    kinds: NDArray[np.intp] | None = None
    wanted: tuple[float, ...] = ()
    strict: float = 0.0

    @cached_property
    def due(self) -> tuple[NDArray[np.int64], int]:
        """What is fair in the square around each place, and altogether."""
        fair = np.ones(self.shape, np.int64) if self.fair is None else self.fair.reshape(self.shape)
        return _blurred(fair, self.around), int(fair.sum())


def _reference(field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    known = grid.view(field.temperature) < 1024
    source = grid.view(field.source)[known]
    number = candidates.index_of[source[source >= 0]]
    return np.bincount(number[number >= 0], minlength=candidates.size).astype(np.int32)


def _launch(machine: Launcher, field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    counts = machine.put(np.zeros(candidates.size, np.int32))
    sites = grid.rows * grid.cols
    machine.launch(
        machine.kernel("use", "use"),
        (sites,),
        *(grid.struct, np.int32(sites), field.source, field.temperature, candidates.index_of, counts),
    )
    found: NDArray[np.int32] = machine.get(counts)
    return found


use = Operation("use", _reference, _launch)
"""``use(machine, field, grid, candidates)``: how many known sites (t < 1) each candidate is the source of, on the host.

(n,) int32. Whole numbers, so the order in which sites are counted does not matter, and counts of tiles add up.
"""


def price(
    counts: NDArray[np.integer],
    market: Market,
    rate: float,
    before: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """What each candidate costs during the next sweep, beside its distance.

    Parameters
    ----------
    counts : (n,) array of integers
        From `use`.
    market : Market
        Of n candidates, or of n places.
    rate : float
        lambda N C sigma^2, the sample's variance times neighbours and channels; 0: no candidate costs anything.
    before : (n or more,) float32 array, optional
        The price during the last sweep.

    Returns
    -------
    (n,) float32 array
        lambda N C sigma^2 min(4, max(0, u - 1)), u the use of the square around a candidate over its fair share; the
        mean of that and of `before`, so that prices settle. Infinity at a place without a candidate.

    Notes
    -----
    Prices are the potentials of a transport problem: to give all output sites the nearest candidates while each
    candidate serves as many sites as any other is semi-discrete optimal transport, and its dual raises the price of
    what is asked for too often. Cost: some ten passes over the candidates, on the host.
    """
    places, total = market.shape[0] * market.shape[1], int(counts.sum())
    there = np.ones(places, bool) if market.fair is None else market.fair > 0
    found = np.zeros(places, np.float32)
    if total and (rate or market.kinds is not None):
        used = np.zeros(places, np.int64)
        used[there if market.listed else slice(None)] = counts
        around, (due, whole) = _blurred(used.reshape(market.shape), market.around), market.due
        excess = around.astype(np.float64) * whole / (np.maximum(due, 1) * np.float64(total)) - 1
        found = (rate * np.clip(excess, 0, CAP)).astype(np.float32).ravel()
        if market.kinds is not None:
            found += _of_kinds(used, market)
    if market.fair is not None:
        found = found[there] if market.listed else np.where(there, found, np.float32(np.inf))
    return found if before is None else (found + before[: found.size]) / np.float32(2)


def _of_kinds(used: NDArray[np.int64], market: Market) -> NDArray[np.float32]:
    """The price of being of a category that is used more than it is to be."""
    assert market.kinds is not None
    counts = np.bincount(market.kinds, used, minlength=len(market.wanted))
    cost = np.zeros(len(market.wanted), np.float32)
    for kind, share in enumerate(market.wanted):
        due = share / sum(market.wanted) * int(used.sum())
        excess = max(0.0, int(counts[kind]) / due - 1) if due else 1.0
        cost[kind] = market.strict * min(1.0, excess)
    return cost[market.kinds]


def _blurred(counts: NDArray[np.integer], radius: int) -> NDArray[np.int64]:
    """The sum over the square of this radius around each, as far as it lies within."""
    sums = np.pad(counts.astype(np.int64), ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    rows, cols = (np.arange(n) for n in counts.shape)
    (top, bottom), (left, right) = (
        (np.maximum(at - radius, 0), np.minimum(at + radius + 1, n))
        for at, n in zip((rows, cols), counts.shape, strict=True)
    )
    a, b, c, d = (sums[r][:, q] for r, q in ((bottom, right), (top, right), (bottom, left), (top, left)))
    found: NDArray[np.int64] = a - b - c + d
    return found
