# SPDX-License-Identifier: BSD-3-Clause
"""Tables of text for pages and terminals, and numbers as text."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10

import rich.table
from rich.console import Console
from rich.text import Text

_NUMBER = re.compile(r"[-+\u2212]?\d.*|[-\u2013]|n/a|inf")


@dataclass(frozen=True)
class Table:
    """A table of texts: rows from heading to cell, all with the same headings; the first cell names the row.

    A cell that begins with ``breaks`` or ``differs`` is a warning. ``note`` is a remark below the table, on
    pages only.
    """

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


def warns(cell: str) -> bool:
    """Return whether a cell is a warning."""
    return cell.startswith(("breaks", "differs"))


def print_table(table: Table, width: int | None = None) -> None:
    """Print a table on lines of ``width`` characters; None: those of the terminal, or 200 without a terminal."""
    console = Console(width=width or (None if sys.stdout.isatty() else 200))
    shown = rich.table.Table(
        title=table.caption, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold"
    )
    for number, (name, numeric) in enumerate(zip(table.header, table.numeric, strict=True)):
        shown.add_column(name, justify="right" if numeric else "left", overflow="fold", no_wrap=not number)
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
