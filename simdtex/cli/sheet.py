# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex sheet``: one sample under several thresholds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.command import command
from simdtex.cli.inputs import candidates_per_level, output_shape
from simdtex.cli.job import progress_bar
from simdtex.cli.options import DEVICE, given, job_options, numbers
from simdtex.cli.places import READ, WRITE


@command(
    ("sheet gravel.png -o sheet.png --alpha 0.1,0.2,0.4", "Three thresholds."),
)
@click.argument("sample", type=READ)
@click.option("-o", "--output", required=True, type=WRITE, help="Write this sheet.")
@click.option(
    "--alpha",
    "alphas",
    default="0.05,0.10,...,0.30",
    show_default=True,
    metavar="A,B,...",
    help="Make a picture for each of these thresholds; auto is not among them.",
)
@click.option(
    "--beta",
    "betas",
    default="0,1",
    show_default=True,
    metavar="A,B,...",
    help="Make a row of pictures for each of these.",
)
@click.option("--size", metavar="WIDTHxHEIGHT", help="Make pictures of this size, in pixels.  [twice the sample]")
@job_options("sheet")
@click.option("--seed", type=int, help="Make every picture from this seed.  [a fresh one, printed]")
@DEVICE
@click.option("-q", "--quiet", is_flag=True, help="Show no progress bar and no numbers.")
def sheet(
    sample: Path,
    output: Path,
    alphas: str,
    betas: str,
    size: str | None,
    seed: int | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Show what thresholds alpha / k^beta make of SAMPLE: Figures 11 and 12 of De Bonet (1997) on one sheet.

    Below each picture stand the mean candidates of its levels, coarse to fine.
    """
    from simdtex.experiments.thresholds import series
    from simdtex.io import image
    from simdtex.random import as_seed
    from simdtex.report.sheet import contact_sheet

    image.check_writable(output, np.uint8, 3)
    picture = image.read(sample)
    height, width = picture.pixels.shape[:2]
    shape = output_shape(size, picture.pixels)
    across = numbers("--alpha", alphas)
    seed = as_seed(seed)
    with progress_bar(quiet) as show:
        made = series(
            picture.pixels,
            shape,
            across,
            numbers("--beta", betas),
            channel_axis=picture.channel_axis,
            rng=seed,
            callback=lambda fraction, _: show(fraction, "sampling", ""),
            **given(options),
        )
    limits = float(picture.pixels.min()), float(picture.pixels.max())
    cells, captions = [], []
    for number, member in enumerate(made):
        if number % len(across) == 0:
            cells.append((sample.name, image.to_display(picture.pixels, limits)))
            captions.append(f"{width}x{height}, candidates coarse to fine:")
        label, counts = f"alpha {member.alpha:g}, beta {member.beta:g}", candidates_per_level(member.levels)
        cells.append((label, image.to_display(member.image, limits)))
        captions.append(counts)
        if not quiet:
            click.echo(f"{label}: candidates {counts}, {member.seconds:.2f} s")
    contact_sheet(cells, output, columns=1 + len(across), captions=captions)
    if not quiet:
        click.echo(f"{output}: {len(made)} pictures of {shape[1]}x{shape[0]} from {width}x{height}, seed {seed}")
