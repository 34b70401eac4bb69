# SPDX-License-Identifier: BSD-3-Clause
"""The reports of an ensemble, of pictures or volumes: realisations, uncertainty, likeness to the training image."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import fields
from itertools import product
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import ArrayLike, NDArray

from simdtex.experiments.ensemble import WINDOW, Summary, connectivity, copies, summary, variogram
from simdtex.io.image import to_display
from simdtex.model.display import category_colours, source_colours
from simdtex.report.page import FAINT, INK, Figure, Part, Section, check_folder, legend, new_figure, tidy, write_report
from simdtex.report.sheet import LEAST_SIDE, contact_sheet
from simdtex.report.tables import Table, number_text

Array = NDArray[Any]
Floats = NDArray[np.float64]

SHOWN = 5  # realisations shown with the training image
MOST_PANELS = 6  # categories drawn, those with the largest shares of the training image
SHOWN_SIDE = 300  # smaller images are enlarged by a whole factor, pixels
MAP_INCHES = 3.4  # of a map's longer side, inches
THEIRS, OWN = "#0072B2", "#D55E00"  # realisations, and the training image
ACROSS = {1: "to the right", 0: "down"}  # the axes of a picture


def write_ensemble(
    folder: str | os.PathLike[str],
    training: ArrayLike,
    ensemble: ArrayLike,
    *,
    data: ArrayLike | None = None,
    categories: Sequence[int] | None = None,
    command: str = "",
    upward: bool = False,
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
        The values that are categories; by default those of the training image if they are integers and at most 16. An
        empty sequence means continuous values.
    command : str
        The command line, if there is one.
    upward : bool
        Draw row 0 at the bottom, as of a map, whose rows ascend to the north.

    Raises
    ------
    ValueError
        The folder cannot be written, the arrays do not match, or a datum lies outside.

    Notes
    -----
    The time is that of `simdtex.experiments.ensemble` and about 3 s for the pictures.
    """
    check_folder(folder)
    found = summary(ensemble, training, data=data, categories=categories)
    images, own = np.asarray(ensemble), np.asarray(training)
    categorical = len(found.categories) > 0
    shown = (images[:, ::-1], own[::-1]) if upward else (images, own)
    with matplotlib.rc_context({"image.origin": "lower" if upward else "upper"}):
        uncertainty = _uncertainty(found)
    sections = [
        Section("The realisations", [_realisations(*shown, found)]),
        Section("Uncertainty", uncertainty),
        Section("Variograms", [_variograms(found)]),
        *([Section("Connectivity of the categories", _connectivity(found))] if categorical else []),
        Section("Variety and likeness", _distances(found)),
        Section("Copies", _copies(*shown, found)),
    ]
    kind = f"{len(found.categories)} categories" if categorical else "continuous values"
    lead = (
        f"{len(images)} realisations of {images.shape[2]} x {images.shape[1]} pixels, {kind}, and a training image "
        f"of {own.shape[1]} x {own.shape[0]}.\n\n{_kept(found)}"
    )
    results = {
        **{one.name: getattr(found, one.name) for one in fields(Summary) if one.name not in ("maps", "open", "anodi")},
        "anodi": found.anodi._asdict(),
        "mean_open": found.open.mean(),
        "shape": images.shape,
        "training_shape": own.shape,
    }
    write_report(folder, "An ensemble of realisations", lead, sections, results, command)


def _kept(found: Summary) -> str:
    """Return a sentence on whether the hard data are kept."""
    number, realisations = len(found.data), len(found.misses)
    data = "hard datum" if number == 1 else f"{number} hard data"
    if number == 0:
        return "There are no hard data."
    if not found.misses.any():
        return f"Every realisation keeps the {data}."
    if len(found.categories) == 0:
        return f"Not every realisation keeps the {data}: the largest RMS error is {found.misses.max():.3g}."
    share, bad = found.misses.sum() / (number * realisations), np.count_nonzero(found.misses)
    return f"Of the {data}, {share:.1%} are missed on average, in {bad} of the {realisations} realisations."


def _drawn(found: Summary) -> list[int]:
    """Return the numbers of the categories that are drawn: all, or those of the largest shares."""
    return sorted(np.argsort(-found.shares[:, -1], kind="stable")[:MOST_PANELS].tolist())


def _mapped(found: Summary) -> list[int]:
    """Return the categories that have a map; of two, the second is enough."""
    return [1] if len(found.categories) == 2 else _drawn(found)


def _realisations(images: Array, own: Array, found: Summary) -> Figure:
    """Return the training image and some realisations, in one scale."""
    number = min(SHOWN, len(images))
    limits, palette = (float(own.min()), float(own.max())), category_colours(len(found.categories))
    shown = []
    for label, image in [("the training image", own), *((f"realisation {i}", images[i]) for i in range(number))]:
        if len(found.categories) == 0:
            picture = to_display(image.astype(np.float64), limits)
        else:
            picture = palette[(image[..., np.newaxis] == found.categories).argmax(axis=-1)]
        shown.append((label, picture))
    return Figure(
        "realisations.png",
        contact_sheet(shown, columns=3, scale=-(-SHOWN_SIDE // max(*own.shape, *images.shape[1:]))),
        f"The training image and the first {number} of {len(images)} realisations, in one scale. No "
        "figure below replaces this look: shapes, widths and directions should be those of the training image, and no "
        "realisation should repeat a piece of it, or of another, as a whole.",
    )


def _uncertainty(found: Summary) -> list[Part]:
    """Return maps of the mean or of the shares of categories, and of the entropy or the standard deviation."""
    dots = " The dots are the hard data in the colours of the map: one that is kept has the colour of its pixel."
    if len(found.categories) == 0:
        values = found.data[:, 2]
        limits = min([found.maps.min(), *values]), max([found.maps.max(), *values])
        maps = _maps(found, {"mean of the realisations": (found.maps[0], values)}, "viridis", limits)
        spread = _maps(found, {"standard deviation": (found.open, None)}, "magma", (0.0, found.open.max() or 1.0))
        what = "The mean of the realisations at every pixel."
        how = "The standard deviation of the realisations at every pixel, in the unit of the values"
    else:
        panels = {}
        for k in _mapped(found):
            category = found.categories[k]
            panels[f"share of category {category}"] = found.maps[k], (found.data[:, 2] == category).astype(float)
        maps = _maps(found, panels, "viridis", (0.0, 1.0))
        most = float(np.log2(max(2, len(found.categories))))
        spread = _maps(found, {"entropy, bits": (found.open, None)}, "magma", (0.0, most))
        what = "The share of the realisations in which a pixel has the category: its probability there."
        how = f"The entropy of every pixel over the categories, {found.open.mean():.2f} bits on average"
    return [
        Figure(
            "maps.png",
            maps,
            f"{what}{dots if len(found.data) else ''} Around data the map follows them; far from them it should be "
            "even, for nothing is known there. Structure far from any datum means that realisations repeat each other.",
        ),
        Figure(
            "entropy.png",
            spread,
            f"{how}: dark where all realisations agree, light where they differ most. It should be dark at hard data "
            "only, and grow with the distance from them over about the range of the variogram.",
        ),
    ]


def _maps(
    found: Summary, panels: dict[str, tuple[Floats, Floats | None]], colours: str, limits: tuple[float, float]
) -> Plot:
    """Plot maps by title, each with the hard data as dots in the colours of their values, or hollow if None."""
    rows, cols = found.open.shape
    across = 2 if len(panels) == 4 else min(3, len(panels))
    down = -(-len(panels) // across)
    wide, high = MAP_INCHES * cols / max(rows, cols), MAP_INCHES * rows / max(rows, cols)
    figure = new_figure(across * max(wide, 1.6) + 1.2, down * (max(high, 1.0) + 0.45))
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    x, y = found.data[:, 0], found.data[:, 1]
    low, high = limits
    for axes, (title, (picture, values)) in zip(grid, panels.items(), strict=False):
        image = axes.imshow(picture, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
        axes.set_title(title, loc="left", fontsize=10, color=INK)
        axes.tick_params(colors=FAINT, labelcolor=INK, labelsize=8)
        inside: Any = "none"
        if values is not None:
            inside = matplotlib.colormaps[colours](np.clip((values - low) / ((high - low) or 1.0), 0, 1))
        axes.scatter(x, y, s=26, c=inside, edgecolors="white", linewidths=1.8)
        axes.scatter(x, y, s=34, c="none", edgecolors="black", linewidths=0.7)
    figure.colorbar(image, ax=list(grid[: len(panels)]), shrink=0.85, pad=0.02)
    return figure


def _variograms(found: Summary) -> Figure:
    if len(found.categories) == 0:
        table, names, of = found.variograms, [""], "the values"
    else:
        shown = _mapped(found)
        table, names = found.variograms[:, shown], [f"category {found.categories[k]}" for k in shown]
        of = "each category's indicator" + (" (of two categories both are the same)" if len(shown) == 1 else "")
    return Figure(
        "variograms.png",
        _lagged(found.lags, table, names, "variogram", ACROSS, "pixels"),
        f"Variograms of {of} along both axes: half the mean squared difference of two pixels at a lag. The training "
        "image's line should run inside the band of the realisations. A band that rises later means bodies that are "
        "too large, one that rises earlier bodies that are too small or noise; waves are regular distances.",
    )


def _lagged(lags: Array, table: Floats, names: Sequence[str], label: str, ways: dict[int, str], unit: str) -> Plot:
    """Plot functions of the lag, (axes, K, n + 1, L): a row for each name, a column for each of some axes."""
    figure = new_figure(2.2 + 3.0 * len(ways), 0.5 + 2.35 * len(names))
    grid = figure.subplots(len(names), len(ways), sharey="row", sharex=True, squeeze=False)
    for row, (name, panels) in enumerate(zip(names, grid, strict=True)):
        for (axis, way), axes in zip(ways.items(), panels, strict=True):
            theirs, own = table[axis, row, :-1], table[axis, row, -1]
            known = np.isfinite(theirs).any(axis=0)
            low, middle, high = (how(theirs[:, known], axis=0) for how in (np.nanmin, np.nanmedian, np.nanmax))
            axes.fill_between(lags[known], low, high, color=THEIRS, alpha=0.22, linewidth=0, label="realisations, all")
            axes.plot(lags[known], middle, color=THEIRS, linewidth=1.3, label="realisations, median")
            axes.plot(lags, own, color=OWN, linewidth=1.8, linestyle="--", label="training image")
            title = f"{name}, {way}" if name else way
            tidy(axes, title, f"lag, {unit}" if row == len(names) - 1 else "", label if axes is panels[0] else "")
        panels[0].set_ylim(0, 1.05 * (np.nanmax(table[:, row]) or 1.0) if np.isfinite(table[:, row]).any() else 1.0)
    legend(figure, grid[0, 0])
    return figure


def _connectivity(found: Summary) -> list[Part]:
    shown = _drawn(found)
    names = [f"category {found.categories[k]}" for k in shown]
    figures = {
        "Share": found.shares,
        "Components in 10,000 pixels": found.components,
        "Share of the largest": found.largest,
        "Dead ends in 10,000 pixels": found.dead_ends,
    }
    note = " Many components are specks, and many dead ends are channels that break off."
    return [
        Figure(
            "connectivity.png",
            _lagged(found.lags, found.connectivity[:, shown], names, "connectivity", ACROSS, "pixels"),
            "The connectivity function: of two pixels at a lag that both have the category, the share that lies in one "
            "connected component (pixels are connected by their sides). A variogram cannot tell whole channels from "
            "broken ones; here, a band below the line of the training image means that its bodies are broken, one "
            "above that they merge. A smaller image cuts bodies apart, so compare images of one size if you can.",
        ),
        _figures(found.categories, figures, note),
    ]


def _figures(categories: Array, figures: dict[str, Floats], note: str) -> Table:
    """Return a table of figures (K, n + 1) of categories, by their headings."""
    rows = [
        {"Category": f"{category}, {name}"} | {head: _spread(table[k, column]) for head, table in figures.items()}
        for k, category in enumerate(categories)
        for name, column in (("training image", slice(-1, None)), ("realisations", slice(0, -1)))
    ]
    return Table("Figures of the categories", rows, f"Realisations: mean ± standard deviation.{note}")


def _spread(values: Floats) -> str:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return "n/a"
    return number_text(known.mean(), known.std(ddof=1) if len(known) > 1 else None)


def _distances(found: Summary) -> list[Part]:
    """Return the analysis of distance."""
    one = found.anodi
    scales = {"all, weighted": (one.variety, one.likeness)}
    scales |= {f"{1 << level}": (variety, likeness) for level, (variety, likeness) in enumerate(one.by_level)}
    rows = [
        {
            "Pixels apart": scale,
            "Between realisations": _decimal(variety),
            "From the training image": _decimal(likeness),
            "Ratio": _decimal(variety / likeness if likeness > 0 else np.nan),
        }
        for scale, (variety, likeness) in scales.items()
    ]
    note = (
        "Mean Jensen-Shannon distances between histograms of small patterns, 0 (the same patterns as often) to 1 (none "
        "in common): between two realisations, and between a realisation and the training image. The first column is "
        "how far apart the pixels of a pattern are; each doubling weighs half. After the analysis of distance of Tan, "
        "Tahmasebi and Caers (2014), simplified."
    )
    words = (
        "Variety should be large and the distance from the training image small. A ratio of about 1 is that of images "
        "that are as different from one another as from the training image, as other images of the same kind are; far "
        "below 1 the realisations are more alike than that, or all of them lack something."
    )
    return [words, Table("Distances", rows, note)]


def _copies(images: Array, own: Array, found: Summary) -> list[Part]:
    """Return the share of copied windows, and the index map of the first realisation that is shown."""
    if not np.isfinite(found.copied).any():
        return [f"No window of {WINDOW} x {WINDOW} pixels has several values."]
    words = (
        f"Of the windows of {WINDOW} x {WINDOW} pixels with more than one value, {_spread(found.copied)} stand in the "
        "training image, pixel by pixel the same. Where few pixels are in question, as of categories, other images of "
        "the same kind have some in common, too. Likeness and ratio above reward copies: read them beside this."
    )
    places = np.moveaxis(np.indices(own.shape), 0, -1)
    index = _index_map(copies(images[:1], own)[0], own.shape[1])
    source = np.where(index[..., np.newaxis] < 0, -1, np.stack([index // own.shape[1], index % own.shape[1]], -1))
    shown = [("places in the training image", places), ("realisation 0", source)]
    return [
        words,
        Figure(
            "copies.png",
            contact_sheet([(label, source_colours(one, own.shape)) for label, one in shown], columns=2),
            "The index map: a colour for each place in the training image, and the pixels of the first realisation "
            "that lie in a copied window, in the colours of where it is first found. Black ones lie in none.",
        ),
    ]


def _index_map(places: NDArray[np.int32], cols: int) -> NDArray[np.int32]:
    """Return the position of each pixel of a copied window in a training image with ``cols`` columns; -1 elsewhere.

    ``places`` (rows, cols) are those of the windows. A pixel in several windows belongs to the one in whose middle it
    is.
    """
    rows, wide = places.shape
    index = np.full((rows + WINDOW - 1, wide + WINDOW - 1), -1, np.int32)
    middle = (WINDOW - 1) / 2
    inside = sorted(product(range(WINDOW), repeat=2), key=lambda at: -((at[0] - middle) ** 2 + (at[1] - middle) ** 2))
    for down, right in inside:
        here = index[down : down + rows, right : right + wide]
        here[places >= 0] = places[places >= 0] + down * cols + right
    return index


def _decimal(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "n/a"


SLICED = 2
"""Realisations whose slices are shown."""

AXES = ("z", "y", "x")


def write_volumes(
    folder: str | os.PathLike[str],
    training: NDArray[Any],
    ensemble: NDArray[Any],
    categorical: bool,
    command: str = "",
    upward: bool = False,
) -> None:
    """Write the report of realisations of a volume: ``index.html``, PNG pictures, ``results.json``.

    ``training`` is (layers, rows, cols), and ``ensemble`` (realisations, layers, rows, cols). Of categories the last is
    drawn. ``upward``: y, or z, is drawn upward, as of a map. Cost: a few passes over each realisation for every lag, up
    to a third of the shortest side.
    """
    images, names = [*ensemble, training], np.unique(training) if categorical else np.zeros(0, training.dtype)
    fields = [(one == names[-1] if categorical else one).astype(np.float64) for one in images]
    what = f"category {names[-1]}" if categorical else "the values"
    limits = (float(fields[-1].min()), float(fields[-1].max()))
    shown = {"training image": fields[-1], f"mean of {len(ensemble)}": np.mean(fields[:-1], 0)}
    shown |= {f"realisation {k}": one for k, one in enumerate(fields[:-1][:SLICED])}
    sheet = [
        (f"{name}, {AXES[axis]} = {n // 2}", to_display(one.take(n // 2, axis)[:: -1 if upward else 1], limits))
        for name, one in shown.items()
        for axis, n in enumerate(one.shape)
    ]
    lags = np.arange(max(1, min(*training.shape, *ensemble.shape[1:]) // 3) + 1)
    along = {axis: f"along {name}" for axis, name in enumerate(AXES)}

    def lagged(label: str, functions: list[Any]) -> Figure:
        table = np.moveaxis(np.array(functions), 1, 0)[:, None]
        caption = (
            f"{label.capitalize()} of {what} along z, y and x. The training image's line should run inside the band."
        )
        return Figure(f"{label}.png", _lagged(lags, table, [""], label, along, "voxels"), caption)

    variograms = [np.array([variogram(one, axis, len(lags) - 1) for axis in range(3)]) for one in fields]
    slices = Figure(
        "slices.png",
        contact_sheet(sheet, columns=3, scale=-(-LEAST_SIDE // max(training.shape))),
        f"The middle slices across z, y and x of {what}: the training image, the mean of the realisations, and "
        "realisations. In the mean, grey is uncertain.",
    )
    sections = [Section("Slices", [slices]), Section("Variograms", [lagged("variograms", variograms)])]
    results: dict[str, Any] = {"shape": ensemble.shape, "training_shape": training.shape}
    results["variograms"] = [variograms[-1], *variograms[:-1]]
    if categorical:
        found = [[connectivity(one, name, len(lags) - 1) for one in images] for name in names]
        figures = {
            "Share": np.array([[(one == name).mean() for one in images] for name in names]),
            "Components in 10,000 voxels": np.array([[one.components for one in row] for row in found]),
            "Share of the largest": np.array([[one.largest for one in row] for row in found]),
        }
        functions = [one.function for one in found[-1]]
        table = _figures(names, figures, " Voxels are connected by their faces.")
        sections.append(Section("Connectivity of the categories", [lagged("connectivity", functions), table]))
        results |= {"connectivity": [functions[-1], *functions[:-1]], "categories": names}
    size = " x ".join(str(side) for side in ensemble.shape[:0:-1])
    lead = f"{len(ensemble)} realisations of {size} voxels, and a training image of {training.shape[::-1]}."
    write_report(folder, "Realisations of a volume", lead, sections, results, command)
