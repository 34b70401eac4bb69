# SPDX-License-Identifier: BSD-3-Clause
"""The page of a synthesis: its pictures, and how evenly it uses the sample."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from simdtex.figures.page import Figure, Part, Section, write_report
from simdtex.figures.sheet import GAP, MOST_SIDE, contact_sheet, magnified, parts, read_fitted, reduction, rgb
from simdtex.figures.tables import settings_table
from simdtex.io.image import to_display
from simdtex.model.display import source_colours, use_colours
from simdtex.model.light import sample_sentences
from simdtex.model.source_map import counts, use_of
from simdtex.run import Output

Picture = NDArray[np.uint8]

WINDOW = 16
"""Side of the windows to find, pixels."""

SHOWN_SIDE = 256  # smaller samples are enlarged by a whole factor, pixels
PAGE = 1120  # the width of a page's pictures; a wider sheet is shrunk, and its labels with it, pixels
CORNER = 512  # side of the part of a reduced output that is shown unchanged, pixels
FRAME = (0, 200, 255)  # the colour of the frame around the most used piece, sRGB; no colour of the map of use is blue


def write_synthesis(
    folder: str | os.PathLike[str],
    sample: NDArray[Any],
    image: Any,
    output: Output,
    command: str = "",
    *,
    continued: bool = False,
) -> None:
    """Write the report of a run, whose image and source map may be of a store; ``continued``: they hold the sample."""
    statistics = dict(output.statistics)
    limits = float(sample.min()), float(sample.max())

    def show(part: NDArray[Any]) -> Picture:
        return rgb(to_display(part, limits))

    shown, made = to_display(sample, limits), _views("output", image, show)
    (height, width), (rows, cols) = image.shape[:2], sample.shape[:2]
    on = f"in {statistics['tiles']}" if "tiles" in statistics else f"on {statistics['device']}"
    lead = f"{width} x {height} pixels from a sample of {cols} x {rows}, {on}."
    results: dict[str, Any] = {"sample_shape": sample.shape, "shape": (height, width), "statistics": statistics}
    pair = _sheet([("the sample", shown), *made], 2)
    factor = reduction(image.shape)
    reduced = f"The output is reduced: one pixel is the mean of {factor} x {factor}." if factor > 1 else ""
    caption = " ".join(["The sample and the output.", reduced, sample_sentences(statistics)])
    sections = [Section("The picture", [Figure("picture.png", pair, " ".join(caption.split()))])]
    if output.source is not None:
        uses, whole = _counted(output.source, (rows, cols))
        statistics["use"] = statistics.get("use") or use_of(uses).as_dict()
        if not continued:
            results |= {"taken": np.count_nonzero(uses) / uses.size, "copied": whole}
        sections.append(Section("Use of the sample", _use(shown, uses, made, output.source, results)))
    job: dict[str, Any] = {name: statistics[name] for name in ("seed", "tiles") if name in statistics}
    job |= {"light": statistics["light"]["light"]} if "light" in statistics else {}
    job |= {"seconds": f"{statistics['seconds']:.2f}", **statistics["options"]}
    sections.append(Section("The job", [settings_table("The run and the options of its method", job)]))
    write_report(folder, "A texture and its sample", lead, sections, results, command)


def _views(name: str, array: Any, show: Any) -> list[tuple[str, Picture]]:
    """Return the picture of an array, (rows, cols[, ...]), with its label; if it is reduced, a corner of it, too."""
    views = [(f"the {name}", read_fitted(array, show))]
    if reduction(array.shape) > 1:
        views.append(("its upper left corner, not reduced", show(array[:CORNER, :CORNER])))
    return views


def _sheet(pictures: list[tuple[str, Picture]], columns: int) -> Picture:
    """Return a sheet with ``columns`` columns, or fewer if its labels would be too small to read."""
    widest = min(MOST_SIDE, max(picture.shape[1] for _, picture in pictures))
    return contact_sheet(pictures, columns=max(1, min(columns, PAGE // (widest + GAP))))


def _counted(source: Any, shape: tuple[int, int]) -> tuple[NDArray[np.intp], float | None]:
    """Return `counts` of a source map, and the share of its windows that are one piece of the sample, if it has any."""
    uses, whole, more = np.zeros(shape, np.intp), 0, WINDOW - 1
    for rows, cols in parts(source.shape):
        part = source[rows.start : rows.stop + more, cols.start : cols.stop + more]
        uses += counts(part[: rows.stop - rows.start, : cols.stop - cols.start], shape)
        whole += int(np.count_nonzero(_pieces(part)))
    windows = [side - more for side in source.shape[:2]]
    return uses, whole / (windows[0] * windows[1]) if min(windows) > 0 else None


def _pieces(source: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Return whether each window of a source map is one piece of the sample, (rows - 15, cols - 15)."""
    rows, cols = source.shape[:2]
    if min(rows, cols) < WINDOW:
        return np.zeros((0, 0), bool)
    offset = source - np.moveaxis(np.indices((rows, cols)), 0, -1)
    size, inside = (WINDOW, WINDOW, 1), tuple(slice(WINDOW // 2, n - (WINDOW - 1) // 2) for n in (rows, cols))
    same = minimum_filter(offset, size)[inside] == maximum_filter(offset, size)[inside]
    return np.asarray(same.all(-1))


def use_sentences(use: dict[str, Any]) -> str:
    """Return how evenly the sample was used, in words; `use` is the entry of `simdtex.run.Output.statistics`."""
    share, most = use["effective_share"], use["most_used"]
    return (
        f"The effective share of the sample is {share:.2f}: if all parts were used alike, {share:.0%} of it would do. "
        f"The piece that is used most, {most['cols']} x {most['rows']} pixels from row {most['row']} and column "
        f"{most['col']} on, is taken {most['times_fair_share']:.1f} times as often as its fair share."
    )


def _use(
    sample: Picture, uses: NDArray[np.intp], made: list[tuple[str, Picture]], source: Any, results: dict[str, Any]
) -> list[Part]:
    shape, use = uses.shape, results["statistics"]["use"]
    factor = max(1, SHOWN_SIDE // max(shape))
    used = magnified(use_colours(uses), factor)
    _frame(used, use["most_used"], factor)
    places = magnified(source_colours(np.moveaxis(np.indices(shape), 0, -1), shape), factor)
    arranged = _views("source places", source, lambda part: source_colours(part, shape))
    return [
        " ".join([use_sentences(use), *_shares(results)]),
        Figure(
            "use.png",
            contact_sheet([("the sample", magnified(sample, factor)), ("its use", used)], columns=2),
            f"How often each pixel of the sample was taken, from never (black) to {uses.max():,} "
            "times (pale yellow), on a logarithmic scale. The frame is around the piece that is used most.",
        ),
        Figure(
            "arrangement.png",
            _sheet([("places in the sample", places), *arranged, *made], 3),
            "The arrangement: a colour for each place in the sample, and the output's pixels in the colours of the "
            "places that they were taken from. A piece taken whole is smooth, and a joint is an edge.",
        ),
    ]


def _shares(results: dict[str, Any]) -> list[str]:
    """Return sentences on how much of the sample was taken at all, and how much of the output in whole pieces."""
    shares = [f"{results['taken']:.0%} of the sample's pixels are taken at least once."] if "taken" in results else []
    if results.get("copied") is not None:
        size = f"{WINDOW} x {WINDOW}"
        shares.append(f"Of the output's windows of {size} pixels, {results['copied']:.1%} are one piece of the sample.")
    return shares


def _frame(picture: Picture, piece: dict[str, Any], factor: int) -> None:
    """Draw the outline of a piece, in place."""
    top, left = piece["row"] * factor, piece["col"] * factor
    inside = picture[top : top + piece["rows"] * factor, left : left + piece["cols"] * factor]
    inside[[0, -1]] = FRAME
    inside[:, [0, -1]] = FRAME
