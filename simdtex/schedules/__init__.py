# SPDX-License-Identifier: BSD-3-Clause
"""Parallel schedules: which sites relax together.

A schedule is a pair of pure functions. ``init`` takes the lattice of a level and gives a `State`; ``step`` takes a
state and gives the next one and an `Info` with the sites to relax now. The counters in the state key every
random choice, so a schedule never depends on the device.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from simdtex.lattice import Grid


class Info(NamedTuple):
    """What a step decided.

    ``sites`` (S,) int32 pixel indices that relax together; ``sweep`` the sweep this step belongs to;
    ``last`` whether the sweep ends with it.
    """

    sites: NDArray[np.int32]
    sweep: int
    last: bool


class Schedule(Protocol):
    """A parallel schedule."""

    name: str
    independent: bool
    """Whether every step's sites are i.i.d. in the sense of equation (14)."""

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> Any:
        """The state before the first sweep of a level."""
        ...

    def step(self, state: Any, active: Callable[[], NDArray[np.bool_]]) -> tuple[Any, Info]:
        """The next step. ``active()`` tells, per site of the grid, whether it still wants relaxing."""
        ...


def get(name: str) -> Schedule:
    """The schedule of a name; ValueError with the valid ones where there is none."""
    from simdtex.schedules.coloring import Coloring

    schedules: dict[str, Schedule] = {"coloring": Coloring()}
    if name not in schedules:
        raise ValueError(f"unknown schedule {name!r}; choose one of: {', '.join(schedules)}")
    return schedules[name]
