# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex maspar``: more of a texture, on the processor array of 1998."""

from __future__ import annotations

import secrets
import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import command
from simdtex.cli.inputs import output_shape, read_material
from simdtex.cli.job import SEEDS, progress_bar
from simdtex.cli.options import DEVICE, QUIET, SEED, given, option, size_option
from simdtex.cli.places import READ, WRITE


@command(
    ("maspar gravel.png -o more.png --order 8 --size 64x64", "Make a small texture as in 1998; it takes seconds."),
    ("maspar gravel.png -o more.png --array 4k --mapping hierarchical", "Use a smaller array, with blocks on each PE."),
)
@click.argument("sample", type=READ)
@option("-o", "--output", required=True, type=WRITE, help="Write this picture.")
@size_option("twice the sample")
@option(
    "--array",
    default="16k",
    show_default=True,
    metavar="PES",
    words=("1k", "2k", "4k", "8k", "16k"),
    help="Use the array of this many PEs, or ROWSxCOLS.",
)
@option(
    "--mapping",
    default="cut-and-stack",
    show_default=True,
    words=("cut-and-stack", "hierarchical"),
    help="Arrange a picture larger than the array in layers of its size (cut-and-stack), or in a block on each PE.",
)
@option(
    "--memory",
    default="64K",
    show_default=True,
    words=("16K", "64K"),
    help="Give each PE this memory; where it does not hold all distances, they are computed three times.",
)
@option("--order", default=18, show_default=True, help="Compare neighbours within sqrt(order) pixels.")
@option("--levels", type=int, help="Use this many levels.  [as many as sample and output allow]")
@option(
    "--boundary",
    default="torus",
    show_default=True,
    words=("torus", "open"),
    help="Wrap the output around, so that it tiles (torus), or not (open).",
)
@option(
    "--pixel",
    words=("density", "source"),
    help="Draw grey levels from the Parzen density, or pixels of the sample (source).  [density]",
)
@SEED
@DEVICE
@QUIET
def maspar(
    sample: Path,
    output: Path,
    size: str | None,
    seed: int | None,
    device: str | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, and print its times of 1998.

    The output has the bytes of `simdtex synth --preset paper`. 64x64 pixels with order 8 take seconds, and 128x128 with
    order 18 a minute or two.
    """
    from simdtex.io import image
    from simdtex.jobs.array import synthesize
    from simdtex.report.terminal import print_sections

    material = read_material([sample])
    shape: Any = output_shape(size, material.pixels[0])
    image.check_writable(output)
    seed = secrets.randbelow(SEEDS) if seed is None else seed
    began = time.perf_counter()
    with progress_bar(quiet) as show:
        made, run = synthesize(
            material.array,
            shape,
            channel_axis=material.channel_axis,
            callback=lambda progress: show(progress.fraction, progress.doing),
            full_output=True,
            rng=seed,
            device=device,
            **given(options),
        )
    like = material.metadata and material.metadata._replace(exif=None, geo=None)
    image.write(output, made, like)
    if not quiet:
        height, width = material.sizes[0]
        seconds = f"in {time.perf_counter() - began:.1f} s on {run.statistics['device']}, seed {seed}"
        click.echo(f"{output}: {shape[1]}x{shape[0]} from {width}x{height} {seconds}")
        print_sections(run.statistics["array"], run.seconds)
