# SPDX-License-Identifier: BSD-3-Clause
"""The profile of a run as a table on the terminal: every kernel, and what was left to the host."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

COLUMNS = ("kernel", "calls", "min", "median", "max", "total", "share", "fma/s", "bytes/s")


def seconds_text(seconds: float) -> str:
    """A duration in a unit that leaves three digits: ``"1.23 s"``, ``"45.6 ms"``, ``"789 us"``."""
    for unit, length in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= length:
            return f"{digits(seconds / length)} {unit}"
    return f"{digits(seconds / 1e-6)} us"


def rate_text(rate: float | None) -> str:
    """A rate with its prefix, ``"12.3 G"``, or ``"-"`` where there is none."""
    if rate is None:
        return "-"
    for prefix, size in (("T", 1e12), ("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if rate >= size:
            return f"{digits(rate / size)} {prefix}"
    return digits(rate)


def digits(value: float) -> str:
    """A number with three digits, or as many as stand before its point."""
    return f"{value:.0f}" if value >= 99.95 else f"{value:.1f}" if value >= 9.995 else f"{value:.2f}"


def rows(kernels: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The table's lines of text under `COLUMNS`, from what `simdtex.run.Output` calls ``kernels``."""
    return [
        (
            kernel["name"],
            f"{kernel['calls']:,}",
            *(seconds_text(kernel[key]) for key in ("min", "median", "max", "seconds")),
            f"{kernel['share']:.1%}",
            rate_text(kernel["fma_rate"]),
            rate_text(kernel["byte_rate"]),
        )
        for kernel in kernels
    ]


def summary(statistics: dict[str, Any]) -> str:
    """Wall time, the device's share of it, and the gaps in between, in a sentence."""
    wall, busy, gaps = statistics["seconds"], statistics["device_seconds"], statistics["gaps"]
    text = f"wall time {seconds_text(wall)}: kernels {seconds_text(busy)} ({busy / wall:.1%})"
    if not gaps["calls"]:
        return text
    return (
        f"{text}; between them {seconds_text(gaps['seconds'])} ({gaps['seconds'] / wall:.1%}) in {gaps['calls']:,} "
        f"gaps, median {seconds_text(gaps['median'])}, longest {seconds_text(gaps['max'])}; "
        f"before the first and after the last {seconds_text(max(0.0, wall - busy - gaps['seconds']))}"
    )


def render(statistics: dict[str, Any], console: Console) -> None:
    """Print the profile that the statistics of a run hold."""
    table = Table(title=f"Kernels on {statistics['device']}", title_justify="left")
    for name in COLUMNS:
        table.add_column(name, justify="left" if name == "kernel" else "right", no_wrap=True)
    for row in rows(statistics["kernels"]):
        table.add_row(*row)
    console.print(table)
    console.print(summary(statistics), highlight=False)
