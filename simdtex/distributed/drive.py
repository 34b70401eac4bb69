# SPDX-License-Identifier: BSD-3-Clause
"""Algorithm 1 over a store: turn by turn, whoever takes the tiles."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.distributed.plan import LevelPlan
from simdtex.distributed.store import PLANES, Store, Stored, Turn, Work, phase_of
from simdtex.machine.reference import Reference
from simdtex.methods.mrf.level import Run
from simdtex.methods.mrf.observers import expected_work
from simdtex.ops.use import price
from simdtex.run import Callback, Tiling

Execute = Callable[[Turn, Sequence[int]], Iterator[int]]
"""Has tiles of a turn done by whomever, in any order; yields the number of each that is done."""

SHOWN = 1024
"""Sites to the side of the picture that a callback sees, at most."""


def go_on(store: Store, execute: Execute, callback: Callback | None = None) -> None:
    """Do all that is left to do of an output.

    Parameters
    ----------
    store : Store
    execute : callable
    callback : callable, optional
        Called with a `simdtex.run.Tiling` after every tile.

    Notes
    -----
    All that this process holds is the sample and one number for each of its candidates.
    """
    if (turn := store.turn).phase == "done":
        store.finish()
        return
    work, machine = store.work(), Reference()
    run = work.outline.run(machine, Stored(store, work, machine), np.zeros((1, 1), np.int32))
    teller = Teller(store, work, run, callback)
    while turn.phase != "done":
        level = work.plan.levels[turn.level]
        new = store.prepare(turn, level, work.plan.channels, _candidates(run, turn))
        left = list(range(level.count)) if new else np.flatnonzero(~store.done(turn, level.count)).tolist()
        for done, _ in enumerate(execute(turn, left), level.count - len(left) + 1):
            teller.tell(turn, done)
        turn = _complete(store, work, run, turn)
    store.finish()


def _candidates(run: Run, turn: Turn) -> int:
    """How many candidates a tile counts the use of."""
    if turn.phase in ("whole", "show"):
        return 0
    where = run.where(turn.level)
    found = run.sample.everywhere(*where) if run.exhaustive(turn.level) else run.sample.positions(*where)
    return int(found.size)


def _complete(store: Store, work: Work, run: Run, turn: Turn) -> Turn:
    """Go on to the next turn, now that all tiles have had this one."""
    level = work.plan.levels[turn.level]
    if turn.phase == "show":
        store.save(turn._replace(number=turn.number + 1, phase="done"))
        return turn._replace(phase="done")
    counts, warm, heat = store.total(turn, level.count)
    cooling = turn.cooling + (turn.phase == "sweep" and turn.warm > 0)
    free = turn.free + (turn.phase == "sweep" and turn.warm == 0)
    number, read = turn.number + 1, turn.write
    if turn.phase != "whole" and (warm or free < run.options.free_sweeps):
        before = store.price(turn) if turn.phase == "sweep" else None
        costs = price(counts, run.market(turn.level), run.options.balance * run.usual, before)
        after = Turn(number, "sweep", turn.level, read, 1 - read, cooling, free, warm, heat)
        store.save(after, costs)
    elif turn.level:
        after = Turn(number, phase_of(work.plan.levels[turn.level - 1]), turn.level - 1, read)
        store.save(after)
    else:
        after = Turn(number, "show", 0, read, read)
        store.save(after)
    if turn.phase in ("begin", "whole"):
        store.forget(turn.level + 1)
    return after


class Teller:
    """Tells how far an output is."""

    def __init__(self, store: Store, work: Work, run: Run, callback: Callback | None) -> None:
        self._store, self._work, self._run, self._callback = store, work, run, callback
        self._expected = expected_work(run)
        self._fraction = 0.0

    def tell(self, turn: Turn, done: int) -> None:
        """So many tiles have had their turn."""
        if self._callback is None:
            return
        level = self._work.plan.levels[turn.level]
        self._fraction = max(self._fraction, self._share(turn, level, done / level.count))
        self._callback(
            Tiling(
                level=turn.level,
                levels=self._run.levels,
                fraction=self._fraction,
                image=partial(self._picture, turn, level),
                phase=turn.phase,
                sweep=turn.cooling + turn.free + 1,
                tile=done,
                tiles=level.count,
            )
        )

    def _share(self, turn: Turn, level: LevelPlan, part: float) -> float:
        """Of the expected work, of which the last hundredth is for writing the picture."""
        total = sum(map(sum, self._expected.values()))
        over = sum(sum(self._expected[number]) for number in range(turn.level + 1, self._run.levels))
        cooling, free = self._expected[turn.level]
        if turn.phase == "show":
            return 0.99 + 0.01 * part
        if turn.phase == "sweep" and not turn.warm:
            over += cooling + free * min(1.0, (turn.free + part) / max(1, self._run.options.free_sweeps))
        elif turn.phase == "sweep":
            first = 1.0 if turn.level == self._run.levels - 1 else 0.75  # mean temperature where the level began
            left = turn.heat / (1024 * level.rows * level.cols * first)
            over += cooling * min(1.0, 1 - sqrt(left) + 0.1 * part)
        elif turn.phase == "whole":
            over += (cooling + free) * part
        return 0.99 * min(1.0, over / total)

    def _picture(self, turn: Turn, level: LevelPlan) -> NDArray[Any]:
        """Every n-th site of the state before the turn: some thousand to the side."""
        step, state = -(-max(level.rows, level.cols) // SHOWN), self._store.root["work"]
        where = (
            f"level{turn.level}/{turn.read}"
            if turn.phase in ("sweep", "show")
            else f"level{turn.level + 1}/{turn.read}"
        )
        if f"{where}/{PLANES[-1]}" not in state:
            return np.zeros((1, 1, self._run.sample.shown), self._run.sample.pixels.dtype)
        values, source = (state[f"{where}/{name}"] for name in PLANES[:2])
        rows = [
            self._run.sample.picture(values[:, i, ::step][:, None], source[i, ::step][None])
            for i in range(0, source.shape[0], step)
        ]
        return np.concatenate(rows)


__all__ = ["Execute", "go_on"]
