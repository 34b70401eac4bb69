# SPDX-License-Identifier: BSD-3-Clause
"""The beginning of a level: sites of the level above keep their values, all others are random pixels of the sample."""

from __future__ import annotations

from math import prod

import numpy as np

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Field


@Operation
def start(
    machine: Launcher | None, pixels: Array, positions: Array, grid: Grid, seed: int, above: Field | None = None
) -> Field:
    """Return the field of a level or a window of it before its first sweep: steps 2 and 5 of Algorithm 1.

    The sites of the level above, which ``above`` holds as far as they are in the window (`Grid.above`), keep their
    values, sources and temperatures. Every other site is a pixel of the sample at a position drawn from ``positions``,
    at temperature 1.
    """
    (channels, plane), shape = pixels.shape, grid.shape
    if machine is None:
        lo, hi, *_ = random.draw4(seed, 0, 0, grid.places(np.arange(grid.size)), random.START)
        source = positions[random.below(lo, hi, positions.size)].reshape(shape)
        field = Field(pixels[:, source].astype(np.uint16), source, np.full(shape, 1024, np.uint16))
        if above is not None:
            shared = tuple(slice(first % 2, None, 2) for first in grid.first)
            for made, kept in zip(field, above, strict=True):
                to = made[(..., *shared)]
                to[...] = kept[..., : to.shape[-2], :]  # without an older picture below it
        return field
    values = machine.empty((channels, *shape), np.uint16)
    field = Field(values, machine.empty(shape, np.int32), machine.empty(shape, np.uint16))
    nothing = machine.constant(np.zeros((1, 0, 0), np.int32))
    held = above or Field(nothing, nothing, nothing)
    machine.launch(
        "start",
        (grid.size,),
        *(np.uint64(seed), pixels, plane, channels, positions, positions.size, grid.struct),
        *(*held, prod(held.source.shape), *held.source.shape[-2:], *field),
        defines=grid.defines,
    )
    return field
