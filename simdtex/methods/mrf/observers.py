# SPDX-License-Identifier: BSD-3-Clause
"""What watches a run of Algorithm 1: progress, counts, stages, and what it would cost on a processor array."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.accounting import Account
from simdtex.maspar.array import parse_array
from simdtex.methods.mrf.algorithm import Info, Part, origin, picture, warmth
from simdtex.methods.mrf.level import Level, Run, State
from simdtex.methods.mrf.meter import Meter
from simdtex.model.lattice import Grid
from simdtex.ops import active
from simdtex.ops.relax import Listed
from simdtex.run import Callback, Relaxing, Stage


class Observer:
    """Sees every part of a sweep and every sweep's end, and changes nothing.

    Parameters
    ----------
    run : Run
    callback : callable, optional
        Called with a `simdtex.run.Relaxing` after every part of a sweep.

    Attributes
    ----------
    stages : list of Stage
        Each level's picture at its end.
    meter : Meter
    account : Account
    """

    def __init__(self, run: Run, callback: Callback | None) -> None:
        options = run.options
        self.stages: list[Stage] = []
        self.meter = Meter(expected_work(run))
        array = parse_array(options.array or "maspar-mp1-16k", options.mapping)
        self.account = Account(array, packed=options.array is None)
        self._run, self._callback = run, callback
        self._level: Level | None = None
        self._number: int | None = None  # of the level that has begun
        self._slots = 0
        self._done = 0  # sites of the present sweep that are relaxed
        self._ended = True  # the next part begins a sweep
        self._spared = self._weighed = 0

    def part(self, level: Level, state: State, free: bool, part: Part) -> None:
        """Count a part of a sweep, and tell of it."""
        if level.number != self._number:
            self._begin(level)
        self._level = level
        sites, phase = level.grid.rows * level.grid.cols, "free" if free else "relax"
        left = 0.0 if free else state.heat / (1024 * sites)
        if self._ended:
            self.meter.sweep(phase, left)
            self._done = 0
        self._ended = part.last
        self._done += part.sites
        step = self.meter.step(part.steps)
        fma = 0 if isinstance(level.proposal, Listed) else level.work * part.sites
        self.meter.add(part.sites, fma, min(1.0, self._done / max(1, sites if free else state.warm)))
        if self._callback:
            self._callback(
                Relaxing(
                    level=level.number,
                    levels=self._run.levels,
                    fraction=self.meter.fraction,
                    image=partial(picture, self._run, level.grid, part.field),
                    sweep=state.cooling + state.free + 1,
                    step=step,
                    phase=phase,
                    temperature_left=left,
                    end_of_sweep=part.last,
                    temperature=partial(warmth, self._run, level.grid, part.field),
                    source=partial(origin, self._run, level.grid, part.field),
                )
            )

    def sweep(self, level: Level, state: State, info: Info) -> None:
        """Count what a sweep would cost on an array; at a level's end, keep its picture."""
        for chosen in info.chosen:
            if self.account.packed:
                self.account.packed_steps(np.diff(chosen.ranges)[:, 0])
            else:
                for step in chosen.apart(level.machine):
                    self.account.step(step.sites)
        if info.ended:
            self._end(level, state)

    def _begin(self, level: Level) -> None:
        self._number, self._spared = level.number, level.machine.spared
        self._slots = level.proposal.slots
        self.meter.begin(level.number, level.grid, level.proposal.candidates.size, self._slots)
        self.account.begin(*self._costs(level.number))

    def _costs(self, number: int) -> tuple[Grid, NDArray[np.int32], int, int, int]:
        """What the account is told of a level."""
        channels, coherence = self._run.sample.channels, bool(self._run.options.coherence)
        words = channels + 1 + coherence  # of a neighbour: pixel, temperature, source
        return self._run.grid(number), self._run.offsets, self._slots, channels, words

    def kept(self) -> dict[str, Any]:
        """What it has seen, between two sweeps, as plain arrays and numbers."""
        spared, weighed = self._run.machine.spared - self._spared, 0
        if self._level is not None and isinstance(self._level.proposal, Listed):
            weighed = active.total(self._run.machine, self._level.grid, self._run.weighed) - self._weighed
        return {
            "stages": [(stage.level, stage.image) for stage in self.stages],
            **{"meter": self.meter.kept(), "account": self.account.levels},
            **{"slots": self._slots, "spared": spared, "weighed": weighed},
        }

    def restore(self, kept: dict[str, Any], number: int) -> None:
        """Go on from what `kept` gave, within a level or at its end."""
        self.stages[:] = [Stage(*stage) for stage in kept["stages"]]
        self.meter.restore(kept["meter"])
        self._number, self._slots = number, kept["slots"]
        self._spared, self._weighed = self._run.machine.spared - kept["spared"], -kept["weighed"]
        self.account.begin(*self._costs(number))
        self.account.levels[:] = kept["account"]

    def _end(self, level: Level, state: State) -> None:
        weighed: tuple[int, int] | None = None
        if isinstance(level.proposal, Listed):
            before, self._weighed = self._weighed, active.total(level.machine, level.grid, level.weighed)
            weighed = self._weighed - before, level.work // level.proposal.slots
        self.stages.append(Stage(level.number, picture(self._run, level.grid, state.field)))
        self.meter.end(level.machine.spared - self._spared, weighed)


def expected_work(run: Run) -> dict[int, tuple[float, float]]:
    """Relaxations times candidates that cooling and free sweeps of each level should take, as measured at xi = -1.

    The coarsest level takes about 0.6 |N| sweeps, the others relax each of their new sites about 6 times.
    """
    work = {}
    for number in range(run.levels):
        grid, options = run.grid(number), run.options
        coarsest = number == run.levels - 1
        sweeps = min(1024, 1 - 0.6 * len(run.offsets) / options.xi) if coarsest else 6 * 0.75
        candidates = run.sample.positions(run.offsets, grid.spacing, options.phases, options.edges).size
        if options.search == "coherent" and not coarsest and candidates > options.exhaustive:
            own = min(options.suggesting, len(run.offsets)) + 1
            candidates = min(candidates, own * (1 + options.similar) + max(1, options.chance))
        sites = grid.rows * grid.cols * candidates
        work[number] = (sites * sweeps, float(sites * options.free_sweeps))
    return work
