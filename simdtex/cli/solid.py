# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex solid``: a block of a texture."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.common import afterwards, last_iteration, opened, plainly, settle, watching
from simdtex.cli.helping import OUTPUTS, command
from simdtex.cli.keeping import kept
from simdtex.cli.options import CHECKPOINT, DEVICE, PROFILE, QUIET, SEED, given, job_options, option, stages_option
from simdtex.cli.places import EITHER, READ, WRITE

SIDE = 128
"""Voxels a side, where no size is given."""


@command(
    (
        "solid marble.png -o block.npz --size 64 --view block.png",
        "A cube of 64^3 voxels, and a picture of it.",
    ),
    ("solid marble.png -o slices --size 16x64x64", "A folder of 16 slices."),
)
@click.argument("sample", type=READ)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    type=EITHER,
    help="Write this block: .npz, .npy, .nrrd, .tif, or without suffix a folder of slices; may be repeated.",
)
@click.option(
    "--size",
    metavar="DEPTHxHEIGHTxWIDTH",
    help=f"Make a block of this many slices, rows and columns, the depth first, or a cube of one number.  [{SIDE}]",
)
@option(
    "--view",
    "picture",
    group=OUTPUTS,
    type=WRITE,
    metavar="PNG",
    help="Write a picture of it: a cube, a sphere and three slices.",
)
@job_options("solid")
@SEED
@DEVICE
@stages_option("the middle slice of every iteration")
@PROFILE
@CHECKPOINT
@QUIET
@plainly
@kept
def solid(
    sample: Path,
    outputs: tuple[Path, ...],
    size: str | None,
    picture: Path | None,
    seed: int | None,
    device: str | None,
    stages: Path | None,
    profile: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Make a solid of the texture SAMPLE: a block whose slices look like it.

    The method is Heeger and Bergen's (1995), for textures that look alike in all directions.
    """
    from simdtex.io import image, volume
    from simdtex.report.solid import view
    from simdtex.synthesis import synthesize_solid

    shape = (SIDE, SIDE, SIDE) if size is None else block_shape(size)
    read = image.read(sample)
    pixels = read.pixels
    channels = 1 if read.channel_axis is None else pixels.shape[-1]
    for output in outputs:
        volume.check_writable(output, pixels.dtype, channels)
    if picture:
        image.check_writable(picture, suffixes=(".png",))

    began = time.perf_counter()
    with watching(quiet, stages, (float(pixels.min()), float(pixels.max()))) as callback:
        block, run = synthesize_solid(
            pixels,
            shape,
            channel_axis=read.channel_axis,
            rng=seed,
            device=opened(device, profile),
            callback=callback,
            checkpoint=click.get_current_context().obj,
            full_output=True,
            **given(options),
        )
    seconds = time.perf_counter() - began
    for output in outputs:
        with afterwards():
            volume.write(output, block)
    if picture:
        with afterwards():
            view(np.asarray(block), picture)
    settle()
    if not quiet:
        names = ", ".join(str(path) for path in (*outputs, *([picture] if picture else [])))
        click.echo(
            f"{names}: {'x'.join(str(side) for side in shape)} from {pixels.shape[1]}x{pixels.shape[0]} "
            f"in {seconds:.1f} s on {run.statistics['device']}, seed {run.statistics['seed']}"
        )
        click.echo(last_iteration(run.statistics))
    if profile:
        from simdtex.report.terminal import print_profile

        print_profile(run.statistics)


def block_shape(text: str) -> tuple[int, int, int]:
    """Depth, rows and columns of ``--size``."""
    match = re.fullmatch(r"\s*([0-9]{1,8})(?:\s*[xX\u00d7]\s*([0-9]{1,8})\s*[xX\u00d7]\s*([0-9]{1,8}))?\s*", text)
    sides = [int(side or match[1]) for side in match.groups()] if match else [0]
    if 0 in sides:
        raise ValueError(
            f"size {text!r} is not DEPTHxHEIGHTxWIDTH: give slices x rows x columns of 1 or more, as 64x128x128, or "
            "one number for a cube"
        )
    return sides[0], sides[1], sides[2]
