# SPDX-License-Identifier: BSD-3-Clause
"""What the public functions put around a method: the machine, the axes of pictures, the profile, the checkpoint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.checkpoints.keeper import CURRENT, Around
from simdtex.machine import Machine, open_machine
from simdtex.options import real_array, whole
from simdtex.random import as_seed
from simdtex.run import Callback, Output


class Begun(NamedTuple):
    """A job that is begun: its ``seed``, and the ``keeper`` of the checkpoint around it, None where there is none."""

    seed: int
    keeper: Around | None

    def on(self, device: str) -> Keep:
        """Where the run on a device of this name keeps its state."""
        return self.keeper.on(device) if self.keeper else NOTHING

    def end(self) -> None:
        """The run is over, and what is left cannot be stopped between two states."""
        if self.keeper:
            self.keeper.running = False


def begin(job: str, rng: Any, inputs: Callable[[], dict[str, Any]]) -> Begun:
    """Begin a job, once all it is given is checked; within `simdtex.checkpoint` it may be that of the folder.

    Parameters
    ----------
    job : str
        The public function.
    rng : None, int or numpy.random.Generator
        As of `simdtex.random.as_seed`.
    inputs : callable
        What else determines the result, by name.
    """
    keeper = CURRENT.get()
    if keeper is None:
        return Begun(as_seed(rng), None)
    return Begun(keeper.begin(job, None if rng is None else as_seed(rng), as_seed, inputs()), keeper)


def executed(
    device: str | Machine | None,
    channel_axis: int | None,
    callback: Callback | None,
    full_output: bool,
    method: Callable[[Machine, Callback | None, Keep], tuple[NDArray[Any], Output]],
    begun: Begun,
) -> NDArray[Any] | tuple[NDArray[Any], Output]:
    """Run ``method(machine, callback, keep)`` on a device, and give its pictures and stages the sample's own axes."""
    machine = open_machine(device)
    machine.profile()  # forget what was before
    image, output = method(machine, seeing(callback, channel_axis), begun.on(machine.name))
    begun.end()
    output.statistics.update(machine.profile() or {})
    picture = restored(image, channel_axis)
    if not full_output:
        return picture
    stages = [replace(stage, image=restored(stage.image, channel_axis)) for stage in output.stages]
    return picture, replace(output, stages=stages, made=image)


def seeing(callback: Callback | None, channel_axis: int | None) -> Callback | None:
    """The callback, which sees pictures with the sample's own axes."""
    if callback is None:
        return None

    def seen(progress: Any) -> Any:
        read: Callable[[], NDArray[Any]] = progress.image
        return callback(replace(progress, image=lambda: restored(read(), channel_axis)))

    return seen


def with_channels_last(options: dict[str, Any], channel_axis: int | None) -> dict[str, Any]:
    """The options, where a picture to start from has its channels last."""
    start = options.get("start")
    if start is None or channel_axis is None or real_array("start", start).ndim < 3:
        return options
    return options | {"start": np.moveaxis(np.asarray(start), channel_axis, -1)}


def restored(image: NDArray[Any], channel_axis: int | None) -> NDArray[Any]:
    """A picture (rows, cols, channels) with the axes that the sample has."""
    return image[..., 0] if channel_axis is None else np.moveaxis(image, -1, channel_axis)


def check_shape(shape: Any, least: int = 1) -> tuple[int, int]:
    """The rows and columns of an output; raises unless they are two integers of at least `least`."""
    try:
        rows, cols = shape
    except (TypeError, ValueError):
        raise ValueError(f"shape must be two integers (rows, columns), not {shape!r}") from None
    whole("rows of the output", rows, least, inf)  # one sentence says what they are together
    whole("columns of the output", cols, least, inf)
    return int(rows), int(cols)
