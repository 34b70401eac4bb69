# SPDX-License-Identifier: BSD-3-Clause
"""The results of a benchmark as tables for the terminal."""

from __future__ import annotations

from typing import Any

from simdtex.report.tables import Table, print_table, seconds_text, three_digits

__all__ = ["render", "table"]


def render(results: dict[str, Any]) -> None:
    """Print the results of `simdtex.bench.run.run`."""
    host = results["host"]
    print(
        f"{host['cpu']}, {host['cores']} cores; {host['system']}; simdtex {results['simdtex']}, numpy {host['numpy']}; "
        f"{results['date']}, {results['seconds']:.0f} s"
    )
    for entry in results["devices"]:
        print()
        print_table(table(entry))


def table(entry: dict[str, Any]) -> Table:
    """Return a table of the cases on a device."""
    device = entry["device"]
    rows = [
        {
            "job": case["name"],
            "time": seconds_text(case["seconds"]),
            "in kernels": f"{case['busy'] / case['seconds']:.0%}",
            "vs reference": three_digits(case["reference"], " x"),
        }
        for case in entry["cases"]
    ]
    units = f"{device['compute_units']} compute units"
    return Table(f"{device['name']}, {units}, {device['version']}, driver {device['driver']}", rows)
