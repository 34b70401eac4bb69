# SPDX-License-Identifier: BSD-3-Clause
"""The turns of an output in tiles: the run of the leading process, of which a step is one turn of all tiles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.tiles.layout import LevelLayout, Tile
from simdtex.jobs.tiles.store import Store, Stored, Turn, phase_of
from simdtex.machine import Machine
from simdtex.methods.mrf.level import Lattices
from simdtex.methods.mrf.record import expected_work, fraction_done, known_before
from simdtex.methods.mrf.use import use_penalty
from simdtex.run import Callback, Observer, Output, Progress

Execute = Callable[[Turn, int], Iterator[int]]
"""A function that executes the given number of tasks of a turn, in any order, and yields the number of each done."""

SHOWN = 1024
"""The largest side of the picture of a callback, sites."""


class Turns:
    """The turns of an output, the plan and its run at once: the state is the current turn, which the store keeps."""

    lattices: Lattices

    def __init__(self, store: Store, execute: Execute) -> None:
        self.store, self.execute, self.levels = store, execute, store.work.layout.levels

    def on(self, machine: Machine, seed: int) -> Turns:
        """Return the run of the leading process, which has the sample and a count for each of its candidates."""
        work = self.store.work
        self.lattices = Lattices(work.plan, machine, work.seed, Stored(self.store))
        return self

    def begin(self) -> Turn:
        """Return the current turn of the store."""
        return self.store.turn

    def step(self, turn: Turn, watch: Callable[..., None]) -> tuple[Turn, None]:
        """Execute a turn of all tiles, and return the next turn; tasks that have finished it take little time."""
        level = self.levels[turn.level]
        self.store.prepare(turn, self._candidates(turn))
        for done, _ in enumerate(self.execute(turn, level.tasks), 1):
            watch(turn, min(level.count, done * level.together))
        return self._complete(turn), None

    def ended(self, turn: Turn) -> bool:
        """Return whether the output is written."""
        return turn.phase == "done"

    def result(self, turn: Turn, observer: Any) -> tuple[Any, Output]:
        """Return the picture and its source map as arrays of the store; slicing reads them."""
        level = self.levels[0]
        tiles = f"{level.count} tile{'s' * (level.count > 1)} of at most {level.side} x {level.side}"
        image, source = self.store.picture(turn)
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
        store, lattices = self.store, self.lattices.of(turn.level)
        if turn.phase == "show":
            return turn._replace(phase="done")  # only `finish` notes it
        total = store.total(turn)
        (active, temperature_sum), counts = total[:2].tolist(), total[2:]
        cooling = turn.cooling + (turn.phase == "sweep" and turn.active > 0)
        free = turn.free + (turn.phase == "sweep" and turn.active == 0)
        following = turn.number + 1
        after = Turn(following, "sweep", turn.level, cooling, free, active, temperature_sum)
        fair_use, penalty = lattices.fair_use(turn.level), counts.astype(np.float32)
        if turn.phase != "whole":
            temperature = temperature_sum / (1024 * lattices.grid(turn.level).size)
            penalty = use_penalty(counts, fair_use, lattices.rate(turn.level), store.penalty(turn), temperature)
            if after.active or after.free < lattices.free_sweeps(turn.level):
                return store.save(after, penalty)
        if turn.level:
            below = Turn(following, phase_of(self.levels[turn.level - 1]), turn.level - 1)
            return store.save(below, fair_use.split(penalty)[1])
        return store.save(Turn(following, "show", 0))


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
        level, sweep = self._run.levels[turn.level], turn.cooling + turn.free + 1
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
        levels = self._run.levels
        reads, step = turn.reads, -(-max(level.rows, level.cols) // SHOWN)
        sample = self._run.lattices.of(min(reads, len(levels) - 1)).sample
        if reads == len(levels):
            return np.zeros((1, 1, sample.shown), sample.pixels.dtype)
        lines = []
        for row in range(0, levels[reads].rows, step):
            line = Tile(row, 0, 1, levels[reads].cols)
            values, source, _ = self._run.store.read(reads, turn.number - 1, line)
            lines.append(sample.picture(values[..., ::step], source[:, ::step]))
        return np.concatenate(lines)
