# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of devices, all in one run: machines are noisy, and only ratios are meaningful."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

import simdtex
from simdtex.machine import Machine
from simdtex.machine.devices import DeviceError, DeviceInfo, devices, find
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference

REPEATS = 3
"""The most timed runs of a case."""


class Case(NamedTuple):
    """A synthesis from gravel, a grey picture of scikit-image.

    ``method`` is ``"solid"`` or a method of `simdtex.synthesize`; ``sample`` and ``output`` are sides in pixels, of a
    solid in voxels; ``order`` and ``search`` are those of ``mrf``.
    """

    method: str
    sample: int
    output: int
    order: int = 0
    search: str = ""

    @property
    def name(self) -> str:
        """A unique name."""
        order = f" {self.search}, order {self.order}" if self.order else ""
        return f"{self.method}{order}, {self.sample} -> {self.output}{'^3' if self.method == 'solid' else ''}"


class Sizes(NamedTuple):
    """The cases of a benchmark: those for devices only, and those also for the NumPy reference.

    ``budget`` are the seconds after which no further run of a case starts.
    """

    devices: tuple[Case, ...]
    reference: tuple[Case, ...]
    budget: float


def _searches(sample: int, output: int, *orders: int) -> tuple[Case, ...]:
    return tuple(Case("mrf", sample, output, n, search) for n in orders for search in ("exact", "coherent"))


QUICK = Sizes(
    (*_searches(64, 64, 8, 18), Case("multires", 64, 128), Case("pyramid", 64, 128), Case("solid", 64, 32)),
    (Case("mrf", 32, 32, 8, "exact"), Case("multires", 32, 64), Case("pyramid", 64, 64), Case("solid", 32, 16)),
    0.5,
)
FULL = Sizes(
    (*_searches(128, 256, 8, 18, 32), Case("multires", 256, 1024), Case("pyramid", 256, 1024), Case("solid", 128, 64)),
    (
        *(Case("mrf", 32, 32, 8, "exact"), Case("mrf", 32, 32, 18, "exact"), Case("multires", 64, 128)),
        *(Case("pyramid", 128, 256), Case("solid", 64, 32)),
    ),
    2.0,
)


def chosen(device: str | None = None) -> list[DeviceInfo]:
    """Return the devices to measure: the one named by ``device``, or all usable ones except simulators.

    Raises
    ------
    simdtex.machine.devices.DeviceError
        There is none, or it is the reference.
    """
    if device is not None:
        info = find(device)
        if info.kind == "reference":
            raise DeviceError("the reference is measured with every device; give an OpenCL device, or none for all")
        return [info]
    usable = [info for info in devices() if info.usable and info.kind != "reference" and not info.simulated]
    return usable or [find(None)]


def run(sizes: Sizes, infos: Sequence[DeviceInfo], tell: Callable[[str], None] = lambda what: None) -> dict[str, Any]:
    """Return measurements of the reference and of devices.

    Parameters
    ----------
    sizes : Sizes
        `QUICK` or `FULL`.
    infos : sequence of DeviceInfo
        From `chosen`.
    tell : callable
        Called with a description of each measurement.

    Returns
    -------
    dict
        ``simdtex`` (version), ``date``, ``seconds``, ``host``, and ``devices``, a dict for each with ``device``, its
        description, and ``cases``: dicts with ``name``; ``seconds`` of the fastest run; ``busy``, seconds of that run
        in kernels; and ``reference``, the factor by which the reference took longer, None if it did not run the case.
    """
    began, date = perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    plain = {}
    for case in sizes.reference:
        tell(f"the NumPy reference: {case.name}")
        plain[case], _ = once(Reference(), case)
    measured = []
    for info in infos:
        machine = OpenCL(info, profile=True)
        cases = []
        for case in (*sizes.devices, *sizes.reference):
            tell(f"{machine.name}: {case.name}")
            seconds, busy = fastest(machine, case, sizes.budget)
            ratio = plain[case] / seconds if case in plain else None
            cases.append({"name": case.name, "seconds": seconds, "busy": busy, "reference": ratio})
        about = {name: getattr(info, name) for name in ("kind", "version", "driver", "compute_units", "memory")}
        measured.append({"device": about | {"name": machine.name}, "cases": cases})
    return {
        "simdtex": simdtex.__version__,
        "date": date,
        "seconds": perf_counter() - began,
        "host": {
            "cpu": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "devices": measured,
    }


def fastest(machine: Machine, case: Case, budget: float) -> tuple[float, float]:
    """Return the seconds of the fastest of a few runs of a case, after one that compiles, and those in kernels."""
    once(machine, case)
    began = perf_counter()
    runs: list[tuple[float, float]] = []
    while not runs or (len(runs) < REPEATS and perf_counter() - began < budget):
        runs.append(once(machine, case))
    return min(runs)


def once(machine: Machine, case: Case) -> tuple[float, float]:
    """Run a case, and return its seconds and its seconds in kernels."""
    from skimage import data

    gravel: Any = data.gravel
    sample = np.ascontiguousarray(gravel()[: case.sample, : case.sample])
    options: dict[str, Any] = {"rng": 1, "device": machine, "full_output": True}
    began = perf_counter()
    if case.method == "solid":
        _, output = simdtex.synthesize_solid(sample, (case.output,) * 3, **options)
    else:
        options |= {"method": case.method, **({"order": case.order, "search": case.search} if case.order else {})}
        _, output = simdtex.synthesize(sample, (case.output, case.output), **options)
    return perf_counter() - began, output.statistics["device_seconds"] or 0.0
