# SPDX-License-Identifier: BSD-3-Clause
"""The protocol of schedules: ``init`` and ``step``, both pure functions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine
from simdtex.model.lattice import Grid


class Setting(NamedTuple):
    """The constants of a level.

    ``machine`` executes operations; ``grid`` is the lattice, or a window of it; ``offsets`` (N, 2) int32 and ``order``
    are those of the neighbourhood; ``seed`` and ``level`` are the keys of random choices.
    """

    machine: Machine
    grid: Grid
    offsets: NDArray[np.int32]
    order: int
    seed: int
    level: int


Lists: TypeAlias = tuple[Array, NDArray[np.int64]]
"""The numbers of sites, group after group, and the first index of each group in them, and the end of the last."""


class Active(Protocol):
    """The sites that are active now, and ``kept``: what a schedule has found for the level, such as lists of sites."""

    kept: dict[Any, Any]

    def mask(self) -> NDArray[np.bool_]:
        """Return whether each site is active, (rows, cols), on the host."""
        ...

    def numbers(self) -> NDArray[np.int64]:
        """Return the numbers of the active sites, in ascending order, on the host."""
        ...

    def among(self, sites: Array, starts: NDArray[np.int64], machine: Machine | None = None) -> Lists:
        """Return the active sites of a list, in its order, and the first index of each group, and the end of the last.

        ``sites`` (S,) are numbers, group after group, an array of NumPy or of ``machine``, which may keep its own copy;
        ``starts`` (groups + 1,) the first index of each group, and the end of the last.
        """
        ...


class Masked:
    """The active sites by a constant mask (rows, cols); None: all are active."""

    def __init__(self, grid: Grid, mask: NDArray[np.bool_] | None = None) -> None:
        self._mask = np.ones(grid.shape, bool) if mask is None else mask
        self._numbers = np.flatnonzero(self._mask)
        self.kept: dict[Any, Any] = {}

    def mask(self) -> NDArray[np.bool_]:
        """Return the given mask."""
        return self._mask

    def numbers(self) -> NDArray[np.int64]:
        """Return the numbers of the active sites."""
        return self._numbers

    def among(self, sites: Array, starts: NDArray[np.int64], machine: Machine | None = None) -> Lists:
        """Return the active sites of a list, computed in NumPy."""
        if self._mask.all():
            return sites, starts
        sites = machine.get(sites) if machine else sites
        wanted = self._mask.ravel()[sites]
        return sites[wanted], np.concatenate([[0], np.cumsum(wanted)])[starts]


class Info(NamedTuple):
    """The decision of a step, or of several steps in advance.

    ``sites`` (S,) int32, the numbers of the sites (`simdtex.model.lattice.Grid`), an array of NumPy or of the machine.
    ``turn`` keys the random numbers of their relaxation: no site is relaxed twice with the same turn. ``last``: whether
    a sweep ends with this. ``steps``: None if all sites relax together, or (steps, 2) int64: sites ``steps[0, 0]`` to
    ``steps[0, 1]`` - 1 relax together, then those of ``steps[1]``, and so on.
    """

    sites: Array
    turn: int
    last: bool
    steps: NDArray[np.int64] | None = None

    @property
    def ranges(self) -> NDArray[np.int64]:
        """``steps``, which for a single step has one row."""
        return np.array([[0, self.sites.size]], np.int64) if self.steps is None else self.steps

    def apart(self, machine: Machine) -> Iterator[Info]:
        """Yield the steps one by one, their sites on the host."""
        sites = self.sites if isinstance(self.sites, np.ndarray) else machine.get(self.sites)
        ranges = self.ranges.tolist()
        for step, (begin, end) in enumerate(ranges, 1):
            yield Info(sites[begin:end], self.turn, self.last and step == len(ranges))


@runtime_checkable
class Schedule(Protocol):
    """A parallel schedule: which sites relax together.

    ``init`` and ``step`` are pure functions: all memory of a schedule is in its state, a tuple of plain arrays and
    numbers, and every random choice comes from the counters of `simdtex.random.draw4`.

    Attributes
    ----------
    name : str
    tile : (int, int) or None
        Rows and columns of tiles that relax independently: sites read the values of neighbours in another tile at the
        start of the sweep. None: they read the latest values.
    windows : bool
        Whether a window of a lattice relaxes in the sets of the same sites of the whole, in the same order; it then has
        the bits of the whole, except within a sweep's reach of its edges: steps times the radius of the neighbourhood.
    """

    name: str
    tile: tuple[int, int] | None
    windows: bool

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Return whether the sites of every step are i.i.d. in the sense of equation (14) on this lattice."""
        ...

    def init(self, setting: Setting) -> Any:
        """Return the state before the first sweep of a level."""
        ...

    def step(self, setting: Setting, state: Any, active: Active) -> tuple[Any, Info]:
        """Return the next state, and the sites to relax now."""
        ...


@runtime_checkable
class Windowed(Schedule, Protocol):
    """A schedule whose `windows` is true, with the number of steps of a sweep, which limits its reach."""

    def count(self, grid: Grid, order: int, seed: int) -> int:
        """Return the most steps of a sweep of the whole lattice."""
        ...


def decisions(schedule: Schedule, setting: Setting, state: Any, active: Active) -> Iterator[tuple[Any, Info]]:
    """Yield the decisions of a schedule in a sweep, each with the state of the schedule after it.

    The caller relaxes the sites of a decision before it asks for the next one.
    """
    last = False
    while not last:
        state, info = schedule.step(setting, state, active)
        yield state, info
        last = info.last


def neighbours_in(grid: Grid, offsets: NDArray[np.int32], sites: NDArray[np.int32]) -> tuple[int, int] | None:
    """Return two sites that are neighbours, which equation (14) forbids, or None."""
    chosen = np.zeros(grid.size, bool)
    chosen[sites] = True
    r = grid.neighbours(sites, offsets)
    met = (r >= 0) & chosen[r]
    if not met.any():
        return None
    k, s = np.argwhere(met)[0]
    return int(sites[s]), int(r[k, s])


class Watched:
    """A wrapper of a schedule, with its claims, states and steps; a subclass examines them."""

    def __init__(self, schedule: Schedule) -> None:
        self.schedule = schedule
        self.name, self.tile, self.windows = schedule.name, schedule.tile, schedule.windows

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Return the claim of the schedule."""
        return self.schedule.independent(grid, offsets)

    def init(self, setting: Setting) -> Any:
        """Return the schedule's own state."""
        return self.schedule.init(setting)

    def step(self, setting: Setting, state: Any, active: Active) -> tuple[Any, Info]:
        """Return the schedule's own step."""
        return self.schedule.step(setting, state, active)


class Checked(Watched):
    """A wrapper that checks the claims of a schedule at every step.

    `step` raises RuntimeError if a step has a site twice or one outside of the lattice, or if the schedule claims
    independence and two sites of a step are neighbours. Cost: O(sites x neighbours) per step, on the host.
    """

    def step(self, setting: Setting, state: Any, active: Active) -> tuple[Any, Info]:
        """Return the schedule's own step; raise RuntimeError if it violates a claim of the schedule."""
        state, info = super().step(setting, state, active)
        grid, offsets = setting.grid, setting.offsets
        for sites, *_ in info.apart(setting.machine):
            if np.unique(sites).size != sites.size:
                raise RuntimeError(f"the schedule {self.name} relaxes a site twice in one step")
            if ((sites < 0) | (sites >= grid.size)).any():
                raise RuntimeError(f"the schedule {self.name} relaxes sites that are not of the level's lattice")
            met = neighbours_in(grid, offsets, sites) if self.independent(grid, offsets) else None
            if met:
                here, there = (divmod(site, grid.cols) for site in met)
                raise RuntimeError(
                    f"the schedule {self.name} claims independent sites, but {here} and {there} are neighbours "
                    "and relax together: equation (14)"
                )
        return state, info


class Trimmed(Watched):
    """A wrapper that limits each step to a tile and the rows around it that affect the tile.

    The value of a site depends on its neighbours one step earlier. So in a sweep of n steps, only sites within (n - i)
    times the radius of the neighbourhood around the tile matter in step i. The sites of a step of ``schedule`` are in
    the order of rows, as in a `simdtex.schedules.Partition`. ``top`` is the first row of the tile within the window,
    ``bottom`` the first row below it.
    """

    def __init__(self, schedule: Schedule, top: int, bottom: int) -> None:
        super().__init__(schedule)
        self.top, self.bottom = top, bottom

    def step(self, setting: Setting, state: Any, active: Active) -> tuple[Any, Info]:
        """Return the schedule's own step, without the rows that do not affect the tile."""
        state, info = super().step(setting, state, active)
        sites = info.sites if isinstance(info.sites, np.ndarray) else setting.machine.get(info.sites)
        ranges, radius, width = info.ranges.copy(), int(setting.offsets.max()), setting.grid.cols
        for step, (begin, end) in enumerate(ranges.tolist(), 1):
            reach = (len(ranges) - step) * radius
            rows = np.array([max(0, self.top - reach), self.bottom + reach], np.int64) * width
            ranges[step - 1] = begin + np.searchsorted(sites[begin:end], rows)
        return state, info._replace(steps=ranges)
