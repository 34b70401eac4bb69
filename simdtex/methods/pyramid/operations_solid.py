# SPDX-License-Identifier: BSD-3-Clause
"""Blocks of solid textures: their Laplacian pyramid in integers, their slices in other directions, their mean.

Blocks are (depth, rows, cols) int32 and wrap around. A level has half the slices, rows and columns of the one below it;
an odd number of them is folded instead, see `simdtex.methods.pyramid.laplacian`. Results are correct if the input of a
reduction is below 2**23 and that of an expansion below 2**25, positive or negative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.pyramid.laplacian import folded

MOST_ITEMS = 2**21
"""About the most work-items of a launch, so that none takes long on a slow device."""

MOST_BLOCKS = 4
"""The most blocks of `solid_mean`."""


def above(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape of the level above a level of ``shape``."""
    return tuple(n if n % 2 else n // 2 for n in shape)


def _weighted(near: list[NDArray[np.int64]], weights: Sequence[int]) -> NDArray[np.int64]:
    return np.asarray(sum(w * g for w, g in zip(weights, near, strict=True)))


def _expanded(coarse: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return 2up(G_{i+1}) at a level of ``shape``."""
    g, bits = coarse.astype(np.int64), 0
    for axis in range(3):
        n = g.shape[axis]
        bits += 4 if shape[axis] % 2 else 3
        if shape[axis] % 2:
            whole = np.empty_like(g)
            whole[(slice(None),) * axis + (folded(n),)] = g  # back at their places
            g = _weighted([np.roll(whole, -a, axis) for a in range(-2, 3)], (1, 4, 6, 4, 1))
            continue
        near = [np.roll(g, -a, axis) for a in (-1, 0, 1)]
        children = np.stack([_weighted(near, (1, 6, 1)), _weighted(near, (0, 4, 4))], axis + 1)
        g = children.reshape(*g.shape[:axis], 2 * n, *g.shape[axis + 1 :])
    return (g + (1 << bits - 1)) >> bits


def _parts(slices: int, pixels: int) -> Iterator[tuple[int, tuple[int, int]]]:
    """Yield the first slice of each launch, and its work-items: pixels of a slice, and slices."""
    step = max(1, MOST_ITEMS // pixels)
    for first in range(0, slices, step):
        yield first, (pixels, min(step, slices - first))


def _launch_expanded(machine: Launcher, sign: int, known: Array, coarse: Array) -> Array:
    result, odd = machine.empty(known.shape, np.int32), any(n % 2 for n in known.shape)
    kernel = "solid_folded" if odd else "solid_expanded"
    depth, rows, cols = known.shape if odd else coarse.shape
    for first, size in _parts(depth, rows * cols):
        machine.launch(kernel, size, known, coarse, first, *known.shape, sign, result)
    return result


@Operation
def solid_reduce(machine: Launcher | None, fine: Array) -> Array:
    """Return G_{i+1} from the block G_i. Cost: 125 multiply-adds per voxel."""
    if machine is None:
        g = fine.astype(np.int64)
        for axis in range(3):
            n = g.shape[axis]
            center = 2 * np.arange(above((n,))[0])
            g = _weighted([g.take(center + a, axis, mode="wrap") for a in range(-2, 3)], (1, 4, 6, 4, 1))
        return ((g + 2**11) >> 12).astype(np.int32)
    depth, rows, cols = above(fine.shape)
    coarse = machine.empty((depth, rows, cols), np.int32)
    for first, size in _parts(depth, rows * cols):
        machine.launch("solid_reduce", size, fine, first, *fine.shape, coarse)
    return coarse


@Operation
def solid_band(machine: Launcher | None, fine: Array, coarse: Array) -> Array:
    """Return L_i from G_i and G_{i+1}. Cost: 12 multiply-adds per voxel of L_i."""
    if machine is None:
        return (fine - _expanded(coarse, fine.shape)).astype(np.int32)
    return _launch_expanded(machine, -1, fine, coarse)


@Operation
def solid_collapse(machine: Launcher | None, band: Array, coarse: Array) -> Array:
    """Return G_i from L_i and G_{i+1}: the original G_i, to the bit, if these are unchanged."""
    if machine is None:
        return (band + _expanded(coarse, band.shape)).astype(np.int32)
    return _launch_expanded(machine, 1, band, coarse)


@Operation
def solid_turn(machine: Launcher | None, block: Array, axes: Sequence[int]) -> Array:
    """Return the block with its axes in the order ``axes``, as `numpy.transpose` does.

    (0, 1, 2) has the x-y slices one behind the other, (1, 0, 2) the x-z slices, (2, 0, 1) the y-z slices.
    """
    if machine is None:
        return np.ascontiguousarray(block.transpose(axes))
    steps = (block.shape[1] * block.shape[2], block.shape[2], 1)
    depth, rows, cols = (block.shape[axis] for axis in axes)
    turned = machine.empty((depth, rows, cols), np.int32)
    for first, size in _parts(depth, rows * cols):
        machine.launch("solid_turn", size, block, first, depth, rows, cols, *(steps[axis] for axis in axes), turned)
    return turned


@Operation
def solid_mean(machine: Launcher | None, blocks: Sequence[Array]) -> Array:
    """Return the mean of one to four int32 arrays of one shape, halves rounded up.

    For k arrays it is floor((2 sum + k) / (2 k)), for any values. The sum has 64 bits.
    """
    k = len(blocks)
    if machine is None:
        return np.asarray((2 * np.sum(blocks, axis=0, dtype=np.int64) + k) // (2 * k), np.int32)
    mean = machine.empty(blocks[0].shape, np.int32)
    four = [*blocks, *[blocks[0]] * (MOST_BLOCKS - k)]
    machine.launch("solid_mean", (mean.size,), *four, mean.size, mean, defines={"COUNT": k})
    return mean
