# SPDX-License-Identifier: BSD-3-Clause
"""What a run tells while it goes on, and what it leaves: progress, stages and statistics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from simdtex.lattice import Grid


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
        ``level``, ``rows``, ``cols``, ``candidates``, ``sweeps``, ``relaxations``, ``fma`` (of equation (12)) and
        ``seconds``.
    """

    source: NDArray[Any]
    temperature: NDArray[Any]
    stages: list[Stage] = field(default_factory=list)
    statistics: dict[str, Any] = field(default_factory=dict)


class Meter:
    """Counts what a run does, level by level, and tells how far it has come.

    Parameters
    ----------
    expected : dict
        Level -> expected relaxations times candidates.
    """

    def __init__(self, expected: dict[int, float]) -> None:
        self.reports: list[dict[str, Any]] = []
        self._expected = expected
        self._ended = 0.0
        self._began = self._level_began = time.perf_counter()

    def begin(self, level: int, grid: Grid, candidates: int) -> None:
        """Begin a level."""
        self._level_began = time.perf_counter()
        sizes = {"level": level, "rows": grid.rows, "cols": grid.cols, "candidates": candidates}
        self.reports.append(sizes | {"sweeps": 0, "relaxations": 0, "fma": 0, "seconds": 0.0})

    def add(self, relaxations: int, fma: int) -> None:
        """Count sites that were relaxed."""
        self.reports[-1]["relaxations"] += relaxations
        self.reports[-1]["fma"] += fma

    def sweeps(self, number: int) -> None:
        """Note how many sweeps the level has had."""
        self.reports[-1]["sweeps"] = number

    def end(self) -> None:
        """End the level."""
        self.reports[-1]["seconds"] = time.perf_counter() - self._level_began
        self._ended += self._expected[self.reports[-1]["level"]]

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.perf_counter() - self._began

    @property
    def fraction(self) -> float:
        """Share of the expected work that is done, 0 to 1; never falls."""
        report = self.reports[-1]
        expected = self._expected[report["level"]]
        here = min(float(expected), float(report["relaxations"] * report["candidates"]))
        return min(1.0, (self._ended + here) / sum(self._expected.values()))
