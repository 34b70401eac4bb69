# SPDX-License-Identifier: BSD-3-Clause
"""The report of realisations of a volume: slices through them and their mean, variograms, connectivity."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex.experiments.ensemble import connectivity
from simdtex.experiments.ensemble.summary import variogram
from simdtex.io.image import to_display
from simdtex.report.page import Figure, Section, write_report
from simdtex.report.plots import legend, new_figure, tidy
from simdtex.report.sheet import LEAST_SIDE, contact_sheet
from simdtex.report.tables import Table, number_text

SHOWN = 2
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

    Parameters
    ----------
    folder : path
        See `simdtex.report.page.check_folder`.
    training : (layers, rows, cols) array
    ensemble : (realisations, layers, rows, cols) array
    categorical : bool
        Whether values are categories, of which the last one is drawn.
    command : str
        The command line, if there is one.
    upward : bool
        Draw y, or z, upward, as of a map.

    Notes
    -----
    Cost: a few passes over each realisation for every lag, up to a third of the shortest side.
    """
    names = np.unique(training) if categorical else np.zeros(0, training.dtype)
    last = names[-1] if categorical else None
    fields = [(one == last if categorical else one).astype(np.float64) for one in (training, *ensemble)]
    own, theirs = fields[0], fields[1:]
    mean = np.mean(theirs, 0)
    what = f"category {last}" if categorical else "the values"
    limits = (float(own.min()), float(own.max()))
    sheet = [
        (f"{name}, {AXES[axis]} = {n // 2}", to_display(one.take(n // 2, axis)[:: -1 if upward else 1], limits))
        for name, one in (
            ("training image", own),
            (f"mean of {len(theirs)}", mean),
            *((f"realisation {k}", one) for k, one in enumerate(theirs[:SHOWN])),
        )
        for axis, n in enumerate(one.shape)
    ]
    most = max(1, min(*training.shape, *ensemble.shape[1:]) // 3)
    variograms = [np.array([variogram(one, axis, most) for axis in range(3)]) for one in fields]
    sections = [
        Section(
            "Slices",
            [
                Figure(
                    "slices.png",
                    contact_sheet(sheet, columns=3, scale=-(-LEAST_SIDE // max(training.shape))),
                    f"The middle slices across z, y and x of {what}: the training image, the mean of the realisations, "
                    "and realisations. In the mean, grey is uncertain.",
                )
            ],
        ),
        Section("Variograms", [_lagged("variograms.png", variograms, f"Variograms of {what} along z, y and x")]),
    ]
    results: dict[str, Any] = {
        "shape": ensemble.shape,
        "training_shape": training.shape,
        "variograms": variograms,
    }
    if categorical:
        found = [[connectivity(one, name, most) for one in (training, *ensemble)] for name in names]
        functions = [one.function for one in found[-1]]
        rows = [
            {
                "Category": f"{name}, {who}",
                "Share": _mean([(one == name).mean() for one in those]),
                "Components in 10,000 voxels": _mean([one.components for one in figures]),
                "Share of the largest": _mean([one.largest for one in figures]),
            }
            for name, every in zip(names, found, strict=True)
            for who, those, figures in (
                ("training image", [training], every[:1]),
                ("realisations", list(ensemble), every[1:]),
            )
        ]
        note = "Means over the realisations. Voxels are connected by their faces."
        plot = _lagged("connectivity.png", functions, f"Connectivity of {what} along z, y and x")
        sections.append(
            Section("Connectivity of the categories", [plot, Table("Figures of the categories", rows, note)])
        )
        results |= {"connectivity": functions, "categories": names}
    size = " x ".join(str(side) for side in ensemble.shape[:0:-1])
    lead = f"{len(ensemble)} realisations of {size} voxels, and a training image of {training.shape[::-1]}."
    write_report(folder, "Realisations of a volume", lead, sections, results, command)


def _lagged(file: str, tables: list[NDArray[np.float64]], caption: str) -> Figure:
    """Return the plot of functions of the lag, (axes, lags): the first of the training image, the others' range."""
    figure: Plot = new_figure(9.0, 2.9)
    theirs, lags = np.array(tables[1:]), np.arange(tables[0].shape[1])
    panels = figure.subplots(1, len(AXES), sharey="row")
    for axis, (name, axes) in enumerate(zip(AXES, panels, strict=True)):
        some = theirs[:, axis]
        axes.fill_between(lags, some.min(0), some.max(0), alpha=0.25, linewidth=0, label="realisations, all")
        axes.plot(lags, tables[0][axis], color="#D55E00", linestyle="--", label="training image")
        tidy(axes, f"along {name}", "lag, voxels")
    legend(figure, panels[0])
    return Figure(file, figure, f"{caption}. The training image's line should run inside the band.")


def _mean(values: list[float]) -> str:
    return number_text(float(np.nanmean(values)))
