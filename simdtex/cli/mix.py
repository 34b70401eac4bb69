# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex mix``: a texture that is a bit like each of several."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.common import (
    last_iteration,
    opened,
    output_shape,
    plainly,
    settle,
    watching,
)
from simdtex.cli.helping import command
from simdtex.cli.inputs import channels
from simdtex.cli.keeping import kept
from simdtex.cli.options import CHECKPOINT, DEVICE, PROFILE, QUIET, SEED, given, job_options, numbers, stages_option
from simdtex.cli.places import READ, WRITE

CHOSEN = ("palette", "pattern", "low", "high")
"""Options that name a sample."""


@command(
    ("mix wood.png stone.png -o both.png", "A bit of each."),
    ("mix wood.png stone.png -o both.png --palette wood.png --pattern stone.png", "Stone in the colours of wood."),
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=READ)
@click.option("-o", "--output", required=True, type=WRITE, help="Write this picture.")
@click.option(
    "--size",
    metavar="WIDTHxHEIGHT",
    help="Make an output of this size, in pixels.  [twice the first sample]",
)
@click.option("--palette", metavar="SAMPLE", help="Take the colours of this sample.  [those of the pattern]")
@click.option("--pattern", metavar="SAMPLE", help="Take the pattern of this sample.  [the average of all]")
@click.option("--average", metavar="W,W,...", help="Take the average of the patterns, a weight for each sample.")
@click.option("--low", metavar="SAMPLE", help="Take the low frequencies of this sample, with --high.")
@click.option("--high", metavar="SAMPLE", help="Take the high frequencies of this sample, with --low.")
@job_options("mix")
@SEED
@DEVICE
@stages_option("every iteration")
@PROFILE
@CHECKPOINT
@QUIET
@plainly
@kept
def mix(
    samples: tuple[Path, ...],
    output: Path,
    size: str | None,
    average: str | None,
    seed: int | None,
    device: str | None,
    stages: Path | None,
    profile: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Mix the textures SAMPLE...: a picture that looks a bit like each of them.

    A sample is named in options by its path as it stands in the command, or by its number from 1. The method is Heeger
    and Bergen's (1995).
    """
    from simdtex.io import image
    from simdtex.methods.pyramid.mixtures import mix as mixed

    chosen = {name: sample_number(name, options.pop(name), samples) for name in CHOSEN}
    weights = None if average is None else numbers("--average", average)
    pictures = [image.read(path) for path in samples]
    arrays = [picture.pixels for picture in pictures]
    shape = output_shape(size, arrays[0])
    colour = any(picture.channel_axis is not None for picture in pictures)
    image.check_writable(output, arrays[0].dtype, max(channels(array) for array in arrays))

    began = time.perf_counter()
    limits = min(float(array.min()) for array in arrays), max(float(array.max()) for array in arrays)
    with watching(quiet, stages, limits) as callback:
        made, run = mixed(
            arrays,
            shape,
            channel_axis=-1 if colour else None,
            rng=seed,
            device=opened(device, profile),
            callback=callback,
            checkpoint=click.get_current_context().obj,
            full_output=True,
            **given(options | chosen | {"average": weights}),
        )
    image.write(output, made)
    settle()
    if not quiet:
        click.echo(
            f"{output}: {shape[1]}x{shape[0]} from {len(arrays)} {'sample' if len(arrays) == 1 else 'samples'} "
            f"in {time.perf_counter() - began:.1f} s on {run.statistics['device']}, seed {run.statistics['seed']}"
        )
        click.echo(last_iteration(run.statistics))
    if profile:
        from simdtex.report.terminal import print_profile

        print_profile(run.statistics)


def sample_number(name: str, text: str | None, samples: tuple[Path, ...]) -> int | None:
    """Which sample an option means, from 0: its path as given, or its number from 1."""
    if text is None:
        return None
    if Path(text) in samples:
        return samples.index(Path(text))
    if text.isdecimal() and 1 <= int(text) <= len(samples):
        return int(text) - 1
    raise ValueError(
        f"--{name} {text} is none of the samples; give the path of one as it stands in the command, "
        f"or its number, 1 to {len(samples)}"
    )
