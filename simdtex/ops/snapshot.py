# SPDX-License-Identifier: BSD-3-Clause
"""A picture and an older copy of it below: what tiles that relax on their own see of one another."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation

TYPES = {"uint8": "uchar", "uint16": "ushort", "int32": "int"}


def _reference(picture: NDArray[Any], height: int) -> NDArray[Any]:
    now = picture[..., :height, :]
    return np.ascontiguousarray(np.concatenate([now, now], -2))  # rows may have been laid out in any way


def _launch(machine: Launcher, picture: Array, height: int) -> Array:
    *planes, rows, width = picture.shape
    plane, count = height * width, prod(planes)
    stacked = picture if rows == 2 * height else machine.empty((*planes, 2 * height, width), picture.dtype)
    machine.launch(
        machine.kernel("snapshot", "snapshot", T=TYPES[picture.dtype.name]),
        (plane * count,),
        *(picture, np.int32(plane), np.int32(count), np.int32(rows * width), stacked),
    )
    return stacked


snapshot = Operation("snapshot", _reference, _launch)
"""``snapshot(machine, picture, height)``: (..., height, W), or a stack made before, to (..., 2 height, W)."""
