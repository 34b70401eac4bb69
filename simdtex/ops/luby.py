# SPDX-License-Identifier: BSD-3-Clause
"""A random maximal set of sites without neighbours, equation (14), by the rounds of Luby (1986)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid

UNDECIDED, IN, OUT = 0, 1, 2

ROUNDS = 4
"""Rounds between two checks for the end; further rounds change nothing."""


@Operation
def luby(
    machine: Launcher | None, grid: Grid, offsets: Array, active: Array, seed: int, level: int, count: int
) -> NDArray[np.uint8]:
    """Return the members of the set, (rows, cols) uint8, on the host, where a schedule needs them.

    ``active`` (rows, cols) uint8 is 1 at sites that may be members. The set is the greedy choice in the order of
    priorities, so it does not depend on the rounds. Cost: O(rows cols N) per round, some 5 to 10 rounds.
    """
    sites = grid.size
    if machine is None:
        draws = random.draw4(seed, level, count, np.arange(sites), random.SCHEDULE)[0].astype(np.int64)
        host = np.where(active.ravel(), UNDECIDED, OUT).astype(np.uint8)
        while (undecided := np.flatnonzero(host == UNDECIDED).astype(np.int32)).size:
            r = grid.flat.neighbours(undecided, offsets)
            there = r >= 0
            beaten = there & (host[r] == IN)
            above = (draws[r] > draws[undecided]) | ((draws[r] == draws[undecided]) & (r > undecided))
            rival = there & (host[r] == UNDECIDED) & above
            host[undecided] = np.where(beaten.any(0), OUT, np.where(rival.any(0), UNDECIDED, IN))
        return np.asarray(host == IN, np.uint8).reshape(active.shape)
    priority = machine.empty((sites,), np.uint32)
    state, following = (machine.empty(grid.shape, np.uint8) for _ in range(2))
    machine.launch(
        "luby_priority",
        (sites,),
        *(sites, np.uint64(seed), np.uint32(level), np.uint32(count), active, priority, state),
    )
    while True:
        for _ in range(ROUNDS):
            machine.launch(
                "luby_round", (sites,), grid.flat.struct, offsets, offsets.shape[0], priority, state, following
            )
            state, following = following, state
        host = machine.get(state)
        if not (host == UNDECIDED).any():
            return np.asarray(host == IN, np.uint8)
