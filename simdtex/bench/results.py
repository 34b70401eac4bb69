# SPDX-License-Identifier: BSD-3-Clause
"""What a benchmark found, as it is written to JSON, and what is worked out of it: ratios, rates, exponents."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from simdtex.bench.cases import Case, case_of
from simdtex.model.lattice import neighbourhood_offsets

FORMAT = "simdtex bench 1"

ENTRIES = ("simdtex", "sizes", "date", "seconds", "host", "devices", "hosts")
"""What the results hold beside ``format``, see `simdtex.bench.run.run`."""


def load(path: str | Path) -> dict[str, Any]:
    """Results from a file that ``simdtex bench --json`` wrote.

    Raises
    ------
    ValueError
        It is no such file.
    """
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError):
        found = None
    if not isinstance(found, dict) or found.get("format") != FORMAT or not set(ENTRIES) <= set(found):
        raise ValueError(f"{path} holds no results of simdtex bench; give a file that --json wrote")
    return found


def ratio(one: float | None, other: float | None) -> float | None:
    """One number over another; None where either is unknown or the other is 0."""
    return None if one is None or not other else one / other


def elsewhere(results: dict[str, Any], machine: str, name: str, threads: int | None = None) -> dict[str, Any] | None:
    """What the reference, or library code with so many threads, took for a case; None where it did not do it."""
    for host in results["hosts"]:
        if host["machine"] == machine and threads in (None, host["threads"]):
            for case in host["cases"]:
                if case["name"] == name:
                    return dict(case)
    return None


def in_library(name: str, case: dict[str, Any]) -> str:
    """The name of a case as the library does it: whatever the search, it looks at every candidate."""
    search = case["search"]
    return name if search in ("", "exact") else name.replace(search, "exact", 1)


def _against(results: dict[str, Any], entry: dict[str, Any], case: dict[str, Any]) -> list[tuple[str, Any]]:
    """The same case on the hosts: ``"reference"`` and ``"library"``, each with what was found or None."""
    name = in_library(case["name"], case)
    return [
        ("reference", elsewhere(results, "reference", name)),
        ("library", elsewhere(results, "library", name, entry["device"]["threads"])),
    ]


def _shown(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """The cases of a device that are jobs, in the order in which they were asked for."""
    by_name = {case["name"]: case for case in entry["cases"]}
    return [by_name[name] for name in entry["jobs"]]


def stated(kernels: list[dict[str, Any]] | None, what: str) -> float | None:
    """``"fma"`` or ``"bytes"`` a second of kernels that state them, over the time of all kernels.

    None where those that do not state them took half of the time or more: then the rate would say little.
    """
    own = [kernel for kernel in kernels or [] if kernel[what] is not None]
    total = sum(kernel["seconds"] for kernel in kernels or [])
    if 2 * sum(kernel["seconds"] for kernel in own) <= total:
        return None
    return ratio(sum(kernel[what] for kernel in own), total)


def jobs(results: dict[str, Any], entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Whole jobs on one device, one of ``results["devices"]``.

    Returns
    -------
    list of dict
        ``case``, its name; ``seconds``; ``busy``, the share of them in kernels; ``fma_rate``, multiply-adds a second in
        kernels, see `stated`; ``of_peak``, that over the device's peak as measured next to the job; ``of_copy``, bytes
        a second over those of a copy; ``effective``, the multiply-adds of weighing every candidate over the wall time
        over the peak; ``reference`` and ``library``, how many times longer these took. None is what is not known.
    """
    copied, found = entry["copy"]["bytes"], []
    for case in _shown(entry):
        peak = case["peak"]
        rate = ratio(case["fma"], case["busy"]) if case["fma"] else stated(case["kernels"], "fma")
        moved = stated(case["kernels"], "bytes")
        row = {
            "case": case["name"],
            "seconds": case["seconds"],
            "busy": ratio(case["busy"], case["seconds"]),
            "fma_rate": rate,
            "of_peak": ratio(rate, peak),
            "of_copy": ratio(moved, copied),
            "effective": ratio(ratio(case["brute_force"], case["seconds"]), peak),
        }
        against = _against(results, entry, case)
        found.append(row | {name: other and ratio(other["seconds"], case["seconds"]) for name, other in against})
    return found


def steps(results: dict[str, Any], entry: dict[str, Any]) -> list[dict[str, Any]]:
    """The LCPDF step, weights and draw included, in every phase of the finest level of every job of ``mrf``.

    Returns
    -------
    list of dict
        ``case`` and ``phase``; ``relaxations``; ``seconds``; ``rate``, the multiply-adds of weighing every candidate
        over the time in kernels; ``of_peak``, that over the peak; ``effective``, the same over the wall time;
        ``reference`` and ``library``, how many times longer they took for a relaxation in this phase.
    """
    found = []
    for case in _shown(entry):
        peak = case["peak"]
        for phase, own in (case["phases"] or {}).items():
            rate = ratio(own["brute_force"], own["busy"])
            row = {
                "case": case["name"],
                "phase": phase,
                "relaxations": own["relaxations"],
                "seconds": own["seconds"],
                "rate": rate,
                "of_peak": ratio(rate, peak),
                "effective": ratio(ratio(own["brute_force"], own["seconds"]), peak),
            }
            each = ratio(own["seconds"], own["relaxations"])
            for name, other in _against(results, entry, case):
                there = other and other["phases"][phase]
                row[name] = there and ratio(ratio(there["seconds"], there["relaxations"]), each)
            found.append(row)
    return found


def growing(case: Case, what: str) -> float:
    """How large a case is by what grows: ``"output pixels"``, ``"voxels"``, ``"sample pixels"`` or ``"neighbours"``."""
    return float(
        {
            "output pixels": case.output**2,
            "voxels": case.output**3,
            "sample pixels": case.sample**2,
            "neighbours": len(neighbourhood_offsets(max(1, case.order))),
        }[what]
    )


def exponent(sizes: list[float], seconds: list[float]) -> float | None:
    """The power of the size that the time grows with: the slope of a line through the logarithms; None of one point."""
    if len(set(sizes)) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def growth(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """The curves of one device: ``name``, ``what``, ``sizes``, ``seconds`` and the ``exponent`` fitted to them."""
    taken = {case["name"]: case["seconds"] for case in entry["cases"]}
    curves = []
    for name, cases in entry["growth"].items():
        method, _, what = name.partition(": ")
        for search in dict.fromkeys(case["search"] for case in cases):
            own = [case for case in cases if case["search"] == search]
            sizes = [growing(case_of(case), what) for case in own]
            seconds = [taken[case["name"]] for case in own]
            curve = {"name": f"{method} {search}".strip(), "what": what, "sizes": sizes, "seconds": seconds}
            curves.append(curve | {"exponent": exponent(sizes, seconds)})
    return curves


def points(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Kernels on a roofline: ``name``, ``method``, ``intensity`` in fma per byte, ``rate`` in fma a second.

    Those that state both, each from the case of its method in which it worked longest.
    """
    best: dict[tuple[str, str], dict[str, Any]] = {}
    for case in entry["cases"]:
        for kernel in case["kernels"] or []:
            key = case["method"], kernel["name"]
            if kernel["fma"] and kernel["bytes"] and kernel["seconds"] > best.get(key, {"seconds": 0})["seconds"]:
                best[key] = kernel
    return [
        {"name": name, "method": method, "intensity": own["fma"] / own["bytes"], "rate": own["fma_rate"]}
        for (method, name), own in best.items()
    ]


def compared(before: dict[str, Any], after: dict[str, Any]) -> list[dict[str, Any]]:
    """The cases that two results share, device by device.

    Returns
    -------
    list of dict
        ``device``, ``case``, ``before`` and ``after`` in seconds; ``times``, how many times faster it is now; and
        ``by_peak``, the same with each time in units of the peak measured in its own run, since machines vary.
    """
    found = []
    known = {entry["device"]["name"]: entry for entry in before["devices"]}
    for entry in after["devices"]:
        name = entry["device"]["name"]
        old = {case["name"]: case["seconds"] for case in known[name]["cases"]} if name in known else {}
        for case in entry["cases"]:
            if case["name"] not in old:
                continue
            was, now = old[case["name"]], case["seconds"]
            peaks = known[name]["peak"]["fma"] / entry["peak"]["fma"]
            times = {"times": was / now, "by_peak": was / now * peaks}
            found.append({"device": name, "case": case["name"], "before": was, "after": now} | times)
    return found
