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
from simdtex.cli.options import DEVICE, given, job_options, numbers, size_option
from simdtex.cli.places import READ, WRITE


@command(
    ("sheet gravel.png -o sheet.png --alpha 0.1,0.2,0.4", "Three thresholds."),
)
@click.argument("sample", type=READ)
@click.option("-o", "--output", "output_path", required=True, type=WRITE, help="Write this sheet.")
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
@size_option("twice the sample", "pictures")
@job_options("sheet")
@click.option("--seed", type=int, help="Make every picture from this seed.  [a fresh one, printed]")
@DEVICE
@click.option("-q", "--quiet", is_flag=True, help="Show no progress bar and no numbers.")
def sheet(
    sample: Path,
    output_path: Path,
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
    from simdtex.io import image
    from simdtex.machine import open_machine
    from simdtex.random import as_seed
    from simdtex.report.sheet import contact_sheet
    from simdtex.synthesis import synthesize

    image.check_writable(output_path, np.uint8, 3)
    picture = image.read(sample)
    height, width = picture.pixels.shape[:2]
    shape = output_shape(size, picture.pixels)
    pairs = [(alpha, beta) for beta in numbers("--beta", betas) for alpha in numbers("--alpha", alphas)]
    columns, machine = len(numbers("--alpha", alphas)), open_machine(options.pop("device"))
    how = {"method": "multires", "channel_axis": picture.channel_axis, "rng": as_seed(seed), "device": machine}
    limits = float(picture.pixels.min()), float(picture.pixels.max())
    cells, captions = [], []
    with progress_bar(quiet) as show:
        for number, (alpha, beta) in enumerate(pairs):
            if number % columns == 0:
                cells.append((sample.name, image.to_display(picture.pixels, limits)))
                captions.append(f"{width}x{height}, candidates coarse to fine:")

            def tell(progress: Any, number: int = number) -> None:
                show((number + progress.fraction) / len(pairs), "sampling")

            given_here = {**how, **given(options), "alpha": alpha, "beta": beta}
            made, output = synthesize(picture.pixels, shape, callback=tell, full_output=True, **given_here)
            label, counts = f"alpha {alpha:g}, beta {beta:g}", candidates_per_level(output.statistics["levels"])
            cells.append((label, image.to_display(made, limits)))
            captions.append(counts)
            if not quiet:
                click.echo(f"{label}: candidates {counts}, {output.statistics['seconds']:.2f} s")
    contact_sheet(cells, output_path, columns=1 + columns, captions=captions)
    if not quiet:
        click.echo(
            f"{output_path}: {len(pairs)} pictures of {shape[1]}x{shape[0]} from {width}x{height}, seed {how['rng']}"
        )
