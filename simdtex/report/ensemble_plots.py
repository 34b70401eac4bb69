# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of an ensemble's report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex.experiments.ensemble import Summary
from simdtex.io.image import to_display
from simdtex.report.plots import FAINT, INK, new_figure, tidy

Array = NDArray[Any]
Floats = NDArray[np.float64]

MOST_PANELS = 6  # categories drawn, those with the largest shares of the training image
SHOWN_SIDE = 300  # images smaller than this are enlarged by a whole factor, pixels
SIDE = 3.4  # of a map's longer side, inches
THEIRS, OWN = "#0072B2", "#D55E00"  # realisations, and the training image
END = (214, 0, 110)  # the mark of a dead end, sRGB; no category has it
# Light to dark, so that they tell each other apart in grey too; later ones begin anew.
_COLOURS = ["#f2ead3", "#1f4e79", "#8fbf9f", "#d08c3a", "#7a5195", "#4a4a4a", "#b8d4e8", "#5c7a29"]
_GOES = ("down", "to the right")


def drawn(found: Summary) -> list[int]:
    """The categories that are drawn, by number: all, or those of the largest shares, in their order."""
    order = np.argsort(-found.shares[:, -1], kind="stable")[:MOST_PANELS]
    return sorted(int(k) for k in order)


def mapped(found: Summary) -> list[int]:
    """The categories that have a map: of two, the second says all."""
    return [1] if len(found.categories) == 2 else drawn(found)


def coloured(image: Array, categories: Array, limits: tuple[float, float]) -> NDArray[np.uint8]:
    """An image (rows, cols) in the colours of its categories, or in grey from the smallest to the largest value."""
    if len(categories) == 0:
        grey = to_display(image.astype(np.float64), limits)
        return np.repeat(grey[..., np.newaxis], 3, axis=2)
    palette = np.array([to_rgb(_COLOURS[k % len(_COLOURS)]) for k in range(len(categories))])
    place = (image[..., np.newaxis] == categories).argmax(axis=-1)
    return np.asarray(np.rint(palette * 255)[place], dtype=np.uint8)


def magnified(picture: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Every pixel as a square of so many."""
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def factor_of(*shapes: tuple[int, ...]) -> int:
    """The factor by which images of these shapes are enlarged, one for all."""
    return -(-SHOWN_SIDE // max(max(shape[:2]) for shape in shapes))


def marked(picture: NDArray[np.uint8], places: NDArray[np.intp], factor: int) -> NDArray[np.uint8]:
    """An enlarged picture with a ring around places of the one that it was made of."""
    rows, cols = np.indices(picture.shape[:2])
    shown, radius = picture.copy(), 4.0 * factor + 4.0
    for row, col in places * factor + factor // 2:
        apart = np.hypot(rows - row, cols - col)
        shown[(apart >= radius - 3.0) & (apart <= radius)] = END
    return shown


def maps(found: Summary) -> Plot:
    """Share maps or the mean, with the hard data."""
    if len(found.categories) == 0:
        values = found.data[:, 2]
        low = min([found.maps.min(), *values])
        high = max([found.maps.max(), *values])
        return _maps(found, [found.maps[0]], ["mean of the realisations"], "viridis", (low, high), [values])
    shown = mapped(found)
    has = [(found.data[:, 2] == found.categories[k]).astype(np.float64) for k in shown]
    titles = [f"share of category {found.categories[k]}" for k in shown]
    return _maps(found, [found.maps[k] for k in shown], titles, "viridis", (0.0, 1.0), has)


def openness(found: Summary) -> Plot:
    """Entropy or standard deviation."""
    if len(found.categories) == 0:
        title, high = "standard deviation", float(found.open.max()) or 1.0
    else:
        title, high = "entropy, bits", float(np.log2(max(2, len(found.categories))))
    return _maps(found, [found.open], [title], "magma", (0.0, high), [None])


def _maps(
    found: Summary,
    panels: Sequence[Floats],
    titles: Sequence[str],
    colours: str,
    limits: tuple[float, float],
    values: Sequence[Floats | None],
) -> Plot:
    rows, cols = panels[0].shape
    across = 2 if len(panels) == 4 else min(3, len(panels))
    down = -(-len(panels) // across)
    wide, high = SIDE * cols / max(rows, cols), SIDE * rows / max(rows, cols)
    figure = new_figure(across * max(wide, 1.6) + 1.2, down * (max(high, 1.0) + 0.45))
    axes = figure.subplots(down, across, squeeze=False)
    for panel in axes.ravel()[len(panels) :]:
        panel.set_axis_off()
    shown = axes.ravel()[: len(panels)]
    for panel, picture, title, datum in zip(shown, panels, titles, values, strict=True):
        image = panel.imshow(picture, cmap=colours, vmin=limits[0], vmax=limits[1], interpolation="nearest")
        panel.set_title(title, loc="left", fontsize=10, color=INK)
        panel.tick_params(colors=FAINT, labelcolor=INK, labelsize=8)
        _data(panel, found.data, datum, colours, limits)
    figure.colorbar(image, ax=list(shown), shrink=0.85, pad=0.02)
    return figure


def _data(axes: Axes, data: Floats, values: Floats | None, colours: str, limits: tuple[float, float]) -> None:
    """Hard data as dots in the map's own colours, so that a datum that is kept vanishes but for its rim."""
    if len(data) == 0:
        return
    fill: Any = "none" if values is None else matplotlib.colormaps[colours](np.clip(_share(values, limits), 0, 1))
    axes.scatter(data[:, 0], data[:, 1], s=26, c=fill, edgecolors="white", linewidths=1.8)
    axes.scatter(data[:, 0], data[:, 1], s=34, c="none", edgecolors="black", linewidths=0.7)


def _share(values: Floats, limits: tuple[float, float]) -> Floats:
    return (values - limits[0]) / ((limits[1] - limits[0]) or 1.0)


def lagged(found: Summary, table: Floats, names: Sequence[str], label: str) -> Plot:
    """Functions of the lag (2, K, n + 1, L): one row for each that is named, one column for each axis."""
    figure = new_figure(8.2, 0.5 + 2.35 * len(names))
    axes = figure.subplots(len(names), 2, sharey="row", sharex=True, squeeze=False)
    for row, (name, panels) in enumerate(zip(names, axes, strict=True)):
        for axis, panel in zip((1, 0), panels, strict=True):
            theirs, own = table[axis, row, :-1], table[axis, row, -1]
            known = np.isfinite(theirs).any(axis=0)
            lags = found.lags[known]
            low, middle, high = (how(theirs[:, known], axis=0) for how in (np.nanmin, np.nanmedian, np.nanmax))
            panel.fill_between(lags, low, high, color=THEIRS, alpha=0.22, linewidth=0, label="realisations, all")
            panel.plot(lags, middle, color=THEIRS, linewidth=1.3, label="realisations, median")
            panel.plot(found.lags, own, color=OWN, linewidth=1.8, linestyle="--", label="training image")
            title = f"{name}, {_GOES[axis]}" if name else _GOES[axis]
            tidy(panel, title, "lag, pixels" if row == len(names) - 1 else "", label if axis == 1 else "")
        panels[0].set_ylim(0, 1.05 * (np.nanmax(table[:, row]) or 1.0) if np.isfinite(table[:, row]).any() else 1.0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize=9, labelcolor=INK)
    return figure


def strips(found: Summary) -> Plot:
    """Shares, components, largest components and dead ends: a row for each category."""
    shown = drawn(found)
    tables = [
        ("share", found.shares),
        ("components in 10,000 pixels", found.components),
        ("share of the largest component", found.largest),
        ("dead ends in 10,000 pixels", found.dead_ends),
    ]
    figure = new_figure(8.2, 1.0 + 2 * (0.75 + 0.34 * len(shown)))
    axes = figure.subplots(2, 2, sharey=True, squeeze=False)
    for panel, (title, table) in zip(axes.ravel(), tables, strict=True):
        for place, k in enumerate(shown):
            theirs, own = table[k, :-1], table[k, -1]
            panel.plot(theirs, [place] * len(theirs), "|", color=THEIRS, alpha=0.6, markersize=11, label="realisations")
            if np.isfinite(theirs).any():
                panel.plot(np.nanmean(theirs), place, "o", color=THEIRS, markersize=6, label="their mean")
            panel.plot(own, place, "D", color=OWN, markersize=7, markerfacecolor="none", label="training image")
        tidy(panel, "", title)
        panel.set_yticks(range(len(shown)), [f"category {found.categories[k]}" for k in shown])
        panel.set_ylim(len(shown) - 0.5, -0.5)
        if np.isfinite(table[shown]).any():
            most = float(np.nanmax(table[shown])) or 1.0
            panel.set_xlim(-0.04 * most, 1.08 * most)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    one = dict(zip(labels, handles, strict=True))
    figure.legend(one.values(), one.keys(), loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    return figure


def distances(found: Summary) -> Plot:
    """The table of distances as a map: points so far apart as the images are, as well as a plane can show it."""
    places = scaled(found.anodi.distances)
    figure = new_figure(4.6, 4.2)
    axes = figure.subplots()
    axes.plot(*places[:-1].T, "o", color=THEIRS, alpha=0.75, markersize=6, label="realisations")
    axes.plot(*places[-1:].T, "D", color=OWN, markersize=9, label="training image")
    axes.set_aspect("equal", adjustable="datalim")
    tidy(axes)
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=9, labelcolor=INK)
    return figure


def scaled(table: Floats) -> Floats:
    """Classical multidimensional scaling of a table of distances (n, n) to places (n, 2)."""
    centre = np.eye(len(table)) - 1.0 / len(table)
    values, vectors = np.linalg.eigh(-0.5 * centre @ table**2 @ centre)
    places = vectors[:, :-3:-1] * np.sqrt(np.clip(values[:-3:-1], 0.0, None))
    signs = np.sign(places[np.abs(places).argmax(axis=0), [0, 1]])
    return np.asarray(places * np.where(signs == 0, 1.0, signs))
