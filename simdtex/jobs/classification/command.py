# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex classify``."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import DATA, OUTPUTS, READ, READ_NAMED, WRITE
from simdtex.cli.inputs import (
    Material,
    Reading,
    channels,
    planes,
    read_material,
    read_pixels,
    size_text,
    without_alpha,
)
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import PROFILE, given, option, output_option, report_option
from simdtex.jobs.classification.options import Options
from simdtex.model.pictures import check_alike

Named = Sequence[tuple[str, list[Path]]]
"""What an option ``NAME=FILE0,FILE1`` was given."""

FITS = (".tif", ".tiff", ".npy")
"""The files of fits."""

UNLABELLED = 255
"""Where the truth is not known."""


@job(
    ("classify a.png --texture brick=brick.png --texture grass=grass.png -o b.png", "Tell brick from grass."),
    ("classify a.png --strokes strokes.png -o b.png", "Learn the classes from strokes on the picture."),
    usual="output textures strokes truth confidence report order seed dry_run device quiet",
    methods=[Options],
)
@click.argument("picture", type=READ)
@output_option("Write the labels: 1, 2..., and 0 for unknown.", WRITE)
@option(
    "--texture",
    "textures",
    multiple=True,
    type=READ_NAMED,
    metavar="NAME=FILE",
    group=DATA,
    help="Learn the class NAME from this sample; give one for each class, NAME=FILE0,FILE1 for several samples. "
    "Transparent pixels are not used.",
)
@option(
    "--strokes",
    type=READ,
    metavar="FILE",
    group=DATA,
    help="Learn the classes from strokes with the values 1, 2... in this picture, of the size of PICTURE.",
)
@option(
    "--validation",
    multiple=True,
    type=READ_NAMED,
    metavar="NAME=FILE",
    group=DATA,
    help="Measure with this picture of a class how much the class varies.",
)
@option("--truth", type=READ, metavar="FILE", group=DATA, help="Compare with these labels; 255 is unknown.")
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
    textures: Named,
    strokes: Path | None,
    validation: Named,
    truth: Path | None,
    confidence: Path | None,
    **options: Any,
) -> Task:
    """Label each pixel of PICTURE with the texture around it, or as unknown.

    Classes are numbered from 1 in the order of --texture; unknown pixels are 0.
    """
    from simdtex.io import image
    from simdtex.jobs.classification.job import classify
    from simdtex.model.display import read_labels, write_labels

    whole = read_material([picture])
    true = None if truth is None else read_labels(truth, UNLABELLED)
    if true is not None and true.shape != whole.sizes[0]:
        sizes = f"{truth} is {size_text(true)} and {picture} {size_text(whole.array)}"
        raise ValueError(f"{sizes}; give labels of its size")
    known: Any = read_classes("--texture", textures, whole)
    judged = read_classes("--validation", validation, whole)
    if bool(known) == bool(strokes):
        raise ValueError("give --texture once for each class, or --strokes")
    if strokes and judged:
        raise ValueError("--validation requires --texture; leave it out")
    names, pixels = dict(enumerate(known, 1)), whole.array
    if strokes:
        known = read_labels(strokes)
        names = {int(label): str(label) for label in np.unique(known[known > 0])}
    image.check_writable(output, np.uint8, 1, labels=True)
    place = whole.metadata and whole.metadata.geo and whole.metadata.geo.place()
    if confidence:
        image.check_writable(confidence, suffixes=FITS)
    if true is not None and (strange := np.setdiff1d(true, [0, *names, UNLABELLED])).size:
        raise ValueError(
            f"{truth} has the label {strange[0]}; give labels of the classes, 0 for unknown textures, and {UNLABELLED} "
            "for pixels without a known label"
        )
    writers: list[Any] = [lambda made, run: write_labels(output, made, place)]
    if confidence:
        writers.append(lambda made, run: image.write(confidence, run.fit, image.Metadata(geo=place, plain=True)))

    def report(folder: Path, made: Any, run: Any) -> None:
        from simdtex.jobs.classification.report import write_classification

        write_classification(folder, pixels, made, run, true, command_line())

    return Task(
        partial(classify, pixels, known, validation=judged, channel_axis=whole.channel_axis, **given(options)),
        f"{size_text(pixels)}, {len(names)} classes",
        str(output),
        writers,
        more=lambda made, run: click.echo(_shares(true, names, made)),
        report=report,
    )


def read_classes(flag: str, named: Named, picture: Material) -> dict[str, list[NDArray[Any]]]:
    """Read the samples of classes, masked where they are transparent; ``flag`` is the option that names them."""
    samples: dict[str, list[NDArray[Any]]] = {}
    for name, paths in named:
        if name in samples:
            raise ValueError(f"{flag} names {name} twice; give {name}=FILE0,FILE1 for several samples of a class")
        samples[name] = []
        for file in paths:
            material = read_pixels(file, Reading(ascending=picture.ascending))
            pixels = without_alpha(material, channels(picture.array))
            check_alike(str(file), planes(pixels), str(picture.paths[0]), planes(picture.array))
            samples[name].append(pixels.reshape(*pixels.shape[:2], *picture.array.shape[2:]))
    return samples


def _shares(true: NDArray[Any] | None, names: dict[int, str], labels: NDArray[Any]) -> str:
    """Return the share of each class and, if the truth is known, how much of it was found."""
    shares = ((name, (labels == label).mean()) for label, name in [(0, "unknown"), *names.items()])
    text = ", ".join(f"{name} {share:.1%}" for name, share in shares)
    if true is not None:
        there = true != UNLABELLED
        text += f"; {(labels == true)[there].mean():.1%} of the pixels agree with --truth"
    return text
