# SPDX-License-Identifier: BSD-3-Clause
"""The temperature of a site after its relaxation, equation (13)."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid, gathered


@Operation
def temperature(machine: Launcher | None, sites: Array, field: Field, offsets: Array, grid: Grid, xi: int) -> Array:
    """Return the new temperatures of sites in 1/1024, (S,) uint16; ``xi`` is in 1/1024, too."""
    if machine is None:
        r = grid.neighbours(sites, offsets)
        t = gathered(field.temperature.ravel(), r, 0).astype(np.int32)
        members = np.maximum(1, (r >= 0).sum(0))
        return (np.maximum(0, xi + t.sum(0)) // members).astype(np.uint16)
    cooled = machine.empty((sites.size,), np.uint16)
    machine.launch(
        "temperature",
        (sites.size,),
        *(sites, sites.size, field.temperature, offsets, offsets.shape[0]),
        *(grid.struct, xi, cooled),
        defines=grid.defines,
    )
    return cooled
