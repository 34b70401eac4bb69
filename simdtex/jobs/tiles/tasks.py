# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of a worker: one turn of some tiles, read from the store and written to it.

A tile relaxes in a window that is larger by the reach of a sweep, so that it has the bits of the whole.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from threading import Lock

import numpy as np

from simdtex.jobs.tiles.layout import Tile
from simdtex.jobs.tiles.store import Store, Stored, Tally, Turn
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf.algorithm import MrfRun, finished_picture, first_field, run_steps, use_counts
from simdtex.methods.mrf.finish import gaussian_offsets
from simdtex.methods.mrf.level import Level, MrfState
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid
from simdtex.model.source_map import apply_source_map
from simdtex.schedules.schedule import Trimmed
from simdtex.schedules.sites import survey

_one = Lock()
"""A process has one device, which two tiles would share."""


@lru_cache(1)
def context(where: str, name: str, device: str | Machine | None) -> tuple[Store, MrfRun]:
    """Return a store and its run, which is put on a device once; only those of the latest store are kept."""
    store = Store(where)
    return store, MrfRun(store.work.plan, open_machine(device), store.work.seed, Stored(store))


def do(where: str, name: str, device: str | Machine | None, turn: Turn, task: int) -> int:
    """Execute a turn of a task's tiles, unless it is done and its data are undamaged; return the number of the task."""
    with _one:
        store, run = context(where, name, device)
        if not store.done(turn, task):
            tiles = store.work.layout.levels[turn.level].task(task)
            store.note(turn, task, np.stack([PHASES[turn.phase](store, run, turn, tile) for tile in tiles]).sum(0))
    return task


def _begin(store: Store, run: MrfRun, turn: Turn, tile: Tile) -> Tally:
    """Write a tile before the first sweep of its level."""
    level = run.level(turn.level, tile)
    field = first_field(run, level, _above(store, run, turn, tile))
    store.write(turn, tile, _off(run.machine, field))
    return _tally(level, field, level.grid)


def _whole(store: Store, run: MrfRun, turn: Turn, tile: Tile) -> Tally:
    """Write a level that is a single tile, after all its sweeps."""
    state = run.enter(turn.level, _above(store, run, turn, tile), store.penalty(turn))
    while not run.at_equilibrium(state):
        state, _ = run.step(state)
    store.write(turn, tile, _off(run.machine, state.field))
    _, kinds = run.of(turn.level).fair_use(turn.level).split(state.penalty)
    return np.append([0, 0], kinds).astype(np.int64)  # whole steps


def _sweep(store: Store, run: MrfRun, turn: Turn, tile: Tile) -> Tally:
    """Write a tile after a sweep."""
    machine, whole, penalty = run.machine, store.work.layout.levels[turn.level], store.penalty(turn)
    window, rows, cols = whole.frame(tile, whole.halo)
    level = run.level(turn.level, window)
    assert penalty is not None
    if window.rows < whole.rows:  # otherwise rows wrap around, and all are near
        level = replace(level, schedule=Trimmed(level.schedule, rows.start, rows.stop))
    sweeps = turn.cooling + turn.free  # the only part of the schedule's state that persists
    memory = level.schedule.init(level.setting)._replace(sweep=sweeps)
    before = _on(machine, store.read(turn.level, turn.number - 1, window))
    after, *_ = run_steps(level, MrfState(*before, penalty, memory, turn.level, active=turn.active))
    inside = Field(*(np.ascontiguousarray(plane[..., rows, cols]) for plane in _off(machine, after)))
    store.write(turn, tile, inside)
    return _tally(level, _on(machine, inside), run.grid(turn.level).window(*tile))


def _show(store: Store, run: MrfRun, turn: Turn, tile: Tile) -> Tally:
    """Write a tile of the arrays of the output."""
    work, outputs, sd = store.work, store.work.outputs, run.options.finish or 0
    halo = int(gaussian_offsets(sd)[0].max()) if sd else 0
    window, rows, cols = work.layout.levels[0].frame(tile, halo)
    state, held = store.read(0, turn.number - 1, window), store.held(0, window)
    field, grid = _on(run.machine, state), run.grid(0).window(*window)
    seen, known = state.source[rows], held and held.known
    shown = finished_picture(run, grid, field, known, seen, rows.start)[:, cols]
    if work.given:
        values, given = store.given(tile)
        shown = np.where(given, values, shown)
    arrays = {"image": shown if outputs.channels else shown[..., 0]}
    if outputs.source or outputs.maps:
        place = run.sample.place(np.ascontiguousarray(seen[:, cols]))
        arrays |= {"source": place} if outputs.source else {}
        for name, maps in outputs.maps.items():
            arrays[name] = apply_source_map(place, maps if len(maps) > 1 else maps[0])
    store.show(tile, arrays)
    return np.zeros(2, np.int64)


PHASES = {"begin": _begin, "whole": _whole, "sweep": _sweep, "show": _show}


def _above(store: Store, run: MrfRun, turn: Turn, tile: Tile) -> Field | None:
    """Return the sites of the level above in a tile, on the machine; None at the coarsest level."""
    if turn.reads == len(store.work.layout.levels):
        return None
    (top, rows), (left, cols) = run.grid(turn.level).window(*tile).above
    return _on(run.machine, store.read(turn.reads, turn.number - 1, Tile(top, left, rows, cols)))


def _tally(level: Level, field: Field, grid: Grid) -> Tally:
    return np.append(survey(level.machine, grid, field.temperature), use_counts(level, field, grid))


def _on(machine: Machine, field: Field) -> Field:
    return Field(*map(machine.put, field))


def _off(machine: Machine, field: Field) -> Field:
    return Field(*(np.array(machine.get(plane)) for plane in field))
