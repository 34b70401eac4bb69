# SPDX-License-Identifier: BSD-3-Clause
"""The turns of an output in tiles: the run of the leading process, and the task of a worker.

For the driver, a step is one turn of all tiles, executed by any processes. A task is one turn of some tiles, read from
the store and written to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from math import sqrt
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.tiles import windows as tiles
from simdtex.jobs.tiles.layout import LevelLayout
from simdtex.jobs.tiles.store import Store, Stored, Turn, Work, phase_of
from simdtex.jobs.tiles.windows import Tally, Tile, framed
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf.algorithm import Run, finished_picture
from simdtex.methods.mrf.finish import gaussian_offsets
from simdtex.methods.mrf.level import Lattices
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.record import expected_work, fraction_done, known_before
from simdtex.methods.mrf.use import use_penalty
from simdtex.model.source_map import apply_source_map
from simdtex.run import Callback, Observer, Output, Progress


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
    field, tally = tiles.begin_tile(here.run, turn.level, tile, _above(here, turn, tile))
    here.store.write(turn, tile, field)
    return tally


def _whole(here: Context, turn: Turn, tile: Tile) -> Tally:
    field, penalty = tiles.run_level(here.run, turn.level, _above(here, turn, tile), here.store.penalty(turn))
    here.store.write(turn, tile, field)
    _, kinds = here.run.of(turn.level).fair_use(turn.level).split(penalty)
    return Tally(kinds.astype(np.int64), 0, 0)  # whole steps


def _sweep(here: Context, turn: Turn, tile: Tile) -> Tally:
    level = here.work.layout.levels[turn.level]
    frame = framed(level.lattice, tile, level.halo)
    before, penalty = here.store.read(level, turn.number - 1, frame.window), here.store.penalty(turn)
    assert penalty is not None
    done, free = turn.cooling + turn.free, not turn.active
    field, tally = tiles.sweep_tile(here.run, turn.level, tile, frame, before, penalty, done, free)
    here.store.write(turn, tile, field)
    return tally


def _show(here: Context, turn: Turn, tile: Tile) -> Tally:
    run, work, level = here.run, here.work, here.work.layout.levels[0]
    sd = run.options.finish or 0
    frame = framed(level.lattice, tile, int(gaussian_offsets(sd)[0].max()) if sd else 0)
    state = here.store.read(level, turn.number - 1, frame.window)
    known = here.store.held(level, frame.window).known if work.held else None
    field, grid = Field(*map(run.machine.put, state)), run.grid(0).window(*frame.window)
    shown = finished_picture(run, grid, field, known, state.source[frame.rows], frame.rows.start)[:, frame.cols]
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


Execute = Callable[[Turn, int], Iterator[int]]
"""A function that executes the given number of tasks of a turn, in any order, and yields the number of each done."""

SHOWN = 1024
"""The largest side of the picture of a callback, sites."""


@dataclass(frozen=True)
class Tiles:
    """The plan of an output in tiles: its store, and the function that executes tasks."""

    store: Store
    execute: Execute

    def on(self, machine: Machine, seed: int) -> Turns:
        """Return the run of the leading process, which has the sample and a count for each of its candidates."""
        return Turns(self, machine)


class Turns:
    """The turns of an output; the state is the current turn, which the store keeps."""

    def __init__(self, tiles: Tiles, machine: Machine) -> None:
        self.store, self.execute, self.work = tiles.store, tiles.execute, tiles.store.work
        work = self.work
        self.lattices = Lattices(work.plan, machine, work.seed, Stored(self.store, work))

    def begin(self) -> Turn:
        """Return the current turn of the store."""
        return self.store.turn

    def step(self, turn: Turn, watch: Callable[..., None]) -> tuple[Turn, None]:
        """Execute a turn of all tiles, and return the next turn; tasks that have finished it take little time."""
        level = self.work.layout.levels[turn.level]
        self.store.prepare(turn, self.work, self._candidates(turn))
        for done, _ in enumerate(self.execute(turn, level.tasks), 1):
            watch(turn, min(level.count, done * level.together))
        return self._complete(turn), None

    def ended(self, turn: Turn) -> bool:
        """Return whether the output is written."""
        return turn.phase == "done"

    def result(self, turn: Turn, observer: Any) -> tuple[Any, Output]:
        """Return the picture and its source map as arrays of the store; slicing reads them."""
        level = self.work.layout.levels[0]
        tiles = f"{level.count} tile{'s' * (level.count > 1)} of at most {level.side} x {level.side}"
        image, source = self.store.picture(turn, self.work)
        return image, Output(source, statistics=known_before(self.lattices) | {"tiles": tiles})

    def save(self, turn: Turn) -> Turn:
        """Return the turn: the store holds everything else."""
        return turn

    load = save

    def observer(self, callback: Callback | None) -> Watch:
        """Return the observer of this run."""
        return Watch(self, callback)

    def _candidates(self, turn: Turn) -> int:
        """Return the number of candidates, and of kinds in regions, whose use a tile counts."""
        lattices = self.lattices.of(turn.level)
        kinds, places = lattices.fair_use(turn.level).wanted.size, lattices.places(turn.level)
        if turn.phase in ("whole", "show"):
            return kinds * (turn.phase == "whole")
        return kinds + int((places.everywhere if lattices.exhaustive(turn.level) else places.positions).size)

    def _complete(self, turn: Turn) -> Turn:
        """Return the turn after a complete one, which becomes the current turn of the store."""
        store, lattices, levels = self.store, self.lattices.of(turn.level), self.work.layout.levels
        if turn.phase == "show":
            return turn._replace(phase="done")  # only `finish` notes it
        counts, active, temperature_sum = store.total(turn)
        cooling = turn.cooling + (turn.phase == "sweep" and turn.active > 0)
        free = turn.free + (turn.phase == "sweep" and turn.active == 0)
        number = turn.number + 1
        after = Turn(number, "sweep", turn.level, cooling, free, active, temperature_sum)
        fair_use, penalty = lattices.fair_use(turn.level), counts.astype(np.float32)
        if turn.phase != "whole":
            penalty = use_penalty(counts, fair_use, lattices.rate, store.penalty(turn))
            if not lattices.at_equilibrium(after):
                return store.save(after, penalty)
        if turn.level:
            below = Turn(number, phase_of(levels[turn.level - 1]), turn.level - 1)
            return store.save(below, fair_use.split(penalty)[1])
        return store.save(Turn(number, "show", 0))


class Watch(Observer):
    """The observer of a run: it reports every tile, and the store holds the state."""

    def __init__(self, run: Turns, callback: Callback | None) -> None:
        super().__init__(run, callback)
        self._expected = expected_work(run.lattices)
        self._fraction = 0.0

    def part(self, turn: Turn, done: int) -> None:
        """Report that ``done`` tiles have finished a turn."""
        if self._callback is None:
            return
        level, sweep = self._run.work.layout.levels[turn.level], turn.cooling + turn.free + 1
        self._fraction = max(self._fraction, self._share(turn, level, done / level.count))
        what = f"level {turn.level}" + (f", sweep {sweep}" if turn.phase == "sweep" else "")
        what = "writing the picture" if turn.phase == "show" else what
        self._callback(
            Progress(
                level=turn.level,
                levels=self._run.lattices.levels,
                fraction=self._fraction,
                doing=f"{what}, tile {done} of {level.count}",
                image=partial(self._picture, turn, level),
                details={"phase": turn.phase, "sweep": sweep, "tile": done, "tiles": level.count},
            )
        )

    def _share(self, turn: Turn, level: LevelLayout, part: float) -> float:
        """Return the finished share of the expected work."""
        cooled, free = (0.0, 0.0) if turn.phase == "begin" else (part, part)
        if turn.phase == "show":
            cooled = free = 1.0
        elif turn.phase == "sweep" and turn.active:
            first = 1.0 if turn.level == self._run.lattices.levels - 1 else 0.75  # mean temperature at the beginning
            left = turn.temperature_sum / (1024 * level.rows * level.cols * first)
            cooled, free = max(0.0, 1 - sqrt(left)), 0.0
        elif turn.phase == "sweep":
            cooled, free = 1.0, min(1.0, (turn.free + part) / max(1, self._run.lattices.free_sweeps(turn.level)))
        return fraction_done(self._expected, turn.level, cooled, free)

    def _picture(self, turn: Turn, level: LevelLayout) -> NDArray[Any]:
        """Return every n-th site of the state before the turn, at most about `SHOWN` on a side."""
        levels = self._run.work.layout.levels
        number, step = turn.reads, -(-max(level.rows, level.cols) // SHOWN)
        sample = self._run.lattices.of(min(number, len(levels) - 1)).sample
        if number == len(levels):
            return np.zeros((1, 1, sample.shown), sample.pixels.dtype)
        found = []
        for row in range(0, levels[number].rows, step):
            values, source, _ = self._run.store.read(
                levels[number], turn.number - 1, Tile(row, 0, 1, levels[number].cols)
            )
            found.append(sample.picture(values[..., ::step], source[:, ::step]))
        return np.concatenate(found)
