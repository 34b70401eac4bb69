# SPDX-License-Identifier: BSD-3-Clause
"""The picture before the first level: every site a pixel of the sample at random, at temperature 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Field


def _reference(pixels: NDArray[np.float32], positions: NDArray[np.int32], grid: Grid, seed: int) -> Field:
    lo, hi, *_ = random.draw4(seed, 0, 0, grid.places(grid.sites()), random.START)
    shape = (grid.height, grid.width)
    source = positions[random.below(lo, hi, positions.size)].reshape(shape)
    return Field(pixels[:, source].astype(np.uint16), source, np.full(shape, 1024, np.uint16))


def _launch(machine: Launcher, pixels: Array, positions: Array, grid: Grid, seed: int) -> Field:
    channels, plane = pixels.shape
    shape = (grid.height, grid.width)
    field = Field(
        machine.empty((channels, *shape), np.uint16),
        machine.empty(shape, np.int32),
        machine.empty(shape, np.uint16),
    )
    machine.launch(
        machine.kernel("start", "start"),
        (grid.plane,),
        *(np.uint64(seed), pixels, np.int32(plane), np.int32(channels), positions),
        *(np.int32(positions.size), grid.struct, *field),
    )
    return field


start = Operation("start", _reference, _launch)
