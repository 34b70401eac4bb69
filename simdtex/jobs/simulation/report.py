# SPDX-License-Identifier: BSD-3-Clause
"""The reports of an ensemble, of pictures or volumes: realisations, uncertainty, likeness to the training image."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import fields
from itertools import product
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import ArrayLike, NDArray

from simdtex.figures.page import FAINT, INK, Figure, Part, Section, check_folder, legend, new_figure, tidy, write_report
from simdtex.figures.sheet import contact_sheet
from simdtex.figures.tables import Table, number_text
from simdtex.io.image import to_display
from simdtex.io.rasters import axis_place
from simdtex.jobs.simulation import uncertainty
from simdtex.jobs.simulation.ensemble import Summary, connectivity, copies, summary, variogram
from simdtex.jobs.synthesis.report import WINDOW
from simdtex.model.display import category_colours, source_colours

if TYPE_CHECKING:
    from xarray import DataArray

Array = NDArray[Any]
Floats = NDArray[np.float64]

SHOWN = 5  # realisations shown with the training image
MOST_PANELS = 6  # categories drawn, those with the largest shares of the training image
SHOWN_SIDE = 300  # smaller images are enlarged by a whole factor, pixels
MAP_INCHES = 3.4  # of a map's longer side, inches
THEIRS, OWN = "#0072B2", "#D55E00"  # realisations, and the training image
QUANTILES = 0.1, 0.5, 0.9
LAGS = 1, 2, 4, 8, 16  # of variograms that are checked, pixels
AXES = ("z", "y", "x")
CUTS = "", ", P10", ", P50", ", P90"


def write_ensemble(
    folder: str | os.PathLike[str],
    training: ArrayLike,
    ensemble: ArrayLike,
    *,
    data: ArrayLike | None = None,
    categories: Sequence[int] | None = None,
    command: str = "",
) -> None:
    """Write the report of an ensemble: ``index.html``, PNG pictures, ``results.json``; about 3 s for the pictures.

    Parameters
    ----------
    folder : path
        See `simdtex.figures.page.check_folder`.
    training : array_like, (rows, cols)
        The training image.
    ensemble : xarray.DataArray or array_like, (realisations, rows, cols)
        That of `simdtex.simulate` with coordinates on the ground has them on all axes. Row 0 is the smallest y, and
        north is at the top.
    data : array_like, (m, 3), optional
        Hard data: x (column), y (row), both in pixels of a realisation, and the value there.
    categories : sequence of int, optional
        The values that are categories, as in `simdtex.jobs.simulation.ensemble.categories_of`.
    command : str
        The command line, if there is one.

    Raises
    ------
    ValueError
        The folder cannot be written, the arrays do not match, or a datum lies outside.
    """
    check_folder(folder)
    found = summary(np.asarray(ensemble), training, data=data, categories=categories)
    made, own = uncertainty.named(ensemble, "realisation", "y", "x"), np.asarray(training)
    images, categorical, names = made.values, len(found.categories) > 0, found.categories[_mapped(found)].tolist()
    shown = images[:, ::-1], own[::-1]
    points = _on_ground(made, found.data)
    sections = [
        Section("The realisations", [_realisations(*shown, found)]),
        Section("Uncertainty", _uncertainty(made, names, points, found)),
        *_measured(made, names, points),
        *([] if categorical else [_histograms(images, own)]),
        Section("Variograms", [_variograms(made, found)]),
        *([Section("Connectivity of the categories", _connectivity(made, found))] if categorical else []),
        Section("Variety and likeness", _distances(found)),
        Section("Copies", _copies(*shown, found)),
    ]
    kind = f"{len(found.categories)} categories" if categorical else "continuous values"
    lead = (
        f"{len(images)} realisations of {images.shape[2]} x {images.shape[1]} pixels, {kind}, and a training image "
        f"of {own.shape[1]} x {own.shape[0]}.\n\n{_kept(found)}"
    )
    results = {
        **{one.name: getattr(found, one.name) for one in fields(Summary) if one.name not in ("open", "anodi")},
        "anodi": found.anodi._asdict(),
        "mean_open": found.open.mean(),
        "shape": images.shape,
        "training_shape": own.shape,
    }
    write_report(folder, "An ensemble of realisations", lead, sections, results, command)


def _kept(figures: Summary) -> str:
    """Return a sentence on whether the hard data are kept."""
    number, realisations = len(figures.data), len(figures.misses)
    data = "hard datum" if number == 1 else f"{number} hard data"
    if number == 0:
        return "There are no hard data."
    if not figures.misses.any():
        return f"Every realisation keeps the {data}."
    if len(figures.categories) == 0:
        return f"Not every realisation keeps the {data}: the largest RMS error is {figures.misses.max():.3g}."
    share, bad = figures.misses.sum() / (number * realisations), np.count_nonzero(figures.misses)
    return f"Of the {data}, {share:.1%} are missed on average, in {bad} of the {realisations} realisations."


def _drawn(shares: Floats) -> list[int]:
    """Return the numbers of the categories that are drawn: all, or those with most of the training image."""
    return sorted(np.argsort(-shares[:, -1], kind="stable")[:MOST_PANELS].tolist())


def _mapped(figures: Summary) -> list[int]:
    """Return the categories that have a map; of two, the second is enough."""
    return [1] if len(figures.categories) == 2 else _drawn(figures.shares)


def _realisations(images: Array, own: Array, figures: Summary) -> Figure:
    """Return the training image and some realisations, in one scale."""
    number = min(SHOWN, len(images))
    limits, palette = (float(own.min()), float(own.max())), category_colours(len(figures.categories))
    shown = []
    for label, image in [("the training image", own), *((f"realisation {i}", images[i]) for i in range(number))]:
        if len(figures.categories) == 0:
            picture = to_display(image.astype(np.float64), limits)
        else:
            picture = palette[(image[..., np.newaxis] == figures.categories).argmax(axis=-1)]
        shown.append((label, picture))
    return Figure(
        "realisations.png",
        contact_sheet(shown, columns=3, scale=-(-SHOWN_SIDE // max(*own.shape, *images.shape[1:]))),
        f"The training image and the first {number} of {len(images)} realisations, in one scale. No "
        "figure below replaces this look: shapes, widths and directions should be those of the training image, and no "
        "realisation should repeat a piece of it, or of another, as a whole.",
    )


def _on_ground(made: DataArray, data: Floats | None) -> Floats:
    """Return hard data, (m, 3 or 4), with the coordinates of their cells in place of column, row and layer."""
    places = np.array([axis_place(made, axis) for axis in "xyz"[: made.ndim - 1]])
    data = np.empty((0, made.ndim)) if data is None else data
    return np.column_stack([places[:, 0] + places[:, 1] * data[:, :-1], data[:, -1]])


def _uncertainty(made: DataArray, names: list[Any], data: Floats, found: Summary) -> list[Part]:
    """Return maps of the mean and quantiles, or of probabilities, and of the standard deviation or the entropy."""
    dots = " The dots are the hard data in the colours of the map: one that is kept has the colour of its pixel."
    spread, values = made[0].copy(data=found.open), data[:, 2]
    if not names:
        planes = [uncertainty.e_type(made), *uncertainty.quantiles(made, QUANTILES)]
        panels = {plane.attrs["long_name"] + cut: (plane, values) for plane, cut in zip(planes, CUTS, strict=True)}
        every = np.concatenate([values, *(plane.values.ravel() for plane in planes)])
        limits = float(every.min()), float(every.max())
        title, most = f"standard deviation of {uncertainty.label(made)}", found.open.max() or 1.0
        what = "The mean of the realisations at every pixel (E-type), and their quantiles 0.1, 0.5 and 0.9."
        how = "The standard deviation of the realisations at every pixel, in the unit of the values"
    else:
        planes = [uncertainty.probability(made, name) for name in names]
        known = [(values == name) * 1.0 for name in names]
        panels = {plane.attrs["long_name"]: (plane, of) for plane, of in zip(planes, known, strict=True)}
        limits, title, most = (0.0, 1.0), "entropy, bits", float(np.log2(max(2, len(found.categories))))
        what = "The share of the realisations in which a pixel has the category: its probability there."
        how = f"The entropy of every pixel over the categories, {found.open.mean():.2f} bits on average"
    return [
        Figure(
            "maps.png",
            _maps(panels, data, "viridis", limits),
            f"{what}{dots if len(data) else ''} Around data the map follows them; far from them it should be "
            "even, for nothing is known there. Structure far from any datum means that realisations repeat each other.",
        ),
        Figure(
            "entropy.png",
            _maps({title: (spread, None)}, data, "magma", (0.0, most)),
            f"{how}: dark where all realisations agree, light where they differ most. It should be dark at hard data "
            "only, and grow with the distance from them over about the range of the variogram.",
        ),
    ]


def _maps(
    panels: dict[str, Any], data: Floats, colours: str, limits: tuple[float, float], across: int | None = None
) -> Plot:
    """Plot planes by title, each with the hard data as dots in the colours of their values, or hollow if None."""
    rows, cols = np.max([plane.shape for plane, _ in panels.values()], axis=0)
    across = across or (2 if len(panels) == 4 else min(3, len(panels)))
    down = -(-len(panels) // across)
    wide, high = MAP_INCHES * cols / max(rows, cols), MAP_INCHES * rows / max(rows, cols)
    figure = new_figure(across * (max(wide, 1.6) + 0.4) + 1.2, down * (max(high, 1.0) + 0.65))
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    low, high = limits
    for axes, (title, (plane, values)) in zip(grid, panels.items(), strict=False):
        how = {"cmap": colours, "vmin": low, "vmax": high, "add_colorbar": False}
        image = plane.plot.imshow(ax=axes, **how)
        (_, up), (_, along) = (axis_place(plane, axis) for axis in plane.dims)
        # cells of a plane through layers are squares
        axes.locator_params(axis="x", nbins=4)  # coordinates on the ground are long
        axes.set_aspect(1 if "y" in plane.dims[:1] else along / up)
        axes.set_title("")
        axes.set_title(title, loc="left", fontsize=10, color=INK)
        axes.tick_params(colors=FAINT, labelcolor=INK, labelsize=8)
        inside: Any = "none"
        if values is not None:
            inside = matplotlib.colormaps[colours](np.clip((values - low) / ((high - low) or 1.0), 0, 1))
        axes.scatter(data[:, 0], data[:, 1], s=26, c=inside, edgecolors="white", linewidths=1.8)
        axes.scatter(data[:, 0], data[:, 1], s=34, c="none", edgecolors="black", linewidths=0.7)
    figure.colorbar(image, ax=[*grid[: len(panels)]], shrink=0.85, pad=0.02, label=plane.attrs.get("units", ""))
    return figure


def _measured(made: DataArray, names: list[Any], data: Floats) -> list[Section]:
    """Return volumes of categories at wells, which are hard data on the ground, and the standard error of maps."""
    rows: list[dict[str, str]] = []
    drawn: dict[str, Any] = {}
    sections = []
    for name in names:
        hits = data[data[:, -1] == name, :-1]
        wells = [(f"x {x:g}, y {y:g}", hits[(hits[:, :2] == (x, y)).all(1)]) for x, y in np.unique(hits[:, :2], axis=0)]
        for well, at in [(f"all {len(wells)}", hits), *wells[:SHOWN]] if wells else []:
            curve = uncertainty.connected_volume(made, name, at)
            drawn.setdefault(str(name), curve)
            cuts = map(number_text, curve.quantile(QUANTILES).values)
            rows.append({"Category": str(name), "Well": well} | dict(zip(("P10", "P50", "P90"), cuts, strict=True)))
    if drawn:
        figure = new_figure(1 + 3.4 * len(drawn), 3)
        for axes, curve in zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn.values(), strict=True):
            curve.plot.hist(ax=axes, color=THEIRS)
            tidy(axes, "", axes.get_xlabel(), "realisations")
            for cut in curve.quantile(QUANTILES).values:
                axes.axvline(cut, color=OWN, linestyle="--")
        caption = "Volumes (areas of a map) of all bodies that a well meets. The dashed lines are P10, P50 and P90."
        note = (
            "Cells are connected by their sides. A tenth of the realisations are below P10, which is P90 of reserves."
        )
        table = Table(f"Connected volumes, {curve.attrs.get('units', '')}".rstrip(", "), rows, note)
        parts: list[Part] = [Figure("volumes.png", figure, caption), table]
        sections.append(Section("Volumes connected to wells", parts))
    if (n := len(made)) > 1:
        curves: list[Any] = [uncertainty.standard_error(made, name) for name in names or [None]]
        figure = new_figure(5.6, 3)
        axes = figure.subplots()
        for name, curve in zip(names or [None], curves, strict=True):
            curve.plot.line(ax=axes, marker=".", label=name)
        tidy(axes, "", axes.get_xlabel(), axes.get_ylabel())
        axes.set_ylim(0)
        if len(curves) > 1:
            axes.legend(title="category", frameon=False)
        most = max(float(curve[-1]) for curve in curves)
        after = f"{most:.2g} after {n} realisations, half of it after {4 * n}"
        caption = f"Standard error of the map, over all cells: {after}."
        sections.append(Section("How many realisations", [Figure("error.png", figure, caption)]))
    return sections


def _vertical(made: DataArray, training: Array, names: Array) -> Section:
    """Return the shares of categories layer by layer, of the realisations and of the training image."""
    both: list[Any] = [uncertainty.vertical_proportions(data, names.tolist()) for data in (made, training)]
    theirs, own = both
    own = own.assign_coords(z=np.linspace(float(made["z"][0]), float(made["z"][-1]), len(training)))
    shown = np.sort(np.argsort(-own.values.mean(1), kind="stable")[:MOST_PANELS])
    figure = new_figure(1 + 2.4 * len(shown), 3.6)
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for k, axes in zip(shown, panels, strict=True):
        for line in theirs[k]:
            line.plot.line(y="z", ax=axes, color=THEIRS, alpha=0.4, label="realisations")
        own[k].plot.line(y="z", ax=axes, color=OWN, linestyle="--", label="training image")
        axes.set_title("")
        tidy(axes, f"category {names[k]}", "share of the layer", axes.get_ylabel() if axes is panels[0] else "")
    if "cell_y" not in made.attrs:
        axes.invert_yaxis()
    legend(figure, panels[0])
    caption = (
        "Vertical proportion curves: the share of each category in each layer, beside the training image's, whose "
        "layers are stretched to those of the realisations if there are more or fewer."
    )
    return Section("Vertical proportions", [Figure("vertical.png", figure, caption)])


def _variograms(made: DataArray, found: Summary) -> Figure:
    if len(found.categories) == 0:
        table, names, of = found.variograms, [""], "the values"
    else:
        shown = _mapped(found)
        table, names = found.variograms[:, shown], [f"category {found.categories[k]}" for k in shown]
        of = "each category's indicator" + (" (of two categories both are the same)" if len(shown) == 1 else "")
    return Figure(
        "variograms.png",
        _lagged(found.lags, table, names, "variogram", made),
        f"Variograms of {of} along both axes: half the mean squared difference of two pixels at a lag. The training "
        "image's line should run inside the band of the realisations. A band that rises later means bodies that are "
        "too large, one that rises earlier bodies that are too small or noise; waves are regular distances.",
    )


def _lagged(lags: Array, table: Floats, names: Sequence[str], label: str, made: DataArray) -> Plot:
    """Plot functions of the lag, (axes, K, n + 1, L): a row for each name, a column for each axis of a realisation."""
    ways = made.dims[1:]
    unit = "" if "cell_y" in made.attrs else "voxels" if len(ways) > 2 else "pixels"
    figure = new_figure(2.2 + 3.0 * len(ways), 0.5 + 2.35 * len(names))
    grid = figure.subplots(len(names), len(ways), sharey="row", sharex="col", squeeze=False)
    for row, (name, panels) in enumerate(zip(names, grid, strict=True)):
        for axis, (way, axes) in enumerate(zip(ways, panels, strict=True)):
            side = axis_place(made, str(way))[1]
            theirs, own = table[axis, row, :-1], table[axis, row, -1]
            known = np.isfinite(theirs).any(axis=0)
            low, middle, high = (how(theirs[:, known], axis=0) for how in (np.nanmin, np.nanmedian, np.nanmax))
            axes.fill_between(
                side * lags[known], low, high, color=THEIRS, alpha=0.22, linewidth=0, label="realisations, all"
            )
            axes.plot(side * lags[known], middle, color=THEIRS, linewidth=1.3, label="realisations, median")
            axes.plot(side * lags, own, color=OWN, linewidth=1.8, linestyle="--", label="training image")
            title = f"{name}, along {way}" if name else f"along {way}"
            below = f"lag, {made[way].attrs.get('units', unit)}".rstrip(", ") if row == len(names) - 1 else ""
            tidy(axes, title, below, label if axes is panels[0] else "")
        panels[0].set_ylim(0, 1.05 * (np.nanmax(table[:, row]) or 1.0) if np.isfinite(table[:, row]).any() else 1.0)
    legend(figure, grid[0, 0])
    return figure


def _connectivity(made: DataArray, found: Summary) -> list[Part]:
    shown = _drawn(found.shares)
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
            _lagged(found.lags, found.connectivity[:, shown], names, "connectivity", made),
            "The connectivity function: of two pixels at a lag that both have the category, the share that lies in one "
            "connected component (pixels are connected by their sides). A variogram cannot tell whole channels from "
            "broken ones; here, a band below the line of the training image means that its bodies are broken, one "
            "above that they merge. A smaller image cuts bodies apart, so compare images of one size if you can.",
        ),
        _figures(found.categories, figures, note),
        _reached(made, found.categories, found.shares),
    ]


def _reached(made: DataArray, categories: Array, shares: Floats) -> Figure:
    """Return the shares of categories (K, n + 1) that realisations have and aim at, and the training image has."""
    shown, numbers = _drawn(shares), made["realisation"].values
    panels = (figure := new_figure(1 + 2.8 * len(shown), 3)).subplots(1, len(shown), squeeze=False)[0]
    asked = made.attrs.get("shares_asked", "").split() or [None] * len(categories)
    for k, axes in zip(shown, panels, strict=True):
        if (aims := made.coords.get(f"share_{categories[k]}", asked[k])) is not None:
            aimed = np.full(len(numbers), aims, float)
            axes.plot(numbers, aimed, "o", color=THEIRS, fillstyle="none", label="aimed at")
        axes.plot(numbers, shares[k, :-1], ".", color=THEIRS, label="realisations")
        axes.axhline(shares[k, -1], color=OWN, linestyle="--", label="training image")
        tidy(axes, f"category {categories[k]}", "realisation", "share" if axes is panels[0] else "")
        axes.xaxis.get_major_locator().set_params(integer=True)
    legend(figure, panels[0])
    return Figure("shares.png", figure, "Shares that realisations have and aim at. Areas vary too little if shares do.")


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
    anodi = found.anodi
    scales = {"all, weighted": (anodi.variety, anodi.likeness)}
    scales |= {f"{1 << level}": (variety, likeness) for level, (variety, likeness) in enumerate(anodi.by_level)}
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
            contact_sheet([(label, source_colours(index_map, own.shape)) for label, index_map in shown], columns=2),
            "The index map: a colour for each place in the training image, and the pixels of the first realisation "
            "that lie in a copied window, in the colours of where it is first found. Black ones lie in none.",
        ),
    ]


def _index_map(places: NDArray[np.int32], cols: int) -> NDArray[np.int32]:
    """Return the position of each pixel of copied windows in a training image with ``cols`` columns; -1 elsewhere."""
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


def unlike(images: Array, own: Array) -> str:
    """Return in which figures continuous realisations are far from the training image, as a sentence; "" in none."""
    every, values = (np.asarray(one, np.float64) for one in (images, own))
    lags = [lag for lag in LAGS if lag < min(*values.shape[-2:], *every.shape[-2:])]

    def along(field: Array) -> Floats:
        return np.asarray(np.mean([variogram(field, axis, lags[-1])[lags] for axis in (-2, -1)], 0))

    spread, usual = values.std(), along(values) if lags else np.zeros(1)
    if not (spread and usual.all()):
        return ""
    found = [("the mean", 1 + (every.mean() - values.mean()) / max(abs(values.mean()), spread), 0.06)]
    found.append(("the standard deviation", np.mean([field.std() for field in every]) / spread, 0.1))
    ratios = np.mean([along(field) for field in every], 0) / usual
    found += [(f"the variogram at lag {lag}", ratio, 0.16) for lag, ratio in zip(lags, ratios, strict=True)]
    far = [f"{name} is {ratio:.2f} times" for name, ratio, most in found if abs(ratio - 1) > most]
    return f"Against the training image, {', '.join(far)} as large." if far else ""


def _histograms(images: Array, own: Array) -> Section:
    """Return the histograms of continuous realisations and of the training image, and what is far off."""
    bins, figure = np.histogram_bin_edges(np.append(images, own), 40).tolist(), new_figure(5.6, 3)
    axes = figure.subplots()
    for values, colour, name in ((images, THEIRS, "realisations"), (own, OWN, "training image")):
        axes.hist(values.ravel(), bins, density=True, histtype="step", color=colour, label=name)
    tidy(axes, "", "value", "density")
    axes.legend(frameon=False)
    caption = f"Histograms of all realisations and of the training image. {unlike(images, own)}".strip()
    return Section("Histograms", [Figure("histograms.png", figure, caption)])


SLICED = 2
"""Realisations whose slices are shown."""


def write_volumes(
    folder: str | os.PathLike[str],
    training: NDArray[Any],
    ensemble: Any,
    categorical: bool,
    command: str = "",
    data: Floats | None = None,
) -> None:
    """Write the report of realisations of a volume; ``data`` (m, 4) are hard data: column, row, layer and value."""
    made = uncertainty.named(ensemble, "realisation", *AXES)
    names = np.unique(training) if categorical else np.zeros(0, training.dtype)
    images, drawn = [*made.values, training], names[-1] if categorical else None
    fields = [(image == drawn if categorical else image).astype(np.float64) for image in images]
    what = f"category {drawn}" if categorical else "the values"
    limits = (float(fields[-1].min()), float(fields[-1].max()))
    along = {axis: axis_place(made, axis)[1] * np.arange(n) for axis, n in zip(AXES, training.shape, strict=True)}
    own = uncertainty.named(fields[-1], *AXES, coords=along, attrs=made.attrs)
    cuts = [] if categorical else uncertainty.quantiles(made, QUANTILES)
    middle = [uncertainty.probability(made, names[-1])] if categorical else [uncertainty.e_type(made), *cuts]
    shown = [
        ("training image", own),
        *((f"{field.attrs['long_name']}{cut}", field) for field, cut in zip(middle, CUTS, strict=False)),
    ]
    shown += [(f"realisation {k}", made[k].copy(data=fields[k])) for k in range(min(SLICED, len(made)))]
    panels: dict[str, Any] = {}
    for name, field in shown:
        for axis in AXES:
            at = field[axis][field.sizes[axis] // 2]
            title = f"{name}, {axis} = {float(at):g} {at.attrs.get('units', '')}".rstrip()
            panels[title] = field.isel({axis: field.sizes[axis] // 2}), None
    lags = np.arange(max(1, min(*training.shape, *made.shape[1:]) // 3) + 1)

    def lagged(label: str, functions: list[Any]) -> Figure:
        table = np.moveaxis(np.array(functions), 1, 0)[:, None]
        of = f"{label.capitalize()} of {what} along z, y and x"
        caption = f"{of}. The training image's line should run inside the band."
        return Figure(f"{label}.png", _lagged(lags, table, [""], label, made), caption)

    variograms = [np.array([variogram(field, axis, len(lags) - 1) for axis in range(3)]) for field in fields]
    slices = Figure(
        "slices.png",
        _maps(panels, np.empty((0, 2)), "viridis", limits, 3),
        f"The middle slices across z, y and x of {what}: the training image, the uncertainty of the realisations, and "
        "realisations.",
    )
    sections = [Section("Slices", [slices]), *_measured(made, names[-1:].tolist(), _on_ground(made, data))]
    sections.append(_vertical(made, training, names) if categorical else _histograms(made.values, training))
    sections.append(Section("Variograms", [lagged("variograms", variograms)]))
    results: dict[str, Any] = {"shape": made.shape, "training_shape": training.shape}
    results["variograms"] = [variograms[-1], *variograms[:-1]]
    if categorical:
        bodies = [[connectivity(image, name, len(lags) - 1) for image in images] for name in names]
        figures = {
            "Share": np.array([[(image == name).mean() for image in images] for name in names]),
            "Components in 10,000 voxels": np.array([[body.components for body in row] for row in bodies]),
            "Share of the largest": np.array([[body.largest for body in row] for row in bodies]),
        }
        functions = [body.function for body in bodies[-1]]
        table = _figures(names, figures, " Voxels are connected by their faces.")
        shares = _reached(made, names, figures["Share"])
        sections.append(Section("Connectivity of the categories", [lagged("connectivity", functions), table, shares]))
        results |= {"connectivity": [functions[-1], *functions[:-1]], "categories": names}
    size = " x ".join(str(side) for side in made.shape[:0:-1])
    lead = f"{len(made)} realisations of {size} voxels, and a training image of {training.shape[::-1]}."
    write_report(folder, "Realisations of a volume", lead, sections, results, command)
