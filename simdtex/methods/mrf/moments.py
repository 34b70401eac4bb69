# SPDX-License-Identifier: BSD-3-Clause
"""The moment of a run at which a site relaxes: its field just before the step of that site."""

from __future__ import annotations

from simdtex.methods.mrf.algorithm import Run, exchanged, relaxed
from simdtex.methods.mrf.explain import Moment, pixel_of
from simdtex.methods.mrf.level import Active, Info, State, rule
from simdtex.ops.neighbourhood import Field


def moment_of(run: Run, level: int, sweep: int | None, site: tuple[int, ...]) -> Moment:
    """Return the moment of a sweep of a level at which a site relaxes; None: of the last sweep in which it does.

    Raises ValueError if the run has no such level or site, or the site does not relax there.
    """
    if not 0 <= level < run.levels:
        raise ValueError(f"level is {level} and the levels of this run are 0 to {run.levels - 1}; give one of these")
    pixel, found, state = pixel_of(run, level, site), None, run.begin()
    while not (state.level == level and run.at_equilibrium(state)):
        before = run.save(state) if state.level == level else None
        state, info = run.step(state)
        if before and info.sweep == (sweep or info.sweep) and _relaxes(run, info, pixel):
            found = before
        if before and info.sweep == sweep:
            break
    if found is None:
        where = f"level {level}" + (f", sweep {sweep}" if sweep else "")
        raise ValueError(
            f"site {site} does not relax at {where}: it keeps its value; give another site, sweep or level"
        )
    return _before(run, run.load(found), pixel)


def _relaxes(run: Run, info: Info, pixel: int) -> bool:
    """Return whether a site has relaxed in a sweep."""
    return any((step.sites == pixel).any() for chosen in info.chosen for step in chosen.apart(run.machine))


def _before(run: Run, state: State, pixel: int) -> Moment:
    """Return the last moment of a sweep at which a site relaxes; it does, and the state's arrays are used up."""
    level, machine, found, last = run.level(state.level), run.machine, None, False
    field, memory, relaxation = exchanged(level, state.field), state.schedule, rule(level, state.penalty)
    number, free = state.cooling + state.free + 1, not state.active
    while not last:
        memory, now = level.schedule.step(level.setting, memory, Active(level, field.temperature, free))
        for step in now.apart(machine):
            if (step.sites == pixel).any():
                found = Moment(level.number, number, Field(*map(machine.get, field)), state.penalty, now.turn)
            for part in relaxed(level, field, step, relaxation):
                field = part.field
        last = now.last
    assert found
    return found
