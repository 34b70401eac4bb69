# SPDX-License-Identifier: BSD-3-Clause
"""What a device can do at most: multiply-adds in independent chains, and a copy. Benchmarks time them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation, touching
from simdtex.ops.arithmetic import fma32

CHAINS = 10
"""Chains of each value in `peak`."""

WIDTHS = (1, 4, 8, 16)
"""Values side by side in a work-item that may be asked for; the number of values is a multiple of it."""


def _peak(values: NDArray[np.float32], rounds: int, width: int) -> NDArray[np.float32]:
    total = np.zeros_like(values)
    for i in range(CHAINS):
        chain = values + np.float32(i)
        for _ in range(rounds):
            chain = fma32(chain, np.float32(0.5), np.float32(0.1))
        total += chain
    return total


def _launch_peak(machine: Launcher, values: Array, rounds: int, width: int) -> Array:
    result, items = machine.empty(values.shape, np.float32), values.size // width
    machine.launch(
        machine.kernel("limits", "limits_peak", V=width, CHAINS=CHAINS),
        (items,),
        *(values, np.int32(items), np.int32(rounds), result),
        work=touching(values, result, fma=float(CHAINS) * rounds * values.size),
    )
    return result


def _copy(values: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    return values.copy()


def _launch_copy(machine: Launcher, values: Array, width: int) -> Array:
    result, items = machine.empty(values.shape, np.float32), values.size // width
    machine.launch(
        machine.kernel("limits", "limits_copy", V=width, CHAINS=CHAINS),
        (items,),
        *(values, np.int32(items), result),
        work=touching(values, result),
    )
    return result


peak = Operation("limits", _peak, _launch_peak)
"""``peak(machine, values, rounds, width)``: (n,) float32, for each value the sum of `CHAINS` chains.

A chain begins at the value plus its number and becomes a / 2 + 0.1, by fma, `rounds` times. Cost: `CHAINS` rounds fma a
value. ``width`` values are side by side in a work-item; it changes no bit, and divides n.
"""

copy = Operation("limits", _copy, _launch_copy)
"""``copy(machine, values, width)``: the values (n,) float32. Cost: 8 bytes a value."""
