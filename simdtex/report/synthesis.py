# SPDX-License-Identifier: BSD-3-Clause
"""The report of one synthesis: the picture, how evenly it uses its sample, and what was taken from where."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import __version__
from simdtex.io.image import to_display
from simdtex.model.colours import source_colours, use_colours
from simdtex.model.use import counts
from simdtex.report.page import Figure, Section, Table, Text, write_report
from simdtex.report.sheet import contact_sheet, encoded
from simdtex.run import Output

__all__ = ["words_of_use", "write_synthesis"]

Picture = NDArray[np.uint8]

SHOWN_SIDE = 256  # samples smaller than this are enlarged by a whole factor, pixels
FRAME = (0, 200, 255)  # the most used piece's, sRGB; no colour of the map of use is blue


def write_synthesis(
    folder: str | os.PathLike[str], sample: NDArray[Any], image: NDArray[Any], output: Output, command: str = ""
) -> None:
    """Write the report of a run: ``index.html``, PNG pictures, ``results.json``.

    Parameters
    ----------
    folder : path
        See `simdtex.report.page.check_folder`.
    sample, image : array, (rows, cols) or (rows, cols, channels)
        The sample, and what was made of it.
    output : Output
        Of the run.
    command : str
        The command line to show, where there was one.

    Raises
    ------
    ValueError
        The folder cannot be written.

    Notes
    -----
    ``picture.png`` shows sample and output. Where there is a source map, ``use.png`` shows how often each pixel of the
    sample was taken, and ``arrangement.png`` from where each pixel of the output was taken.
    """
    statistics = output.statistics
    limits = float(sample.min()), float(sample.max())
    shown, made = to_display(sample, limits), to_display(image, limits)
    (height, width), (rows, cols) = image.shape[:2], sample.shape[:2]
    lead = f"{width} x {height} pixels from a sample of {cols} x {rows}, on {statistics['device']}."
    pair = contact_sheet([("the sample", shown), ("the output", made)], columns=2)
    picture = Figure("The sample and the output.", encoded(pair), "The sample and the output", "picture.png")
    sections = [Section("The picture", [picture])]
    if output.source is not None:
        sections.append(Section("What is taken from where", _use(shown, made, output)))
    sections.append(Section("The job", _job(statistics, command)))
    shapes = {"sample_shape": list(sample.shape), "shape": [height, width]}
    results = {**shapes, "statistics": statistics, "command": command, "version": __version__}
    write_report(folder, "A texture and its sample", lead, sections, results)


def words_of_use(use: dict[str, Any]) -> str:
    """Say in words how evenly the sample was used; `use` is the entry of `simdtex.run.Output.statistics`."""
    share, most = use["effective_share"], use["most_used"]
    return (
        f"The effective share of the sample is {share:.2f}: if all parts were used alike, {share:.0%} of it would do. "
        f"The piece that is used most, {most['cols']} x {most['rows']} pixels from row {most['row']} and column "
        f"{most['col']} on, is taken {most['times_fair_share']:.1f} times as often as its fair share."
    )


def _use(sample: Picture, made: Picture, output: Output) -> list[Text | Table | Figure]:
    shape, use = sample.shape[:2], output.statistics["use"]
    source: Any = output.source
    most = int(counts(source, shape).max())
    used = _enlarged(use_colours(source, shape))
    _frame(used, use["most_used"], used.shape[0] // shape[0])
    own = source_colours(np.moveaxis(np.indices(shape), 0, -1), shape)
    arranged = [
        ("places in the sample", _enlarged(own)),
        ("where from", source_colours(source, shape)),
        ("the output", made),
    ]
    return [
        Text(words_of_use(use)),
        Figure(
            f"How often each pixel of the sample was taken, from never (black) to {most:,} times (pale yellow), on a "
            "logarithmic scale. The frame is around the piece that is used most.",
            encoded(contact_sheet([("the sample", _enlarged(sample)), ("its use", used)], columns=2)),
            "The sample, and a map of how often each of its pixels was taken",
            "use.png",
        ),
        Figure(
            "The arrangement: a colour for each place in the sample, and the output's pixels in the colours of the "
            "places that they were taken from. A piece taken whole is smooth, and a joint is an edge.",
            encoded(contact_sheet(arranged, columns=3)),
            "Places in the sample as colours, the output in these colours, and the output",
            "arrangement.png",
        ),
    ]


def _job(statistics: dict[str, Any], command: str) -> list[Text | Table | Figure]:
    rows = [["seed", str(statistics["seed"])], ["seconds", f"{statistics['seconds']:.2f}"]]
    rows += [[name, str(value)] for name, value in statistics["options"].items() if not isinstance(value, np.ndarray)]
    table = Table("The run and the options of its method", ["What", "Value"], rows)
    return [*([Text(f"$ {command}")] if command else []), table]


def _enlarged(picture: Picture) -> Picture:
    factor = max(1, SHOWN_SIDE // max(picture.shape[:2]))
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def _frame(picture: Picture, piece: dict[str, Any], factor: int) -> None:
    """Draw the outline of a piece, in place."""
    top, left = piece["row"] * factor, piece["col"] * factor
    inside = picture[top : top + piece["rows"] * factor, left : left + piece["cols"] * factor]
    inside[[0, -1]] = FRAME
    inside[:, [0, -1]] = FRAME
