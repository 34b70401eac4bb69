# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex solid``: a block of a texture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.command import OUTPUTS
from simdtex.cli.inputs import channels, last_iteration, read_material
from simdtex.cli.inputs import size as size_of
from simdtex.cli.job import Task, job
from simdtex.cli.options import PROFILE, given, option, stages_option
from simdtex.cli.places import EITHER, READ, WRITE

SIDE = 128
"""The default size, voxels a side."""


@job(
    ("solid marble.png -o block.npz --size 64 --view block.png", "Make a cube of 64^3 voxels, and a picture of it."),
    ("solid marble.png -o slices --size 16x64x64", "Make a folder of 16 slices."),
    usual="outputs size picture seed iterations pyramid dry_run device quiet",
)
@stages_option("the middle slice of every iteration")
@PROFILE
@click.argument("sample", type=READ)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    type=EITHER,
    help="Write the block: .npz, .npy, .nrrd, .tif, or, without suffix, a folder of slices; may be repeated.",
)
@click.option(
    "--size",
    metavar="DEPTHxHEIGHTxWIDTH",
    help=f"Make a block of this many slices, rows and columns; one number makes a cube.  [{SIDE}]",
)
@option(
    "--view",
    "picture",
    group=OUTPUTS,
    type=WRITE,
    metavar="PNG",
    help="Write a picture of the block: a cube, a sphere and three slices.",
)
def solid(sample: Path, outputs: tuple[Path, ...], size: str | None, picture: Path | None, **options: Any) -> Task:
    """Make a solid block whose slices have the texture of SAMPLE.

    The method is Heeger and Bergen's (1995), for textures that look alike in all directions.
    """
    from simdtex.io import image, volume
    from simdtex.report.solid import view
    from simdtex.synthesis import synthesize_solid

    shape: Any = image.parse_sides(str(SIDE) if size is None else size, "DEPTHxHEIGHTxWIDTH")
    material = read_material([sample])
    pixels = material.pixels[0]
    writers: list[Any] = []
    for output in outputs:
        volume.check_writable(output, pixels.dtype, channels(pixels))
        writers.append(lambda block, run, output=output: volume.write(output, block))
    if picture:
        image.check_writable(picture, suffixes=(".png",))
        writers.append(lambda block, run: view(np.asarray(block), picture))
    return Task(
        partial(synthesize_solid, pixels, shape, channel_axis=material.channel_axis, **given(options)),
        f"{'x'.join(map(str, shape))} from {size_of(pixels)}",
        ", ".join(str(path) for path in (*outputs, picture) if path),
        writers,
        material.limits,
        lambda made, statistics: click.echo(last_iteration(statistics)),
    )
