# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex schedules`` and ``simdtex maspar``: schedules side by side, and the processor array of 1998."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import FOLDER, READ, WRITE, afterwards, command
from simdtex.cli.inputs import check_output, output_shape, read_material, read_picture
from simdtex.cli.job import Task, command_line, expected, job, watching
from simdtex.cli.options import (
    DEVICE,
    DRY_RUN,
    QUIET,
    SEED,
    given,
    job_options,
    option,
    output_option,
    paper_options,
    report_option,
    size_option,
)
from simdtex.maspar import EXECUTED
from simdtex.maspar.array import ARRAYS, MAPPINGS, PREFIX
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
@job_options("schedules")
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
    own = {"seeds": range(seed, seed + seeds), "channel_axis": channel_axis, **given(options)}
    if dry_run:

        def spin(callback: Any, device: str | None, **_: Any) -> None:
            of_schedules(chosen, device, seed, callback)

        def run(schedule: Schedule, callback: Any, **_: Any) -> None:
            compare(pixels, shape, [schedule], callback=callback, **own)

        told = expected(options["device"], *[spin] * ising, *(partial(run, one) for one in chosen))
        click.echo(f"{output}: {len(chosen)} schedules, {seeds} seeds, {told}; nothing was written")
        return
    with watching(quiet) as callback:
        found = compare(pixels, shape, chosen, callback=callback, **own)
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


@job(
    ("maspar gravel.png -o more.png --order 8 --size 64x64", "Make a small texture as in 1998."),
    ("maspar gravel.png -o more.png --array 4k --mapping hierarchical", "Use a smaller array, with blocks on each PE."),
    ("maspar gravel.png -o more.png --order 8 --size 64 --report page", "See the PEs at work, for several schedules."),
    usual="output size order levels relaxation array film report seed quiet",
    of=None,
)
@click.argument("sample", type=READ)
@output_option("Write this picture.", WRITE)
@size_option("128x128")
@option(
    "--array",
    default="16k",
    show_default=True,
    metavar="PES",
    words=[name.removeprefix(PREFIX) for name in ARRAYS],
    help="Use the array of this many PEs, or ROWSxCOLS.",
)
@option(
    "--mapping",
    default=MAPPINGS[0],
    show_default=True,
    words=MAPPINGS,
    help="Arrange a picture larger than the array in layers of its size (cut-and-stack), or in a block on each PE.",
)
@option(
    "--memory",
    default="64K",
    show_default=True,
    words=("16K", "64K"),
    help="Give each PE this memory; what does not fit is refused.",
)
@paper_options(*EXECUTED)
@option(
    "--film",
    default="coloring,checkerboard,synchronous,raster",
    show_default=True,
    metavar="A,B,...",
    help="Show the PEs that these schedules activate and the pictures that they make, with --report.",
)
@report_option("the seconds of 1998, the PEs at work, and a film of schedules")
@SEED
def maspar(sample: Path, output: Path, size: str | None, film: str, **options: Any) -> Task:
    """Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, and print its times of 1998.

    The output has the bytes of `simdtex synth --preset paper`. 128x128 pixels, one for each PE, take about 90 s
    of a core from a sample of 138x138 in colour; the time grows with the pixels of both and with the order.
    """
    from simdtex.io import image
    from simdtex.jobs.array import synthesize
    from simdtex.report.schedules import develop, section_table, write_array
    from simdtex.report.tables import print_table
    from simdtex.schedules import get

    names = [get(name.strip()).name for name in film.split(",")]
    material = read_material([sample])
    shape: Any = output_shape("128x128" if size is None else size, material.pixels[0])
    like = material.metadata and material.metadata.at()._replace(exif=None)
    check_output(output, material.pixels[0], like)

    used: dict[str, Any] = {"channel_axis": material.channel_axis}

    def make(checkpoint: None, **call: Any) -> Any:
        used["device"] = call["device"]
        return synthesize(material.array, shape, channel_axis=material.channel_axis, **given(options), **call)

    def report(folder: Path, made: Any, run: Any) -> None:
        own = {name: value for name, value in given(options).items() if name in EXECUTED}
        own |= used | {"rng": run.statistics["seed"]}
        pictures = {name: develop(material.array, shape, name, **own) for name in names}
        write_array(folder, material.pixels[0], made, run, pictures, command_line())

    height, width = material.sizes[0]
    return Task(
        make,
        f"{shape[1]}x{shape[0]} from {width}x{height}",
        str(output),
        [lambda made, run: image.write(output, made, like)],
        more=lambda made, run: print_table(section_table(run)),
        report=report,
    )
