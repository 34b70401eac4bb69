# SPDX-License-Identifier: BSD-3-Clause
"""Schedules that choose sites at random at every step; their sweep is as many relaxations as sites were active."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.model.lattice import Grid
from simdtex.ops.luby import luby
from simdtex.schedules.partition import neighbourless
from simdtex.schedules.schedule import Active, Info, Setting


class State(NamedTuple):
    """What a random choice carries.

    ``steps`` counts the choices and keys them; ``left`` relaxations that are left of the present sweep.
    """

    steps: int = 0
    left: int = 0


class Scattered:
    """A random choice among the sites that are active now; a subclass says how."""

    name: str
    tile: tuple[int, int] | None = None
    windows = False

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Numbers of sites out of those that are active; there are some."""
        raise NotImplementedError

    def init(self, setting: Setting) -> State:
        """Nothing is decided beforehand."""
        return State()

    def step(self, setting: Setting, state: State, active: Active) -> tuple[State, Info]:
        """Choose; the sweep ends with as many relaxations as sites were active when it began."""
        wanting, steps = active.numbers().size, state.steps + 1
        chosen = self.choose(setting, steps, active) if wanting else active.numbers()
        left = max(0, (state.left or wanting) - chosen.size) if wanting else 0
        sites = setting.grid.pixel_of(np.unravel_index(chosen, setting.grid.shape)).astype(np.int32)
        return State(steps, left), Info(sites, steps, not left)


class Luby(Scattered):
    """A fresh random maximal independent set each step, as Algorithm 1 reads.

    Guarantees that no two sites of a step are neighbours, equation (14), and that no further active site could join
    them. Sites are chosen by the step, not by the sweep: within a sweep one may come twice and another not at all.
    """

    name = "luby"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """By the rounds of Luby, on the machine."""
        machine, grid, offsets, _, seed, level = setting
        mask = machine.put(active.mask().astype(np.uint8))
        return np.flatnonzero(luby(machine, grid, machine.put(offsets), mask, seed, level, steps))


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

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Toss a coin for each."""
        wanting = active.numbers()
        bits = random.draw4(setting.seed, setting.level, steps, wanting, random.SCHEDULE)[0]
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

    def choose(self, setting: Setting, steps: int, active: Active) -> NDArray[np.int64]:
        """Choose one of the active sites."""
        wanting = active.numbers()
        first, at = divmod(steps, AHEAD)
        lo, hi = (bits[at : at + 1] for bits in _ahead(setting.seed, setting.level, first * AHEAD))
        return wanting[random.below(lo, hi, wanting.size)]


AHEAD = 1024


@lru_cache(maxsize=8)
def _ahead(seed: int, level: int, first: int) -> list[NDArray[np.uint32]]:
    """Return random bits of many steps at once: one step at a time they cost a hundred times as much."""
    steps = first + np.arange(AHEAD)
    return random.draw4(seed, level, steps, np.zeros(AHEAD), random.SCHEDULE)[:2]
