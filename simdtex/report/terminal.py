# SPDX-License-Identifier: BSD-3-Clause
"""The tables that commands print: a run's profile and accounting, a benchmark, and the versions in use."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Any

from simdtex.machine.devices import DeviceError, find
from simdtex.report.tables import Table, duration_text, number_text, print_table, seconds_text


def print_profile(statistics: dict[str, Any]) -> None:
    """Print the profile in the statistics of a run, see `simdtex.run.Output`."""
    print_table(profile_table(statistics))
    print(profile_summary(statistics))


def profile_table(statistics: dict[str, Any]) -> Table:
    """Return a table of the kernels of a run."""
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
    return Table(f"Kernels on {statistics['device']}", rows)


def profile_summary(statistics: dict[str, Any]) -> str:
    """Return a sentence on the wall time and the time in kernels."""
    wall, busy = statistics["seconds"], statistics["device_seconds"]
    return f"wall time {seconds_text(wall)}: kernels {seconds_text(busy)} ({busy / wall:.1%})"


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
    """Print the results of `simdtex.bench.run.run`."""
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
    found = [
        f"simdtex {version('simdtex')}",
        f"Python {platform.python_version()}, NumPy {version('numpy')}, pyopencl {version('pyopencl')}",
    ]
    try:
        device = find()
    except DeviceError as error:
        return [*found, str(error)]
    driver = f", {device.version}, driver {device.driver}" if device.version else ""
    return [*found, f"{device}{driver}"]
