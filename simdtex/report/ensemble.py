# SPDX-License-Identifier: BSD-3-Clause
"""The report of an ensemble: its realisations beside the training image, what they leave open, and how like it they are."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import ArrayLike, NDArray

from simdtex import __version__
from simdtex.experiments.ensemble import Summary, dead_end_places, summary
from simdtex.experiments.ensemble.ends import MARGIN
from simdtex.report import ensemble_plots as plots
from simdtex.report.page import Figure, Section, Table, Text, check_folder, write_report
from simdtex.report.plots import figure_png
from simdtex.report.sheet import contact_sheet, encoded

__all__ = ["write_ensemble"]

Array = NDArray[Any]
Part = Text | Table | Figure

SHOWN = 5  # realisations beside the training image
MARKED = 2  # realisations with their dead ends


def write_ensemble(
    folder: str | os.PathLike[str],
    training: ArrayLike,
    ensemble: ArrayLike,
    *,
    data: ArrayLike | None = None,
    categories: Sequence[int] | None = None,
    command: str = "",
) -> None:
    """Write the report of an ensemble: ``index.html``, PNG pictures, ``results.json``.

    Parameters
    ----------
    folder : path
        See `simdtex.report.page.check_folder`.
    training : array_like, (rows, cols)
        The training image.
    ensemble : array_like, (realisations, rows, cols)
    data : array_like, (m, 3), optional
        Hard data: x (column), y (row), both in pixels of a realisation, and the value there.
    categories : sequence of int, optional
        The values that stand for categories; by default the training image's own if they are integers and at most
        16. An empty one says that the values are continuous.
    command : str
        The command line to show, where there was one.

    Raises
    ------
    ValueError
        The folder cannot be written, the arrays do not suit each other, a datum lies outside, or GSTools is not
        installed.

    Notes
    -----
    The time is that of `simdtex.experiments.ensemble.summary` and about 3 s for the pictures.
    """
    check_folder(folder)
    found = summary(ensemble, training, data=data, categories=categories)
    images, own = np.asarray(ensemble), np.asarray(training)
    categorical = len(found.categories) > 0
    sections = [
        Section("The realisations", _pictures(images, own, found)),
        Section("What they leave open", _open(found)),
        Section("Variograms", [_variograms(found)]),
        *([Section("How the categories hang together", _connected(images, own, found))] if categorical else []),
        Section("Variety and likeness", _distances(found)),
        *([Section("The command", [Text(f"$ {command}")])] if command else []),
    ]
    kind = f"{len(found.categories)} categories" if categorical else "continuous values"
    lead = (
        f"{len(images)} realisations of {images.shape[2]} x {images.shape[1]} pixels, {kind}, beside a training image "
        f"of {own.shape[1]} x {own.shape[0]}.\n\n{_kept(found)}"
    )
    results = {
        **{one.name: getattr(found, one.name) for one in fields(Summary) if one.name not in ("maps", "open", "anodi")},
        "anodi": found.anodi._asdict(),
        "mean_open": float(found.open.mean()),
        "shape": list(images.shape),
        "training_shape": list(own.shape),
        "command": command,
        "version": __version__,
    }
    write_report(folder, "An ensemble of realisations", lead, sections, results)


def _kept(found: Summary) -> str:
    """Whether the hard data are kept, in words."""
    number, realisations = len(found.data), len(found.misses)
    if number == 0:
        return "There are no hard data."
    if not found.misses.any():
        return f"Every realisation keeps all of the {number} hard data."
    if len(found.categories) == 0:
        worst = f"{found.misses.max():.3g}"
        return f"The {number} hard data are not all kept: a realisation is off by up to {worst} (root of the mean square)."
    share = found.misses.sum() / (number * realisations)
    bad = np.count_nonzero(found.misses)
    return f"Of the {number} hard data, {share:.1%} are missed on average, in {bad} of the {realisations} realisations."


def _figure(plot: Plot, caption: str, alt: str, file: str) -> Figure:
    return Figure(caption, figure_png(plot), alt, file)


def _pictures(images: Array, own: Array, found: Summary) -> list[Part]:
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


def _open(found: Summary) -> list[Part]:
    dots = (
        " The dots are the hard data in the colours of the map: one that is kept has the colour of its pixel."
        if len(found.data)
        else ""
    )
    if len(found.categories) == 0:
        what = "The mean of the realisations at every pixel."
        how = "The standard deviation of the realisations at every pixel, in the unit of the values"
    else:
        what = "The share of the realisations in which a pixel has the category: its probability, if the ensemble is right."
        how = f"The entropy of every pixel over the categories, {found.open.mean():.2f} bits on average"
    maps = (
        f"{what}{dots} Around data the map follows them; far from data it should be even, since nothing is known there. "
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


def _variograms(found: Summary) -> Figure:
    if len(found.categories) == 0:
        table, names, of = found.variograms, [""], "the values"
    else:
        shown = plots.mapped(found)
        table, names = found.variograms[:, shown], [f"category {found.categories[k]}" for k in shown]
        of = "each category's indicator" + (" (of two categories both are the same)" if len(shown) == 1 else "")
    caption = (
        f"Variograms of {of} along both axes: half the mean squared difference of two pixels at a lag. The training "
        "image's line should run inside the band of the realisations. A band that rises later means bodies that are too "
        "large, one that rises earlier bodies that are too small or noise; waves are regular distances."
    )
    plot = plots.lagged(found, table, names, "variogram")
    return _figure(plot, caption, "Variograms of the training image and the realisations", "variograms.png")


def _connected(images: Array, own: Array, found: Summary) -> list[Part]:
    shown = plots.drawn(found)
    names = [f"category {found.categories[k]}" for k in shown]
    curves = (
        "The connectivity function: of two pixels at a lag that both have the category, the share that lies in one "
        "connected piece (pixels hang together by their sides). A variogram cannot tell whole channels from broken ones; "
        "here, a band below the line of the training image means that its bodies are broken, one above that they run "
        "together. A smaller image cuts bodies apart, so compare images of one size where you can."
    )
    strips = (
        "For each category its share, its connected pieces, the share of the largest piece, and its dead ends: a stroke "
        "for each realisation. The training image's diamond should lie among the strokes. Many pieces are specks, and "
        "many dead ends are channels that break off."
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
    header = ("Category", "Share", "Pieces in 10,000 pixels", "Share of the largest", "Dead ends in 10,000 pixels")
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


def _distances(found: Summary) -> list[Part]:
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
    table = Table("Variety and likeness", header, rows, note)
    plot = _figure(plots.distances(found), caption, "Realisations and training image as points", "distances.png")
    return [Text(words), table, plot]


def _cells(variety: float, likeness: float) -> list[str]:
    ratio = variety / likeness if likeness > 0 else float("nan")
    return [f"{value:.3f}" if np.isfinite(value) else "n/a" for value in (variety, likeness, ratio)]
