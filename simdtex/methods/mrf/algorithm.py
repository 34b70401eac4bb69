# SPDX-License-Identifier: BSD-3-Clause
"""Nonparametric multiscale Markov random field: Algorithm 1 of Paget and Longstaff (1998).

`MrfRun.begin`, `MrfRun.step` and `sweep` are the algorithm, and the numbers in the comments are the paper's. First the
schedule chooses the sites of a step of 6.2.2, which do not depend on one another; a device then relaxes all of them in
one launch (`simdtex.methods.mrf.relax`). The observer (record.py) keeps progress, counts and stages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.checkpoint import like
from simdtex.methods.mrf.commit import commit
from simdtex.methods.mrf.finish import finish
from simdtex.methods.mrf.level import ActiveSites, Lattices, Level, MrfState, Part, SweepInfo, parts, with_penalty
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.record import MrfRecord, output
from simdtex.methods.mrf.relax import Relaxation, relax, relax_out_of_place
from simdtex.methods.mrf.snapshot import snapshot
from simdtex.methods.mrf.start import start
from simdtex.methods.mrf.use import use, use_penalty
from simdtex.model.lattice import Grid
from simdtex.run import Callback, Output
from simdtex.schedules.sites import survey

AT_ONCE = 2**20
"""Sites that are finished together."""


Watch = Callable[[Level, MrfState, Part], Any]
"""A function that is called after every part of a sweep, with the state before the sweep."""


def ignore(level: Level, state: MrfState, part: Part) -> None:
    """Do nothing: the default of ``watch``."""


class MrfRun(Lattices):
    """Algorithm 1 for the driver: a step is a sweep, or enters a level."""

    def begin(self) -> MrfState:
        """Return the state at the beginning of the coarsest level: sample pixels drawn at random, t = 1."""
        return self.enter(self.levels - 1, None)

    def enter(self, number: int, above: Field | None, penalty: NDArray[np.float32] | None = None) -> MrfState:
        """Return the state at the beginning of a level: sites of the level above have t = 0, all others t = 1.

        ``penalty`` are those after the level above, of which the penalties of kinds are kept.
        """
        level = self.level(number)  # 3, 4, 6.1
        return first_state(level, first_field(self, level, above), penalty)

    def step(self, state: MrfState, watch: Watch = ignore) -> tuple[MrfState, SweepInfo]:
        """Run a sweep, or enter the next level if the current one is at equilibrium; return the state after it."""
        if self.at_equilibrium(state):  # 6
            return self.enter(state.level - 1, state.field, state.penalty), SweepInfo(state.level - 1)
        level = self.level(state.level)
        state, chosen = sweep(level, state, watch)  # 6.2
        turn = state.cooling + state.free
        return state, SweepInfo(level.number, turn, tuple(chosen), self.at_equilibrium(state))

    def at_equilibrium(self, state: MrfState) -> bool:
        """Return whether all temperatures of the level are 0 and its free sweeps are done."""
        return not state.active and state.free == self.free_sweeps(state.level)

    def ended(self, state: MrfState) -> bool:
        """Return whether the finest level has reached equilibrium."""
        return state.level == 0 and self.at_equilibrium(state)

    def result(self, state: MrfState, observer: MrfRecord) -> tuple[NDArray[Any], Output]:
        """Return the picture ([layers,] rows, cols, channels) in the sample's type, and the rest of the output."""
        grid, given = self.grid(0), self.plan.given
        source = grid.latest(self.machine.get(state.source))
        known = given.data if given and given.data.any() else None
        image = finished_picture(self, grid, state.field, known, source)
        return given.shown(image, grid) if given else image, output(self, state, source, observer)

    def save(self, state: MrfState) -> dict[str, Any]:
        """Return a copy of the state that needs no machine."""
        planes = (np.array(self.machine.get(plane)) for plane in state.field)
        return dict(zip(MrfState._fields, (*planes, *state[3:]), strict=True))

    def load(self, saved: dict[str, Any]) -> MrfState:
        """Return the state that `save` copied, on this machine."""
        state = MrfState(**saved)
        level = self.level(state.level)
        memory = like(level.schedule.init(level.setting), state.schedule)  # with the types of the schedule's own state
        values, source, temperature = map(self.machine.put, state.field)
        return state._replace(values=values, source=source, temperature=temperature, schedule=memory)

    def observer(self, callback: Callback | None) -> MrfRecord:
        """Return the observer of this run."""
        return MrfRecord(self, callback)


def first_field(run: Lattices, level: Level, above: Field | None) -> Field:
    """Return the field of a level, or of a window of it, before its first sweep: steps 2 and 5, and known sites.

    ``above`` are the sites of the level above in the window, on the machine; None at the coarsest level.
    """
    machine, grid, run = level.machine, level.setting.grid, run.of(level.number)
    everywhere = machine.put(run.sample.places(np.zeros((1, 2), np.int32), 1).positions)
    field = start(machine, run.planes, everywhere, grid, run.seed, above, run.squares, run.sample.cols)  # 2, 5
    return run.conditions.entered(machine, level.number, grid, field)


def first_state(level: Level, field: Field, penalty: NDArray[np.float32] | None = None) -> MrfState:
    """Return the state of a level before its first sweep; ``penalty`` as in `MrfRun.enter`."""
    count, total = survey(level.machine, level.grid, field.temperature)
    kept = None if penalty is None else level.fair_use.split(penalty)[1]
    counts, temperature = use_counts(level, field, level.grid), total / (1024 * level.grid.size)
    penalty = use_penalty(counts, level.fair_use, level.rate, kept, temperature)
    memory = level.schedule.init(level.setting)
    return MrfState(*field, penalty, memory, level.number, active=count, temperature_sum=total)


def sweep(level: Level, state: MrfState, watch: Watch = ignore) -> tuple[MrfState, list[schedules.Info]]:
    """Relax about as many sites as are active, in the steps of the schedule: 6.2.1 and 6.2.2.

    The arrays of ``state`` are overwritten. If no site is active, the sweep is a free sweep: it relaxes all sites that
    are not known. ``watch`` is called after every part of the sweep. Returns the state after the sweep, and the
    schedule's decision at each step.
    """
    free = not state.active
    field, memory, chosen = run_steps(level, state, watch)
    count, total = survey(level.machine, level.grid, field.temperature)
    counts, temperature = use_counts(level, field, level.grid), total / (1024 * level.grid.size)
    penalty = use_penalty(counts, level.fair_use, level.rate, state.penalty, temperature)
    cooling, freed = state.cooling + (not free), state.free + free
    return MrfState(*field, penalty, memory, level.number, cooling, freed, count, total), chosen


def run_steps(
    level: Level, state: MrfState, watch: Watch = ignore, sets: float = inf
) -> tuple[Field, Any, list[schedules.Info]]:
    """Run the steps of a sweep; return the field after it, the state of the schedule, and its decisions.

    ``sets`` is the number of sets of sites after which the sweep is left.
    """
    field, memory = with_snapshot(level, state.field), state.schedule
    active, relaxation = ActiveSites(level, field.temperature, not state.active), with_penalty(level, state.penalty)
    chosen: list[schedules.Info] = []
    for after, decision in schedules.decisions(level.schedule, level.setting, state.schedule, active):  # 6.2.1
        if not sets:
            break
        memory = after
        if sets < len(decision.ranges):
            decision = decision._replace(steps=decision.ranges[: int(sets)])
        for part in relax_parts(level, field, decision, relaxation):  # 6.2.2
            field = part.field
            watch(level, state, part)
        chosen.append(decision)
        sets -= len(decision.ranges)
    return field, memory, chosen


def use_counts(level: Level, field: Field, grid: Grid) -> NDArray[np.int32]:
    """Return the uses of each candidate, zeros if none matters, and the number of sites of each kind in each region."""
    candidates, machine, kinds = level.proposal.candidates, level.machine, np.zeros(0, np.int32)
    uses = use(machine, field, grid, candidates) if level.rate else np.zeros(candidates.size, np.int32)
    if level.regions:
        kinds = level.regions.counts(Field(*map(machine.get, field)), grid).astype(np.int32)
    return np.append(uses, kinds)


def relax_parts(level: Level, field: Field, chosen: schedules.Info, relaxation: Relaxation) -> Iterator[Part]:
    """Relax the sites of the chosen steps one step after another, and yield short parts: 6.2.2."""
    machine = level.machine
    if level.in_place:
        sites, before = chosen.sites, 0
        sites = machine.put(sites) if isinstance(sites, np.ndarray) else sites
        for ranges, begun, last in parts(chosen.ranges, level.at_once):
            field = relax(machine, sites, ranges, field, level.evaluations, relaxation, chosen.turn)
            done = int((ranges[:, 1] - ranges[:, 0]).sum())
            machine.sync(level.work * done)
            yield Part(begun - before, done, last and chosen.last, chosen.turn, field)
            before = begun
        return
    for step in chosen.apart(machine):
        outcomes: list[Any] = []
        for first in range(0, step.sites.size, level.at_once):  # no site sees another of its step
            if outcomes:
                yield Part(len(outcomes) == 1, outcomes[-1][0].size, False, chosen.turn, field)
            here = machine.put(step.sites[first : first + level.at_once])
            outcomes.append(
                (here, *relax_out_of_place(machine, here, field, level.evaluations, relaxation, chosen.turn))
            )
            machine.sync(level.work * here.size)
        for here, taken, cooled in outcomes:
            field = commit(machine, field, here, taken, cooled)
        done = outcomes[-1][0].size if outcomes else 0
        yield Part(len(outcomes) < 2, done, step.last, chosen.turn, field)


def with_snapshot(level: Level, field: Field) -> Field:
    """Return the field; if the schedule has blocks, with a copy below it that other blocks read during the sweep."""
    if not level.schedule.tile:
        return field
    return Field(*(snapshot(level.machine, plane, level.grid.rows) for plane in field))


def finished_picture(
    run: Lattices, grid: Grid, field: Field, known: NDArray[np.bool_] | None, seen: NDArray[np.int32], first: int = 0
) -> NDArray[Any]:
    """Return the picture in the sample's type, with the finish (`simdtex.methods.mrf.finish`) if the options have one.

    ``grid`` is the finest level or a window of it, ``field`` its sites, and ``known`` (H, W) its known sites; ``seen``
    (rows, cols) are the sources on the host, of all rows or of some rows from ``first`` on.
    """
    sample = run.sample
    if not run.options.finish:
        values = grid.latest(run.machine.get(field.values))[:, first : first + len(seen)]
        return sample.picture(values, seen)
    sd, rows = run.options.finish, max(1, AT_ONCE // grid.cols)
    picture = np.empty((*seen.shape, sample.shown), sample.pixels.dtype)
    fixed = run.machine.put((np.zeros(grid.shape, bool) if known is None else known).view(np.uint8))
    for top in range(0, len(seen), rows):
        here = seen[top : top + rows]
        by = finish(
            run.machine, field, fixed, grid, run.planes, sample, sd, range(first + top, first + top + len(here))
        )
        picture[top : top + rows] = sample.moved(here, by.reshape(-1, *here.shape))
    return picture
