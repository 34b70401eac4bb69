# SPDX-License-Identifier: BSD-3-Clause
"""Plots for reports: the same bytes for the same numbers, and the same style for a schedule in every plot."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import cycle
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

INK, FAINT, GRID = "#22262b", "#5c6570", "#e4e2dc"
DPI = 140


# The palette of Okabe and Ito, distinct for every kind of colour vision, its yellow darkened for a white background.
_KNOWN = {
    "coloring": ("#0072B2", "o"),
    "coloring-fixed": ("#56B4E9", "s"),
    "luby": ("#009E73", "^"),
    "checkerboard": ("#E69F00", "D"),
    "synchronous": ("#D55E00", "v"),
    "random-subset": ("#CC79A7", "P"),
    "raster": ("#000000", "<"),
    "random-scan": ("#7A7A7A", ">"),
    "block": ("#8A6D00", "X"),
}
_SPARE = [("#882255", "*"), ("#332288", "h"), ("#117733", "p"), ("#AA4499", "d"), ("#661100", "8"), ("#6699CC", "H")]


def styles(schedules: Mapping[str, bool]) -> dict[str, dict[str, Any]]:
    """Return the keywords of `matplotlib.axes.Axes.plot` for each schedule, given whether it keeps equation (14).

    A schedule of the package always has the same colour and marker; others take the remaining ones in order. Lines are
    dashed and markers hollow if it breaks equation (14).
    """
    taken = {_KNOWN[name] for name in schedules if name in _KNOWN}
    spare = cycle([style for style in [*_SPARE, *_KNOWN.values()] if style not in taken])
    found = {}
    for name, keeps in schedules.items():
        color, marker = _KNOWN.get(name) or next(spare)
        line, inside = ("-", color) if keeps else ("--", "white")
        found[name] = {"color": color, "marker": marker, "linestyle": line, "markerfacecolor": inside}
    return found


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of ``width`` x ``height`` inches, without any global state."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def figure_png(figure: Figure) -> bytes:
    """Return the figure as a PNG, the same bytes every time."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Set labels and a faint grid below the data, and remove the box."""
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.grid(True, which="major", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=FAINT, labelcolor=INK, labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)


def legend(figure: Figure, axes: Axes, place: Any = "outside upper center", columns: int = 3) -> None:
    """Add a legend of the labels of some axes, each once, outside the plots."""
    handles, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    more: dict[str, Any] = {"ncols": columns, "frameon": False, "fontsize": 9, "labelcolor": INK}
    figure.legend(list(entries.values()), list(entries), loc=place, **more)
