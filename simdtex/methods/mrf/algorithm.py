# SPDX-License-Identifier: BSD-3-Clause
"""Nonparametric multiscale Markov random field: Algorithm 1 of Paget and Longstaff (1998).

`anneal` is the algorithm, `sweep` the body of its loop, and the numbers in the comments are the algorithm's own. A step
of 6.2.2 is said first and executed at once (`simdtex.ops.relax`): the sites of a step know nothing of one another, so a
device relaxes them in one launch. Whatever watches a run stands outside (observers.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.methods.mrf.level import Level, Run, State, Warm, parts
from simdtex.model.lattice import Grid
from simdtex.model.sample import BLOCK
from simdtex.ops import active
from simdtex.ops.commit import commit
from simdtex.ops.neighbourhood import Field
from simdtex.ops.relax import Relaxation, relax, relax_apart
from simdtex.ops.snapshot import snapshot
from simdtex.ops.start import start
from simdtex.ops.use import price, use


class Info(NamedTuple):
    """What a sweep did.

    ``level`` and ``number``, the sweep within it, from 1; ``phase`` ``"relax"`` while temperatures are above 0, then
    ``"free"``; ``chosen`` what the schedule decided; ``ended`` whether the level ends with it.
    """

    level: int
    number: int
    phase: str
    chosen: list[schedules.Info]
    ended: bool


class Part(NamedTuple):
    """A part of a sweep: told several times a second.

    ``steps`` that have begun with it; ``sites`` that it has relaxed; ``last`` whether the sweep ends with it; ``field``
    the arrays over sites.
    """

    steps: int
    sites: int
    last: bool
    field: Field


Watch = Callable[[Level, State, bool, Part], Any]
"""Called after every part of a sweep, with the state before the sweep and whether it is a free one."""


def anneal(run: Run, state: State | None = None, watch: Watch | None = None) -> Iterator[tuple[Level, State, Info]]:
    """Algorithm 1, sweep by sweep.

    Parameters
    ----------
    run : Run
        Its ``levels`` are M of step 1.
    state : State, optional
        What another run of the same kind has come to, to go on from there.
    watch : callable, optional
        Called within sweeps.

    Yields
    ------
    level, state, info
        After every sweep. The next one uses up the state's arrays.
    """
    state = begin(run) if state is None else state  # 2, 5
    for number in reversed(range(state.level + 1)):  # 6
        level = run.level(number)  # 3, 4, 6.1
        if state.schedule is None or state.level != number:
            state = enter(level, state)
        while state.warm:  # 6.2
            state, info = sweep(level, state, watch=watch)
            yield level, state, info._replace(ended=not (state.warm or run.options.free_sweeps))
        while state.free < run.options.free_sweeps:
            state, info = sweep(level, state, free=True, watch=watch)
            yield level, state, info._replace(ended=state.free == run.options.free_sweeps)


def begin(run: Run) -> State:
    """The state before the first level: every site a pixel of the sample at random (2), at temperature 1 (5).

    Those whose values are given have these, at temperature 0.
    """
    everywhere = run.machine.put(run.sample.positions(np.zeros((1, 2), np.int32), 1))
    field = run.holding.begun(start(run.machine, run.planes, everywhere, Grid(*run.shape), run.seed))
    return State(*field, price=None, schedule=None, level=run.levels - 1)


def enter(level: Level, state: State) -> State:
    """The state at the beginning of a level: sites kept from the level above have t = 0, all others t = 1.

    Data between the sites stand for the nearest ones from now on, and no longer for those of the level above.
    """
    field = level.holding.entered(level.number, level.setting.grid, state.field)
    return opened(level, field)


def opened(level: Level, field: Field) -> State:
    """The state of a level whose sites are as they are before its first sweep."""
    warm, heat = active.survey(level.machine, level.grid, field.temperature)
    price = priced(level, field, None)
    return State(*field, price, level.schedule.init(level.setting), level.number, warm=warm, heat=heat)


def sweep(level: Level, state: State, *, free: bool = False, watch: Watch | None = None) -> tuple[State, Info]:
    """Steps 6.2.1 and 6.2.2 until about as many sites have been relaxed as were active: a sweep of the schedule.

    Parameters
    ----------
    level : Level
    state : State
        Its arrays are used up.
    free : bool
        Whether all sites are active, instead of those that are warmer than 0.
    watch : callable, optional
        Called after every part of the sweep.

    Returns
    -------
    state : State
    info : Info
    """
    field, memory, chosen = swept(level, state, free=free, watch=watch)
    hot, heat = active.survey(level.machine, level.grid, field.temperature)
    cooling, freed = state.cooling + (not free), state.free + free
    info = Info(level.number, cooling + freed, "free" if free else "relax", chosen, False)
    price = priced(level, field, state.price)
    return State(*field, price, memory, level.number, cooling, freed, hot, heat), info


def swept(
    level: Level, state: State, *, free: bool = False, watch: Watch | None = None
) -> tuple[Field, Any, list[schedules.Info]]:
    """The steps of a sweep: the sites after it, the schedule's state, and what the schedule chose."""
    field, memory = exchanged(level, state.field), state.schedule
    relaxation = rule(level, state.price)
    chosen: list[schedules.Info] = []
    while not (chosen and chosen[-1].last):
        warm = Warm(level, field.temperature, free)
        memory, now = level.schedule.step(level.setting, memory, warm)  # 6.2.1
        for part in relaxed(level, field, now, relaxation):  # 6.2.2
            field = part.field
            if watch:
                watch(level, state, free, part)
        chosen.append(now)
    return field, memory, chosen


def priced(level: Level, field: Field, before: NDArray[np.float32] | None) -> NDArray[np.float32]:
    """What each candidate costs during the next sweep, from how often it is used now: the same for all sites of it."""
    return price(counted(level, field, level.grid), level.market, level.rate, before)


def counted(level: Level, field: Field, grid: Grid) -> NDArray[np.int32]:
    """How often each candidate is used, (n,), where that says what it costs; 0 otherwise."""
    candidates = level.proposal.candidates
    if not (level.rate or level.market.kinds is not None):
        return np.zeros(candidates.size, np.int32)
    found: NDArray[np.int32] = use(level.machine, field, grid, candidates)
    return found


def rule(level: Level, price: NDArray[np.float32] | None) -> Relaxation:
    """How a site of the level relaxes: what happens to all sites of a step in parallel."""
    assert price is not None  # the level has begun
    return Relaxation(
        grid=level.grid,
        offsets=level.offsets,
        proposal=level.proposal,  # 6.2.2.1 the LCPDF, equations (6) and (12), of these candidates
        favour=level.favour,
        novelty=level.novelty,
        beside=level.beside,
        price=level.machine.put(np.pad(price, (0, -price.size % BLOCK))),
        choice=level.choice,  # 6.2.2.2 a draw from it, or its mode
        xi=level.xi,  # 6.2.2.3 the temperature, equation (13)
        seed=level.setting.seed,
        level=level.number,
    )


def relaxed(level: Level, field: Field, chosen: schedules.Info, relaxation: Relaxation) -> Iterator[Part]:
    """Step 6.2.2 for the sites of one step after another, in parts that do not take long."""
    machine = level.machine
    if level.in_place:
        sites, before = chosen.sites, 0
        sites = machine.put(sites) if isinstance(sites, np.ndarray) else sites
        for ranges, begun, last in parts(chosen.ranges, level.at_once):
            field = relax(machine, sites, ranges, field, level.weighed, relaxation, chosen.turn)
            done = int((ranges[:, 1] - ranges[:, 0]).sum())
            machine.sync(level.work * done)
            yield Part(begun - before, done, last and chosen.last, field)
            before = begun
        return
    for step in chosen.apart(machine):
        outcomes: list[Any] = []
        for first in range(0, step.sites.size, level.at_once):  # no site sees another of its step
            if outcomes:
                yield Part(len(outcomes) == 1, outcomes[-1][0].size, False, field)
            here = machine.put(step.sites[first : first + level.at_once])
            outcomes.append((here, *relax_apart(machine, here, field, level.weighed, relaxation, chosen.turn)))
            machine.sync(level.work * here.size)
        for here, taken, cooled in outcomes:
            field = commit(machine, field, here, taken, cooled)
        yield Part(len(outcomes) < 2, outcomes[-1][0].size if outcomes else 0, step.last, field)


def exchanged(level: Level, field: Field) -> Field:
    """The field with an older copy below it, which other tiles see until the sweep ends, where there are tiles."""
    if not level.schedule.tile:
        return field
    return Field(*(snapshot(level.machine, plane, level.grid.height) for plane in field))


def picture(run: Run, grid: Grid, field: Field) -> NDArray[Any]:
    """Read the picture of a level back, in the sample's type."""
    values, source = run.machine.get(field.values), run.machine.get(field.source)
    found = run.sample.picture(grid.view(values), grid.view(source))
    return run.given.shown(found, grid) if run.given else found


def warmth(run: Run, grid: Grid, field: Field) -> NDArray[np.float64]:
    """Read the temperatures of a level back, 0 to 1."""
    found: NDArray[np.float64] = np.ascontiguousarray(grid.view(run.machine.get(field.temperature))) / np.float64(1024)
    return found


def origin(run: Run, grid: Grid, field: Field) -> NDArray[np.int32]:
    """Read back where in the sample each site of a level is from, (rows, cols, 2 or 3)."""
    return run.sample.place(grid.view(run.machine.get(field.source)))


__all__ = [
    *("Info", "Part", "Watch", "anneal", "begin", "counted", "enter", "opened", "origin", "picture", "priced", "sweep"),
    *("swept", "warmth"),
]
