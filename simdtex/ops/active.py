# SPDX-License-Identifier: BSD-3-Clause
"""Which sites are active, that is, warmer than 0: counted and listed on the machine, so that the plane stays there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.model.lattice import Grid

CHUNK = 256
"""Sites that a work-item counts."""


def _survey_reference(grid: Grid, temperature: NDArray[np.uint16]) -> tuple[int, int]:
    t = grid.view(temperature)
    return int((t > 0).sum()), int(t.sum(dtype=np.int64))


def _survey_launch(machine: Launcher, grid: Grid, temperature: Array) -> tuple[int, int]:
    stretches = -(-grid.rows * grid.cols // CHUNK)
    both = machine.empty((2, stretches), np.int32)
    machine.launch(
        machine.kernel("active", "active_survey"),
        (stretches,),
        *(grid.struct, temperature, np.int32(CHUNK), np.int32(stretches), both),
    )
    warm, heat = machine.get(both)
    return int(warm.sum(dtype=np.int64)), int(heat.sum(dtype=np.int64))


survey = Operation("active", _survey_reference, _survey_launch)
"""``survey(machine, grid, temperature)``: how many sites are active, and the sum of their temperatures in 1/1024."""


def _total_reference(grid: Grid, numbers: NDArray[np.int32]) -> int:
    return int(grid.view(numbers).sum(dtype=np.int64))


def _total_launch(machine: Launcher, grid: Grid, numbers: Array) -> int:
    stretches = -(-grid.rows * grid.cols // CHUNK)
    sums = machine.empty((stretches,), np.int32)
    machine.launch(
        machine.kernel("active", "active_total"),
        (stretches,),
        *(grid.struct, numbers, np.int32(CHUNK), np.int32(stretches), sums),
    )
    return int(machine.get(sums).sum(dtype=np.int64))


total = Operation("active", _total_reference, _total_launch)
"""``total(machine, grid, numbers)``: the sum of an (H, W) int32 array over the sites of a grid."""


def _count_reference(
    sites: NDArray[np.int32], starts: NDArray[np.int32], temperature: NDArray[np.uint16]
) -> NDArray[np.int32]:
    before = np.concatenate([[0], np.cumsum(temperature.ravel()[sites] > 0)])
    counts: NDArray[np.int32] = (before[starts[1:]] - before[starts[:-1]]).astype(np.int32)
    return counts


def _count_launch(machine: Launcher, sites: Array, starts: Array, temperature: Array) -> NDArray[np.int32]:
    stretches = starts.size - 1
    counts = machine.empty((stretches,), np.int32)
    machine.launch(
        machine.kernel("active", "active_count"),
        (stretches,),
        *(sites, starts, np.int32(stretches), temperature, counts),
    )
    found: NDArray[np.int32] = machine.get(counts)
    return found


count = Operation("active", _count_reference, _count_launch)
"""``count(machine, sites, starts, temperature)``: how many sites of each stretch of a list are active, on the host."""


def _keep_reference(
    sites: NDArray[np.int32], starts: NDArray[np.int32], temperature: NDArray[np.uint16], counts: NDArray[np.int32]
) -> NDArray[np.int32]:
    return sites[temperature.ravel()[sites] > 0]


def _keep_launch(
    machine: Launcher, sites: Array, starts: Array, temperature: Array, counts: NDArray[np.int32]
) -> Array:
    stretches = starts.size - 1
    firsts = np.cumsum(counts, dtype=np.int32)
    kept = machine.empty((int(firsts[-1]),), np.int32)
    machine.launch(
        machine.kernel("active", "active_keep"),
        (stretches,),
        *(sites, starts, np.int32(stretches), temperature, machine.put(firsts - counts), kept),
    )
    return kept


keep = Operation("active", _keep_reference, _keep_launch)
"""``keep(machine, sites, starts, temperature, counts)``: the active sites of a list, in its order."""


def stretches(starts: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Groups of a list cut into stretches of `CHUNK` sites at most.

    Parameters
    ----------
    starts : (groups + 1,) array
        Where each group begins in the list, and where the last one ends.

    Returns
    -------
    (stretches + 1,) int32 array
        Where each stretch begins, and where the last one ends.
    (groups + 1,) int64 array
        Number of the first stretch of each group, and how many there are.
    """
    pieces = -(-np.diff(starts) // CHUNK)
    firsts = np.concatenate([[0], np.cumsum(pieces)])
    within = np.arange(firsts[-1]) - np.repeat(firsts[:-1], pieces)
    begins = np.repeat(starts[:-1], pieces) + within * CHUNK
    return np.concatenate([begins, starts[-1:]]).astype(np.int32), firsts


def among(
    machine: Machine,
    sites: Array,
    starts: Array,
    firsts: NDArray[np.int64],
    temperature: Array,
) -> tuple[Array, NDArray[np.int64]]:
    """The active sites of a list, group after group.

    Parameters
    ----------
    machine : Machine
    sites : (S,) int32 array of the machine
        Pixel indices, group after group.
    starts : (stretches + 1,) int32 array of the machine
    firsts : (groups + 1,) array
        As of `stretches`.
    temperature : (H, W) uint16 array of the machine

    Returns
    -------
    (active,) int32 array of the machine
    (groups + 1,) int64 array
        Where each group begins among them, and where the last one ends.
    """
    counts = count(machine, sites, starts, temperature)
    before = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    if before[-1] < sites.size:
        sites = keep(machine, sites, starts, temperature, counts)
    return sites, before[firsts]
