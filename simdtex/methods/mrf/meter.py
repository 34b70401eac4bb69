# SPDX-License-Identifier: BSD-3-Clause
"""What a run of Algorithm 1 does, counted level by level, and how far it has come."""

from __future__ import annotations

import time
from math import sqrt
from typing import Any

from simdtex.model.lattice import Grid


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
        self._free = self._weighed = 0
        self._cooling = True
        self._began = self._level_began = time.perf_counter()

    def kept(self) -> dict[str, Any]:
        """All of it between two sweeps, with the seconds of the level so far in place of when it began."""
        told = {name: value for name, value in vars(self).items() if name not in ("_expected", "_began")}
        return told | {"_level_began": time.perf_counter() - self._level_began}

    def restore(self, kept: dict[str, Any]) -> None:
        """Go on from what `kept` gave."""
        vars(self).update(kept | {"_level_began": time.perf_counter() - kept["_level_began"]})

    def begin(self, level: int, grid: Grid, candidates: int, weighed: int | None = None) -> None:
        """Begin a level; a relaxation weighs about `weighed` of its candidates, or all."""
        self._weighed = candidates if weighed is None else weighed
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

    def step(self, steps: int = 1) -> int:
        """Begin a step, or several that go together, and return the last one's number within the level, from 1."""
        self._count("steps", steps)
        return int(self.reports[-1]["steps"])

    def add(self, relaxations: int, fma: int, share: float) -> None:
        """Count sites that were relaxed, `share` of the sweep being done with them."""
        report = self.reports[-1]
        self._count("relaxations", relaxations)
        report["fma"] += fma
        cooling, free = self._expected[report["level"]]
        done = (self._cooled + self._sweep_share * share) * cooling
        if self._cooled == 1:
            self._free += relaxations * self._weighed
            done = cooling + min(self._free, free)
        total = sum(sum(work) for work in self._expected.values())
        self._fraction = max(self._fraction, min(1.0, (self._ended + done) / total))

    def end(self, skipped: int, weighed: tuple[int, int] | None = None) -> None:
        """End the level: so many fma were skipped, or so many candidates weighed at so many fma."""
        report = self.reports[-1]
        report["weighed"] = float(report["candidates"])
        if weighed is not None:
            report["weighed"] = weighed[0] / max(1, report["relaxations"])  # of none, where all of a level is known
            report["fma"] += weighed[0] * weighed[1]
        self.reports[-1]["skipped"] = skipped
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
