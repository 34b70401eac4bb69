# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex synth``: more of a texture."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.common import (
    DEVICE,
    PROFILE,
    QUIET,
    SEED,
    candidates_per_level,
    check_distinct,
    command_line,
    given,
    last_iteration,
    method_options,
    opened,
    option,
    output_shape,
    plainly,
    print_profile,
    stages_option,
    watching,
)


@click.command()
@click.argument("sample", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Picture to write.")
@click.option(
    "--size", metavar="WIDTHxHEIGHT", help="Of the output, in pixels. Default: that of --start, else twice the sample."
)
@click.option(
    "--method",
    default="mrf",
    show_default=True,
    help="mrf: Paget and Longstaff 1998. multires: De Bonet 1997. pyramid: Heeger and Bergen 1995.",
)
@method_options
@option(
    "--schedule",
    help="mrf: which sites relax together: coloring, coloring-fixed, luby, checkerboard, synchronous, "
    "random-subset[:P], raster, random-scan or block[:ROWSxCOLS].  [{mrf.schedule}]",
)
@click.option("--check-schedule", is_flag=True, default=None, help="mrf: check equation (14) at every step.")
@click.option(
    "--array", metavar="ROWSxCOLS", help="mrf: run on a processor array, or maspar-mp1-1k to -16k.  [sites are packed]"
)
@option("--mapping", help="mrf: cut-and-stack or hierarchical: how pixels lie on the array.  [{mrf.mapping}]")
@click.option(
    "--emulate/--no-emulate", default=None, help="mrf: launch one work-item per PE, or only account for the array."
)
@click.option("--accounting", is_flag=True, help="mrf: print what the run costs on the array, or on a full MP-1.")
@SEED
@DEVICE
@stages_option("every level, sweep or iteration")
@click.option("--source-map", type=click.Path(path_type=Path), metavar="FILE", help="Write it: .npz, .npy, .png.")
@click.option(
    "--also",
    multiple=True,
    metavar="MAP=OUT",
    help="Carry the arrangement over to another map of the material (normal, height); may be repeated.",
)
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Write a page of the run: pictures, and how evenly it uses the sample.",
)
@PROFILE
@QUIET
@plainly
def synth(
    sample: Path,
    output: Path,
    size: str | None,
    method: str,
    start: Path | None,
    seed: int | None,
    device: str | None,
    stages: Path | None,
    source_map: Path | None,
    also: tuple[str, ...],
    report: Path | None,
    accounting: bool,
    profile: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Make more of the texture SAMPLE."""
    from simdtex.io import image
    from simdtex.synthesis import synthesize

    if accounting and method != "mrf":
        raise ValueError(f"--accounting is of the method mrf, not {method}; leave it out")
    if method == "pyramid" and (source_map or also):
        raise ValueError("the method pyramid takes no pixel from the sample; leave --source-map and --also out")
    picture = image.read(sample)
    pixels = picture.pixels
    height, width = pixels.shape[:2]
    begin = image.read(start).pixels if start else None
    shape = output_shape(size, pixels, begin)
    channels = 1 if picture.channel_axis is None else pixels.shape[-1]
    image.check_writable(output, pixels.dtype, channels)
    if source_map or also:
        from simdtex.model import source_map as maps
    if source_map:
        image.check_writable(source_map, suffixes=maps.SOURCE_SUFFIXES)
    others = [_other_map(text, (height, width)) for text in also]
    if report:
        from simdtex.report.page import check_folder

        check_folder(report)
    outputs = [output, *(path for path in (source_map, stages, report) if path), *(path for _, path in others)]
    inputs = [sample, *([start] if start else []), *(Path(text.partition("=")[0]) for text in also)]
    check_distinct(outputs, inputs)

    began = time.perf_counter()
    with watching(quiet, stages, (float(pixels.min()), float(pixels.max()))) as callback:
        made, run = synthesize(
            pixels,
            shape,
            method=method,
            channel_axis=picture.channel_axis,
            rng=seed,
            device=opened(device, profile),
            callback=callback,
            full_output=True,
            **given(options | {"start": begin}),
        )
    source: Any = run.source
    carried = [(maps.apply_source_map(source, other, (height, width)), path) for other, path in others]
    image.write(output, made)
    for array, path in carried:
        image.write(path, array)
    if source_map:
        maps.save_source_map(source_map, source)
    if report:
        from simdtex.report.synthesis import write_synthesis

        write_synthesis(report, pixels, made, run, command_line(click.get_current_context()))
    if not quiet:
        click.echo(
            f"{output}: {shape[1]}x{shape[0]} from {width}x{height} in {time.perf_counter() - began:.1f} s "
            f"on {run.statistics['device']}, seed {run.statistics['seed']}"
        )
        if method == "multires":
            levels, alpha = run.statistics["levels"], run.statistics["options"]["alpha"]
            thresholds = "thresholds as given" if alpha is None else f"alpha {alpha}"
            click.echo(f"{thresholds}; candidates per level, coarse to fine: {candidates_per_level(levels)}")
        if method == "pyramid":
            click.echo(last_iteration(run.statistics))
    if profile:
        print_profile(run.statistics)
    if accounting:
        from rich.console import Console

        from simdtex.report.accounting import render

        render(run.statistics["accounting"], Console())


def _other_map(text: str, sample: tuple[int, int]) -> tuple[Any, Path]:
    """Read the map of ``--also MAP=OUT`` and check that it can be carried over and written."""
    from simdtex.io import image

    name, equals, out = text.partition("=")
    if not (name and equals and out):
        raise ValueError(f"--also {text} must be MAP=OUT, the map's file and the file to write")
    other = image.read(name)
    pixels = other.pixels
    if pixels.shape[:2] != sample:
        raise ValueError(
            f"{name} is {pixels.shape[1]}x{pixels.shape[0]} and the sample {sample[1]}x{sample[0]}; "
            "give --also a map of the sample's size"
        )
    image.check_writable(out, pixels.dtype, 1 if other.channel_axis is None else pixels.shape[-1])
    return pixels, Path(out)
