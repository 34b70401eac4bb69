# SPDX-License-Identifier: BSD-3-Clause
"""The beginning of a level: sites of the level above keep their values, all others are random pixels of the sample."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid, gathered


@Operation
def start(
    machine: Launcher | None,
    pixels: Array,
    positions: Array,
    grid: Grid,
    seed: int,
    above: Field | None = None,
    squares: NDArray[np.int32] | None = None,
    cols: int = 0,
) -> Field:
    """Return the field of a level or a window of it before its first sweep: steps 2 and 5 of Algorithm 1.

    The sites of the level above in the window, ``above`` (`Grid.above`), keep their values, sources and temperatures.
    Every other site is a pixel of the sample at a position drawn from ``positions``, at temperature 1.

    ``squares`` (n,), if the level above has a sample of half the size, is the first pixel of the 2x2 pixels of this
    sample, of ``cols`` columns, that each of its pixels is. Each site then takes a pixel of the square that the site of
    the level above at or before it has, at temperature 0; below a site without a source, source -1 and values 0.
    """
    (channels, plane), shape = pixels.shape, grid.shape
    if machine is None and squares is not None:
        assert above
        row, col = (first + np.arange(n) for first, n in zip(grid.first, shape, strict=True))
        there = np.ix_(row // 2 - grid.first[0] // 2, col // 2 - grid.first[1] // 2)
        square = gathered(squares, above.source[there], -1)
        source = np.where(square < 0, -1, square + (row % 2 * cols)[:, None] + col % 2).astype(np.int32)
        return Field(gathered(pixels, source, 0).astype(np.uint16), source, np.zeros(shape, np.uint16))
    if machine is None:
        lo, hi, *_ = random.draw4(seed, 0, 0, grid.places(np.arange(grid.size)), random.START)
        source = positions[random.below(lo, hi, positions.size)].reshape(shape)
        field = Field(pixels[:, source].astype(np.uint16), source, np.full(shape, 1024, np.uint16))
        if above is not None:
            shared, every = (tuple(slice(first % 2, None, n) for first in grid.first) for n in (2, None))
            for made, kept in zip(field, above, strict=True):
                to = made[(..., *shared)]
                to[...] = kept[(..., *every)][..., : to.shape[-2], :]  # without an older picture below it
        return field
    values = machine.empty((channels, *shape), np.uint16)
    field = Field(values, machine.empty(shape, np.int32), machine.empty(shape, np.uint16))
    nothing = machine.constant(np.zeros((1, 0, 0), np.int32))
    held = above or Field(nothing, nothing, nothing)
    machine.launch(
        "start",
        (grid.size,),
        *(np.uint64(seed), pixels, plane, channels, positions, positions.size, grid.struct),
        *(*held, prod(held.source.shape), *held.source.shape[-2:]),
        *((nothing, 0) if squares is None else (machine.put(squares), cols)),
        *field,
        defines=grid.defines,
    )
    return field
