# SPDX-License-Identifier: BSD-3-Clause
"""The pictures and plots of a comparison of schedules, each as the bytes of a PNG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from simdtex.experiments.comparison import Comparison, Entry, Spread, Sweep
from simdtex.io.image import to_display
from simdtex.report.plots import Curve, curves, dots, figure_png, legend, named_rows, new_figure, styles, tidy
from simdtex.report.sheet import contact_sheet, encoded

__all__ = ["all_seeds", "channels_last", "costs", "first_seed", "per_sweep", "qualities", "temperature"]

SHOWN_SIDE = 256  # pictures smaller than this are enlarged by a whole factor, pixels


def channels_last(comparison: Comparison, image: NDArray[Any]) -> NDArray[Any]:
    """The picture with its channels last."""
    return image if comparison.channel_axis is None else np.moveaxis(image, comparison.channel_axis, -1)


def _shown(comparison: Comparison, image: NDArray[Any], side: int) -> NDArray[np.uint8]:
    limits = float(comparison.sample.min()), float(comparison.sample.max())
    picture = to_display(channels_last(comparison, image), limits)
    factor = max(1, side // max(comparison.shape))
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def _label(entry: Entry) -> str:
    return entry.name if entry.independent else f"{entry.name}, breaks (14)"


def first_seed(comparison: Comparison) -> bytes:
    """The sample, and each schedule's picture of the first seed."""
    pictures = [("the sample", _shown(comparison, comparison.sample, SHOWN_SIDE))]
    pictures += [(_label(entry), _shown(comparison, entry.runs[0].image, SHOWN_SIDE)) for entry in comparison.entries]
    return encoded(contact_sheet(pictures, columns=min(4, len(pictures))))


def all_seeds(comparison: Comparison) -> bytes:
    """Every picture, a seed a row."""
    pictures = [
        (f"{entry.name}, {run.seed}", _shown(comparison, run.image, 0))
        for runs in zip(*(entry.runs for entry in comparison.entries), strict=True)
        for entry, run in zip(comparison.entries, runs, strict=True)
    ]
    return encoded(contact_sheet(pictures, columns=len(comparison.entries)))


# ---------------------------------------------------------------- plots


def _plot(comparison: Comparison, lines: Sequence[Curve], title: str, x: str, y: str) -> tuple[Figure, Any]:
    entries = comparison.entries
    looks = styles({entry.name: entry.independent for entry in entries})
    plot = new_figure(9.2, 4.4)
    axes = plot.subplots()
    tidy(axes, title, x, y)
    curves(axes, lines, looks, {entry.name: _label(entry) for entry in entries})
    legend(plot, axes)
    return plot, axes


def temperature(comparison: Comparison) -> bytes:
    """The temperature left at the finest level against its steps, until equilibrium."""
    lines = []
    for entry in comparison.entries:
        for run in reversed(entry.runs):  # the first seed on top
            sweeps = [sweep for sweep in run.finest if sweep.phase == "relax"]
            if not sweeps:
                continue
            x = [0.0, *(float(sweep.steps) for sweep in sweeps)]
            y = [sweeps[0].before, *(sweep.left for sweep in sweeps)]
            lines.append(Curve(entry.name, x, y, range(len(x)), run is not entry.runs[0]))
    plot, axes = _plot(comparison, lines, "Temperature left", "Step of the finest level", "Mean temperature")
    axes.set_xscale("symlog", linthresh=1.0, linscale=0.3)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    return figure_png(plot)


def per_sweep(comparison: Comparison, what: str, title: str) -> bytes:
    """A share of the finest level's pixels, ``"changed"`` or ``"returned"``, against its sweeps."""
    lines = []
    for entry in comparison.entries:
        for run in reversed(entry.runs):
            known: list[tuple[Sweep, float]] = []
            for sweep in run.finest:
                share = getattr(sweep, what)
                known += [] if share is None else [(sweep, 100 * share)]
            free = [place for place, (sweep, _) in enumerate(known) if sweep.phase == "free"]
            x, y = [float(sweep.sweep) for sweep, _ in known], [share for _, share in known]
            lines.append(Curve(entry.name, x, y, free, run is not entry.runs[0]))
    plot, axes = _plot(comparison, lines, title, "Sweep of the finest level", "Pixels, %")
    axes.set_yscale("symlog", linthresh=0.1, linscale=0.3)
    axes.set_ylim(bottom=0.0)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.xaxis.get_major_locator().set_params(integer=True)
    return figure_png(plot)


def _panels(comparison: Comparison, panels: Sequence[tuple[str, str, float, bool]]) -> bytes:
    """Figures side by side, a row for each schedule; of each its name, a title, a factor, whether on a log scale."""
    entries = comparison.entries
    looks = styles({entry.name: entry.independent for entry in entries})
    across = 2
    plot = new_figure(9.2, 0.9 + len(panels) // across * (0.75 + 0.3 * len(entries)))
    grid = plot.subplots(-(-len(panels) // across), across, squeeze=False, sharey=True)
    for axes, (figure, title, factor, log) in zip(grid.ravel(), panels, strict=True):
        found = {entry.name: entry.figure(figure) for entry in entries}
        dots(axes, {name: spread and _scaled(spread, factor) for name, spread in found.items()}, looks)
        if log and all(spread is None or min(spread.values) > 0 for spread in found.values()):
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        tidy(axes, title)
        named_rows(axes, [_label(entry) for entry in entries])
    return figure_png(plot)


def _scaled(spread: Spread, factor: float) -> Spread:
    deviation = None if spread.deviation is None else factor * spread.deviation
    return Spread(factor * spread.mean, deviation, tuple(factor * value for value in spread.values))


def costs(comparison: Comparison) -> bytes:
    """Steps, utilisation, wall time and the model's time."""
    return _panels(
        comparison,
        [
            ("steps", "Steps to equilibrium, finest level", 1.0, True),
            ("utilisation", "Utilisation of the array, %", 100.0, True),
            ("seconds", "Wall time, s", 1.0, True),
            ("model_seconds", "MP-1 by the model, s", 1.0, True),
        ],
    )


def qualities(comparison: Comparison) -> bytes:
    """Figures of merit."""
    return _panels(
        comparison,
        [
            ("plausibility", "Plausibility, 0 is best", 1.0, False),
            ("coverage", "Coverage, 0 is best", 1.0, False),
            ("histogram_distance", "Histogram distance, 0 is best", 1.0, False),
            ("copying", "Copying", 1.0, False),
        ],
    )
