# SPDX-License-Identifier: BSD-3-Clause
"""A schedule on a window that leaves out what cannot reach the window's tile any more."""

from __future__ import annotations

from typing import Any

import numpy as np

from simdtex.schedules.schedule import Active, Info, Schedule, Setting, Watched


class Trimmed(Watched):
    """A schedule whose every step but the last also relaxes rows around a tile, fewer with every step.

    What a site is depends on its neighbours one step earlier. So of a sweep of n steps, the i-th one matters to the
    tile as far as (n - i) times the neighbourhood's radius beyond it, and no farther.

    Parameters
    ----------
    schedule : Schedule
        One whose sites come row by row within a step, as a `simdtex.schedules.Partition` has them.
    top, bottom : int
        The first row of the tile within the window, and the first one below it.
    """

    def __init__(self, schedule: Schedule, top: int, bottom: int) -> None:
        super().__init__(schedule)
        self.top, self.bottom = top, bottom

    def step(self, setting: Setting, state: Any, active: Active) -> tuple[Any, Info]:
        """The schedule's own step, without the rows that do not matter."""
        state, info = self.schedule.step(setting, state, active)
        sites = info.sites if isinstance(info.sites, np.ndarray) else setting.machine.get(info.sites)
        ranges, radius, width = info.ranges.copy(), int(setting.offsets.max()), setting.grid.width
        for number, (begin, end) in enumerate(ranges.tolist(), 1):
            reach = (len(ranges) - number) * radius
            rows = np.array([max(0, self.top - reach), self.bottom + reach], np.int64) * width
            ranges[number - 1] = begin + np.searchsorted(sites[begin:end], rows)
        return state, info._replace(steps=ranges)
