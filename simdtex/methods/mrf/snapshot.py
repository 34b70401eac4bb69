# SPDX-License-Identifier: BSD-3-Clause
"""A picture with an older copy below it, which independently relaxing tiles read of one another."""

from __future__ import annotations

from math import prod

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation

TYPES = {"uint8": "uchar", "uint16": "ushort", "int32": "int"}


@Operation
def snapshot(machine: Launcher | None, picture: Array, height: int) -> Array:
    """Return a picture (..., height, W), or an earlier stack, as a stack (..., 2 height, W) with a copy below."""
    if machine is None:
        now = picture[..., :height, :]
        return np.ascontiguousarray(np.concatenate([now, now], -2))  # rows may have any memory layout
    *planes, rows, width = picture.shape
    plane, count = height * width, prod(planes)
    stacked = picture if rows == 2 * height else machine.empty((*planes, 2 * height, width), picture.dtype)
    kind = {"T": TYPES[picture.dtype.name]}
    machine.launch("snapshot", (plane * count,), picture, plane, count, rows * width, stacked, defines=kind)
    return stacked
