# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex schedules``: schedules side by side."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import afterwards, command
from simdtex.cli.inputs import read_picture
from simdtex.cli.job import command_line, watching
from simdtex.cli.options import DEVICE, QUIET, given, job_options, output_option
from simdtex.cli.places import FOLDER, READ
from simdtex.schedules import PARALLEL


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
@job_options("schedules")
@DEVICE
@QUIET
def schedules(
    sample: Path | None,
    output: Path,
    names: str,
    seeds: int,
    seed: int,
    size: str,
    ising: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Run the same job under several schedules and compare them in a report.

    The default SAMPLE is 128x128 pixels of the brick of scikit-image.
    """
    from simdtex import schedules as known
    from simdtex.experiments.comparison import compare
    from simdtex.experiments.ising import of_schedules
    from simdtex.io import image
    from simdtex.options import whole
    from simdtex.report.page import check_folder
    from simdtex.report.schedules import comparison_tables, conclusion, ising_tables, write_comparison
    from simdtex.report.tables import print_table

    check_folder(output)
    shape = image.parse_size(size)
    chosen = [known.get(name.strip()) for name in names.split(",")]
    whole("--seeds", seeds, 1)
    pixels, channel_axis = _sample(sample)
    began = time.perf_counter()
    with watching(quiet) as callback:
        found = compare(
            pixels,
            shape,
            chosen,
            seeds=range(seed, seed + seeds),
            channel_axis=channel_axis,
            callback=callback,
            **given(options),
        )
        spins = of_schedules(chosen, options["device"], seed, callback) if ising else None
    with afterwards():
        write_comparison(output, found, command_line(), spins)
    if quiet:
        return
    for table in comparison_tables(found) + (ising_tables(spins.findings) if spins else []):
        print_table(table)
    for sentence in conclusion(spins.findings) if spins else []:
        click.echo(sentence)
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
