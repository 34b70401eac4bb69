# SPDX-License-Identifier: BSD-3-Clause
"""The one loop that runs every method, and the common part of all public functions around it.

A `Plan` is validated input. On a machine it is a `Run`, which `drive` begins, steps and ends. Everything that must
survive between two steps is in the state, a tree of plain arrays and numbers. A `simdtex.run.Observer` only watches it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import fields, replace
from functools import partial
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import Checkpoint, Checkpointing, begin_run
from simdtex.machine import Machine, open_machine
from simdtex.model.light import Light
from simdtex.run import Callback, Observer, Output, Progress

Seed = int | np.random.Generator | None
"""The seed of a public function."""

Device: TypeAlias = "str | Machine | None"
"""The device of a public function: a name, or an open machine."""

Kept = str | os.PathLike[str] | Checkpoint | Checkpointing | None
"""Where a public function keeps the state of its run."""

Tree = Any
"""Plain arrays and numbers, in dicts, lists and tuples."""


class Run(Protocol):
    """A plan on a machine."""

    def begin(self) -> Any:
        """Return the state before the first step."""

    def step(self, state: Any, watch: Callable[..., None]) -> tuple[Any, Any]:
        """Return the state after the next step, and a description of the step; ``watch`` gets parts of a long step."""

    def ended(self, state: Any) -> bool:
        """Return whether the run has ended: there is no further step."""

    def result(self, state: Any, observer: Any) -> tuple[NDArray[Any], Output]:
        """Return the picture, channels last, and the rest of the output."""

    def save(self, state: Any) -> Tree:
        """Return a copy of the state that needs no machine."""

    def load(self, saved: Tree) -> Any:
        """Return the state that `save` copied, on this machine."""

    def observer(self, callback: Callback | None) -> Observer:
        """Return the observer of this run."""


class Plan(Protocol):
    """Validated input of a run, as plain data."""

    def on(self, machine: Machine, seed: int) -> Run:
        """Return the run of the plan on a machine; ``seed`` is the key of every random number."""


def drive(
    plan: Plan,
    machine: Machine,
    seed: int,
    callback: Callback | None = None,
    checkpointing: Checkpointing | None = None,
    others: Sequence[Callable[[Any], Observer]] = (),
) -> tuple[NDArray[Any], Output]:
    """Run a plan to its end; return the picture, channels last, and the `simdtex.run.Output`.

    Parameters
    ----------
    plan, machine, seed
        The plan, its machine and its seed.
    callback : callable, optional
        Called with a `simdtex.run.Progress` after every part of a step.
    checkpointing : Checkpointing, optional
        The state to continue from, and the function that receives every later state.
    others : sequence of callables
        Each makes a further observer of the run, whose statistics the output has too.
    """
    began, worked = time.perf_counter(), machine.seconds
    run = plan.on(machine, seed)
    observers = [run.observer(callback), *(make(run) for make in others)]
    checkpointing = checkpointing or Checkpointing()
    if checkpointing.found is None:
        state = run.begin()
    else:
        state = run.load(checkpointing.found["state"])
        for observer, saved in zip(observers, checkpointing.found["observers"], strict=True):
            observer.load(saved)
    while not run.ended(state):
        state, info = run.step(state, observers[0].part)
        for observer in observers:
            observer.step(state, info)
        checkpointing.offer(info, partial(_saved, run, state, observers))
    image, output = run.result(state, observers[0])
    for observer in observers:
        output.statistics.update(observer.statistics())
    output.statistics.update(
        device=machine.name,
        seed=seed,
        seconds=time.perf_counter() - began,
        device_seconds=None if worked is None else (machine.seconds or 0.0) - worked,
    )
    return image, output


def _saved(run: Run, state: Any, observers: Sequence[Observer]) -> Tree:
    return {"state": run.save(state), "observers": [observer.save() for observer in observers]}


class Call(Protocol):
    """The checked input of a public function: a frozen dataclass, whose fields identify a run in a checkpoint.

    Fields declared with ``compare=False`` do not.
    """

    @property
    def options(self) -> Any:
        """The options of the method."""

    @property
    def channel_axis(self) -> int | None:
        """The axis of the picture that holds channels; None if it has none."""

    @property
    def light(self) -> Light:
        """What was done to the light of the pictures; it puts the light of the place back into the output."""

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Return the picture, channels last, and the rest of the output; one run of `drive`, or several in turn."""


class SingleRun:
    """A base of jobs that are the plan of their only run, and take pictures in any light as they are."""

    light = Light()

    def make(
        self: Plan, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Run the plan, and return its result."""
        return drive(self, machine, seed, callback, checkpointing)


def run(
    name: str, job: Call, rng: Seed, device: Device, callback: Callback | None, checkpoint: Kept
) -> tuple[NDArray[Any], Output]:
    """Run the call of a public function of this name; return the picture with its axes, and the output."""
    machine = open_machine(device)
    machine.profile()  # forget what was before
    axis, light = job.channel_axis, job.light
    if callback:  # which may change the arrays of the call; a schedule may tell its owner what it saw
        job = deepcopy(job, {id(job.options): job.options})

    def seen(progress: Progress) -> Any:
        assert callback
        return callback(replace(progress, image=lambda: restored(light(progress.image(), progress.level), axis)))

    with begin_run(checkpoint, name, rng, partial(identities, job), machine.name) as (seed, checkpointing):
        image, output = job.make(machine, seed, callback and seen, checkpointing)
    output.statistics.update(machine.profile() or {})
    if light.about:
        output.statistics["light"] = light.about
    made = light(image)
    stages = [replace(stage, image=restored(light(stage.image, stage.level), axis)) for stage in output.stages]
    return restored(made, axis), replace(output, stages=stages, made=made)


def identities(job: Any) -> dict[str, Any]:
    """Return the fields of a job that identify its run."""
    return {field.name: getattr(job, field.name) for field in fields(job) if field.compare}


def restored(image: NDArray[Any], channel_axis: int | None) -> NDArray[Any]:
    """Return a picture (rows, cols, channels) with the axes of the sample."""
    return image[..., 0] if channel_axis is None else np.moveaxis(image, -1, channel_axis)
