# SPDX-License-Identifier: BSD-3-Clause
"""Active sites, with a temperature above 0: counted and listed on the machine, without a copy to the host."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid

CHUNK = 256
"""The most sites that a work-item counts."""


@Operation
def survey(machine: Launcher | None, grid: Grid, temperature: Array) -> tuple[int, int]:
    """Return the number of active sites, and the sum of their temperatures in 1/1024."""
    if machine is None:
        t = grid.view(temperature)
        return int((t > 0).sum()), int(t.sum(dtype=np.int64))
    stretches = -(-grid.size // CHUNK)
    both = machine.empty((2, stretches), np.int32)
    machine.launch("active_survey", (stretches,), grid.struct, temperature, CHUNK, stretches, both)
    count, total = machine.get(both).sum(1, dtype=np.int64)
    return int(count), int(total)


def stretches(starts: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the stretches, of at most `CHUNK` sites, of the groups of a list, which begin at ``starts``.

    The first result is the position of each stretch's first site, and the end of the list, (stretches + 1,); the second
    is the number of the first stretch of each group, and the number of stretches, (groups + 1,).
    """
    pieces = -(-np.diff(starts) // CHUNK)
    firsts = np.concatenate([[0], np.cumsum(pieces)])
    within = np.arange(firsts[-1]) - np.repeat(firsts[:-1], pieces)
    begins = np.repeat(starts[:-1], pieces) + within * CHUNK
    return np.concatenate([begins, starts[-1:]]).astype(np.int32), firsts


@Operation
def among(
    machine: Launcher | None, sites: Array, starts: Array, firsts: NDArray[np.int64], temperature: Array
) -> tuple[Array, NDArray[np.int64]]:
    """Return the active sites of a list in its order, and the bounds of its groups among them.

    ``sites`` (S,) int32 are pixel indices, group after group; ``starts`` and ``firsts`` come from `stretches`.
    """
    if machine is None:
        active = temperature.ravel()[sites] > 0
        return sites[active], np.concatenate([[0], np.cumsum(active)])[starts[firsts]]
    stretches = starts.size - 1
    counts = machine.empty((stretches,), np.int32)
    machine.launch("active_count", (stretches,), sites, starts, stretches, temperature, counts)
    before = np.concatenate([[0], np.cumsum(machine.get(counts), dtype=np.int64)])
    if before[-1] < sites.size:
        kept = machine.empty((int(before[-1]),), np.int32)
        machine.launch(
            "active_keep",
            (stretches,),
            *(sites, starts, stretches, temperature, machine.put(before[:-1].astype(np.int32)), kept),
        )
        sites = kept
    return sites, before[firsts]
