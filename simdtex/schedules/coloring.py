# SPDX-License-Identifier: BSD-3-Clause
"""The schedule `coloring`: one colour class a step, the colours in a fresh random order each sweep."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.lattice import Grid
from simdtex.ops.coloring import coloring
from simdtex.schedules import Info


class State(NamedTuple):
    """What the schedule carries.

    ``members`` the grid sites of each colour; ``pixel`` site -> pixel index; ``sweep`` sweeps begun so far; ``queue``
    what is left of the present one.
    """

    members: tuple[NDArray[np.int32], ...]
    pixel: NDArray[np.int32]
    seed: int
    level: int
    sweep: int
    queue: tuple[NDArray[np.int32], ...]


class Coloring:
    """Relax one colour class of the lattice at a time.

    Guarantees that no two sites of a step are neighbours, equation (14), and that each active site is relaxed
    exactly once a sweep.
    """

    name = "coloring"
    independent = True

    def init(self, machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int, level: int) -> State:
        """Colour the lattice; O(sites x (neighbours + colours)) once a level."""
        colors = coloring(machine, grid, offsets, order, seed).ravel()
        members = tuple(np.flatnonzero(colors == c).astype(np.int32) for c in range(colors.max() + 1))
        return State(members, grid.sites(), seed, level, 0, ())

    def step(self, state: State, active: Callable[[], NDArray[np.bool_]]) -> tuple[State, Info]:
        """The next colour class with active sites; a site changes its activity only when it relaxes."""
        if not state.queue:
            state = self._begin(state, active())
        sites, *rest = state.queue
        state = state._replace(queue=tuple(rest))
        return state, Info(sites, state.sweep, not rest)

    def _begin(self, state: State, active: NDArray[np.bool_]) -> State:
        colors = np.arange(len(state.members))
        sweep = state.sweep + 1
        order = np.argsort(random.draw4(state.seed, state.level, sweep, colors, random.SCHEDULE)[0], kind="stable")
        active = active.ravel()
        queue = []
        for color in order:
            members = state.members[color]
            members = members[active[members]]
            if members.size:
                queue.append(state.pixel[members])
        return state._replace(sweep=sweep, queue=tuple(queue) or (state.pixel[:0],))
