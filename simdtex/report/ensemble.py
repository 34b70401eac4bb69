# SPDX-License-Identifier: BSD-3-Clause
"""The report of an ensemble: realisations beside their training image, what they leave open, how like it they are."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike

from simdtex import __version__
from simdtex.experiments.ensemble import Summary, summary
from simdtex.report import ensemble_parts as parts
from simdtex.report.page import Section, Text, check_folder, write_report

__all__ = ["write_ensemble"]


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
        Section("The realisations", parts.pictures(images, own, found)),
        Section("What they leave open", parts.left_open(found)),
        Section("Variograms", [parts.variograms(found)]),
        *([Section("How the categories hang together", parts.connected(images, own, found))] if categorical else []),
        Section("Variety and likeness", parts.distances(found)),
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
    data = "hard datum" if number == 1 else f"{number} hard data"
    if number == 0:
        return "There are no hard data."
    if not found.misses.any():
        return f"Every realisation keeps the {data}."
    if len(found.categories) == 0:
        worst = f"{found.misses.max():.3g}"
        return f"Not every realisation keeps the {data}: one is off by {worst}, the root of the mean square."
    share = found.misses.sum() / (number * realisations)
    bad = np.count_nonzero(found.misses)
    return f"Of the {data}, {share:.1%} are missed on average, in {bad} of the {realisations} realisations."
