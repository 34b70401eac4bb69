# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex schedules``: schedules side by side; and ``simdtex bench``: the time of each method on each device."""

from __future__ import annotations

import json
import time
from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import FOLDER, READ, WRITE, afterwards, command
from simdtex.cli.inputs import read_picture
from simdtex.cli.job import command_line, expected, watching
from simdtex.cli.options import DEVICE, DRY_RUN, QUIET, given, job_options, output_option
from simdtex.methods.mrf.options import Options
from simdtex.schedules import PARALLEL, Schedule


@command(
    ("schedules", "Compare schedules on a picture of brick, in the folder schedules-report."),
    ("schedules gravel.png -o page --schedule coloring,synchronous", "Compare two schedules."),
    ("schedules --ising --schedule coloring,raster,synchronous", "Say also which sample the right distribution."),
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
@click.option("--ising", is_flag=True, help="Relax Ising spins as well, and compare with the exact energy.")
@job_options("schedules", Options)
@DEVICE
@DRY_RUN
@QUIET
def schedules(
    sample: Path | None,
    output: Path,
    names: str,
    seeds: int,
    seed: int,
    size: str,
    ising: bool,
    dry_run: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Run the same job under several schedules and compare them in a report.

    The default SAMPLE is 128x128 pixels of the brick of scikit-image.
    """
    from simdtex import schedules as known
    from simdtex.figures.page import check_folder
    from simdtex.figures.tables import print_table
    from simdtex.io import image
    from simdtex.jobs.studies.comparison import compare
    from simdtex.jobs.studies.ising import of_schedules
    from simdtex.jobs.studies.report import comparison_tables, conclusion, ising_tables, write_comparison
    from simdtex.options import whole

    check_folder(output)
    shape = image.parse_size(size)
    chosen = [known.get(name.strip()) for name in names.split(",")]
    whole("--seeds", seeds, 1)
    pixels, channel_axis = _sample(sample)
    began = time.perf_counter()
    common = {"seeds": range(seed, seed + seeds), "channel_axis": channel_axis, **given(options)}
    if dry_run:

        def spin(callback: Any, device: str | None, **_: Any) -> None:
            of_schedules(chosen, device, seed, callback)

        def run(schedule: Schedule, callback: Any, **_: Any) -> None:
            compare(pixels, shape, [schedule], callback=callback, **common)

        told = expected(options["device"], *[spin] * ising, *(partial(run, one) for one in chosen))
        click.echo(f"{output}: {len(chosen)} schedules, {seeds} seeds, {told}; nothing was written")
        return
    with watching(quiet) as callback:
        comparison = compare(pixels, shape, chosen, callback=callback, **common)
        spins = of_schedules(chosen, options["device"], seed, callback) if ising else None
    with afterwards():
        write_comparison(output, comparison, command_line(), spins)
    if quiet:
        return
    for table in comparison_tables(comparison) + (ising_tables(spins.findings) if spins else []):
        print_table(table)
    for sentence in conclusion(spins.findings) if spins else []:
        click.echo(sentence)
    click.echo(
        f"{output / 'index.html'}: {len(chosen)} schedules, {seeds} {'seed' if seeds == 1 else 'seeds'}, "
        f"{time.perf_counter() - began:.0f} s on {comparison.device}"
    )


def _sample(path: Path | None) -> tuple[Any, int | None]:
    if path is None:
        from skimage import data

        brick: Any = data.brick
        return brick()[:128, :128], None
    picture = read_picture(path)
    return picture.pixels, picture.channel_axis


@command(
    ("bench --quick", "Measure small sizes, within a minute."),
)
@click.option(
    "--device",
    metavar="TEXT",
    help="Measure only this device: a part of its name or platform, or its index in `simdtex devices`.  "
    "[all usable devices]",
)
@click.option(
    "--quick",
    is_flag=True,
    help="Use small sizes, which take a quarter of a minute for each device instead of two minutes.",
)
@click.option("--json", "path", type=WRITE, metavar="FILE", help="Write all measurements.")
@QUIET
def bench(device: str | None, quick: bool, path: Path | None, quiet: bool) -> None:
    """Measure the time of each method on each device, and compare with NumPy.

    All times are from one run. Do not use the machine for other work during the run.
    """
    from simdtex.figures.tables import print_benchmark
    from simdtex.io.files import atomic_path
    from simdtex.io.image import check_writable
    from simdtex.jobs.studies import benchmark

    if path:
        check_writable(path, suffixes=(".json",))
    infos = benchmark.chosen(device)

    def tell(what: str) -> None:
        if not quiet:
            click.echo(what, err=True)

    times = benchmark.run(benchmark.QUICK if quick else benchmark.FULL, infos, tell)
    if path:
        with afterwards(), atomic_path(path) as whole:
            whole.write_text(json.dumps(times, indent=1) + "\n", encoding="utf-8")
    if not quiet:
        print_benchmark(times)
        if path:
            click.echo(path)
