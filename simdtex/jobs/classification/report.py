# SPDX-License-Identifier: BSD-3-Clause
"""The page of a classification."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.figures.page import Figure, Section, write_report
from simdtex.figures.sheet import contact_sheet, rgb
from simdtex.figures.tables import Table, settings_table
from simdtex.model.display import label_colours, temperature_colours
from simdtex.run import Output

UNTOLD = np.full(3, 128, np.uint8)
"""The colour of pixels whose true label is not known."""


def write_classification(
    folder: str | os.PathLike[str],
    image: NDArray[Any],
    labels: NDArray[np.uint8],
    output: Output,
    truth: NDArray[Any] | None = None,
    command: str = "",
) -> None:
    """Write the report of labels: ``index.html``, PNG pictures, ``results.json``; ``truth`` are the true labels."""
    statistics, fit = output.statistics, output.fit
    assert fit is not None
    classes = statistics["classes"]
    names, count, colours = [about["name"] for about in classes], len(classes), label_colours(256)
    index = np.full(256, count)  # of the class of each label
    index[[about["label"] for about in classes]] = np.arange(count)
    sheet = [("the picture", rgb(image)), ("the labels", colours[labels])]
    if truth is not None:
        known = index[truth][..., None] < count
        sheet.append(("the truth", np.where(known, colours[truth], UNTOLD)))
    legend = [
        {
            **{"Label": str(about["label"]), "Class": about["name"]},
            **{"Colour": f"#{bytes(colours[about['label']]).hex()}", "Share": f"{about['share']:.1%}"},
        }
        for about in classes
    ]
    pictures = contact_sheet(sheet, columns=len(sheet))
    caption = "The picture and its labels. Black is unknown; grey is where the truth is not known."
    fits = [(name, temperature_colours(fit[..., c])) for c, name in enumerate(names[1:])]
    limit = statistics["options"]["unknown"]
    meaning = (
        "The fit of each class, from 0 (near black) to 1 (pale yellow). It is the probability that a texture of the "
        "class differs from its samples as much as the picture does around a pixel, within its segment. Where that of "
        f"the label is below {limit:g}, the pixel is unknown."
    )
    sections = [
        Section("The labels", [Figure("labels.png", pictures, caption), Table("The classes", legend)]),
        Section(
            "How well each class fits",
            [Figure("fit.png", contact_sheet(fits, columns=min(4, len(fits))), meaning)],
        ),
    ]
    results: dict[str, Any] = {"shape": labels.shape, "statistics": statistics}
    if truth is not None:
        confusion = confusion_matrix(index[labels], index[truth], count)
        rows = [
            {"True class": name, **{other: str(n) for other, n in zip(names, line, strict=True)}}
            for name, line in zip(names, confusion, strict=True)
            if line.any()
        ]
        right = float(np.trace(confusion) / max(1, confusion.sum()))
        note = f"Pixels of each true class by their label; {right:.1%} are right."
        sections.append(Section("Confusion", [Table("The confusion matrix", rows, note)]))
        results |= {"confusion": confusion, "accuracy": right}
    job = {"seed": statistics["seed"], "seconds": f"{statistics['seconds']:.2f}", **statistics["options"]}
    sections.append(Section("The job", [settings_table("The run and its options", job)]))
    lead = f"{labels.shape[1]} x {labels.shape[0]} pixels and {count - 1} classes, on {statistics['device']}."
    write_report(folder, "Which texture is where", lead, sections, results, command)


def confusion_matrix(labels: NDArray[Any], truth: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Return the number of pixels of each true class (rows) with each label (columns); ``count`` is not known."""
    known = truth < count
    pairs = truth[known].astype(np.int64) * count + labels[known]
    return np.bincount(pairs, minlength=count * count).reshape(count, count)
