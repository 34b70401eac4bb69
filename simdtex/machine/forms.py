# SPDX-License-Identifier: BSD-3-Clause
"""The forms that a device may be asked to do the inner loop in. None changes a bit of any result."""

from __future__ import annotations

from typing import NamedTuple

from simdtex.machine.devices import DeviceInfo


class Form(NamedTuple):
    """``vector`` sites or candidates side by side, ``step`` of them in registers, ``group`` work-items to a group."""

    vector: int
    step: int
    group: int


def default(info: DeviceInfo) -> Form:
    """The form of a device that nothing is known of."""
    return Form(1, 4, 64) if info.kind == "gpu" else Form(16, 4, 16)


def others(info: DeviceInfo) -> list[Form]:
    """Forms that may be faster, the likeliest first."""
    if info.kind == "gpu":
        return [Form(1, 8, 64), Form(1, 4, 128), Form(1, 2, 64), Form(4, 4, 64), Form(1, 4, 256)]
    return [Form(8, 4, 16), Form(16, 2, 16), Form(8, 8, 16), Form(4, 4, 16), Form(1, 8, 16)]
