# SPDX-License-Identifier: BSD-3-Clause
"""What a device can do at most: multiply-adds in independent chains, and a copy. Benchmarks time them."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation, touching
from simdtex.ops.arithmetic import fma32

CHAINS = 10
"""Chains of each value in `peak`."""

WIDTHS = (1, 4, 8, 16)
"""Values side by side in a work-item that may be asked for; the number of values is a multiple of it."""


@Operation
def peak(machine: Launcher | None, values: Array, rounds: int, width: int) -> Array:
    """Return for each value the sum of `CHAINS` chains, (n,) float32.

    A chain begins at the value plus its number and becomes a / 2 + 0.1, by fma, ``rounds`` times. Cost: `CHAINS` rounds
    fma a value. ``width`` values are side by side in a work-item; it changes no bit, and divides n.
    """
    if machine is None:
        total = np.zeros_like(values)
        for i in range(CHAINS):
            chain = values + np.float32(i)
            for _ in range(rounds):
                chain = fma32(chain, np.float32(0.5), np.float32(0.1))
            total += chain
        return total
    result, items = machine.empty(values.shape, np.float32), values.size // width
    machine.launch(
        machine.kernel("limits", "limits_peak", V=width, CHAINS=CHAINS),
        (items,),
        *(values, np.int32(items), np.int32(rounds), result),
        work=touching(values, result, fma=float(CHAINS) * rounds * values.size),
    )
    return result


@Operation
def copy(machine: Launcher | None, values: Array, width: int) -> Array:
    """Return the values (n,) float32. Cost: 8 bytes a value."""
    if machine is None:
        return values.copy()
    result, items = machine.empty(values.shape, np.float32), values.size // width
    machine.launch(
        machine.kernel("limits", "limits_copy", V=width, CHAINS=CHAINS),
        (items,),
        *(values, np.int32(items), result),
        work=touching(values, result),
    )
    return result
