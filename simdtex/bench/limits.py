# SPDX-License-Identifier: BSD-3-Clause
"""Limits of a device, measured: multiply-adds and bytes a second."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from simdtex.machine.opencl import OpenCL
from simdtex.ops.limits import CHAINS, WIDTHS, copy, peak

CACHES = 2**28
"""Bytes of each of the two arrays of a copy at most: far more than caches hold."""


def measure_peak(machine: OpenCL, seconds: float = 0.4, widths: Sequence[int] = WIDTHS) -> dict[str, Any]:
    """Measure multiply-adds a second in independent chains.

    Parameters
    ----------
    machine : OpenCL
    seconds : float
        Time to try each width, about.
    widths : sequence of int
        Vector widths, of `simdtex.ops.limits.WIDTHS`.

    Returns
    -------
    dict
        ``fma``, the highest rate; ``width``, at which; ``by_width``, the rate at each, by its text.
    """
    items = (2048 if machine.info.kind == "gpu" else 64) * max(1, machine.info.compute_units)  # several for each unit
    rates = {}
    for width in widths:
        values = machine.put(np.linspace(0, 1, items * width, dtype=np.float32))
        rounds = 64
        while _fastest(machine, partial(peak, machine, values, rounds, width), 0.0) < seconds / 20:
            rounds *= 2
        took = _fastest(machine, partial(peak, machine, values, rounds, width), seconds)
        rates[width] = CHAINS * float(rounds) * values.size / took
    return _best("fma", rates)


def measure_copy(machine: OpenCL, seconds: float = 0.4) -> dict[str, Any]:
    """Measure bytes read plus bytes written a second, of arrays that no cache holds; as `measure_peak`, ``bytes``."""
    size = min(CACHES, machine.info.memory // 16) // 4 // max(WIDTHS) * max(WIDTHS)
    values = machine.put(np.ones(size, np.float32))
    rates = {width: 8.0 * size / _fastest(machine, partial(copy, machine, values, width), seconds) for width in WIDTHS}
    return _best("bytes", rates)


def _best(what: str, rates: dict[int, float]) -> dict[str, Any]:
    width = max(rates, key=lambda width: rates[width])
    return {what: rates[width], "width": width, "by_width": {str(width): rate for width, rate in rates.items()}}


def _fastest(machine: OpenCL, call: Callable[[], Any], seconds: float) -> float:
    """Return seconds of the fastest of some calls after the first: three, or as many more as fit."""
    call()  # compiles
    machine.sync()
    began = perf_counter()
    times: list[float] = []
    while len(times) < 3 or perf_counter() - began < seconds:
        before = perf_counter()
        call()
        machine.sync()
        times.append(perf_counter() - before)
    return min(times)
