# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of a worker: one turn of some tiles, read from the store and written to it.

A tile relaxes in a window that is larger by the reach of a sweep, so that it has the bits of the whole.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from simdtex.jobs.tiles.layout import Tile
from simdtex.jobs.tiles.store import Store, Stored, Tally, Turn
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf.algorithm import Run, finished_picture, first_field, run_steps, use_counts
from simdtex.methods.mrf.finish import gaussian_offsets
from simdtex.methods.mrf.level import Level, State
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid
from simdtex.model.source_map import apply_source_map
from simdtex.schedules.schedule import Trimmed
from simdtex.schedules.sites import survey


class Context(NamedTuple):
    """The data that a process keeps from one tile to the next."""

    store: Store
    run: Run


_one = Lock()
"""A process has one device, which two tiles would share."""


@lru_cache(1)
def context(where: str, name: str, device: str | Machine | None) -> Context:
    """Return the context of a store, which is put on a device once; only the latest is kept."""
    store = Store(where)
    return Context(store, Run(store.work.plan, open_machine(device), store.work.seed, Stored(store)))


def do(where: str, name: str, device: str | Machine | None, turn: Turn, task: int) -> int:
    """Execute a turn of a task's tiles, unless it is done and its data are undamaged; return the number of the task.

    ``where`` and ``name`` are the store's path and name, since the path may later hold another store.
    """
    with _one:
        here = context(where, name, device)
        if not here.store.done(turn, task):
            tiles = here.store.work.layout.levels[turn.level].task(task)
            tallies = [PHASES[turn.phase](here, turn, tile) for tile in tiles]
            here.store.note(turn, task, np.stack(tallies).sum(0))
    return task


def _begin(here: Context, turn: Turn, tile: Tile) -> Tally:
    """Write a tile before the first sweep of its level."""
    level = here.run.level(turn.level, tile)
    field = first_field(here.run, level, _above(here, turn, tile))
    here.store.write(turn, tile, _off(here.run.machine, field))
    return _tally(level, field, level.grid)


def _whole(here: Context, turn: Turn, tile: Tile) -> Tally:
    """Write a level that is a single tile, after all its sweeps."""
    run = here.run
    state = run.enter(turn.level, _above(here, turn, tile), here.store.penalty(turn))
    while not run.at_equilibrium(state):
        state, _ = run.step(state)
    here.store.write(turn, tile, _off(run.machine, state.field))
    _, kinds = run.of(turn.level).fair_use(turn.level).split(state.penalty)
    return np.append([0, 0], kinds).astype(np.int64)  # whole steps


def _sweep(here: Context, turn: Turn, tile: Tile) -> Tally:
    """Write a tile after a sweep."""
    run, machine, level = here.run, here.run.machine, here.store.work.layout.levels[turn.level]
    frame = level.frame(tile, level.halo)
    window, penalty = run.level(turn.level, frame.window), here.store.penalty(turn)
    assert penalty is not None
    if frame.window.rows < level.rows:  # otherwise rows wrap around, and all are near
        window = replace(window, schedule=Trimmed(window.schedule, frame.rows.start, frame.rows.stop))
    sweeps = turn.cooling + turn.free  # the only part of the schedule's state that persists
    memory = window.schedule.init(window.setting)._replace(sweep=sweeps)
    before = _on(machine, here.store.read(level, turn.number - 1, frame.window))
    found, *_ = run_steps(window, State(*before, penalty, memory, turn.level, active=turn.active))
    inside = Field(*map(frame.cut, _off(machine, found)))
    here.store.write(turn, tile, inside)
    return _tally(window, _on(machine, inside), run.grid(turn.level).window(*tile))


def _show(here: Context, turn: Turn, tile: Tile) -> Tally:
    """Write a tile of the arrays of the output."""
    run, store, work = here.run, here.store, here.store.work
    level, outputs, sd = work.layout.levels[0], work.outputs, run.options.finish or 0
    frame = level.frame(tile, int(gaussian_offsets(sd)[0].max()) if sd else 0)
    state = store.read(level, turn.number - 1, frame.window)
    known = store.held(level, frame.window).known if work.held else None
    field, grid = _on(run.machine, state), run.grid(0).window(*frame.window)
    shown = finished_picture(run, grid, field, known, state.source[frame.rows], frame.rows.start)[:, frame.cols]
    if work.given:
        values, given = store.given(tile)
        shown = np.where(given, values, shown)
    arrays = {"image": shown if outputs.channels else shown[..., 0]}
    if outputs.source or outputs.maps:
        place = run.sample.place(frame.cut(state.source))
        arrays |= {"source": place} if outputs.source else {}
        for name, maps in outputs.maps.items():
            arrays[name] = apply_source_map(place, maps if len(maps) > 1 else maps[0])
    store.show(tile, arrays)
    return np.zeros(2, np.int64)


PHASES = {"begin": _begin, "whole": _whole, "sweep": _sweep, "show": _show}


def _above(here: Context, turn: Turn, tile: Tile) -> Field | None:
    """Return the sites of the level above in a tile, on the machine; None at the coarsest level."""
    levels = here.store.work.layout.levels
    if turn.reads == len(levels):
        return None
    (top, rows), (left, cols) = here.run.grid(turn.level).window(*tile).above
    above = here.store.read(levels[turn.reads], turn.number - 1, Tile(top, left, rows, cols))
    return _on(here.run.machine, above)


def _tally(level: Level, field: Field, grid: Grid) -> Tally:
    return np.append(survey(level.machine, grid, field.temperature), use_counts(level, field, grid))


def _on(machine: Machine, field: Field) -> Field:
    return Field(*map(machine.put, field))


def _off(machine: Machine, field: Field) -> Field:
    return Field(*(np.array(machine.get(plane)) for plane in field))
