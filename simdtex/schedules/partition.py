# SPDX-License-Identifier: BSD-3-Clause
"""Schedules that divide the lattice into groups and relax one group after another, each active site once per sweep."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Machine
from simdtex.model.lattice import Grid, Sublattice, coloring_of_layers
from simdtex.options import whole
from simdtex.schedules.schedule import Active, Info, Lists, Setting
from simdtex.schedules.sites import LatticeColoring, by_color, coloring, lattice_plan


class PartitionState(NamedTuple):
    """The state of a partition: ``sweep``, the number of sweeps started."""

    sweep: int = 0


class Partition:
    """One group of sites per step; a subclass defines `groups` or, if a formula gives them, `plan`."""

    name: str
    shuffled = False
    """Whether the groups have a new random order in each sweep, or always the same order."""
    tile: tuple[int, int] | None = None
    windows = False

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """Return the groups of the whole lattice of a grid, as colours."""
        raise NotImplementedError

    def groups(self, machine: Machine, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int) -> Array:
        """Return the group of each site of a lattice, or of a window if `windows` is true: (rows, cols) integers."""
        return coloring(machine, grid, self.plan(grid, order, seed))

    def count(self, grid: Grid, order: int, seed: int) -> int:
        """Return the number of groups of the whole lattice, if `windows` is true."""
        return self.plan(grid, order, seed).colors

    def init(self, setting: Setting) -> PartitionState:
        """Return the state of a level."""
        return PartitionState()

    def lists(self, setting: Setting) -> Lists:
        """Return all sites, group after group, and the bounds of the groups (`simdtex.schedules.sites.by_color`)."""
        machine, grid, offsets, order, seed, _ = setting
        group = self.groups(machine, grid, offsets, order, seed)
        if isinstance(group, np.ndarray) and not self.windows:
            if group.min() < 0 or group.max() >= group.size:  # numbers with wide gaps
                group = np.unique(group, return_inverse=True)[1]
            count = int(group.max()) + 1
        else:
            count = self.count(grid, order, seed)
        if isinstance(group, np.ndarray):
            group = machine.put(group.astype(np.int64, casting="same_kind").clip(-1, count).astype(np.int32))
        return by_color(machine, group, count)

    def step(self, setting: Setting, state: PartitionState, active: Active) -> tuple[PartitionState, Info]:
        """Return all groups with active sites; a sweep relaxes the sites that were active at its start."""
        sweep = state.sweep + 1
        key = self.lists, setting.grid, setting.order, setting.seed
        sites, starts = active.kept[key] = active.kept.get(key) or self.lists(setting)
        sites, starts = active.among(sites, starts, setting.machine)
        steps = np.stack([starts[:-1], starts[1:]], 1)
        if self.shuffled:
            first, at = divmod(sweep, AHEAD)
            steps = steps[_orders(setting.seed, setting.level, first * AHEAD, len(steps))[at]]
        steps = steps[steps[:, 1] > steps[:, 0]]
        steps = steps if len(steps) else np.zeros((1, 2), np.int64)  # an empty sweep is one empty group
        return PartitionState(sweep), Info(sites, sweep, True, steps)


AHEAD = 32


@lru_cache(maxsize=8)
def _orders(seed: int, level: int, first: int, groups: int) -> NDArray[np.intp]:
    """Return random orders of groups, (sweeps, groups); a call for each sweep would take ten times as long."""
    sweeps = np.repeat(first + np.arange(AHEAD), groups)
    bits = random.draw4(seed, level, sweeps, np.tile(np.arange(groups), AHEAD), random.SCHEDULE)[0]
    return np.argsort(bits.reshape(AHEAD, groups), 1, kind="stable")


class Coloring(Partition):
    """One colour class of the lattice per step, with the colours in a new random order in each sweep.

    No two sites of a step are neighbours, equation (14), and each active site is relaxed exactly once per sweep. All
    colours are used equally often, so the stationary distribution is the model's.
    """

    name = "coloring"
    shuffled = True
    windows = True

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """Return the colouring of a volume or a picture."""
        if grid.layered:
            m, *by = coloring_of_layers(order)
            return LatticeColoring(Sublattice(m, m - 1, 1, *by), m)
        rows, cols = grid.whole.shape
        return lattice_plan(rows, cols, grid.torus, order, seed)


class FixedColoring(Coloring):
    """One colour class of the lattice per step, with the colours always in the same order.

    The guarantees are those of `Coloring`: no neighbours together, each active site once per sweep, the model's
    distribution. With a fixed order, the choices of the first colours spread in the same direction in every sweep.
    """

    name = "coloring-fixed"
    shuffled = False


class Checkerboard(Partition):
    """Two colours, black then white, whatever the order of the neighbourhood.

    Sites are independent for order 1 on an open lattice or a torus with even sides. Above order 1 diagonal neighbours
    have the same colour and relax together, which violates equation (14). Each active site is relaxed exactly once per
    sweep.
    """

    name = "checkerboard"
    windows = True

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Return whether every neighbour has the other colour."""
        even = not grid.torus or all(n == 1 or n % 2 == 0 for n in grid.shape)
        return even and bool((offsets.sum(1) % 2 == 1).all())

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """Layer plus row plus column, even or odd; one colour of a single site."""
        return LatticeColoring(Sublattice(2, 1, 1, layers=1), min(2, grid.whole.size))


class Synchronous(Partition):
    """All active sites together, from the old values.

    There is no guarantee: neighbours relax together, against equation (14). The sampled distribution is another one,
    and neighbours that tend to agree can exchange their values forever.
    """

    name = "synchronous"
    windows = True

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Only on a lattice without neighbours, since every neighbourhood holds the four nearest sites."""
        return grid.size == 1

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """One colour."""
        return LatticeColoring(Sublattice(1, 0, 1), 1)


class Raster(Partition):
    """One site per step, row by row: the systematic scan of textbooks.

    Sites of a step are independent, since it has only one, and each active site is relaxed once per sweep. A sweep has
    as many steps as sites, so it is for small lattices.
    """

    name = "raster"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Always."""
        return True

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """Return a colour for each site."""
        (*_, rows, cols), size = grid.whole.shape, grid.whole.size
        return LatticeColoring(Sublattice(size // cols, 0, cols, layers=rows), size)


class Block(Partition):
    """Tiles that relax independently at the same time, each row by row, as in naive multi-device code.

    A site reads the current values of its neighbours within its tile; beyond the edge of the tile it reads those at the
    start of the sweep, when tiles exchange their edges. So neighbours across an edge relax as in `Synchronous`. Each
    active site is relaxed exactly once per sweep; with a single tile this is `Raster`.

    Parameters
    ----------
    rows, cols : int
        Size of a tile, in sites of the level's lattice.
    """

    def __init__(self, rows: int = 16, cols: int = 16) -> None:
        whole("rows of a tile", rows, 1)
        whole("columns of a tile", cols, 1)
        self.tile = int(rows), int(cols)
        self.name = "block" if self.tile == (16, 16) else f"block:{rows}x{cols}"

    def independent(self, grid: Grid, offsets: NDArray[np.int32]) -> bool:
        """Return whether one tile holds the whole lattice."""
        assert self.tile is not None
        return grid.rows <= self.tile[0] and grid.cols <= self.tile[1]

    def plan(self, grid: Grid, order: int, seed: int) -> LatticeColoring:
        """Return the place of each site within its tile."""
        assert self.tile is not None
        rows, cols = (min(tile, n) for tile, n in zip(self.tile, grid.whole.shape, strict=True))
        return LatticeColoring(Sublattice(rows, 0, cols), rows * cols)
