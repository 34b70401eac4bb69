# SPDX-License-Identifier: BSD-3-Clause
"""What a schedule is: an init and a step, both pure functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from simdtex.model.lattice import Grid

Active = Callable[[], NDArray[np.bool_]]
"""``active()`` tells, per site of the grid (rows, cols), whether it wants relaxing now; its array never changes."""


class Info(NamedTuple):
    """What a step decided.

    ``sites`` (S,) int32 pixel indices that relax together, none of them twice. ``turn`` keys the random numbers of
    their relaxation: no site is ever relaxed twice under the same. ``last`` whether a sweep ends with this step.
    ``tile`` None, or (rows, cols) of tiles that relax on their own: neighbours in another tile are then read as they
    were when the sweep began.
    """

    sites: NDArray[np.int32]
    turn: int
    last: bool
    tile: tuple[int, int] | None = None


class Schedule(Protocol):
    """A parallel schedule: which sites relax together.

    ``init`` and ``step`` are pure functions: whatever a schedule remembers is in its state, an immutable value of
    any type, and every random choice comes from the counters of `simdtex.random.draw4`.
    """

    name: str

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Whether every step's sites are i.i.d. in the sense of equation (14) on this lattice."""
        ...

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> Any:
        """The state before the first sweep of a level."""
        ...

    def step(self, state: Any, active: Active) -> tuple[Any, Info]:
        """The next state, and what to relax now."""
        ...


def neighbours_in(grid: Grid, offsets: NDArray[np.int32], sites: NDArray[np.int32]) -> tuple[int, int] | None:
    """Two sites that are neighbours, which equation (14) forbids, or None."""
    chosen = np.zeros(grid.plane, bool)
    chosen[sites] = True
    r = grid.neighbours(sites, offsets)
    met = (r >= 0) & chosen[r]
    if not met.any():
        return None
    k, s = np.argwhere(met)[0]
    return int(sites[s]), int(r[k, s])


class Watched:
    """A schedule within another; a subclass looks at what it does.

    Parameters
    ----------
    schedule : Schedule
    """

    def __init__(self, schedule: Schedule) -> None:
        self.schedule = schedule
        self.name = schedule.name
        self.tile = getattr(schedule, "tile", None)

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """As the schedule says."""
        return self.schedule.independent(grid, offsets)


class Checked(Watched):
    """A schedule that is watched: what it says of itself is checked at every step.

    Parameters
    ----------
    schedule : Schedule

    Notes
    -----
    `step` raises RuntimeError where sites stand twice in a step or do not belong to the lattice, and where a
    schedule claims independence and two of its sites are neighbours. Cost: O(sites x neighbours) a step, on the host.
    """

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> Any:
        """The schedule's own state, the lattice to check against, and whether the schedule claims independence."""
        inner = self.schedule.init(machine, grid, offsets, order, seed, level)
        return inner, grid, offsets, self.independent(grid, offsets)

    def step(self, state: Any, active: Active) -> tuple[Any, Info]:
        """The schedule's own step, once it has been checked."""
        inner, grid, offsets, claims = state
        inner, info = self.schedule.step(inner, active)
        if np.unique(info.sites).size != info.sites.size:
            raise RuntimeError(f"the schedule {self.name} relaxes a site twice in one step")
        if not np.isin(info.sites, grid.sites()).all():
            raise RuntimeError(f"the schedule {self.name} relaxes sites that are not of the level's lattice")
        met = neighbours_in(grid, offsets, info.sites) if claims else None
        if met:
            here, there = (divmod(site, grid.width) for site in met)
            raise RuntimeError(
                f"the schedule {self.name} claims independent sites, but {here} and {there} are neighbours "
                "and relax together: equation (14)"
            )
        return (inner, grid, offsets, claims), info
