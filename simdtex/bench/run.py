# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of devices, all in one run, since machines are noisy and only ratios say much."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from time import perf_counter
from typing import Any

import numpy as np
import scipy

import simdtex
from simdtex.bench.cases import measure, once
from simdtex.bench.elsewhere import measure_elsewhere
from simdtex.bench.limits import measure_copy, measure_peak
from simdtex.bench.results import FORMAT
from simdtex.bench.sizes import Sizes, with_searches
from simdtex.machine.devices import DeviceError, DeviceInfo, devices, find
from simdtex.machine.opencl import OpenCL


def chosen(device: str | None = None) -> list[DeviceInfo]:
    """The devices to measure: the one of a text, or all that are usable but for simulators.

    Raises
    ------
    simdtex.machine.devices.DeviceError
        There is none, or it is the reference.
    """
    if device is not None:
        info = find(device)
        if info.kind == "reference":
            raise DeviceError(
                "the reference is measured beside every device; give an OpenCL device, or none for all of them"
            )
        return [info]
    found = [info for info in devices() if info.usable and info.kind != "reference" and not info.simulated]
    return found or [find(None)]


def threads_beside(info: DeviceInfo) -> int:
    """Threads of library code that a device is compared with: its compute units, or all cores beside a GPU."""
    return max(1, info.compute_units if info.kind == "cpu" else os.cpu_count() or 1)


def cpu_model() -> str:
    """What the CPU of this machine calls itself."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def host() -> dict[str, Any]:
    """What the machine is, and the libraries that devices are compared with."""
    blas: Any = np.show_config(mode="dicts") or {}
    library = blas.get("Build Dependencies", {}).get("blas", {})
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count() or 0,
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "blas": f"{library.get('name', 'unknown')} {library.get('version', '')}".strip(),
    }


def run(sizes: Sizes, infos: Sequence[DeviceInfo], tell: Callable[[str], None] = lambda what: None) -> dict[str, Any]:
    """Measure devices, and the hosts beside them.

    Parameters
    ----------
    sizes : Sizes
        Which jobs.
    infos : sequence of DeviceInfo
        From `chosen`.
    tell : callable
        Is told in words what is being measured.

    Returns
    -------
    dict
        ``format``, ``simdtex`` (version), ``sizes`` (name), ``date``, ``seconds``, ``host``; ``devices``, for each a
        dict with ``device`` (what it calls itself), ``peak`` and ``copy`` (see `simdtex.bench.limits`), ``cases`` (see
        `simdtex.bench.cases.measure`; with ``peak``, measured just before and just after a job), ``jobs`` (names of
        cases) and ``growth`` (what grows -> cases); and ``hosts``, dicts with ``machine`` (``"reference"`` or
        ``"library"``), ``threads`` and ``cases``.

    Raises
    ------
    ChildProcessError
        A process of the hosts failed.
    """
    began = perf_counter()
    date = datetime.now(UTC).isoformat(timespec="seconds")
    found = [_device(sizes, info, tell) for info in infos]
    tell("the NumPy reference")
    plain = [case for case in with_searches(sizes.reference) if case.search in ("", "exact")]
    hosts = [{"machine": "reference", "threads": 1, "cases": measure_elsewhere("reference", 1, plain)}]
    library = [case for case in with_searches(sizes.library) if case.search in ("", "exact")]
    for threads in sorted({threads_beside(info) for info in infos}):
        tell(f"library code, {threads} threads")
        cases = measure_elsewhere("library", threads, library)
        hosts.append({"machine": "library", "threads": threads, "cases": cases})
    return {
        "format": FORMAT,
        "simdtex": simdtex.__version__,
        "sizes": sizes.name,
        "date": date,
        "seconds": perf_counter() - began,
        "host": host(),
        "devices": found,
        "hosts": hosts,
    }


def _device(sizes: Sizes, info: DeviceInfo, tell: Callable[[str], None]) -> dict[str, Any]:
    machine = OpenCL(info, profile=True)
    tell(f"{machine.name}: limits")
    peak, copied = measure_peak(machine, sizes.seconds), measure_copy(machine, sizes.seconds)
    machine.profile()  # forget these
    for case in sizes.tiny:  # programs are built
        once(machine, case)
    cases, jobs = [], with_searches([*sizes.jobs, *sizes.reference])
    for case in sizes.cases:
        tell(f"{machine.name}: {case.name}")
        near = [measure_peak(machine, sizes.seconds / 2, [peak["width"]])] if case in jobs else []
        cases.append(measure(machine, case, sizes.repeats, sizes.budget))
        near += [measure_peak(machine, sizes.seconds / 2, [peak["width"]]) for _ in near]
        cases[-1]["peak"] = max((one["fma"] for one in near), default=None)
    after = measure_peak(machine, sizes.seconds)
    machine.profile()
    return {
        "device": {
            "name": machine.name,
            "kind": info.kind,
            "version": info.version,
            "driver": info.driver,
            "units": info.compute_units,
            "threads": threads_beside(info),
            "memory": info.memory,
        },
        "peak": max(peak, after, key=lambda one: float(one["fma"])),
        "copy": copied,
        "cases": cases,
        "jobs": [case.name for case in jobs],
        "growth": {name: [case.as_dict() for case in with_searches(own)] for name, own in sizes.growth.items()},
    }
