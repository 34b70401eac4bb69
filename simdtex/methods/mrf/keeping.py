# SPDX-License-Identifier: BSD-3-Clause
"""A run of Algorithm 1 between two sweeps, as plain arrays and numbers, and back."""

from __future__ import annotations

from typing import Any

from simdtex.checkpoints.tree import like
from simdtex.methods.mrf.level import Run, State
from simdtex.methods.mrf.observers import Observer
from simdtex.schedules import Setting


def kept(run: Run, state: State, observer: Observer) -> dict[str, Any]:
    """What a run needs to go on from this state with these observations."""
    return {"state": state.off(run.machine)._asdict(), "observer": observer.kept()}


def restored(run: Run, observer: Observer, found: dict[str, Any]) -> State:
    """The state that `kept` gave, on the machine of the run; the observer knows what it had seen."""
    state = State(**found["state"])
    number = state.level
    setting = Setting(run.machine, run.grid(number), run.offsets, run.options.order, run.seed, number)
    named = like(run.schedule.init(setting), state.schedule)  # what a schedule keeps has types that it knows itself
    observer.restore(found["observer"], number)
    return state._replace(schedule=named).on(run.machine)
