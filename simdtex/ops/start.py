# SPDX-License-Identifier: BSD-3-Clause
"""The picture before the first level: every site is a random pixel of the sample, at temperature 1."""

from __future__ import annotations

import numpy as np

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Field


@Operation
def start(machine: Launcher | None, pixels: Array, positions: Array, grid: Grid, seed: int) -> Field:
    """Return a field whose sites are pixels of the sample at positions drawn from ``positions``."""
    (channels, plane), shape = pixels.shape, grid.pixels
    if machine is None:
        lo, hi, *_ = random.draw4(seed, 0, 0, grid.places(grid.sites()), random.START)
        source = positions[random.below(lo, hi, positions.size)].reshape(shape)
        return Field(pixels[:, source].astype(np.uint16), source, np.full(shape, 1024, np.uint16))
    values = machine.empty((channels, *shape), np.uint16)
    field = Field(values, machine.empty(shape, np.int32), machine.empty(shape, np.uint16))
    machine.launch(
        "start",
        (grid.plane,),
        *(np.uint64(seed), pixels, plane, channels, positions),
        *(positions.size, grid.struct, *field),
    )
    return field
