# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex ising``: which schedules sample the right distribution."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import command
from simdtex.cli.job import command_line, progress_bar
from simdtex.cli.options import DEVICE, QUIET
from simdtex.cli.places import FOLDER

SCHEDULES = (
    "coloring,coloring-fixed,luby,checkerboard,raster,random-scan,"
    "synchronous,random-subset,random-subset:0.25,block:8x8"
)
TEMPERATURES = (2.0, 2.3, 2.6)
PICTURE_SWEEPS = 50
"""From a random start: enough for domains to grow, too few for one to win."""


@command(
    ("ising -o page", "Compare all schedules, and write a report."),
    ("ising --schedule coloring,synchronous --temperature 2.3", "Compare two schedules at one temperature."),
)
@click.option(
    "--schedule",
    "names",
    default=SCHEDULES,
    metavar="A,B,...",
    help="Compare these schedules.  [one or more of each kind]",
)
@click.option(
    "--temperature",
    "temperatures",
    type=float,
    multiple=True,
    default=TEMPERATURES,
    metavar="T",
    help="Relax at this temperature, in units of J / k_B, where T_c is 2.269; may be repeated.  [2.0, 2.3 and 2.6]",
)
@click.option("--size", default="24", show_default=True, metavar="WIDTHxHEIGHT", help="Use a torus of this size.")
@click.option(
    "--seeds", default=32, show_default=True, help="Run this many independent chains at each temperature, 2 or more."
)
@click.option("--sweeps", default=300, show_default=True, help="Measure this many sweeps, 2 or more.")
@click.option("--burn-in", default=600, show_default=True, help="Run this many sweeps before the measurement.")
@click.option("--start", default="up", show_default=True, help="Start with all spins up (up), or random (random).")
@click.option(
    "--seed", default=1, show_default=True, help="Use this seed: the same seed gives the same numbers on every device."
)
@DEVICE
@click.option("-o", "--output", type=FOLDER, metavar="DIR", help="Write a report into this folder.")
@QUIET
def ising(
    names: str,
    temperatures: tuple[float, ...],
    size: str,
    seed: int,
    device: str | None,
    output: Path | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Relax Ising spins by each schedule and compare with the exact energy."""
    from simdtex import schedules as known
    from simdtex.experiments.estimates import findings
    from simdtex.experiments.ising import Experiment, ising
    from simdtex.io import image
    from simdtex.machine import open_machine
    from simdtex.options import whole
    from simdtex.random import as_seed
    from simdtex.report import ising as report
    from simdtex.report.page import check_folder
    from simdtex.report.tables import print_table

    if output:
        check_folder(output)
    chosen = list({one.name: one for one in (known.get(name.strip()) for name in names.split(","))}.values())
    temperatures = tuple(dict.fromkeys(temperatures))
    shape = image.parse_size(size)
    whole("--seeds", options["seeds"], 2)  # there is no error bar over one
    whole("--sweeps", options["sweeps"], 2)
    as_seed(seed)
    experiment = Experiment(shape, temperatures, **options)
    once = Experiment(shape, [min(temperatures)], 1, PICTURE_SWEEPS, 0, start="random")
    machine = open_machine(device)

    began = time.perf_counter()
    runs, pictures = [], []
    with progress_bar(quiet) as show:
        for place, schedule in enumerate(chosen):
            job = f"schedule {place + 1} of {len(chosen)}: {schedule.name}"

            def show_share(share: float, place: int = place, job: str = job) -> None:
                show((place + share) / len(chosen), "", job)

            runs.append(ising(machine, experiment, schedule, seed=seed, callback=show_share))
            if output:
                pictures.append(ising(machine, once, schedule, seed=seed))
    found = findings(runs)
    if not quiet:
        for table in report.tables(found):
            print_table(table)
        for sentence in report.conclusion(found):
            click.echo(sentence)
    if output:
        settings = {"device": machine.name, "rows": shape[0], "columns": shape[1], "seed": seed, **options}
        settings |= {"boundary": "torus", "temperatures": temperatures}
        report.write_ising(output, found, runs, pictures, settings, command_line())
    if not quiet:
        where = f"{output / 'index.html'}: " if output else ""
        click.echo(f"{where}{time.perf_counter() - began:.0f} s on {machine.name}")
