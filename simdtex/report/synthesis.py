# SPDX-License-Identifier: BSD-3-Clause
"""The report of one synthesis: the picture, how evenly it uses its sample, and what was taken from where."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import to_display
from simdtex.model.colours import source_colours, use_colours
from simdtex.model.regularity import lattice_sentence
from simdtex.model.use import counts
from simdtex.report.page import Figure, Part, Section, write_report
from simdtex.report.sheet import contact_sheet, magnified
from simdtex.report.tables import Table
from simdtex.run import Output

Picture = NDArray[np.uint8]

SHOWN_SIDE = 256  # smaller samples are enlarged by a whole factor, pixels
FRAME = (0, 200, 255)  # the colour of the frame around the most used piece, sRGB; no colour of the map of use is blue


def write_synthesis(
    folder: str | os.PathLike[str], sample: NDArray[Any], image: NDArray[Any], output: Output, command: str = ""
) -> None:
    """Write the report of a run: ``index.html``, PNG pictures, ``results.json``.

    ``picture.png`` shows sample and output, both (rows, cols[, channels]). If there is a source map, ``use.png`` shows
    how often each pixel of the sample was taken, and ``arrangement.png`` from where each pixel of the output was taken.
    """
    statistics = output.statistics
    limits = float(sample.min()), float(sample.max())
    shown, made = to_display(sample, limits), to_display(image, limits)
    (height, width), (rows, cols) = image.shape[:2], sample.shape[:2]
    lead = f"{width} x {height} pixels from a sample of {cols} x {rows}, on {statistics['device']}."
    pair = contact_sheet([("the sample", shown), ("the output", made)], columns=2)
    caption = f"The sample and the output. {lattice_sentence(statistics.get('lattice'))}".strip()
    sections = [Section("The picture", [Figure("picture.png", pair, caption)])]
    if output.source is not None:
        sections.append(Section("Use of the sample", _use(shown, made, output)))
    job = {"seed": statistics["seed"], "seconds": f"{statistics['seconds']:.2f}", **statistics["options"]}
    settings = [{"What": k, "Value": str(v)} for k, v in job.items() if not isinstance(v, np.ndarray)]
    sections.append(Section("The job", [Table("The run and the options of its method", settings)]))
    results = {"sample_shape": sample.shape, "shape": (height, width), "statistics": statistics}
    write_report(folder, "A texture and its sample", lead, sections, results, command)


def use_sentences(use: dict[str, Any]) -> str:
    """Return how evenly the sample was used, in words; `use` is the entry of `simdtex.run.Output.statistics`."""
    share, most = use["effective_share"], use["most_used"]
    return (
        f"The effective share of the sample is {share:.2f}: if all parts were used alike, {share:.0%} of it would do. "
        f"The piece that is used most, {most['cols']} x {most['rows']} pixels from row {most['row']} and column "
        f"{most['col']} on, is taken {most['times_fair_share']:.1f} times as often as its fair share."
    )


def _use(sample: Picture, made: Picture, output: Output) -> list[Part]:
    shape, use = sample.shape[:2], output.statistics["use"]
    source: Any = output.source
    factor = max(1, SHOWN_SIDE // max(shape))
    used = magnified(use_colours(source, shape), factor)
    _frame(used, use["most_used"], factor)
    places = magnified(source_colours(np.moveaxis(np.indices(shape), 0, -1), shape), factor)
    arrangement = [("places in the sample", places), ("source places", source_colours(source, shape))]
    return [
        use_sentences(use),
        Figure(
            "use.png",
            contact_sheet([("the sample", magnified(sample, factor)), ("its use", used)], columns=2),
            f"How often each pixel of the sample was taken, from never (black) to {counts(source, shape).max():,} "
            "times (pale yellow), on a logarithmic scale. The frame is around the piece that is used most.",
        ),
        Figure(
            "arrangement.png",
            contact_sheet([*arrangement, ("the output", made)], columns=3),
            "The arrangement: a colour for each place in the sample, and the output's pixels in the colours of the "
            "places that they were taken from. A piece taken whole is smooth, and a joint is an edge.",
        ),
    ]


def _frame(picture: Picture, piece: dict[str, Any], factor: int) -> None:
    """Draw the outline of a piece, in place."""
    top, left = piece["row"] * factor, piece["col"] * factor
    inside = picture[top : top + piece["rows"] * factor, left : left + piece["cols"] * factor]
    inside[[0, -1]] = FRAME
    inside[:, [0, -1]] = FRAME
