# SPDX-License-Identifier: BSD-3-Clause
"""Schedules that choose sites at random at every step; their sweep is as many relaxations as sites were active."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.model.lattice import Grid
from simdtex.ops.luby import luby
from simdtex.schedules.partition import neighbourless
from simdtex.schedules.schedule import Active, Info


class State(NamedTuple):
    """What a random choice carries.

    ``machine``, ``grid``, ``offsets``, ``pixel`` the lattice, as `Schedule.init` was given it, and the pixel index
    of its sites; ``seed`` and ``level`` key the choice, ``steps`` counts it; ``left`` relaxations that are left of
    the present sweep; ``mask`` and ``wanting`` what was active last, and its sites.
    """

    machine: Any
    grid: Grid
    offsets: Any
    pixel: NDArray[np.int32]
    seed: int
    level: int
    steps: int = 0
    left: int = 0
    mask: NDArray[np.bool_] | None = None
    wanting: NDArray[np.int64] | None = None


class Scattered:
    """A random choice among the sites that are active now; a subclass says how."""

    name: str

    def choose(self, state: State, wanting: NDArray[np.int64], active: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Sites of the grid out of those that want relaxing."""
        raise NotImplementedError

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> State:
        """Nothing is decided beforehand."""
        return State(machine, grid, machine.put(offsets), grid.sites(), seed, level)

    def step(self, state: State, active: Active) -> tuple[State, Info]:
        """Choose; the sweep ends with as many relaxations as sites were active when it began."""
        mask = active()
        wanting = state.wanting if mask is state.mask else np.flatnonzero(mask)
        assert wanting is not None
        state = state._replace(steps=state.steps + 1, left=state.left or wanting.size, mask=mask, wanting=wanting)
        chosen = self.choose(state, wanting, mask) if wanting.size else wanting
        left = max(0, state.left - chosen.size) if wanting.size else 0
        return state._replace(left=left), Info(state.pixel[chosen], state.steps, not left)


class Luby(Scattered):
    """A fresh random maximal independent set each step, as Algorithm 1 reads.

    Guarantees that no two sites of a step are neighbours, equation (14), and that no further active site could join
    them. Sites are chosen by the step, not by the sweep: within a sweep one may come twice and another not at all.
    """

    name = "luby"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def choose(self, state: State, wanting: NDArray[np.int64], active: NDArray[np.bool_]) -> NDArray[np.int64]:
        """By the rounds of Luby, on the machine."""
        mask = state.machine.put(active.astype(np.uint8))
        chosen = luby(state.machine, state.grid, state.offsets, mask, state.seed, state.level, state.steps)
        return np.flatnonzero(chosen)


class RandomSubset(Scattered):
    """Each active site with probability p, neighbours or not.

    Guarantees nothing: neighbours are often chosen together, against equation (14), the more rarely the smaller p is.
    It tends to random single sites as p goes to 0, and is `Synchronous` at p = 1.

    Parameters
    ----------
    p : float
        0.001 to 1.
    """

    def __init__(self, p: float = 0.5) -> None:
        if not 0.001 <= p <= 1:  # below, a small lattice takes forever
            raise ValueError(f"{p} is no share of sites; give one from 0.001 to 1: random-subset:0.5")
        self.p = p
        self.name = "random-subset" if p == 0.5 else f"random-subset:{float(p)!r}".removesuffix(".0")

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Only on a lattice without neighbours."""
        return neighbourless(grid)

    def choose(self, state: State, wanting: NDArray[np.int64], active: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Toss a coin for each."""
        bits = random.draw4(state.seed, state.level, state.steps, wanting, random.SCHEDULE)[0]
        return wanting[bits < self.p * 2.0**32]


class RandomScan(Scattered):
    """One site a step, any of the active ones with the same probability: the textbook's random scan.

    Guarantees independence, a step being one site. Choices are independent of one another: within a sweep one site may
    come twice and another not at all. As many steps as sites: for small lattices.
    """

    name = "random-scan"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def choose(self, state: State, wanting: NDArray[np.int64], active: NDArray[np.bool_]) -> NDArray[np.int64]:
        """One of them."""
        first, at = divmod(state.steps, AHEAD)
        lo, hi = (bits[at : at + 1] for bits in _ahead(state.seed, state.level, first * AHEAD))
        return wanting[random.below(lo, hi, wanting.size)]


AHEAD = 1024


@lru_cache(maxsize=8)
def _ahead(seed: int, level: int, first: int) -> list[NDArray[np.uint32]]:
    """Random bits of many steps in one go: one step at a time they cost a hundred times as much."""
    steps = first + np.arange(AHEAD)
    return random.draw4(seed, level, steps, np.zeros(AHEAD), random.SCHEDULE)[:2]
