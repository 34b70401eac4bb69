# SPDX-License-Identifier: BSD-3-Clause
"""How an output is cut into tiles: their sizes, their halos, and what that costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil

from simdtex.methods.mrf.plan import Plan
from simdtex.methods.mrf.tiles import Tile, framed
from simdtex.model.lattice import Grid
from simdtex.ops.finish import around
from simdtex.options import whole
from simdtex.schedules.schedule import Windowed

SMALLEST = 64
"""Sides of the smallest tiles that a level is cut into for the sake of more workers."""

CHUNK = 512
"""Sites to the side of a chunk in the store, at most where the tile's side has such a divisor."""

TILES = 2**22
"""Tiles of a level, at most: one process keeps count of them."""

MOST = 10**5
"""Workers that a plan is made for, at most."""

PROCESS = 2**30
"""Bytes of a worker that has no work: Python, libraries, an OpenCL runtime that compiles kernels for the first time.

Once they are compiled it is 400 MiB (``benchmarks/tiles.py``)."""

SITE = 110, 12
"""Bytes of a worker for each site of a window, and for each of its channels besides (measured; see the docs)."""

PIXEL = 400, 40
"""The same for each pixel of the sample with its margin."""


@dataclass(frozen=True)
class LevelLayout:
    """A level in tiles.

    Attributes
    ----------
    number : int
        0 is the finest.
    rows, cols : int
        Of its lattice.
    side : int
        Sites to the side of a tile; those of the last row and column of tiles have what is left.
    halo : int
        Sites around a tile that its sweep also needs: groups of the schedule times the neighbourhood's radius.
    torus : bool
    """

    number: int
    rows: int
    cols: int
    side: int
    halo: int
    torus: bool

    @property
    def down(self) -> int:
        """Tiles from top to bottom."""
        return ceil(self.rows / self.side)

    @property
    def across(self) -> int:
        """Tiles from left to right."""
        return ceil(self.cols / self.side)

    @property
    def count(self) -> int:
        """Of tiles."""
        return self.down * self.across

    @property
    def lattice(self) -> Grid:
        """All of the level, site by site."""
        return Grid(self.rows, self.cols, 1, self.torus)

    def tile(self, number: int) -> Tile:
        """A tile by its number, row by row."""
        i, j = divmod(number, self.across)
        top, left = i * self.side, j * self.side
        return Tile(top, left, min(self.side, self.rows - top), min(self.side, self.cols - left))

    def tiles(self) -> Iterator[Tile]:
        """All of them, row by row."""
        return map(self.tile, range(self.count))

    @property
    def chunk(self) -> int:
        """Sites to the side of a chunk in the store: no chunk is of two tiles."""
        fitting = [n for n in range(CHUNK // 4, CHUNK + 1) if self.side % n == 0]
        return max(fitting, default=self.side)

    @property
    def window(self) -> int:
        """Sites of the largest window."""
        sides = (min(self.side + 2 * self.halo, n) for n in (self.rows, self.cols))
        down, across = sides if self.count > 1 else (self.rows, self.cols)
        return down * across

    def relaxed(self, tile: Tile) -> int:
        """Sites that a free sweep of a tile relaxes: columns of its whole window, rows fewer with every step."""
        if self.count == 1:
            return self.rows * self.cols
        window = framed(self.lattice, tile, self.halo).window
        rows = window.rows if window.rows == self.rows else (tile.rows + window.rows) // 2
        return rows * window.cols

    @property
    def redundant(self) -> float:
        """Relaxations that are done again in other tiles, over those that are needed."""
        first = self.relaxed(self.tile(0)) or 1  # rows and columns are cut alike: a sum of products is one of sums
        down = sum(self.relaxed(self.tile(i * self.across)) for i in range(self.down))
        across = sum(self.relaxed(self.tile(j)) for j in range(self.across))
        return down * across / first / (self.rows * self.cols) - 1


@dataclass(frozen=True)
class Layout:
    """An output in tiles.

    Attributes
    ----------
    levels : tuple of LevelLayout
        The finest first.
    channels : int
        Of the sites' values.
    workers : int
        For whom it is laid out; any number makes the same bytes.
    memory : int
        Bytes that a worker needs at most, whatever the output's size.
    disk : int
        Bytes that the store needs at most, uncompressed: two states of the finest level, the output, one level above.
    """

    levels: tuple[LevelLayout, ...]
    channels: int
    workers: int
    memory: int
    disk: int

    def lines(self) -> list[str]:
        """The plan in words, a line for each level and one for what it needs."""
        found = [
            f"level {one.number}: {one.cols}x{one.rows} sites in {one.count} tile{'s' * (one.count > 1)} of "
            f"{min(one.side, one.cols)}x{min(one.side, one.rows)}"
            + (f", halo {one.halo}, {100 * one.redundant:.1f} % redundant work" if one.count > 1 else "")
            for one in reversed(self.levels)
        ]
        memory, disk = (size / 2**20 for size in (self.memory, self.disk))
        return [*found, f"a worker needs at most {memory:.0f} MiB, the store {disk:.0f} MiB before compression"]


def planned(plan: Plan, seed: int, tile: int, workers: int) -> Layout:
    """Cut an output into tiles.

    Parameters
    ----------
    plan : simdtex.methods.mrf.Plan
        Of the whole output.
    seed : int
    tile : int
        Sites to the side of the largest tiles.
    workers : int
        Coarse levels, which are small, are cut smaller where that gives more of them something to do.

    Raises
    ------
    ValueError
        The schedule does not relax a window as it does the whole, or there would be too many tiles.
    """
    whole("tiles", tile, 1)
    whole("workers", workers, 1, MOST)
    options, schedule = plan.options, plan.schedule
    if not (schedule.windows and isinstance(schedule, Windowed)) or options.array:
        given = f"array {options.array}" if options.array else f"schedule {schedule.name}"
        raise ValueError(f"{given} needs the whole output at once; give the schedule coloring, or leave tiles out")
    count = ceil(plan.shape[0] / tile) * ceil(plan.shape[1] / tile)
    if count > TILES:
        raise ValueError(f"tiles of {tile}x{tile} pixels are {count}, more than {TILES}; give larger ones")
    levels = []
    for number in range(plan.levels):
        sides, least = [tile], max(SMALLEST, _halo(plan, seed, number))
        while number and sides[-1] // 2 >= least:
            sides.append(sides[-1] // 2)
        some = [_level(plan, seed, number, side) for side in sides]
        levels.append(min(some, key=lambda one: _span(one, workers)))
    return laid(plan, seed, [one.side for one in levels], workers)


def laid(plan: Plan, seed: int, sides: Sequence[int], workers: int) -> Layout:
    """The plan of tiles whose sides, level by level, are known."""
    sample, levels = plan.sample, tuple(_level(plan, seed, number, side) for number, side in enumerate(sides))
    channels = sample.working.shape[0]
    window = max(max(one.window for one in levels), _shown(levels[0], plan.options.finish or 0))
    memory = (
        PROCESS + window * (SITE[0] + SITE[1] * channels) + sample.rows * sample.cols * (PIXEL[0] + PIXEL[1] * channels)
    )
    sites = plan.shape[0] * plan.shape[1]
    shown = sites * sample.shown * sample.pixels.dtype.itemsize
    disk = int(sites * (6 + 2 * channels) * 2.25) + shown
    return Layout(levels, channels, workers, memory, disk)


def _halo(plan: Plan, seed: int, number: int) -> int:
    """Sites that a sweep reaches: each of its steps as far as a neighbourhood does."""
    options, lattice = plan.options, Grid(*plan.shape, 2**number)
    grid = Grid(lattice.rows, lattice.cols, 1, options.boundary == "torus")
    assert isinstance(plan.schedule, Windowed)
    return plan.schedule.count(grid, options.order, seed) * int(plan.offsets.max())


def _level(plan: Plan, seed: int, number: int, side: int) -> LevelLayout:
    lattice, torus = Grid(*plan.shape, 2**number), plan.options.boundary == "torus"
    return LevelLayout(number, lattice.rows, lattice.cols, side, _halo(plan, seed, number), torus)


def _span(level: LevelLayout, workers: int) -> float:
    """What a sweep of a level takes, in sites that one worker relaxes."""
    if level.count == 1:
        return level.rows * level.cols
    return ceil(level.count / workers) * level.relaxed(level.tile(0))


def _shown(level: LevelLayout, sd: float) -> int:
    reach = int(around(sd)[0].max(initial=0)) if sd else 0
    return min(level.side + 2 * reach, level.rows) * min(level.side + 2 * reach, level.cols)


__all__ = ["Layout", "LevelLayout", "laid", "planned"]
