# SPDX-License-Identifier: BSD-3-Clause
"""What a run tells while it goes on, and what it leaves: progress, stages and statistics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import sqrt
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
    step : int
        The present step of the level, from 1: sites that relax together.
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
    step: int
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
        ``device``, ``seed``, ``options``, ``seconds``, ``device_seconds`` (of kernels; None unless the machine was
        opened with ``profile=True``), ``accounting``, and ``levels``: one dict per level with
        ``level``, ``rows``, ``cols``, ``candidates``, ``sweeps``, ``steps``, ``relaxations``, ``fma`` (of equation
        (12)), ``seconds``, and ``equilibrium``: the ``sweeps``, ``steps`` and ``relaxations`` until no temperature
        was left, free sweeps not counted. ``accounting`` is what the run costs on a processor array, or, where none
        was given, packed on a full MP-1: ``array``, ``mapping``, ``emulated``; ``layers``, virtual layers; ``shifts``,
        X-Net shifts of a word that bring every pixel of the finest level all its neighbours, for either mapping;
        ``steps``; ``passes``, SIMD steps: one for each virtual layer of a step that has an active site; ``active``,
        the mean number of active PEs per pass; ``utilisation``, that over all PEs; ``sites``, relaxations; ``moved``,
        words that each PE shifted; ``routed``, words through the router; ``flop``, 32-bit operations in the
        distances; ``model_seconds``, the time of a MasPar MP-1 by the model of
        `simdtex.machine.accounting.Account`; and ``launches``, kernels enqueued on the device.
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
        Level -> expected work of its cooling and of its free sweeps, in relaxations times candidates.
    """

    def __init__(self, expected: dict[int, tuple[float, float]]) -> None:
        self.reports: list[dict[str, Any]] = []
        self._expected = expected
        self._ended = self._fraction = self._cooled = 0.0
        self._sweep_share = self._first_left = 0.0
        self._free = 0
        self._cooling = True
        self._began = self._level_began = time.perf_counter()

    def begin(self, level: int, grid: Grid, candidates: int) -> None:
        """Begin a level."""
        self._level_began = time.perf_counter()
        self._cooled = self._sweep_share = self._first_left = 0.0
        self._free = 0
        sizes = {"level": level, "rows": grid.rows, "cols": grid.cols, "candidates": candidates}
        counts = {"sweeps": 0, "steps": 0, "relaxations": 0}
        self.reports.append({**sizes, **counts, "equilibrium": dict(counts), "fma": 0, "seconds": 0.0})

    def sweep(self, phase: str, left: float) -> int:
        """Begin a sweep with this mean temperature: the share of the sweeps done is about 1 - sqrt(t / t_0).

        Returns the number of the sweep within the level, from 1.
        """
        self._cooling = phase == "relax"
        self._count("sweeps", 1)
        self._first_left = self._first_left or left
        cooled = 1 - sqrt(left / self._first_left) if left else 1.0
        like_the_last = cooled - self._cooled or 0.1
        self._sweep_share, self._cooled = min(like_the_last, 1 - cooled), cooled
        return int(self.reports[-1]["sweeps"])

    def step(self) -> int:
        """Begin a step, and return its number within the level, from 1."""
        self._count("steps", 1)
        return int(self.reports[-1]["steps"])

    def add(self, relaxations: int, fma: int, share: float) -> None:
        """Count sites that were relaxed, `share` of the sweep being done with them."""
        report = self.reports[-1]
        self._count("relaxations", relaxations)
        report["fma"] += fma
        cooling, free = self._expected[report["level"]]
        done = (self._cooled + self._sweep_share * share) * cooling
        if self._cooled == 1:
            self._free += relaxations * report["candidates"]
            done = cooling + min(self._free, free)
        total = sum(sum(work) for work in self._expected.values())
        self._fraction = max(self._fraction, min(1.0, (self._ended + done) / total))

    def end(self) -> None:
        """End the level."""
        self.reports[-1]["seconds"] = time.perf_counter() - self._level_began
        self._ended += sum(self._expected[self.reports[-1]["level"]])

    def _count(self, what: str, number: int) -> None:
        report = self.reports[-1]
        report[what] += number
        if self._cooling:
            report["equilibrium"][what] += number

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.perf_counter() - self._began

    @property
    def fraction(self) -> float:
        """Share of the expected work that is done, 0 to 1; never falls."""
        return self._fraction
