# SPDX-License-Identifier: BSD-3-Clause
"""What a run tells while it goes on, and what it leaves: progress, stages and statistics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray


@dataclass(frozen=True)
class Progress:
    """Where a run stands; what a callback is called with after every piece of a step.

    Attributes
    ----------
    level, levels : int
        The present level (0 is the finest, and the last) and their number.
    sweep : int
        The present sweep of the level, from 1.
    phase : str
        ``"relax"`` while some temperature is above 0, then ``"free"``.
    temperature_left : float
        Mean temperature of the level, 0 to 1, at the beginning of the sweep.
    end_of_sweep : bool
        Whether the sweep ends with this piece.
    fraction : float
        Share of the expected work that is done, 0 to 1; an estimate.
    image : callable
        ``image()`` reads back the level's picture, (rows, cols[, channels]) in the sample's type.
    temperature : callable
        ``temperature()`` reads back the level's temperatures, (rows, cols), 0 to 1.
    """

    level: int
    levels: int
    sweep: int
    phase: str
    temperature_left: float
    end_of_sweep: bool
    fraction: float
    image: Callable[[], NDArray[Any]]
    temperature: Callable[[], NDArray[Any]]


Callback = Callable[[Progress], Any]


@dataclass(frozen=True)
class Stage:
    """A level at its end: ``level``; ``image`` (rows, cols[, channels]) in the sample's type."""

    level: int
    image: NDArray[Any]


@dataclass(frozen=True)
class Output:
    """What ``full_output=True`` returns beside the image.

    Attributes
    ----------
    source : (rows, cols, 2) int32 array
        For every output pixel the (row, column) of the sample pixel it was taken from.
    temperature : (rows, cols) float64 array
        What is left of the pixel temperatures, 0 to 1.
    stages : list of Stage
        Each level's picture at its end, the coarsest first.
    statistics : dict
        ``device``, ``seed``, ``options``, ``seconds``, and ``levels``: one dict per level with
        ``level``, ``rows``, ``cols``, ``candidates``, ``bandwidth``, ``colors`` (steps of the first sweep),
        ``sweeps``, ``relaxations``, ``fma`` (of equation (12)) and ``seconds``.
    """

    source: NDArray[Any]
    temperature: NDArray[Any]
    stages: list[Stage] = field(default_factory=list)
    statistics: dict[str, Any] = field(default_factory=dict)
