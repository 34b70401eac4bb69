# SPDX-License-Identifier: BSD-3-Clause
"""Algorithm 1 over a store, for the driver: a step is one turn of all tiles, executed by any processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.distributed.layout import LevelLayout
from simdtex.distributed.store import Store, Stored, Turn, phase_of
from simdtex.machine import Machine
from simdtex.methods.mrf.level import Lattices
from simdtex.methods.mrf.record import expected_work, fraction_done, known_before
from simdtex.methods.mrf.tiles import Tile
from simdtex.ops.use import use_penalty
from simdtex.run import Callback, Output, Tiling

Execute = Callable[[Turn, int], Iterator[int]]
"""A function that executes the given number of tasks of a turn, in any order, and yields the number of each done."""

SHOWN = 1024
"""The largest side of the picture of a callback, sites."""


@dataclass(frozen=True)
class Tiles:
    """The plan of an output in tiles: its store, and the function that executes tasks."""

    store: Store
    execute: Execute

    def on(self, machine: Machine, seed: int) -> Run:
        """Return the run of the leading process, which has the sample and a count for each of its candidates."""
        return Run(self, machine)


class Run:
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
        """Return the number of candidates whose use a tile counts."""
        if turn.phase in ("whole", "show"):
            return 0
        places = self.lattices.places(turn.level)
        return int((places.everywhere if self.lattices.exhaustive(turn.level) else places.positions).size)

    def _complete(self, turn: Turn) -> Turn:
        """Return the turn after a complete one, which becomes the current turn of the store."""
        store, lattices, levels = self.store, self.lattices, self.work.layout.levels
        if turn.phase == "show":
            return turn._replace(phase="done")  # only `finish` notes it
        counts, active, temperature_sum = store.total(turn)
        cooling = turn.cooling + (turn.phase == "sweep" and turn.active > 0)
        free = turn.free + (turn.phase == "sweep" and turn.active == 0)
        number = turn.number + 1
        if turn.phase != "whole" and (active or free < lattices.options.free_sweeps):
            before = store.penalty(turn) if turn.phase == "sweep" else None
            rate = lattices.options.balance * lattices.usual
            after = Turn(number, "sweep", turn.level, cooling, free, active, temperature_sum)
            return store.save(after, use_penalty(counts, lattices.fair_use(turn.level), rate, before))
        if turn.level:
            return store.save(Turn(number, phase_of(levels[turn.level - 1]), turn.level - 1))
        return store.save(Turn(number, "show", 0))


class Watch:
    """Calls the callback with a `simdtex.run.Tiling` after every tile."""

    def __init__(self, run: Run, callback: Callback | None) -> None:
        self._run, self._callback = run, callback
        self._expected = expected_work(run.lattices)
        self._fraction = 0.0

    def part(self, turn: Turn, done: int) -> None:
        """Report that ``done`` tiles have finished a turn."""
        if self._callback is None:
            return
        level = self._run.work.layout.levels[turn.level]
        self._fraction = max(self._fraction, self._share(turn, level, done / level.count))
        self._callback(
            Tiling(
                level=turn.level,
                levels=self._run.lattices.levels,
                fraction=self._fraction,
                image=partial(self._picture, turn, level),
                phase=turn.phase,
                sweep=turn.cooling + turn.free + 1,
                tile=done,
                tiles=level.count,
            )
        )

    def step(self, turn: Turn, info: None) -> None:
        """Do nothing: tiles are reported one by one."""

    def save(self) -> None:
        """Return nothing: the store holds the state."""

    def load(self, saved: None) -> None:
        """Do nothing: the store holds the state."""

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
            cooled, free = 1.0, min(1.0, (turn.free + part) / max(1, self._run.lattices.options.free_sweeps))
        return fraction_done(self._expected, turn.level, cooled, free)

    def _picture(self, turn: Turn, level: LevelLayout) -> NDArray[Any]:
        """Return every n-th site of the state before the turn, at most about `SHOWN` on a side."""
        sample, levels = self._run.lattices.sample, self._run.work.layout.levels
        number, step = turn.reads, -(-max(level.rows, level.cols) // SHOWN)
        if number == len(levels):
            return np.zeros((1, 1, sample.shown), sample.pixels.dtype)
        found = []
        for row in range(0, levels[number].rows, step):
            values, source, _ = self._run.store.read(
                levels[number], turn.number - 1, Tile(row, 0, 1, levels[number].cols)
            )
            found.append(sample.picture(values[..., ::step], source[:, ::step]))
        return np.concatenate(found)
