# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of devices, all in one run: machines are noisy, and only ratios are meaningful."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from time import perf_counter
from typing import Any

import numpy as np

import simdtex
from simdtex.bench.cases import Case, Sizes, measure, once
from simdtex.bench.limits import measure_copy, measure_peak
from simdtex.machine.devices import DeviceError, DeviceInfo, devices, find
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference

FORMAT = "simdtex bench 2"


def chosen(device: str | None = None) -> list[DeviceInfo]:
    """Return the devices to measure: the one of a text, or all usable ones except simulators.

    Raises
    ------
    simdtex.machine.devices.DeviceError
        There is none, or it is the reference.
    """
    if device is not None:
        info = find(device)
        if info.kind == "reference":
            raise DeviceError(
                "the reference is measured with every device; give an OpenCL device, or none for all of them"
            )
        return [info]
    found = [info for info in devices() if info.usable and info.kind != "reference" and not info.simulated]
    return found or [find(None)]


def run(sizes: Sizes, infos: Sequence[DeviceInfo], tell: Callable[[str], None] = lambda what: None) -> dict[str, Any]:
    """Measure the reference and devices.

    Parameters
    ----------
    sizes : Sizes
        The jobs.
    infos : sequence of DeviceInfo
        From `chosen`.
    tell : callable
        Called with a description of each measurement.

    Returns
    -------
    dict
        ``format``, ``simdtex`` (version), ``sizes`` (name), ``date``, ``seconds``, ``host``, and ``devices``, a dict
        for each with

        - ``device``, its description; ``peak`` and ``copy``, see `simdtex.bench.limits`;
        - ``cases``, see `simdtex.bench.cases.measure`, each with ``job`` (whether it is reported by itself) and the
          ratios of `ratios`;
        - ``growth``, curves: ``name``, ``what``, ``sizes``, ``seconds`` and the fitted ``exponent``.
    """
    began, date = perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    plain = {}
    for case in sizes.reference:
        tell(f"the NumPy reference: {case.name}")
        plain[case.name] = measure(Reference(), case)
    found = [_device(sizes, info, plain, tell) for info in infos]
    return {
        "format": FORMAT,
        "simdtex": simdtex.__version__,
        "sizes": sizes.name,
        "date": date,
        "seconds": perf_counter() - began,
        "host": {
            "cpu": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "devices": found,
    }


def _device(
    sizes: Sizes, info: DeviceInfo, plain: dict[str, dict[str, Any]], tell: Callable[[str], None]
) -> dict[str, Any]:
    machine = OpenCL(info, profile=True)
    tell(f"{machine.name}: limits")
    peak, copied = measure_peak(machine, sizes.seconds), measure_copy(machine, sizes.seconds)
    for method, order, search in dict.fromkeys((case.method, case.order, case.search) for case in sizes.cases):
        once(machine, Case(method, 16, 8 if method == "solid" else 16, order, search))  # builds the programs
    machine.profile()  # forget the kernels so far
    cases = {}
    for case in sizes.cases:
        tell(f"{machine.name}: {case.name}")
        near = measure_peak(machine, sizes.seconds / 2, [peak["width"]])  # close in time to the case
        result = measure(machine, case, sizes.repeats, sizes.budget)
        cases[case.name] = ratios(result, near["fma"], copied["bytes"], plain.get(case.name))
        cases[case.name]["job"] = case in sizes.jobs
    return {
        "device": {
            "name": machine.name,
            "kind": info.kind,
            "version": info.version,
            "driver": info.driver,
            "units": info.compute_units,
            "memory": info.memory,
        },
        "peak": peak,
        "copy": copied,
        "cases": list(cases.values()),
        "growth": [_curve(what, row, cases) for what, rows in sizes.growth.items() for row in rows],
    }


def ratios(case: dict[str, Any], peak: float, copied: float, plain: dict[str, Any] | None) -> dict[str, Any]:
    """Return a measured case with ratios.

    Parameters
    ----------
    case, plain : dict
        From `simdtex.bench.cases.measure`; `plain` of the reference, None if it did not run the case.
    peak, copied : float
        Limits of the device: multiply-adds and bytes a second.

    Returns
    -------
    dict
        The case with ``peak``; ``fma_rate``, multiply-adds a second in kernels, and ``of_peak``, over the peak;
        ``of_copy``, bytes a second over those of a copy; ``effective``, the multiply-adds of weighing every candidate
        over the wall time over the peak; ``reference``, how many times longer the reference took. Each of its phases
        with ``rate``, the multiply-adds of weighing every candidate over the time in kernels, ``of_peak``,
        ``effective`` and ``reference``, the latter for a relaxation. None is unknown; a rate is unknown if the kernels
        that state their work take less than half of the time.
    """
    rate = _ratio(case["fma"], case["busy"]) if case["fma"] else _stated(case["kernels"], "fma")
    phases = []
    for number, phase in enumerate(case["phases"] or []):
        own = _ratio(phase["brute_force"], phase["busy"])
        other = plain["phases"][number] if plain else None
        each = _ratio(phase["seconds"], phase["relaxations"])
        phases.append(
            phase
            | {
                "rate": own,
                "of_peak": _ratio(own, peak),
                "effective": _ratio(_ratio(phase["brute_force"], phase["seconds"]), peak),
                "reference": other and _ratio(_ratio(other["seconds"], other["relaxations"]), each),
            }
        )
    return case | {
        "peak": peak,
        "fma_rate": rate,
        "of_peak": _ratio(rate, peak),
        "of_copy": _ratio(_stated(case["kernels"], "bytes"), copied),
        "effective": _ratio(_ratio(case["brute_force"], case["seconds"]), peak),
        "reference": plain and _ratio(plain["seconds"], case["seconds"]),
        "phases": phases or None,
    }


def _ratio(one: float | None, other: float | None) -> float | None:
    return None if one is None or not other else one / other


def _stated(kernels: list[dict[str, Any]] | None, what: str) -> float | None:
    """Return ``"fma"`` or ``"bytes"`` a second over the time of all kernels, None if most of it is of others."""
    own = [kernel for kernel in kernels or [] if kernel[what] is not None]
    total = sum(kernel["seconds"] for kernel in kernels or [])
    if 2 * sum(kernel["seconds"] for kernel in own) <= total:
        return None
    return _ratio(sum(kernel[what] for kernel in own), total)


def _curve(what: str, row: Sequence[Case], cases: dict[str, dict[str, Any]]) -> dict[str, Any]:
    sizes, seconds = [case.size[what] for case in row], [cases[case.name]["seconds"] for case in row]
    name = f"{row[0].method} {row[0].search}".strip()
    return {"name": name, "what": what, "sizes": sizes, "seconds": seconds, "exponent": exponent(sizes, seconds)}


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float | None:
    """Return the power of the size that the time grows with, by least squares on logarithms; None for one size."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0]) if len(set(sizes)) > 1 else None
