# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex schedules`` and ``ising``: schedules side by side."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import afterwards, command
from simdtex.cli.inputs import read_picture
from simdtex.cli.job import command_line, progress_bar
from simdtex.cli.options import DEVICE, QUIET, given, job_options, output_option
from simdtex.cli.places import FOLDER, READ
from simdtex.schedules import PARALLEL

SCHEDULES = (
    "coloring,coloring-fixed,luby,checkerboard,raster,random-scan,"
    "synchronous,random-subset,random-subset:0.25,block:8x8"
)
TEMPERATURES = (2.0, 2.3, 2.6)
PICTURE_SWEEPS = 50
"""Sweeps of the pictures of `ising`, from a random start: enough for domains to grow, too few for one to win."""


@command(
    ("schedules", "Compare schedules on a picture of brick, in the folder schedules-report."),
    ("schedules gravel.png -o page --schedule coloring,synchronous", "Compare two schedules."),
)
@click.argument("sample", required=False, type=READ)
@output_option("Write the report into this folder.", FOLDER, default="schedules-report", show_default=True)
@click.option(
    "--schedule",
    "names",
    default=",".join(PARALLEL),
    metavar="A,B,...",
    help="Compare these schedules.  [those that relax many sites in a step]",
)
@click.option(
    "--seeds", default=3, show_default=True, help="Run each schedule this many times, with consecutive seeds."
)
@click.option("--seed", default=1, show_default=True, help="Start with this seed.")
@click.option(
    "--size", default="96x96", show_default=True, metavar="WIDTHxHEIGHT", help="Make outputs of this size, in pixels."
)
@job_options("schedules")
@DEVICE
@QUIET
def schedules(
    sample: Path | None, output: Path, names: str, seeds: int, seed: int, size: str, quiet: bool, **options: Any
) -> None:
    """Run the same job under several schedules and compare them in a report.

    The default SAMPLE is 128x128 pixels of the brick of scikit-image.
    """
    from simdtex import schedules as known
    from simdtex.experiments.comparison import compare
    from simdtex.io import image
    from simdtex.options import whole
    from simdtex.report.page import check_folder
    from simdtex.report.schedules import comparison_tables as tables
    from simdtex.report.schedules import write_comparison
    from simdtex.report.tables import print_table

    check_folder(output)
    shape = image.parse_size(size)
    chosen = [known.get(name.strip()) for name in names.split(",")]
    whole("--seeds", seeds, 1)
    pixels, channel_axis = _sample(sample)
    began = time.perf_counter()
    with progress_bar(quiet) as show:
        found = compare(
            pixels,
            shape,
            chosen,
            seeds=range(seed, seed + seeds),
            channel_axis=channel_axis,
            callback=lambda fraction, job, progress: show(fraction, progress.doing, job),
            **given(options),
        )
    with afterwards():
        write_comparison(output, found, command_line())
    if quiet:
        return
    for table in tables(found):
        print_table(table)
    click.echo(
        f"{output / 'index.html'}: {len(chosen)} schedules, {seeds} {'seed' if seeds == 1 else 'seeds'}, "
        f"{time.perf_counter() - began:.0f} s on {found.device}"
    )


def _sample(path: Path | None) -> tuple[Any, int | None]:
    if path is None:
        from skimage import data

        brick: Any = data.brick
        return brick()[:128, :128], None
    picture = read_picture(path)
    return picture.pixels, picture.channel_axis


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
    from simdtex.experiments.ising import Experiment, findings, ising
    from simdtex.io import image
    from simdtex.machine import open_machine
    from simdtex.options import whole
    from simdtex.random import as_seed
    from simdtex.report import schedules as report
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
        for table in report.ising_tables(found):
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
