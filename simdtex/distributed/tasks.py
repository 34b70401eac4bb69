# SPDX-License-Identifier: BSD-3-Clause
"""The task of a worker: one turn of some tiles, read from the store and written to it."""

from __future__ import annotations

from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from simdtex.distributed.store import Store, Stored, Turn, Work
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf import tiles
from simdtex.methods.mrf.algorithm import Run, finished
from simdtex.methods.mrf.tiles import Tally, Tile, framed
from simdtex.model.source_map import apply_source_map
from simdtex.ops.finish import around
from simdtex.ops.neighbourhood import Field


class Context(NamedTuple):
    """The data that a process keeps from one tile to the next."""

    store: Store
    work: Work
    run: Run


_one = Lock()
"""A process has one device, which two tiles would share."""


@lru_cache(1)
def context(where: str, name: str, device: str | Machine | None) -> Context:
    """Return the context of a store, which is put on a device once; only the latest is kept."""
    store, machine = Store(where), open_machine(device)
    run = Run(store.work.plan, machine, store.work.seed, Stored(store, store.work))
    return Context(store, store.work, run)


def do(where: str, name: str, device: str | Machine | None, turn: Turn, task: int) -> int:
    """Execute a turn of a task's tiles, unless it is done and its data are undamaged; return the number of the task.

    ``where`` and ``name`` are the store's path and name, since the path may later hold another store.
    """
    with _one:
        here = context(where, name, device)
        if not here.store.done(turn, here.work, task):
            level = here.work.layout.levels[turn.level]
            tallies = [PHASES[turn.phase](here, turn, level.tile(number)) for number in level.task(task)]
            here.store.note(turn, task, tiles.together(tallies))
    return task


def _begin(here: Context, turn: Turn, tile: Tile) -> Tally:
    field, tally = tiles.entered(here.run, turn.level, tile, _above(here, turn, tile))
    here.store.write(turn, tile, field)
    return tally


def _whole(here: Context, turn: Turn, tile: Tile) -> Tally:
    here.store.write(turn, tile, tiles.whole(here.run, turn.level, _above(here, turn, tile)))
    return Tally(np.zeros(0, np.int32), 0, 0)


def _sweep(here: Context, turn: Turn, tile: Tile) -> Tally:
    level = here.work.layout.levels[turn.level]
    frame = framed(level.lattice, tile, level.halo)
    before, penalty = here.store.read(level, turn.number - 1, frame.window), here.store.penalty(turn)
    done, free = turn.cooling + turn.free, not turn.active
    field, tally = tiles.relaxed(here.run, turn.level, tile, frame, before, penalty, done, free)
    here.store.write(turn, tile, field)
    return tally


def _show(here: Context, turn: Turn, tile: Tile) -> Tally:
    run, work, level = here.run, here.work, here.work.layout.levels[0]
    sd = run.options.finish or 0
    frame = framed(level.lattice, tile, int(around(sd)[0].max()) if sd else 0)
    state = here.store.read(level, turn.number - 1, frame.window)
    known = here.store.held(level, frame.window).known if work.held else None
    field, grid = Field(*map(run.machine.put, state)), run.grid(0).window(*frame.window)
    shown = finished(run, grid, field, known, state.source[frame.rows], frame.rows.start)[:, frame.cols]
    if here.work.given:
        values, given = here.store.given(tile)
        shown = np.where(given, values, shown)
    arrays = {"image": shown if work.channels else shown[..., 0]}
    if work.source or work.maps:
        place = run.sample.place(frame.cut(state.source))
        arrays |= {"source": place} if work.source else {}
        for name, maps in work.maps.items():
            arrays[name] = apply_source_map(place, maps if len(maps) > 1 else maps[0])
    here.store.show(tile, arrays)
    return Tally(np.zeros(0, np.int32), 0, 0)


def _above(here: Context, turn: Turn, tile: Tile) -> Field | None:
    levels = here.work.layout.levels
    if turn.reads == len(levels):
        return None
    (top, rows), (left, cols) = here.run.grid(turn.level).window(*tile).above
    return here.store.read(levels[turn.reads], turn.number - 1, Tile(top, left, rows, cols))


PHASES = {"begin": _begin, "whole": _whole, "sweep": _sweep, "show": _show}
