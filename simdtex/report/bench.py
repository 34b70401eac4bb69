# SPDX-License-Identifier: BSD-3-Clause
"""The results of a benchmark: tables on the terminal, a roofline and curves of growth as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from simdtex.bench import results as worked_out
from simdtex.io.atomic import atomic_path
from simdtex.report.tables import rate_text, seconds_text, three_digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DASH = "-"


def percent(share: float | None) -> str:
    """A share as text, ``"85 %"``."""
    return DASH if share is None else three_digits(100 * share, " %")


def times(ratio: float | None) -> str:
    """A ratio as text, ``"8.1 x"``."""
    return DASH if ratio is None else three_digits(ratio, " x")


def render(results: dict[str, Any], console: Console) -> None:
    """Print all tables of a benchmark."""
    host = results["host"]
    console.print(
        f"{host['cpu']}, {host['cores']} cores; {host['system']}; simdtex {results['simdtex']}, "
        f"numpy {host['numpy']} with {host['blas']}, scipy {host['scipy']}; "
        f"{results['date']}, sizes {results['sizes']}, {results['seconds']:.0f} s",
        highlight=False,
    )
    for entry in results["devices"]:
        device, peak, copied = entry["device"], entry["peak"], entry["copy"]
        console.print(
            f"\n{device['name']}, {device['units']} compute units, {device['version']}, driver {device['driver']}",
            highlight=False,
        )
        console.print(
            f"measured: {rate_text(peak['fma'])} fma/s (vectors of {peak['width']}), copy {rate_text(copied['bytes'])} "
            f"bytes/s (vectors of {copied['width']}), {device['threads']} threads for library code",
            highlight=False,
        )
        console.print(_steps(worked_out.steps(results, entry)))
        console.print(_jobs(worked_out.jobs(results, entry)))
        console.print(_growth(worked_out.growth(entry)))


def _table(title: str, left: int, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number < left else "right", no_wrap=True)
    return table


def _steps(rows: list[dict[str, Any]]) -> Table:
    columns = ("job", "phase", "relaxations", "time", "fma/s", "of peak", "by wall time", "vs reference", "vs library")
    table = _table("LCPDF step at the finest level: fma of weighing every candidate, over time in kernels", 2, *columns)
    for row in rows:
        table.add_row(
            row["case"],
            row["phase"],
            f"{row['relaxations']:,}",
            seconds_text(row["seconds"]),
            rate_text(row["rate"]),
            percent(row["of_peak"]),
            percent(row["effective"]),
            times(row["reference"]),
            times(row["library"]),
        )
    return table


def _jobs(rows: list[dict[str, Any]]) -> Table:
    columns = (
        *("job", "time", "in kernels", "fma/s done", "of peak", "bytes, of copy"),
        *("effective, of peak", "vs reference", "vs library"),
    )
    table = _table("Whole jobs", 1, *columns)
    for row in rows:
        table.add_row(
            row["case"],
            seconds_text(row["seconds"]),
            percent(row["busy"]),
            rate_text(row["fma_rate"]),
            percent(row["of_peak"]),
            percent(row["of_copy"]),
            percent(row["effective"]),
            times(row["reference"]),
            times(row["library"]),
        )
    return table


def _growth(curves: list[dict[str, Any]]) -> Table:
    table = _table("Growth of the time", 2, "method", "with", "from", "to", "exponent")
    for curve in curves:
        fitted = DASH if curve["exponent"] is None else f"{curve['exponent']:.2f}"
        ends = [f"{curve['sizes'][i]:,.0f}: {seconds_text(curve['seconds'][i])}" for i in (0, -1)]
        table.add_row(curve["name"], curve["what"], *ends, fitted)
    return table


# -- pictures -------------------------------------------------------------------------------------------------


def plot(results: dict[str, Any], folder: Path) -> list[Path]:
    """Draw ``roofline.png`` and ``growth.png``, for a device each, into a folder that is made; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, entry in enumerate(results["devices"]):
        suffix = f"-{number}" if len(results["devices"]) > 1 else ""
        for name, draw in (("roofline", _roofline), ("growth", _curves)):
            written.append(folder / f"{name}{suffix}.png")
            draw(entry, written[-1])
    return written


def _figure(entry: dict[str, Any], path: Path, panels: int) -> tuple[Any, list[Axes]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0 * panels if panels > 1 else 8.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(entry["device"]["name"], fontsize="medium")
    found = figure.subplots(1, panels, squeeze=False)[0]
    return figure, list(found)


def _write(figure: Any, path: Path) -> None:
    from simdtex.report.plots import figure_png

    figure.set_dpi(120)
    with atomic_path(path) as whole:
        whole.write_bytes(figure_png(figure))


def _roofline(entry: dict[str, Any], path: Path) -> None:
    """Fma a second against fma per byte, log-log: the device's roofs as measured, kernels as points."""
    figure, (axes,) = _figure(entry, path, 1)
    peak, copied = entry["peak"]["fma"], entry["copy"]["bytes"]
    points = worked_out.points(entry)
    ridge = peak / copied
    intensities = [point["intensity"] for point in points] + [ridge]
    x = np.geomspace(min(intensities) / 3, max(intensities) * 3, 200)
    axes.loglog(x, np.minimum(peak, copied * x), color="black")
    axes.annotate(f"peak, {rate_text(peak)} fma/s", (x[-1], peak), (-4, 4), textcoords="offset points", ha="right")
    axes.annotate(
        f"copy, {rate_text(copied)} bytes/s", (x[60], copied * x[60]), (6, -14), textcoords="offset points", ha="left"
    )
    for number, method in enumerate(dict.fromkeys(point["method"] for point in points)):
        own = [point for point in points if point["method"] == method]
        axes.plot(
            [point["intensity"] for point in own],
            [point["rate"] for point in own],
            linestyle="none",
            marker="osD^"[number % 4],
            label=method,
        )
        for point in own:
            axes.annotate(
                point["name"], (point["intensity"], point["rate"]), (4, -9), textcoords="offset points", fontsize=7
            )
    axes.set_xlabel("multiply-adds per byte that has to be moved")
    axes.set_ylabel("multiply-adds a second")
    axes.grid(True, which="major", alpha=0.3)
    if points:
        axes.legend(loc="lower right")
    _write(figure, path)


def _curves(entry: dict[str, Any], path: Path) -> None:
    """Seconds against size, log-log, a panel for each thing that grows."""
    curves = worked_out.growth(entry)
    kinds: dict[str, list[dict[str, Any]]] = {}
    for curve in curves:
        kinds.setdefault(curve["what"].replace("voxels", "output pixels"), []).append(curve)
    figure, panels = _figure(entry, path, max(1, len(kinds)))
    for axes, (what, own) in zip(panels, kinds.items(), strict=False):
        for curve in own:
            fitted = "" if curve["exponent"] is None else f", exponent {curve['exponent']:.2f}"
            axes.loglog(curve["sizes"], curve["seconds"], marker="o", label=f"{curve['name']}{fitted}")
        axes.set_xlabel(what if what != "output pixels" else "output pixels (solid: voxels)")
        axes.set_ylabel("seconds")
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(fontsize="small")
    _write(figure, path)
