# SPDX-License-Identifier: BSD-3-Clause
"""A tile of a level, relaxed in a window that is larger by the reach of a sweep, so that it has the bits of the whole.

Input and output are NumPy arrays over the sites of a lattice, so any process can compute any tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Machine
from simdtex.methods.mrf.algorithm import Run, first_field, run_steps, use_counts
from simdtex.methods.mrf.level import Level, State
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid
from simdtex.schedules.schedule import Trimmed
from simdtex.schedules.sites import survey


class Tile(NamedTuple):
    """A tile or a window of a lattice: its first row and column, and its numbers of rows and columns."""

    top: int
    left: int
    rows: int
    cols: int


class Framed(NamedTuple):
    """A tile in a window of its lattice: the window, and the tile's rows and columns in the window."""

    window: Tile
    rows: slice
    cols: slice

    def cut(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return the tile's part of an array (..., rows, cols) over the window."""
        return np.ascontiguousarray(array[..., self.rows, self.cols])


class Tally(NamedTuple):
    """Counts of a tile's sites, which add up over tiles.

    ``counts``, the uses of each candidate and the sites of each kind in each region; ``active``, the number of active
    sites; ``temperature_sum``, the sum of temperatures in units of 1/1024.
    """

    counts: NDArray[Any]
    active: int
    temperature_sum: int


def together(tallies: Sequence[Tally]) -> Tally:
    """Return the sum of several tallies."""
    counts = np.stack([one.counts for one in tallies]).sum(0)
    return Tally(counts, sum(one.active for one in tallies), sum(one.temperature_sum for one in tallies))


def framed(lattice: Grid, tile: Tile, halo: int) -> Framed:
    """Return a tile in the window that holds it and all sites of the lattice within ``halo`` sites of it."""
    sides = []
    for first, size, whole in ((tile.top, tile.rows, lattice.rows), (tile.left, tile.cols, lattice.cols)):
        if size + 2 * halo >= whole:
            begin, end = 0, whole
        elif lattice.torus:
            begin, end = first - halo, first + size + halo
        else:
            begin, end = max(0, first - halo), min(whole, first + size + halo)
        sides.append((begin % whole, end - begin, slice(first - begin, first - begin + size)))
    (top, rows, down), (left, cols, right) = sides
    return Framed(Tile(top, left, rows, cols), down, right)


def begin_tile(run: Run, number: int, tile: Tile, above: Field | None) -> tuple[Field, Tally]:
    """Return a tile before the first sweep of its level, and its tally.

    ``above`` are the sites of the level above in the tile; None at the coarsest level.
    """
    level = run.level(number, tile)
    field = first_field(run, level, above and _on(run.machine, above))
    return _off(run.machine, field), _tally(level, field, level.grid)


def run_level(
    run: Run, number: int, above: Field | None, penalty: NDArray[np.float32] | None
) -> tuple[Field, NDArray[np.float32]]:
    """Return a level that is a single tile, after all its sweeps, and the penalties; ``penalty`` as in `Run.enter`."""
    state = run.enter(number, above and _on(run.machine, above), penalty)
    while not run.at_equilibrium(state):
        state, _ = run.step(state)
    return _off(run.machine, state.field), state.penalty


def sweep_tile(
    run: Run, number: int, tile: Tile, frame: Framed, field: Field, penalty: NDArray[np.float32], done: int, free: bool
) -> tuple[Field, Tally]:
    """Return a tile after a sweep, and its tally.

    ``frame`` is the tile in a window with a halo of the reach of the sweep, ``field`` the sites of the window before
    the sweep, ``penalty`` those of `State` during it, ``done`` the number of earlier sweeps of the level, and
    ``free`` whether it is a free sweep.
    """
    machine, level = run.machine, run.level(number, frame.window)
    if frame.window.rows < run.grid(number).rows:  # otherwise rows wrap around, and all are near
        level = replace(level, schedule=Trimmed(level.schedule, frame.rows.start, frame.rows.stop))
    memory = level.schedule.init(level.setting)._replace(sweep=done)  # the only part of the state that persists
    state = State(*_on(machine, field), penalty, memory, number, active=int(not free))
    found, *_ = run_steps(level, state)
    inside = Field(*map(frame.cut, _off(machine, found)))
    return inside, _tally(level, _on(machine, inside), run.grid(number).window(*tile))


def _tally(level: Level, field: Field, grid: Grid) -> Tally:
    return Tally(use_counts(level, field, grid), *survey(level.machine, grid, field.temperature))


def _on(machine: Machine, field: Field) -> Field:
    return Field(*map(machine.put, field))


def _off(machine: Machine, field: Field) -> Field:
    return Field(*(np.array(machine.get(plane)) for plane in field))
