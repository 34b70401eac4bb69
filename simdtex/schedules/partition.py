# SPDX-License-Identifier: BSD-3-Clause
"""Schedules that cut the lattice into groups and relax one group after another, each active site once a sweep."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.model.lattice import Grid
from simdtex.ops.coloring import coloring
from simdtex.options import whole
from simdtex.schedules.schedule import Active, Info


class State(NamedTuple):
    """What a partition carries.

    ``place`` (sites,) the grid's sites, group after group and row by row within each; ``pixel`` (sites,) their pixel
    indices; ``starts`` (groups + 1,) where each group begins among them; ``seed`` and ``level`` key the groups' order;
    ``sweep`` sweeps begun so far; ``sites`` the present sweep's pixel indices, group after group; ``ends`` where each
    group ends in them; ``done`` groups that were relaxed.
    """

    place: NDArray[np.int32]
    pixel: NDArray[np.int32]
    starts: NDArray[np.int64]
    seed: int
    level: int
    sweep: int
    sites: NDArray[np.int32]
    ends: NDArray[np.int64]
    done: int


class Plan(NamedTuple):
    """A whole sweep that is known beforehand.

    ``sites`` (S,) int32 pixel indices, one step's after the other; ``bounds`` (steps + 1,) where each begins in them,
    and where the last ends; ``turn`` keys the random numbers of all of them.
    """

    sites: NDArray[np.int32]
    bounds: NDArray[np.int64]
    turn: int


class Partition:
    """One group of sites a step; a subclass says which group a site belongs to."""

    name: str
    shuffled = False
    """Whether the groups come in a fresh random order each sweep, or always in their own."""
    tile: tuple[int, int] | None = None

    def __init_subclass__(cls) -> None:
        """A subclass with steps of its own has no sweeps that are known beforehand, unless it says them."""
        if "step" in cls.__dict__ and "sweep" not in cls.__dict__:
            cls.sweep = None  # type: ignore[assignment, method-assign]

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """(rows, cols) whole numbers from 0: the group of each site."""
        raise NotImplementedError

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> State:
        """Lay out the groups, once a level."""
        group = np.ravel(self.groups(machine, grid, offsets, order, seed))
        if group.min() < 0 or group.max() >= group.size:  # numbers with wide gaps
            group = np.unique(group, return_inverse=True)[1]
        few = group.astype(np.uint16) if group.max() < 2**16 else group  # sorts in linear time
        place = np.argsort(few, kind="stable").astype(np.int32)
        starts = np.concatenate([[0], np.cumsum(np.bincount(group))])
        nothing = np.zeros(0, np.int32)
        return State(place, grid.sites()[place], starts, seed, level, 0, nothing, np.zeros(0, np.int64), 0)

    def step(self, state: State, active: Active) -> tuple[State, Info]:
        """The next group that has active sites; a sweep goes by what was active when it began."""
        if state.done == state.ends.size:
            state = self._begin(state, active().ravel())
        begin = int(state.ends[state.done - 1]) if state.done else 0
        sites = state.sites[begin : int(state.ends[state.done])]
        state = state._replace(done=state.done + 1)
        return state, Info(sites, state.sweep, state.done == state.ends.size, self.tile)

    def sweep(self, state: State, active: Active) -> tuple[State, Plan]:
        """All steps of the next sweep in one go."""
        state = self._begin(state, active().ravel())
        return state._replace(done=state.ends.size), Plan(state.sites, np.concatenate([[0], state.ends]), state.sweep)

    def _begin(self, state: State, active: NDArray[np.bool_]) -> State:
        sweep = state.sweep + 1
        groups = state.starts.size - 1
        turn = np.arange(groups)
        if self.shuffled:
            first, at = divmod(sweep, AHEAD)
            turn = _orders(state.seed, state.level, first * AHEAD, groups)[at]
        wanted = active[state.place]
        sites = state.pixel if wanted.all() else state.pixel[wanted]
        counts = [np.count_nonzero(wanted[begin:end]) for begin, end in pairwise(state.starts.tolist())]
        bounds = np.concatenate([[0], np.cumsum(counts)]).tolist()
        parts = [sites[bounds[g] : bounds[g + 1]] for g in turn.tolist() if bounds[g + 1] > bounds[g]]
        parts = parts or [sites]  # an empty sweep is one empty group
        ends = np.cumsum([part.size for part in parts])
        return state._replace(sweep=sweep, sites=np.concatenate(parts), ends=ends, done=0)


AHEAD = 32


@lru_cache(maxsize=8)
def _orders(seed: int, level: int, first: int, groups: int) -> NDArray[np.intp]:
    """Random orders of groups, (sweeps, groups): a sweep at a time they cost ten times as much."""
    sweeps = np.repeat(first + np.arange(AHEAD), groups)
    bits = random.draw4(seed, level, sweeps, np.tile(np.arange(groups), AHEAD), random.SCHEDULE)[0]
    return np.argsort(bits.reshape(AHEAD, groups), 1, kind="stable")


class Coloring(Partition):
    """One colour class of the lattice a step, the colours in a fresh random order each sweep.

    Guarantees that no two sites of a step are neighbours, equation (14), and that each active site is relaxed
    exactly once a sweep. Every colour comes as often as any other, so the stationary distribution is the model's.
    """

    name = "coloring"
    shuffled = True

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """Colours; O(sites x (neighbours + colours))."""
        colors: NDArray[Any] = coloring(machine, grid, offsets, order, seed)
        return colors


class FixedColoring(Coloring):
    """One colour class of the lattice a step, the colours in the same order always.

    Guarantees what `Coloring` does: no neighbours together, each active site once a sweep, the model's distribution. A
    fixed order lets what the first colours decided spread in the same direction each time.
    """

    name = "coloring-fixed"
    shuffled = False


class Checkerboard(Partition):
    """Two colours, black then white, whatever the order of the neighbourhood.

    Guarantees independence for order 1 on an open lattice or a torus of even sides. Above order 1 diagonal
    neighbours are of one colour and relax together, which violates equation (14). Each active site is relaxed
    exactly once a sweep.
    """

    name = "checkerboard"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Whether every neighbour is of the other colour."""
        even = not grid.torus or all(n == 1 or n % 2 == 0 for n in (grid.rows, grid.cols))
        return even and bool((offsets.sum(1) % 2 == 1).all())

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """Row plus column, odd or even."""
        colors: NDArray[Any] = np.indices((grid.rows, grid.cols)).sum(0) % 2
        return colors


class Synchronous(Partition):
    """All active sites at once, old values read.

    Guarantees nothing: neighbours relax together, against equation (14). What it samples is another distribution,
    and where neighbours want to agree they can exchange their values forever.
    """

    name = "synchronous"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Only on a lattice without neighbours."""
        return neighbourless(grid)

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """One for all."""
        return np.zeros((grid.rows, grid.cols), np.int64)


class Raster(Partition):
    """One site a step, row by row: the textbook's systematic scan.

    Guarantees independence, a step being one site, and each active site once a sweep. As many steps as sites: for
    small lattices.
    """

    name = "raster"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """Each site its own."""
        return np.arange(grid.rows * grid.cols).reshape(grid.rows, grid.cols)


class Block(Partition):
    """Tiles that relax at once and on their own, row by row inside: what naive multi-device code does.

    Within a tile a site sees its neighbours as they are; beyond its edge it sees them as they were when the sweep
    began, the last time that the tiles exchanged their edges. So neighbours across an edge relax as in `Synchronous`.
    Each active site is relaxed exactly once a sweep; with a single tile this is `Raster`.

    Parameters
    ----------
    rows, cols : int
        Of a tile, in sites of the level's lattice.
    """

    def __init__(self, rows: int = 16, cols: int = 16) -> None:
        whole("rows of a tile", rows, 1)
        whole("columns of a tile", cols, 1)
        self.tile = int(rows), int(cols)
        self.name = "block" if self.tile == (16, 16) else f"block:{rows}x{cols}"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Only where one tile holds the whole lattice."""
        assert self.tile is not None
        return grid.rows <= self.tile[0] and grid.cols <= self.tile[1]

    def groups(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> NDArray[Any]:
        """The place within the tile."""
        assert self.tile is not None
        row, col = np.indices((grid.rows, grid.cols))
        place: NDArray[Any] = row % self.tile[0] * self.tile[1] + col % self.tile[1]
        return place


def neighbourless(grid: Grid) -> bool:
    """Whether no site of the lattice has a neighbour: every neighbourhood holds the four nearest."""
    return grid.rows * grid.cols == 1
