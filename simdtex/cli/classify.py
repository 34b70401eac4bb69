# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex classify``: which texture is where."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import DATA, OUTPUTS
from simdtex.cli.inputs import Material, channels, planes, read_material, read_pixels, size_text, without_alpha
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import PROFILE, given, option, output_option, reads, report_option
from simdtex.cli.places import READ, READ_NAMED, WRITE
from simdtex.model.pictures import check_alike

FITS = (".tif", ".tiff", ".npy")

UNLABELLED = 255
"""Where the truth is not known."""


@job(
    ("classify a.png --texture brick=brick.png --texture grass=grass.png -o b.png", "Tell brick from grass."),
    ("classify a.png --strokes strokes.png -o b.png", "Learn the classes from strokes on the picture."),
    usual="output textures strokes truth confidence report order seed dry_run device quiet",
)
@click.argument("picture", type=READ)
@output_option("Write the labels: 1, 2..., and 0 for unknown.", WRITE)
@option(
    "--texture",
    "textures",
    type=READ_NAMED,
    multiple=True,
    metavar="NAME=FILE",
    group=DATA,
    help="Learn the class NAME from this sample; give one for each class, NAME=FILE0,FILE1 for several samples. "
    "Transparent pixels are not used.",
)
@reads(
    "--strokes", help="Learn the classes from strokes with the values 1, 2... in this picture, of the size of PICTURE."
)
@option(
    "--validation",
    type=READ_NAMED,
    multiple=True,
    metavar="NAME=FILE",
    group=DATA,
    help="Measure with this picture of a class how much the class varies.",
)
@reads("--truth", help="Compare with these labels; 255 is unknown.")
@option(
    "--confidence",
    type=WRITE,
    metavar="FILE",
    group=OUTPUTS,
    help="Write the fit of each class at each pixel, 0 to 1, one band for each class: .tif or .npy.",
)
@report_option("labels, fits and, with --truth, the confusion matrix")
@PROFILE
def classify(
    picture: Path,
    output: Path,
    textures: tuple[tuple[str, list[Path]], ...],
    strokes: Path | None,
    validation: tuple[tuple[str, list[Path]], ...],
    truth: Path | None,
    confidence: Path | None,
    **options: Any,
) -> Task:
    """Label each pixel of PICTURE with the texture around it, or as unknown.

    Classes are numbered from 1 in the order of --texture; unknown pixels are 0.
    """
    from simdtex import classify
    from simdtex.io import image
    from simdtex.model.display import read_labels, write_labels

    whole = read_material([picture])
    true = None if truth is None else read_labels(truth, UNLABELLED)
    if true is not None and true.shape != whole.sizes[0]:
        sizes = f"{truth} is {size_text(true)} and {picture} {size_text(whole.array)}"
        raise ValueError(f"{sizes}; give labels of its size")
    held = _read_samples("--validation", validation, whole)
    if bool(textures) == bool(strokes):
        raise ValueError("give --texture once for each class, or --strokes")
    if strokes and validation:
        raise ValueError("--validation requires --texture; leave it out")
    pixels: NDArray[Any] = whole.array
    more: dict[str, Any] = {"channel_axis": whole.channel_axis}
    known: Any
    if strokes:
        known = read_labels(strokes)
        names = {int(label): str(label) for label in np.unique(known[known > 0])}
    else:
        known = _read_samples("--texture", textures, whole)
        more |= {"validation": held}
        names = dict(enumerate(known, 1))
    image.check_writable(output, np.uint8, 1)
    if confidence:
        image.check_writable(confidence, suffixes=FITS)
    if true is not None and (strange := np.setdiff1d(true, [0, *names, UNLABELLED])).size:
        raise ValueError(
            f"{truth} has the label {strange[0]}; give labels of the classes, 0 for unknown textures, and {UNLABELLED} "
            "for pixels without a known label"
        )
    writers: list[Any] = [lambda made, run: write_labels(output, made)]
    if confidence:
        writers.append(lambda made, run: image.write(confidence, run.fit))

    def report(folder: Path, made: Any, run: Any) -> None:
        from simdtex.report.synthesis import write_classification

        write_classification(folder, pixels, made, run, true, command_line())

    run = partial(classify, pixels, known, **more, **given(options))
    summary = f"{size_text(pixels)}, {len(names)} classes"
    return Task(
        run, summary, str(output), writers, more=lambda made, _: click.echo(_shares(true, names, made)), report=report
    )


def _read_samples(
    flag: str, named: Sequence[tuple[str, list[Path]]], picture: Material
) -> dict[str, list[NDArray[Any]]]:
    """Read the samples of classes, ``NAME=FILE`` or ``NAME=FILE0,FILE1``, masked where they are transparent."""
    found: dict[str, list[NDArray[Any]]] = {}
    for name, files in named:
        if name in found:
            raise ValueError(f"{flag} names {name} twice; give {name}=FILE0,FILE1 for several samples of a class")
        found[name] = []
        for file in files:
            pixels = without_alpha(read_pixels(file).pixels, channels(picture.array))
            check_alike(str(file), planes(pixels), str(picture.paths[0]), planes(picture.array))
            found[name].append(pixels.reshape(*pixels.shape[:2], *picture.array.shape[2:]))
    return found


def _shares(true: NDArray[Any] | None, names: dict[int, str], labels: NDArray[Any]) -> str:
    """Return the share of each class and, if the truth is known, how much of it was found."""
    shares = ((name, (labels == label).mean()) for label, name in [(0, "unknown"), *names.items()])
    text = ", ".join(f"{name} {share:.1%}" for name, share in shares)
    if true is not None:
        there = true != UNLABELLED
        text += f"; {(labels == true)[there].mean():.1%} of the pixels agree with --truth"
    return text
