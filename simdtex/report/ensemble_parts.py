# SPDX-License-Identifier: BSD-3-Clause
"""The parts of an ensemble's report: figures and tables, and what a reader can tell from each."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex.experiments.ensemble import Summary, dead_end_places
from simdtex.experiments.ensemble.ends import MARGIN
from simdtex.report import ensemble_plots as plots
from simdtex.report.page import Figure, Table, Text
from simdtex.report.plots import figure_png
from simdtex.report.sheet import contact_sheet, encoded

Array = NDArray[Any]
Part = Text | Table | Figure

SHOWN = 5  # realisations beside the training image
MARKED = 2  # realisations with their dead ends


def _figure(plot: Plot, caption: str, alt: str, file: str) -> Figure:
    return Figure(caption, figure_png(plot), alt, file)


def pictures(images: Array, own: Array, found: Summary) -> list[Part]:
    """The training image and some realisations."""
    limits = float(own.min()), float(own.max())
    factor = plots.factor_of(own.shape, images.shape[1:])
    shown = [("the training image", own), *((f"realisation {i}", one) for i, one in enumerate(images[:SHOWN]))]
    sheet = contact_sheet(
        [(name, plots.magnified(plots.coloured(one, found.categories, limits), factor)) for name, one in shown],
        columns=3,
    )
    caption = (
        f"The training image and the first {min(SHOWN, len(images))} of {len(images)} realisations, in one scale. No "
        "figure below replaces this look: shapes, widths and directions should be those of the training image, and no "
        "realisation should repeat a piece of it, or of another, as a whole."
    )
    return [Figure(caption, encoded(sheet), "The training image and some realisations", "realisations.png")]


def left_open(found: Summary) -> list[Part]:
    """What the ensemble says of every pixel, and how sure it is."""
    dots = (
        " The dots are the hard data in the colours of the map: one that is kept has the colour of its pixel."
        if len(found.data)
        else ""
    )
    if len(found.categories) == 0:
        what = "The mean of the realisations at every pixel."
        how = "The standard deviation of the realisations at every pixel, in the unit of the values"
    else:
        what = "The share of the realisations in which a pixel has the category: its probability there."
        how = f"The entropy of every pixel over the categories, {found.open.mean():.2f} bits on average"
    maps = (
        f"{what}{dots} Around data the map follows them; far from them it should be even, for nothing is known there. "
        "Structure far from any datum means that realisations repeat one another."
    )
    openness = (
        f"{how}: dark where all realisations agree, light where they leave most open. It should be dark at hard data "
        "only, and grow with the distance from them over about the range of the variogram."
    )
    return [
        _figure(plots.maps(found), maps, "Maps of the mean or of the shares of categories", "maps.png"),
        _figure(plots.openness(found), openness, "A map of how much the realisations differ", "entropy.png"),
    ]


def variograms(found: Summary) -> Figure:
    """Variograms of the values or of the categories."""
    if len(found.categories) == 0:
        table, names, of = found.variograms, [""], "the values"
    else:
        shown = plots.mapped(found)
        table, names = found.variograms[:, shown], [f"category {found.categories[k]}" for k in shown]
        of = "each category's indicator" + (" (of two categories both are the same)" if len(shown) == 1 else "")
    caption = (
        f"Variograms of {of} along both axes: half the mean squared difference of two pixels at a lag. The training "
        "image's line should run inside the band of the realisations. A band that rises later means bodies that are "
        "too large, one that rises earlier bodies that are too small or noise; waves are regular distances."
    )
    plot = plots.lagged(found, table, names, "variogram")
    return _figure(plot, caption, "Variograms of the training image and the realisations", "variograms.png")


def connected(images: Array, own: Array, found: Summary) -> list[Part]:
    """Connectivity functions, and figures of the categories."""
    shown = plots.drawn(found)
    names = [f"category {found.categories[k]}" for k in shown]
    curves = (
        "The connectivity function: of two pixels at a lag that both have the category, the share that lies in one "
        "connected component (pixels hang together by their sides). A variogram cannot tell whole channels from broken "
        "ones; here, a band below the line of the training image means that its bodies are broken, one above "
        "that they run together. A smaller image cuts bodies apart, so compare images of one size where you can."
    )
    strips = (
        "For each category its share, its connected components, the share of the largest, and its dead ends: a "
        "stroke for each realisation. The training image's diamond should lie among the strokes. Many components are "
        "specks, and many dead ends are channels that break off."
    )
    plot = plots.lagged(found, found.connectivity[:, shown], names, "connectivity")
    parts: list[Part] = [
        _figure(plot, curves, "Connectivity functions of the training image and the realisations", "connectivity.png"),
        _figure(plots.strips(found), strips, "Figures of each category, for all realisations", "figures.png"),
        _table(found),
    ]
    return parts if not np.isfinite(found.dead_ends).all() else [*parts, _ends(images, own, found)]


def _table(found: Summary) -> Table:
    rows = []
    for k, category in enumerate(found.categories):
        for name, column in (("training image", slice(-1, None)), ("realisations", slice(0, -1))):
            tables = (found.shares, found.components, found.largest, found.dead_ends)
            rows.append([f"{category}, {name}", *(_spread(table[k, column]) for table in tables)])
    header = ("Category", "Share", "Components in 10,000 pixels", "Share of the largest", "Dead ends in 10,000 pixels")
    return Table("Figures of the categories", header, rows, "Realisations: mean ± standard deviation.")


def _spread(values: NDArray[np.float64]) -> str:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return "n/a"
    return f"{known.mean():.3f}" + (f" ± {known.std(ddof=1):.3f}" if len(known) > 1 else "")


def _ends(images: Array, own: Array, found: Summary) -> Figure:
    rarest = int(found.shares[:, -1].argmin())
    category = found.categories[rarest]
    factor = plots.factor_of(own.shape, images.shape[1:])
    shown = [("the training image", own), *((f"realisation {i}", one) for i, one in enumerate(images[:MARKED]))]
    pictures = []
    for name, one in shown:
        places = dead_end_places(one, category)
        picture = plots.magnified(plots.coloured(one, found.categories, (0.0, 1.0)), factor)
        pictures.append((f"{name}: {len(places)}", plots.marked(picture, places, factor)))
    caption = (
        f"The dead ends of category {category} that are counted, in rings: free ends of its skeleton, without short "
        f"spurs and without those within {MARGIN} pixels of the border."
    )
    return Figure(caption, encoded(contact_sheet(pictures, columns=3)), "Images with their dead ends", "dead-ends.png")


def distances(found: Summary) -> list[Part]:
    """The analysis of distance."""
    one = found.anodi
    levels = [[f"{1 << level}", *_cells(*row)] for level, row in enumerate(one.by_level)]
    rows = [["all, weighted", *_cells(one.variety, one.likeness)], *levels]
    note = (
        "Mean Jensen-Shannon distances between histograms of small patterns, 0 (the same patterns as often) to 1 (none "
        "in common): between two realisations, and between a realisation and the training image. The first column is "
        "how far apart the pixels of a pattern are; each doubling weighs half. After the analysis of distance of Tan, "
        "Tahmasebi and Caers (2014), simplified."
    )
    words = (
        "Variety is to be large and the distance from the training image small. A ratio of about 1 is that of images "
        "that are as different from one another as from the training image, as other images of the same kind are; far "
        "below 1 the realisations are more alike than that, or all of them miss something."
    )
    caption = (
        "The same distances as a map: two images are about as far apart as their patterns differ. The training image "
        "should lie within the cloud; a cloud beside it means a fault that all realisations share, and a narrow cloud "
        "little variety."
    )
    header = ("Pixels apart", "Between realisations", "From the training image", "Ratio")
    table = Table("Distances", header, rows, note)
    plot = _figure(plots.distances(found), caption, "Realisations and training image as points", "distances.png")
    return [Text(words), table, plot]


def _cells(variety: float, likeness: float) -> list[str]:
    ratio = variety / likeness if likeness > 0 else float("nan")
    return [f"{value:.3f}" if np.isfinite(value) else "n/a" for value in (variety, likeness, ratio)]
