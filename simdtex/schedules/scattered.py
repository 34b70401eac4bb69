# SPDX-License-Identifier: BSD-3-Clause
"""Schedules that choose sites at random at every step; a sweep has as many relaxations as sites active at its start."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.model.lattice import Grid
from simdtex.schedules.schedule import Active, Info, Setting
from simdtex.schedules.sites import luby


class ScatteredState(NamedTuple):
    """The state of a random choice.

    ``steps``, the number of choices, which keys the next; ``left``, the relaxations left in the current sweep.
    """

    steps: int = 0
    left: int = 0


class Scattered:
    """A random choice among the active sites, which a subclass defines."""

    name: str
    tile: tuple[int, int] | None = None
    windows = False

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Return the numbers of the chosen sites; at least one site is active."""
        raise NotImplementedError

    def init(self, setting: Setting) -> ScatteredState:
        """Return the state before any choice."""
        return ScatteredState()

    def step(self, setting: Setting, state: ScatteredState, active: Active) -> tuple[ScatteredState, Info]:
        """Return the chosen sites; the sweep ends after as many relaxations as sites were active at its start."""
        wanting, steps = active.numbers().size, state.steps + 1
        chosen = self.choose(setting, steps, active) if wanting else active.numbers()
        left = max(0, (state.left or wanting) - chosen.size) if wanting else 0
        return ScatteredState(steps, left), Info(chosen.astype(np.int32), steps, not left)


class Luby(Scattered):
    """A new random maximal independent set in each step, as in Algorithm 1.

    No two sites of a step are neighbours, equation (14), and no further active site could be added. Sites are chosen
    per step and not per sweep: a sweep may relax one site twice and another not at all.
    """

    name = "luby"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Return the sites of the rounds of Luby, on the machine."""
        machine, grid, offsets, _, seed, level = setting
        mask = machine.put(active.mask().astype(np.uint8))
        return np.flatnonzero(luby(machine, grid, machine.put(offsets), mask, seed, level, steps))


class RandomSubset(Scattered):
    """Each active site with probability p, independently of its neighbours.

    There is no guarantee: neighbours may be chosen together, against equation (14), more rarely for a smaller p. It
    tends to random single sites as p goes to 0, and is `Synchronous` at p = 1.

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
        return grid.size == 1

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Return each active site with probability p."""
        wanting = active.numbers()
        bits = random.draw4(setting.seed, setting.level, steps, setting.grid.key[0] + wanting, random.SCHEDULE)[0]
        return wanting[bits < self.p * 2.0**32]


class RandomScan(Scattered):
    """One site per step, each active one with the same probability: the random scan of textbooks.

    Sites of a step are independent, since it has only one. So are choices: a sweep may relax one site twice and another
    not at all. A sweep has as many steps as sites, so it is for small lattices.
    """

    name = "random-scan"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Return one of the active sites."""
        wanting = active.numbers()
        first, at = divmod(steps, AHEAD)
        ahead = _ahead(setting.seed, setting.level, first * AHEAD, setting.grid.key[0])
        lo, hi = (bits[at : at + 1] for bits in ahead)
        return wanting[random.below(lo, hi, wanting.size)]


AHEAD = 1024


@lru_cache(maxsize=8)
def _ahead(seed: int, level: int, first: int, begin: int) -> list[NDArray[np.uint32]]:
    """Return random bits of many steps; a call for each step would take a hundred times as long."""
    steps = first + np.arange(AHEAD)
    return random.draw4(seed, level, steps, np.full(AHEAD, begin), random.SCHEDULE)[:2]
