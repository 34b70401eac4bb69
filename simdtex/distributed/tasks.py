# SPDX-License-Identifier: BSD-3-Clause
"""What a worker does: one tile's turn. It finds all that it needs in the store, and notes there what it has done."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from simdtex.distributed.store import Store, Stored, Turn, Work
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf import tiles
from simdtex.methods.mrf.algorithm import Run, finished
from simdtex.methods.mrf.tiles import Tally, Tile, framed
from simdtex.ops.finish import around
from simdtex.ops.neighbourhood import Field


@dataclass(frozen=True)
class Context:
    """What a process keeps between two tiles."""

    store: Store
    work: Work
    run: Run


_contexts: dict[tuple[str, str, Any], Context] = {}
_one = Lock()
"""A process has one device, and two tiles at once would share it."""


def context(where: str, name: str, device: str | Machine | None) -> Context:
    """The context of a store, laid out on a device once."""
    key = (where, name, device)
    if key not in _contexts:
        _contexts.clear()  # one at a time, so that memory has its bound
        store, machine = Store(where), open_machine(device)
        work = store.work()
        run = Run(work.plan, machine, work.seed, Stored(store, work))
        _contexts[key] = Context(store, work, run)
    return _contexts[key]


def forget() -> None:
    """Let go of what is kept."""
    _contexts.clear()


def do(where: str, name: str, device: str | Machine | None, turn: Turn, number: int) -> int:
    """A tile's turn, unless it has been done; returns the tile's number.

    Parameters
    ----------
    where, name : str
        The store, and the name that it was given when it was made: another may lie there later.
    device : str or Machine, optional
        As of `simdtex.open_machine`.
    turn : Turn
    number : int
        Of the tile, row by row.
    """
    with _one:
        here = context(where, name, device)
        if here.store.tally(turn, number) is None:
            here.store.told(
                turn, number, PHASES[turn.phase](here, turn, here.work.layout.levels[turn.level].tile(number))
            )
    return number


def _begin(here: Context, turn: Turn, tile: Tile) -> Tally:
    field, tally = tiles.entered(here.run, turn.level, tile, _above(here, turn, tile))
    here.store.write(here.work.layout.levels[turn.level], turn.write, tile, field)
    return tally


def _whole(here: Context, turn: Turn, tile: Tile) -> Tally:
    field = tiles.whole(here.run, turn.level, _above(here, turn, tile))
    here.store.write(here.work.layout.levels[turn.level], turn.write, tile, field)
    return Tally(np.zeros(0, np.int32), 0, 0)


def _sweep(here: Context, turn: Turn, tile: Tile) -> Tally:
    level = here.work.layout.levels[turn.level]
    frame = framed(level.lattice, tile, level.halo)
    before, penalty = here.store.read(level, turn.read, frame.window), here.store.penalty(turn)
    done, free = turn.cooling + turn.free, not turn.active
    field, tally = tiles.relaxed(here.run, turn.level, tile, frame, before, penalty, done, free)
    here.store.write(level, turn.write, tile, field)
    return tally


def _show(here: Context, turn: Turn, tile: Tile) -> Tally:
    run, work, level = here.run, here.work, here.work.layout.levels[0]
    sd = run.options.finish or 0
    frame = framed(level.lattice, tile, int(around(sd)[0].max()) if sd else 0)
    state = here.store.read(level, turn.read, frame.window)
    known = here.store.held(level, frame.window).kind > 0 if work.held else None
    field, grid = Field(*map(run.machine.put, state)), run.grid(0).window(*frame.window)
    shown = finished(run, grid, field, known, state.source[frame.rows], frame.rows.start)[:, frame.cols]
    if here.work.given:
        values, given = here.store.given(tile)
        shown = np.where(given, values, shown)
    here.store.show(tile, shown, run.sample.place(frame.cut(state.source)))
    return Tally(np.zeros(0, np.int32), 0, 0)


def _above(here: Context, turn: Turn, tile: Tile) -> Field | None:
    levels = here.work.layout.levels
    if turn.level + 1 == len(levels):
        return None
    (top, rows), (left, cols) = here.run.grid(turn.level).window(*tile).above
    return here.store.read(levels[turn.level + 1], turn.read, Tile(top, left, rows, cols))


PHASES = {"begin": _begin, "whole": _whole, "sweep": _sweep, "show": _show}

__all__ = ["Context", "context", "do", "forget"]
