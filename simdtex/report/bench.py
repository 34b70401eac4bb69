# SPDX-License-Identifier: BSD-3-Clause
"""The results of a benchmark: tables for the terminal, a roofline and curves of growth as plots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from simdtex.io.atomic import atomic_path
from simdtex.report.plots import figure_png, new_figure, tidy
from simdtex.report.tables import Table, print_table, rate_text, seconds_text, three_digits

__all__ = ["plot", "render", "tables"]


def render(results: dict[str, Any]) -> None:
    """Print the results of `simdtex.bench.run.run`."""
    host = results["host"]
    print(
        f"{host['cpu']}, {host['cores']} cores; {host['system']}; simdtex {results['simdtex']}, numpy {host['numpy']}; "
        f"{results['date']}, sizes {results['sizes']}, {results['seconds']:.0f} s"
    )
    for entry in results["devices"]:
        device, peak, copied = entry["device"], entry["peak"], entry["copy"]
        print(f"\n{device['name']}, {device['units']} compute units, {device['version']}, driver {device['driver']}")
        print(
            f"measured: {rate_text(peak['fma'])} fma/s (vectors of {peak['width']}), copy {rate_text(copied['bytes'])} "
            f"bytes/s (vectors of {copied['width']})"
        )
        for table in tables(entry):
            print_table(table)


def tables(entry: dict[str, Any]) -> list[Table]:
    """Return three tables of a device: LCPDF steps, whole jobs and growth."""
    jobs = [case for case in entry["cases"] if case["job"]]
    steps = [
        {
            "job": case["name"],
            "phase": phase["phase"],
            "relaxations": f"{phase['relaxations']:,}",
            "time": seconds_text(phase["seconds"]),
            "fma/s": rate_text(phase["rate"]),
            "of peak": _percent(phase["of_peak"]),
            "by wall time": _percent(phase["effective"]),
            "vs reference": three_digits(phase["reference"], " x"),
        }
        for case in jobs
        for phase in case["phases"] or []
    ]
    whole = [
        {
            "job": case["name"],
            "time": seconds_text(case["seconds"]),
            "in kernels": _percent(case["busy"] / case["seconds"]),
            "fma/s done": rate_text(case["fma_rate"]),
            "of peak": _percent(case["of_peak"]),
            "bytes, of copy": _percent(case["of_copy"]),
            "effective, of peak": _percent(case["effective"]),
            "vs reference": three_digits(case["reference"], " x"),
        }
        for case in jobs
    ]
    growth = [
        {
            "method": curve["name"],
            "with": curve["what"],
            "from": f"{curve['sizes'][0]:,}: {seconds_text(curve['seconds'][0])}",
            "to": f"{curve['sizes'][-1]:,}: {seconds_text(curve['seconds'][-1])}",
            "exponent": "-" if curve["exponent"] is None else f"{curve['exponent']:.2f}",
        }
        for curve in entry["growth"]
    ]
    return [
        Table("LCPDF step at the finest level: fma of weighing every candidate, over time in kernels", steps),
        Table("Whole jobs", whole),
        Table("Growth of the time", growth),
    ]


def _percent(share: float | None) -> str:
    return "-" if share is None else three_digits(100 * share, " %")


def plot(results: dict[str, Any], folder: Path) -> list[Path]:
    """Write ``roofline.png`` and ``growth.png``, for each device, into a folder that is made; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, entry in enumerate(results["devices"]):
        suffix = f"-{number}" if len(results["devices"]) > 1 else ""
        for name, draw in (("roofline", roofline), ("growth", growth)):
            written.append(folder / f"{name}{suffix}.png")
            figure = draw(entry)
            figure.suptitle(entry["device"]["name"], fontsize="medium")
            with atomic_path(written[-1]) as whole:
                whole.write_bytes(figure_png(figure))
    return written


def roofline(entry: dict[str, Any]) -> Figure:
    """Plot fma a second against fma per byte: the measured limits, and each kernel where it worked longest."""
    figure = new_figure(8.0, 5.0)
    axes = figure.subplots()
    peak, copied = entry["peak"]["fma"], entry["copy"]["bytes"]
    longest: dict[tuple[str, str], dict[str, Any]] = {}
    for case in entry["cases"]:
        for kernel in case["kernels"]:
            key = case["method"], kernel["name"]
            if kernel["fma"] and kernel["bytes"] and kernel["seconds"] > longest.get(key, {"seconds": 0})["seconds"]:
                longest[key] = kernel
    shares = [kernel["fma"] / kernel["bytes"] for kernel in longest.values()]
    x = np.geomspace(min([peak / copied, *shares]) / 3, max([peak / copied, *shares]) * 3, 200)
    axes.loglog(
        x, np.minimum(peak, copied * x), color="black", label=f"{rate_text(peak)} fma/s, {rate_text(copied)} B/s"
    )
    for method, marker in zip(("mrf", "multires", "pyramid", "solid"), "osD^", strict=True):
        own = {name: kernel for (of, name), kernel in longest.items() if of == method}
        points = [(kernel["fma"] / kernel["bytes"], kernel["fma_rate"]) for kernel in own.values()]
        axes.plot(*np.reshape(points, (-1, 2)).T, marker, label=method)
        for name, point in zip(own, points, strict=True):
            axes.annotate(name, point, (4, -9), textcoords="offset points", fontsize=7)
    tidy(axes, "", "multiply-adds per byte that has to be moved", "multiply-adds a second")
    axes.legend(loc="lower right")
    return figure


def growth(entry: dict[str, Any]) -> Figure:
    """Plot seconds against size, a panel for each quantity that grows."""
    kinds = list(dict.fromkeys(curve["what"] for curve in entry["growth"]))
    figure = new_figure(5.0 * len(kinds), 5.0)
    for axes, what in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        for curve in entry["growth"]:
            if curve["what"] == what:
                axes.loglog(curve["sizes"], curve["seconds"], marker="o", label=curve["name"])
        tidy(axes, "", what, "seconds")
        axes.legend(fontsize="small")
    return figure
