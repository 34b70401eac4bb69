# SPDX-License-Identifier: BSD-3-Clause
"""The accounting of a run on a processor array, as a table on the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table


def duration(seconds: float) -> str:
    """Seconds for people: ``"0.3 s"``, ``"2.5 min"``, ``"9.6 h"``, ``"12.0 d"``."""
    for unit, length in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"


def render(accounting: dict[str, Any], console: Console) -> None:
    """Print what `simdtex.run.Output` calls ``accounting``."""
    packed = accounting["mapping"] == "packed"
    table = Table(title=f"On an array of {accounting['array']} PEs ({accounting['mapping']})", title_justify="left")
    table.add_column("What")
    table.add_column("How much", justify="right")
    rows = {
        "steps: sites that relax together": f"{accounting['steps']:,}",
        "SIMD steps: passes over a virtual layer": f"{accounting['passes']:,}",
        "virtual layers": f"{accounting['layers']:,}",
        "active PEs per SIMD step, mean": f"{accounting['active']:,.0f}",
        "utilisation of the array": f"{accounting['utilisation']:.1%}",
        "X-Net shifts for all neighbourhoods, cut-and-stack": f"{accounting['shifts']['cut-and-stack']:,}",
        "X-Net shifts for all neighbourhoods, hierarchical": f"{accounting['shifts']['hierarchical']:,}",
        "words shifted by the X-Net, per PE": f"{accounting['moved']:,}",
        "words through the router": f"{accounting['routed']:,}",
        "floating-point operations": f"{accounting['flop']:.3g}",
        "launches on this device": f"{accounting['launches']:,}",
        "MasPar MP-1 of this size, by the model": duration(accounting["model_seconds"]),
    }
    for what, much in rows.items():
        if packed and what.startswith("X-Net"):
            continue
        table.add_row(what, much)
    console.print(table)
