# SPDX-License-Identifier: BSD-3-Clause
"""Watching a run: how its picture moves from sweep to sweep, and which sites its schedule relaxed together."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.lattice import Grid
from simdtex.run import Relaxing
from simdtex.schedules import Info, Schedule, Setting, Watched, neighbours_in

__all__ = ["Noted", "Recorder", "Sweep"]

Tell = Callable[[Relaxing], Any]


@dataclass(frozen=True)
class Sweep:
    """What a sweep of a level did.

    Attributes
    ----------
    level, sweep : int
        The level, 0 the finest, and the sweep within it, from 1.
    phase : str
        ``"relax"`` until equilibrium, then ``"free"``.
    steps : int
        Steps of the level until its end.
    before, left : float
        Mean temperature of the level's sites when it began and when it ended, 0 to 1.
    changed : float or None
        Share of the level's sites whose pixel is another than a sweep ago; None in the first sweep.
    returned : float or None
        The oscillation index: share of the level's sites whose pixel is another than a sweep ago, and the same as two
        sweeps ago; None in the first two sweeps.
    """

    level: int
    sweep: int
    phase: str
    steps: int
    before: float
    left: float
    changed: float | None
    returned: float | None


class Recorder:
    """A callback that looks at the picture and the temperatures after every sweep.

    Parameters
    ----------
    channel_axis : int, optional
        Of the pictures.
    then : callable, optional
        Called with every progress, before it is recorded.
    settle : callable, optional
        Called before the recorder's own time is taken; waits for the device.

    Attributes
    ----------
    sweeps : list of Sweep
    seconds : float
        What the recording itself took.

    Notes
    -----
    Holds the last two pictures of a level.
    """

    def __init__(
        self,
        channel_axis: int | None = None,
        then: Tell | None = None,
        settle: Callable[[], Any] | None = None,
    ) -> None:
        self.sweeps: list[Sweep] = []
        self.seconds = 0.0
        self._axis, self._then, self._settle = channel_axis, then, settle
        self._level = -1
        self._last: list[NDArray[Any]] = []

    def __call__(self, progress: Relaxing) -> None:
        """Record if a sweep has ended."""
        if self._then:
            self._then(progress)
        if not progress.end_of_sweep:
            return
        if self._settle:
            self._settle()
        began = time.perf_counter()
        image, left = progress.image(), progress.temperature()
        if progress.level != self._level:
            self._level, self._last = progress.level, []
        moved = [self._differs(image, earlier) for earlier in self._last]  # from one and from two sweeps ago
        self.sweeps.append(
            Sweep(
                progress.level,
                progress.sweep,
                progress.phase,
                progress.step,
                float(progress.temperature_left),
                float(left.mean()),
                float(moved[0].mean()) if moved else None,
                float((moved[0] & ~moved[1]).mean()) if len(moved) > 1 else None,
            )
        )
        self._last = [image, *self._last][:2]
        self.seconds += time.perf_counter() - began

    def _differs(self, image: NDArray[Any], earlier: NDArray[Any]) -> NDArray[np.bool_]:
        apart = image != earlier
        return np.asarray(apart if self._axis is None else apart.any(axis=self._axis), np.bool_)


class Noted(Watched):
    """A schedule whose steps are noted down, to be checked when the clock has stopped."""

    def __init__(self, schedule: Schedule) -> None:
        super().__init__(schedule)
        self.claims: list[bool] = []
        self.levels: list[tuple[int, Grid, NDArray[np.int32], list[NDArray[np.int32]]]] = []

    def init(self, setting: Setting) -> Any:
        """The schedule's own state."""
        self.claims.append(bool(self.independent(setting.grid, setting.offsets)))
        self.levels.append((setting.level, setting.grid, setting.offsets, []))
        return self.schedule.init(setting)

    def look(self, setting: Setting, info: Info) -> None:
        """Note a step."""
        if self.claims[-1] and len(info.sites) > 1:  # a site alone meets nobody
            self.levels[-1][3].append(info.sites)

    def met(self) -> tuple[int, int, int] | None:
        """The level and two neighbours of a step that relaxed together where the schedule claims equation (14)."""
        for level, grid, offsets, steps in self.levels:
            for sites in steps:
                pair = neighbours_in(grid, offsets, sites)
                if pair:
                    return level, *pair
        return None
