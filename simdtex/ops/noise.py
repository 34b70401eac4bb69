# SPDX-License-Identifier: BSD-3-Clause
"""White noise, from which the pyramid method starts."""

from __future__ import annotations

import numpy as np

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation


@Operation
def noise(machine: Launcher | None, planes: int, n: int, seed: int, level: int) -> Array:
    """Return white noise (planes, n) int32, uniform over all 32 bits.

    Plane p has word p % 4 of the draws of turn p // 4 at sites 0 .. n-1.
    """
    if machine is None:
        draws = [random.draw4(seed, level, turn, np.arange(n), random.NOISE) for turn in range(-(-planes // 4))]
        return np.concatenate(draws)[:planes].view(np.int32)
    values = machine.empty((planes, n), np.int32)
    machine.launch("noise", (n, -(-planes // 4)), np.uint64(seed), level, planes, n, values)
    return values
