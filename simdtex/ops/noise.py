# SPDX-License-Identifier: BSD-3-Clause
"""White noise, what the pyramid method begins with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation, touching


def _reference(planes: int, n: int, seed: int, level: int) -> NDArray[np.int32]:
    draws = [random.draw4(seed, level, turn, np.arange(n), random.NOISE) for turn in range(-(-planes // 4))]
    return np.concatenate(draws)[:planes].view(np.int32)


def _launch(machine: Launcher, planes: int, n: int, seed: int, level: int) -> Array:
    values = machine.empty((planes, n), np.int32)
    machine.launch(
        machine.kernel("noise", "noise"),
        (-(-n // 8), -(-planes // 4)),
        *(np.uint64(seed), np.int32(level), np.int32(planes), np.int32(n), values),
        work=touching(values),
    )
    return values


noise = Operation("noise", _reference, _launch)
"""``noise(machine, planes, n, seed, level)``: (planes, n) int32, all 32 bits uniform.

Plane p has word p % 4 of the draws of turn p // 4 at sites 0 .. n-1.
"""
