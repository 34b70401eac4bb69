# SPDX-License-Identifier: BSD-3-Clause
"""The form in which a device does the inner loop fastest: measured once, and remembered. It changes no bit.

What is measured is the loop of equation (12) alone: a fused multiply-add for the difference, one for its square. The
choice goes into ``tuning.json`` in the user's cache folder, by device, driver and version of simdtex. SIMDTEX_CACHE
names another folder; SIMDTEX_TUNE=0 takes the defaults and leaves the folder alone.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl

from simdtex.machine.cache import FOLDER, SWITCH, folder, keep
from simdtex.machine.forms import Form, default, others
from simdtex.machine.opencl import OpenCL
from simdtex.machine.programs import compiled

__all__ = ["FILE", "FOLDER", "SWITCH", "Form", "choose", "default", "others", "probe", "tune"]

FILE = "tuning.json"
SCHEMA = 1
"""To be raised when the loop changes, so that old choices are not taken."""
BUDGET = 0.7
"""Seconds that measuring may take, compilation included; the default form is measured first."""
MARGIN = 1.1
"""How much faster than the default a form must be to take its place: timings are noisy."""

SOURCE = """
#pragma OPENCL FP_CONTRACT OFF
#include "common/vector.h"
__kernel __attribute__((vec_type_hint(vec))) void tune(__global const float *x, __global const float *y,
                                                       const int rounds, __global float *out)
{
    vec d[STEP];
    x += get_global_id(0) % 16; // each has its own, else a compiler would do one for all
    for (int q = 0; q < STEP; ++q)
        d[q] = 0.0f;
    for (int n = 0; n < rounds; ++n)
        for (int k = 0; k < 60; ++k) {
            const vec u = LOAD(x + k * V), xu = LOAD(x + (60 + k) * V);
#pragma unroll
            for (int q = 0; q < STEP; ++q) {
                const vec e = fma((vec)(-y[k + q + (n & 63)]), u, xu);
                d[q] = fma(e, e, d[q]);
            }
        }
    vec sum = 0.0f;
    for (int q = 0; q < STEP; ++q)
        sum += d[q];
    STORE(sum, out + get_global_id(0) * V);
}
"""


def probe(machine: OpenCL, form: Form) -> Callable[[], float]:
    """The loop in this form, compiled: a function that gives its fma per second, the best of three launches."""
    items = form.group * machine.info.compute_units * (16 if machine.info.kind == "gpu" else 4)
    options = ["-D", f"V={form.vector}", "-D", f"STEP={form.step}", *machine.include]
    kernel = cl.Kernel(compiled(machine.context, SOURCE, options), "tune")
    x, y = (machine.put(np.linspace(0, 1, n, dtype=np.float32)) for n in (120 * form.vector + 16, 128 + form.step))
    out = machine.empty((items * form.vector,), np.float32)

    def seconds(rounds: int) -> float:
        began = time.perf_counter()
        kernel(machine.queue, (items,), (form.group,), x.data, y.data, np.int32(rounds), out.data)
        machine.queue.finish()
        return time.perf_counter() - began

    seconds(1)
    rounds = 1
    while seconds(rounds) < 1e-3 and rounds < 2**20:
        rounds *= 4
    fma = 2.0 * 60 * rounds * items * form.vector * form.step
    return lambda: fma / min(seconds(rounds) for _ in range(3))


def choose(machine: OpenCL) -> Form:
    """The fastest form, as far as `BUDGET` allows to tell; each is timed beside the default."""
    began = time.perf_counter()
    form = default(machine.info)
    usual, best, longest = probe(machine, form), MARGIN, 0.0
    for other in others(machine.info):
        started = time.perf_counter()
        most = machine.info.handle.max_work_group_size if machine.info.handle else 1
        if started - began + longest > BUDGET or other.group > most:
            break
        rate = probe(machine, other)
        gain = rate() / usual()
        if gain > best:
            form, best = other, gain
        longest = max(longest, time.perf_counter() - started)
    return form


def tune(machine: OpenCL) -> None:
    """Give a machine the form that its device does best: the one remembered, or one measured now."""
    place = folder()
    if place is None:
        return
    info = machine.info
    key = " | ".join([str(SCHEMA), info.platform, info.name, info.version, info.driver, str(info.compute_units)])
    form = _recall(place / FILE, key)
    if form is None:
        form = choose(machine)
        keep(place / FILE, json.dumps(_read(place / FILE) | {key: form._asdict()}, indent=1).encode())
    machine.take(form)


def _read(path: Path) -> dict[str, Any]:
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):  # the last: brackets within brackets without end
        return {}
    return known if isinstance(known, dict) else {}


def _recall(path: Path, key: str) -> Form | None:
    """The remembered form; None where there is none, or none that can be."""
    try:
        form = Form(**_read(path).get(key, {}))
        legal = form.vector in (1, 4, 8, 16) and form.step in (1, 2, 4, 8, 16) and form.group in (16, 64, 128, 256)
    except TypeError:
        return None
    return form if legal else None
