# SPDX-License-Identifier: BSD-3-Clause
"""Plots for reports: the same bytes for the same numbers, and one look for a schedule wherever it appears."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

__all__ = ["Curve", "Style", "curves", "dots", "figure_png", "legend", "named_rows", "new_figure", "styles", "tidy"]

INK, FAINT, GRID = "#22262b", "#5c6570", "#e4e2dc"
DPI = 140


class Style(NamedTuple):
    """How a schedule is drawn; ``fill`` whether its markers are filled and its lines solid."""

    color: str
    marker: str
    fill: bool = True

    @property
    def line(self) -> str:
        """Of its curves."""
        return "-" if self.fill else "--"


# The palette of Okabe and Ito, told apart by every kind of colour vision, its yellow darkened for a white ground.
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


def styles(schedules: Mapping[str, bool]) -> dict[str, Style]:
    """A colour and a marker for each schedule.

    Parameters
    ----------
    schedules : dict
        Name -> whether it keeps equation (14); those that break it have hollow markers and dashed lines.

    Returns
    -------
    dict
        Name -> `Style`. A schedule of the package always has the same; others take those that are left, in their order.
    """
    taken = {_KNOWN[name] for name in schedules if name in _KNOWN}
    left = [look for look in [*_SPARE, *_KNOWN.values()] if look not in taken]
    found, spare = {}, 0
    for name, keeps in schedules.items():
        look = _KNOWN.get(name)
        if look is None:
            look, spare = (left or _SPARE)[spare % len(left or _SPARE)], spare + 1
        found[name] = Style(*look, keeps)
    return found


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size in inches, without any global state."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def figure_png(figure: Figure) -> bytes:
    """The figure as a PNG, the same bytes every time."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Labels, a faint grid below the data, and no box."""
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.grid(True, which="major", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=FAINT, labelcolor=INK, labelsize=9)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(FAINT)


class Measured(Protocol):
    """A mean, the standard deviation if there is one, and the single values."""

    @property
    def mean(self) -> float: ...
    @property
    def deviation(self) -> float | None: ...
    @property
    def values(self) -> tuple[float, ...]: ...


class Curve(NamedTuple):
    """A line of a plot: whose it is, its points, and which of them have a marker; ``faint`` beside the main one."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    marked: Sequence[int]
    faint: bool = False


def curves(axes: Axes, lines: Sequence[Curve], looks: Mapping[str, Style], labels: Mapping[str, str]) -> None:
    """Draw lines, each in its schedule's style, and name the main ones."""
    for line in lines:
        look = looks[line.name]
        axes.plot(
            line.x,
            line.y,
            color=look.color,
            linestyle=look.line,
            linewidth=0.8 if line.faint else 1.7,
            alpha=0.35 if line.faint else 1.0,
            marker=None if line.faint else look.marker,
            markevery=None if line.faint else list(line.marked),
            markersize=6,
            markerfacecolor=look.color if look.fill else "white",
            markeredgecolor=look.color,
            label=None if line.faint else labels[line.name],
        )


def dots(axes: Axes, rows: Mapping[str, Measured | None], looks: Mapping[str, Style]) -> None:
    """One row for each schedule, from above: its mean, a bar of one deviation to each side, and its single values."""
    for place, (name, found) in enumerate(rows.items()):
        if found is None:
            axes.text(0.01, place, "n/a", transform=axes.get_yaxis_transform(), va="center", color=FAINT, fontsize=9)
            continue
        look = looks[name]
        axes.plot(found.values, [place] * len(found.values), "|", color=look.color, alpha=0.6, markersize=9)
        axes.errorbar(
            found.mean,
            place,
            xerr=found.deviation or 0.0,
            fmt=look.marker,
            color=look.color,
            markerfacecolor=look.color if look.fill else "white",
            markersize=8,
            elinewidth=1.6,
            capsize=3,
        )
    axes.set_ylim(len(rows) - 0.5, -0.5)


def named_rows(axes: Axes, labels: Sequence[str]) -> None:
    """Names of the rows of `dots`."""
    axes.set_yticks(range(len(labels)), labels)


def legend(figure: Figure, axes: Axes) -> None:
    """The names beside the plot."""
    handles: Any
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9, labelcolor=INK)
