# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex classify``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import DATA, OUTPUTS, READ, WRITE
from simdtex.cli.inputs import read_inputs, read_material, size_text
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import PROFILE, given, input_options, option, output_option, report_option
from simdtex.jobs.classification.options import Options

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
@input_options("classify")
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
    strokes: Path | None,
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
    data = read_inputs("classify", options, whole)
    if bool(data["textures"]) == bool(strokes):
        raise ValueError("give --texture once for each class, or --strokes")
    if strokes and data["validation"]:
        raise ValueError("--validation requires --texture; leave it out")
    pixels: NDArray[Any] = whole.array
    if strokes:
        data["textures"] = labels = read_labels(strokes)
        names = {int(label): str(label) for label in np.unique(labels[labels > 0])}
    else:
        names = dict(enumerate(data["textures"], 1))
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

    run = partial(classify, pixels, **data, **given(options))
    summary = f"{size_text(pixels)}, {len(names)} classes"
    return Task(
        run, summary, str(output), writers, more=lambda made, _: click.echo(_shares(true, names, made)), report=report
    )


def _shares(true: NDArray[Any] | None, names: dict[int, str], labels: NDArray[Any]) -> str:
    """Return the share of each class and, if the truth is known, how much of it was found."""
    shares = ((name, (labels == label).mean()) for label, name in [(0, "unknown"), *names.items()])
    text = ", ".join(f"{name} {share:.1%}" for name, share in shares)
    if true is not None:
        there = true != UNLABELLED
        text += f"; {(labels == true)[there].mean():.1%} of the pixels agree with --truth"
    return text
