# SPDX-License-Identifier: BSD-3-Clause
"""Tables of text for pages and terminals: numbers as text, a run's profile, a benchmark, and the versions in use."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from math import floor, log10
from typing import Any

import rich.table
from rich.console import Console
from rich.text import Text

from simdtex.machine.devices import DeviceError, find

_NUMBER = re.compile(r"[-+\u2212]?\d.*|[-\u2013]|n/a|inf")


@dataclass(frozen=True)
class Table:
    """A table of texts: rows from heading to cell; the first cell names the row. ``note`` stands below it on pages."""

    caption: str
    rows: Sequence[Mapping[str, str]]
    note: str = ""

    @property
    def header(self) -> list[str]:
        """The headings."""
        return list(self.rows[0]) if self.rows else []

    @property
    def numeric(self) -> list[bool]:
        """Whether each column holds numbers, which are aligned to the right; always False for the first column."""
        return [n > 0 and all(_NUMBER.fullmatch(row[name]) for row in self.rows) for n, name in enumerate(self.header)]


def settings_table(caption: str, settings: Mapping[str, Any]) -> Table:
    """Return a table with a row for each setting that is no array."""
    rows = [{"What": name, "Value": str(value)} for name, value in settings.items() if not hasattr(value, "shape")]
    return Table(caption, rows)


def warns(cell: str) -> bool:
    """Return whether a cell is a warning: it begins with ``breaks`` or ``differs``."""
    return cell.startswith(("breaks", "differs"))


def print_table(table: Table, width: int | None = None) -> None:
    """Print a table on lines of ``width`` characters; None: those of the terminal, or 200 without a terminal."""
    console = Console(width=width or (None if sys.stdout.isatty() else 200))
    shown = rich.table.Table(
        title=table.caption, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold"
    )
    for column, (name, numeric) in enumerate(zip(table.header, table.numeric, strict=True)):
        shown.add_column(name, justify="right" if numeric else "left", overflow="fold", no_wrap=not column)
    for row in table.rows:
        cells = map(Text, row.values())  # names may contain [brackets], which are no markup
        shown.add_row(*cells, style="yellow" if any(map(warns, row.values())) else None)
    console.print(shown)
    console.print()


def number_text(value: float | None, deviation: float | None = None, unit: str = "") -> str:
    """Return a number as text, ``"12.3 ± 0.4"``, with thousands separated by commas; None is ``"n/a"``.

    It has three significant digits or all digits before its point, and no decimals if it is whole and has no deviation;
    the deviation has as many decimals.
    """
    if value is None:
        return "n/a"
    magnitude = floor(log10(abs(value))) if value else 0
    decimals = 0 if value == int(value) and not deviation else 2 - min(2, max(-2, magnitude))
    spread = "" if deviation is None else f" ± {deviation:,.{decimals}f}"
    return f"{value:,.{decimals}f}{spread}{unit}"


def seconds_text(seconds: float) -> str:
    """Return a duration with three digits: ``"1.23 s"``, ``"45.6 ms"``, ``"789 us"``."""
    unit, length = next(((u, x) for u, x in ((" s", 1.0), (" ms", 1e-3)) if seconds >= x), (" us", 1e-6))
    return number_text(seconds / length, unit=unit)


def duration_text(seconds: float) -> str:
    """Return a duration for people: ``"0.3 s"``, ``"2.5 min"``, ``"9.6 h"``, ``"12.0 d"``."""
    units = {"d": 86400.0, "h": 3600.0, "min": 60.0}
    unit = next((unit for unit, length in units.items() if seconds >= 2 * length), "s")
    return f"{seconds / units.get(unit, 1.0):.1f} {unit}"


def print_profile(statistics: dict[str, Any]) -> None:
    """Print the kernels of a run, and its wall time, from its statistics: see `simdtex.run.Output`."""
    rows = [
        {
            "kernel": kernel["name"],
            "calls": f"{kernel['calls']:,}",
            "each": seconds_text(kernel["seconds"] / kernel["calls"]),
            "total": seconds_text(kernel["seconds"]),
            "share": f"{kernel['share']:.1%}",
        }
        for kernel in statistics["kernels"]
    ]
    print_table(Table(f"Kernels on {statistics['device']}", rows))
    wall, busy = statistics["seconds"], statistics["device_seconds"]
    print(f"wall time {seconds_text(wall)}: kernels {seconds_text(busy)} ({busy / wall:.1%})")


def print_accounting(accounting: dict[str, Any]) -> None:
    """Print the cost of a run on a processor array, ``accounting`` of `simdtex.run.Output.statistics`."""
    shifts = {name: f"{count:,}" for name, count in accounting["shifts"].items()}
    rows = {
        "steps: sites that relax together": f"{accounting['steps']:,}",
        "SIMD steps: passes over a virtual layer": f"{accounting['passes']:,}",
        "virtual layers": f"{accounting['layers']:,}",
        "active PEs per SIMD step, mean": f"{accounting['active']:,.0f}",
        "utilisation of the array": f"{accounting['utilisation']:.1%}",
        **{f"X-Net shifts for all neighbourhoods, {name}": count for name, count in shifts.items()},
        "words shifted by the X-Net, per PE": f"{accounting['moved']:,}",
        "words from the router, per PE": f"{accounting['routed']:,}",
        "floating-point operations": f"{accounting['flop']:.3g}",
        "launches on this device": f"{accounting['launches']:,}",
        "MasPar MP-1 of this size, by the model": duration_text(accounting["model_seconds"]),
    }
    caption = f"On an array of {accounting['array']} PEs ({accounting['mapping']})"
    print_table(Table(caption, [{"What": what, "How much": much} for what, much in rows.items()]))


def print_benchmark(results: dict[str, Any]) -> None:
    """Print the results of `simdtex.jobs.studies.benchmark.run`."""
    host = results["host"]
    print(
        f"{host['cpu']}, {host['cores']} cores; {host['system']}; simdtex {results['simdtex']}, numpy {host['numpy']}; "
        f"{results['date']}, {results['seconds']:.0f} s"
    )
    for entry in results["devices"]:
        print()
        print_table(benchmark_table(entry))


def benchmark_table(entry: dict[str, Any]) -> Table:
    """Return a table of the cases on a device."""
    device = entry["device"]
    rows = [
        {
            "job": case["name"],
            "time": seconds_text(case["seconds"]),
            "in kernels": f"{case['busy'] / case['seconds']:.0%}",
            "vs reference": number_text(case["reference"], unit=" x"),
        }
        for case in entry["cases"]
    ]
    units = f"{device['compute_units']} compute units"
    return Table(f"{device['name']}, {units}, {device['version']}, driver {device['driver']}", rows)


def version_lines() -> list[str]:
    """Return the versions of simdtex and of its libraries, and the default device or the reason why none works."""
    lines = [
        f"simdtex {version('simdtex')}",
        f"Python {platform.python_version()}, NumPy {version('numpy')}, pyopencl {version('pyopencl')}",
    ]
    try:
        device = find()
    except DeviceError as error:
        return [*lines, str(error)]
    driver = f", {device.version}, driver {device.driver}" if device.version else ""
    return [*lines, f"{device}{driver}"]
