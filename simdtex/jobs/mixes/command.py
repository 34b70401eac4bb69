# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex mix`` and ``solid``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.command import OUTPUTS, READ, WRITE
from simdtex.cli.inputs import channels, last_iteration, output_shape, read_material, size_text
from simdtex.cli.job import Task, job
from simdtex.cli.options import NUMBERS, PROFILE, given, option, output_option, size_option, stages_option
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid import solid as solids

NUMBERED = ("palette", "pattern", "low", "high")
"""The options that name a sample."""


@job(
    ("mix wood.png stone.png -o both.png", "Average the patterns of two samples."),
    ("mix wood.png stone.png -o both.png --palette wood.png --pattern stone.png", "Make stone in the colours of wood."),
    usual="output size palette pattern average low high seed dry_run device quiet",
    methods=[pyramid.Options],
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=READ)
@output_option("Write this picture.", WRITE)
@size_option("twice the first sample", base="the first sample")
@option("--palette", metavar="SAMPLE", help="Take the colours of this sample.  [those of the pattern]")
@option("--pattern", metavar="SAMPLE", help="Take the pattern of this sample.  [the average of all]")
@option(
    "--average", type=NUMBERS, metavar="W,W,...", help="Average the patterns with these weights, one for each sample."
)
@option("--low", metavar="SAMPLE", help="Take the low frequencies of this sample, with --high.")
@option("--high", metavar="SAMPLE", help="Take the high frequencies of this sample, with --low.")
@stages_option("every iteration")
@PROFILE
def mix(samples: tuple[Path, ...], output: Path, size: str | None, **options: Any) -> Task:
    """Mix the textures SAMPLE... into one picture.

    Options name a sample by its path as in the command, or by its number from 1. The method is Heeger and Bergen's
    (1995).
    """
    from simdtex.io import image
    from simdtex.jobs.mixes.job import mix

    material = read_material(samples)
    options |= {name: _number(name, options[name], samples) for name in NUMBERED if options[name] is not None}
    pixels, metadata = material.pixels, material.metadata and material.metadata.at()._replace(exif=None)
    rows, cols = output_shape(size, pixels[0])
    axis = -1 if any(one.ndim > 2 for one in pixels) else None
    image.check_writable(output, pixels[0].dtype, max(map(channels, pixels)), metadata=metadata)
    return Task(
        partial(mix, pixels, (rows, cols), channel_axis=axis, **given(options)),
        f"{cols}x{rows} from {len(pixels)} sample{'s' * (len(pixels) > 1)}",
        str(output),
        [lambda made, run: image.write(output, made, metadata)],
        material.limits,
        lambda made, run: click.echo(last_iteration(run.statistics)),
    )


def _number(name: str, text: str, samples: tuple[Path, ...]) -> int:
    """Return the number, from 0, of the sample that an option names by its path as given or its number from 1."""
    if Path(text) in samples:
        return samples.index(Path(text))
    if text.isdecimal() and 1 <= int(text) <= len(samples):
        return int(text) - 1
    remedy = f"give the path of one as in the command, or its number, 1 to {len(samples)}"
    raise ValueError(f"--{name} {text} is none of the samples; {remedy}")


@job(
    ("solid marble.png -o block.npz --size 64 --view block.png", "Make a cube of 64^3 voxels, and a picture of it."),
    ("solid marble.png -o slices --size 16x64x64", "Make a folder of 16 slices."),
    usual="output size picture seed iterations pyramid dry_run device quiet",
    methods=[solids.Options],
)
@click.argument("sample", type=READ)
@output_option(
    "Write the block: .npz, .npy, .nrrd, .tif, or, without suffix, a folder of slices; may be repeated.", multiple=True
)
@option(
    "--size",
    default="128",
    show_default=True,
    metavar="DEPTHxHEIGHTxWIDTH",
    help="Make a block of this many slices, rows and columns; one number makes a cube.",
)
@option(
    "--view",
    "picture",
    group=OUTPUTS,
    type=WRITE,
    metavar="PNG",
    help="Write a picture of the block and of its three middle slices.",
)
@stages_option("the middle slice of every iteration")
@PROFILE
def solid(sample: Path, output: tuple[Path, ...], size: str, picture: Path | None, **options: Any) -> Task:
    """Make a solid block whose slices have the texture of SAMPLE.

    The method is Heeger and Bergen's (1995), for textures that look alike in all directions.
    """
    from simdtex.figures.sheet import view
    from simdtex.io import image, volume
    from simdtex.jobs.mixes.job import synthesize_solid

    shape: Any = image.parse_sides(size, "DEPTHxHEIGHTxWIDTH")
    material = read_material([sample])
    pixels = material.pixels[0]
    writers: list[Any] = []
    for path in output:
        volume.check_writable(path, pixels.dtype, channels(pixels))
        writers.append(lambda block, run, path=path: volume.write(path, block))
    if picture:
        image.check_writable(picture, suffixes=(".png",))
        writers.append(lambda block, run: view(np.asarray(block), picture))
    return Task(
        partial(synthesize_solid, pixels, shape, channel_axis=material.channel_axis, **given(options)),
        f"{'x'.join(map(str, shape))} from {size_text(pixels)}",
        ", ".join(str(path) for path in (*output, picture) if path),
        writers,
        material.limits,
        lambda block, run: click.echo(last_iteration(run.statistics)),
    )
