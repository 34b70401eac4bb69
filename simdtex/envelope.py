# SPDX-License-Identifier: BSD-3-Clause
"""What the public functions put around a method: the machine, the axes of pictures, the profile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine, open_machine
from simdtex.options import real_array, whole
from simdtex.run import Callback, Output


def executed(
    device: str | Machine | None,
    channel_axis: int | None,
    callback: Callback | None,
    full_output: bool,
    method: Callable[[Machine, Callback | None], tuple[NDArray[Any], Output]],
) -> NDArray[Any] | tuple[NDArray[Any], Output]:
    """Run ``method(machine, callback)`` on a device, and give its pictures and stages the sample's own axes."""
    machine = open_machine(device)
    machine.profile()  # forget what was before
    image, output = method(machine, seeing(callback, channel_axis))
    output.statistics.update(machine.profile() or {})
    image = restored(image, channel_axis)
    if not full_output:
        return image
    stages = [replace(stage, image=restored(stage.image, channel_axis)) for stage in output.stages]
    return image, replace(output, stages=stages)


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
    whole("columns of the output", cols, least, inf)  # one sentence says what they are together
    return int(rows), int(cols)
