# SPDX-License-Identifier: BSD-3-Clause
"""The layout of an output in tiles: their sizes, their halos, and the cost."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.methods.mrf.finish import gaussian_offsets
from simdtex.methods.mrf.plan import MrfPlan
from simdtex.model.lattice import Grid
from simdtex.options import whole
from simdtex.schedules.schedule import Windowed

CHUNK = 512
"""The largest side of a chunk in the store, sites, if the tile's side has such a divisor."""

TILES = 2**22
"""The most tiles of a level, since one process counts them."""

TASKS = 2**14
"""The most tasks of a turn, since one process distributes them and reads their notes."""

PROCESS = 2**30
"""Bytes of an idle worker that compiles kernels; then it needs 400 MiB (``benchmarks/tiles.py``)."""

SITE = 110, 12
"""Bytes of a worker for each site of a window, and for each channel of a site (measured; see the docs)."""

PIXEL = 400, 40
"""The same for each pixel of the sample with its margin."""

Maps = dict[str, list[NDArray[Any]]]
"""Further maps of the material by name: (rows, cols[, channels]), one for each picture of the sample."""


class Outputs(NamedTuple):
    """The arrays of an output: the image, with an axis for its ``channels``; the ``source`` map; further ``maps``."""

    channels: bool
    source: bool
    maps: Maps

    def arrays(self, plan: MrfPlan) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        """Return the axes after rows and columns, and the type, of each array by name."""
        sample = plan.sample
        arrays = {"image": ((sample.shown,) * self.channels, sample.pixels.dtype)}
        arrays |= {"source": ((2 + (len(sample.boxes) > 1),), np.dtype(np.int32))} if self.source else {}
        return arrays | {name: (images[0].shape[2:], images[0].dtype) for name, images in self.maps.items()}


class Tile(NamedTuple):
    """A tile or a window of a lattice: its first row and column, and its numbers of rows and columns."""

    top: int
    left: int
    rows: int
    cols: int


@dataclass(frozen=True)
class LevelLayout:
    """A level, 0 the finest, in tiles of ``side`` sites a side; a sweep of a tile reads ``halo`` sites around it."""

    number: int
    rows: int
    cols: int
    side: int
    halo: int
    torus: bool

    @property
    def across(self) -> int:
        """Number of tiles from left to right."""
        return ceil(self.cols / self.side)

    @property
    def count(self) -> int:
        """Number of tiles."""
        return ceil(self.rows / self.side) * self.across

    @property
    def together(self) -> int:
        """Number of tiles of a task; the last task may have fewer."""
        return ceil(self.count / TASKS)

    @property
    def tasks(self) -> int:
        """Number of tasks of a turn."""
        return ceil(self.count / self.together)

    def task(self, task: int) -> list[Tile]:
        """Return the tiles of a task."""
        return [*map(self.tile, range(task * self.together, min(self.count, (task + 1) * self.together)))]

    def tile(self, index: int) -> Tile:
        """Return a tile by its number, row by row."""
        i, j = divmod(index, self.across)
        top, left = i * self.side, j * self.side
        return Tile(top, left, min(self.side, self.rows - top), min(self.side, self.cols - left))

    def frame(self, tile: Tile, halo: int) -> tuple[Tile, slice, slice]:
        """Return the window of a tile and all sites within ``halo`` of it, and the tile's rows and columns in it."""
        sides = []
        for first, size, every in ((tile.top, tile.rows, self.rows), (tile.left, tile.cols, self.cols)):
            if size + 2 * halo >= every:
                begin, end = 0, every
            elif self.torus:
                begin, end = first - halo, first + size + halo
            else:
                begin, end = max(0, first - halo), min(every, first + size + halo)
            sides.append((begin % every, end - begin, slice(first - begin, first - begin + size)))
        (top, rows, down), (left, cols, right) = sides
        return Tile(top, left, rows, cols), down, right

    @property
    def chunk(self) -> int:
        """Side of a chunk in the store, sites; no two tiles share a chunk."""
        fitting = [n for n in range(CHUNK // 4, CHUNK + 1) if self.side % n == 0]
        return max(fitting, default=self.side)

    @property
    def window(self) -> tuple[int, int]:
        """Rows and columns of the largest window."""
        side = self.side + 2 * self.halo if self.count > 1 else self.side
        return min(side, self.rows), min(side, self.cols)

    @property
    def redundant(self) -> float:
        """Repeated relaxations of a tile that touches no edge, divided by its required ones."""
        rows, cols, (down, across) = min(self.side, self.rows), min(self.side, self.cols), self.window
        return (down if down == self.rows else (rows + down) // 2) * across / (rows * cols) - 1


@dataclass(frozen=True)
class TileLayout:
    """An output in tiles.

    Attributes
    ----------
    levels : tuple of LevelLayout
        The finest first.
    channels : int
        Number of channels of the sites' values.
    memory : int
        The most bytes that a worker needs, whatever the size of the output.
    disk : int
        The most bytes that the store needs, uncompressed: two states of the finest level, one of each
        other level, and the output with its source map and further maps.
    """

    levels: tuple[LevelLayout, ...]
    channels: int
    memory: int
    disk: int

    def lines(self) -> list[str]:
        """Return a line of text for each level, and one for memory and disk."""
        lines = [
            f"level {level.number}: {level.cols}x{level.rows} sites in {level.count} tile{'s' * (level.count > 1)} of "
            f"{min(level.side, level.cols)}x{min(level.side, level.rows)}"
            + (f", halo {level.halo}, {100 * level.redundant:.1f} % redundant work" if level.count > 1 else "")
            for level in reversed(self.levels)
        ]
        memory, disk = (size / 2**20 for size in (self.memory, self.disk))
        return [*lines, f"a worker needs at most {memory:.0f} MiB, the store {disk:.0f} MiB before compression"]


@dataclass(frozen=True, eq=False)
class TilePlan:
    """The plan of an output in tiles, with its ``seed``, the arrays of the output, and the layout of the tiles."""

    plan: MrfPlan
    seed: int
    outputs: Outputs
    layout: TileLayout


def planned(plan: MrfPlan, seed: int, side: int, outputs: Outputs) -> TilePlan:
    """Return the plan of an output in tiles of at most ``side`` sites a side; raise if the whole is needed at once."""
    whole("side of tiles", side, 1)
    options, schedule = plan.options, plan.schedule
    if not isinstance(options.schedule, str):
        raise TypeError("workers know schedules by their names; give schedule the name of one")
    if not (schedule.windows and isinstance(schedule, Windowed)) or options.array:
        cause = f"array {options.array}" if options.array else f"schedule {schedule.name}"
        raise ValueError(f"{cause} needs the whole output at once; give the schedule coloring, or make no tiles")
    count = ceil(plan.shape[0] / side) * ceil(plan.shape[1] / side)
    if count > TILES:
        raise ValueError(f"tiles of {side}x{side} pixels are {count}, more than {TILES}; give larger ones")
    levels = tuple(_level(plan, seed, level, side) for level in range(plan.levels))
    sample, channels, sd = plan.sample, plan.sample.working.shape[0], options.finish or 0
    shown = side + (2 * int(gaussian_offsets(sd)[0].max(initial=0)) if sd else 0)  # with the margin of the finish
    window = max(*(prod(one.window) for one in levels), min(shown, levels[0].rows) * min(shown, levels[0].cols))
    each, pixel = (fixed + more * channels for fixed, more in (SITE, PIXEL))
    memory = PROCESS + window * each + sample.rows * sample.cols * pixel
    shown_bytes = sum(prod(axes) * dtype.itemsize for axes, dtype in outputs.arrays(plan).values())
    disk = int(prod(plan.shape) * ((6 + 2 * channels) * 7 / 3 + shown_bytes))
    return TilePlan(plan, seed, outputs, TileLayout(levels, channels, memory, disk))


def _level(plan: MrfPlan, seed: int, number: int, side: int) -> LevelLayout:
    """Return the layout of a level; each step of a sweep reaches the radius of the neighbourhood farther."""
    lattice, torus = Grid.of(plan.shape, 2**number), plan.options.boundary == "torus"
    assert isinstance(plan.schedule, Windowed)
    steps = plan.schedule.count(Grid(lattice.shape, torus), plan.options.neighbourhood, seed)
    return LevelLayout(number, lattice.rows, lattice.cols, side, steps * int(plan.offsets.max()), torus)
