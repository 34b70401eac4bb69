# SPDX-License-Identifier: BSD-3-Clause
"""What a device can do at most, as measured: multiply-adds and bytes a second."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from simdtex.machine.opencl import OpenCL
from simdtex.ops.limits import CHAINS, WIDTHS, copy, peak

CACHES = 2**28
"""Bytes of each of the two arrays of a copy, at most: far more than caches hold."""


def measure_peak(machine: OpenCL, seconds: float = 0.4, widths: Sequence[int] = WIDTHS) -> dict[str, Any]:
    """Multiply-adds a second in independent chains, for every vector width or some.

    Parameters
    ----------
    machine : OpenCL
    seconds : float
        How long about each width is tried.
    widths : sequence of int
        Of `simdtex.ops.limits.WIDTHS`.

    Returns
    -------
    dict
        ``fma``, the most a second; ``width``, at which; ``by_width``, the most at each, by its text.
    """
    items = _items(machine)
    rates = {}
    for width in widths:
        values = machine.put(np.linspace(0, 1, items * width, dtype=np.float32))
        rounds = 64
        peak(machine, values, rounds, width)  # compiled
        machine.sync()
        while _fastest(machine, lambda: peak(machine, values, rounds, width), 0.0) < seconds / 20:  # noqa: B023
            rounds *= 2
        took = _fastest(machine, lambda: peak(machine, values, rounds, width), seconds)  # noqa: B023
        rates[width] = CHAINS * float(rounds) * values.size / took
    best = max(rates, key=lambda width: rates[width])
    return {"fma": rates[best], "width": best, "by_width": {str(width): rate for width, rate in rates.items()}}


def measure_copy(machine: OpenCL, seconds: float = 0.4) -> dict[str, Any]:
    """Bytes read plus bytes written a second, of arrays that no cache holds; as `measure_peak`, ``bytes`` the most."""
    size = min(CACHES, machine.info.memory // 16) // 4 // max(WIDTHS) * max(WIDTHS)
    values = machine.put(np.ones(size, np.float32))
    rates = {}
    for width in WIDTHS:
        copy(machine, values, width)
        took = _fastest(machine, lambda: copy(machine, values, width), seconds)  # noqa: B023
        rates[width] = 8.0 * size / took
    best = max(rates, key=lambda width: rates[width])
    return {"bytes": rates[best], "width": best, "by_width": {str(width): rate for width, rate in rates.items()}}


def _items(machine: OpenCL) -> int:
    """Work-items that fill the device several times over."""
    return (2048 if machine.info.kind == "gpu" else 64) * max(1, machine.info.compute_units)


def _fastest(machine: OpenCL, call: Callable[[], Any], seconds: float) -> float:
    """Seconds of the fastest of some calls: three, or as many more as fit."""
    machine.sync()
    began, best, count = perf_counter(), float("inf"), 0
    while count < 3 or perf_counter() - began < seconds:
        before = perf_counter()
        call()
        machine.sync()
        best, count = min(best, perf_counter() - before), count + 1
    return best
