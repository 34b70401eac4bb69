# SPDX-License-Identifier: BSD-3-Clause
"""Blocks of solid textures: their Laplacian pyramid in integers, their slices the other ways, their mean.

Blocks are (depth, rows, cols) int32. A level has half the slices, rows and columns of the one below it, rounded up;
around a torus an odd number of them is folded instead, see `simdtex.ops.fold`.
Results are right where what is reduced is below 2**23 and what is expanded below 2**25, positive or negative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation, Work, touching
from simdtex.ops.fold import folded
from simdtex.ops.laplacian import within

MOST_ITEMS = 2**21
"""Work-items of a launch, about: so that none is long on a slow device."""

MOST_BLOCKS = 4
"""Blocks that `solid_mean` takes."""


def above(shape: tuple[int, ...], torus: bool) -> tuple[int, ...]:
    """The shape of the level above one of this shape."""
    return tuple(n if torus and n % 2 else -(-n // 2) for n in shape)


def _weighted(near: list[NDArray[np.int64]], weights: Sequence[int]) -> NDArray[np.int64]:
    return np.asarray(sum(w * g for w, g in zip(weights, near, strict=True)))


def _reduce(fine: NDArray[np.int32], torus: bool) -> NDArray[np.int32]:
    g = fine.astype(np.int64)
    for axis in range(3):
        n = g.shape[axis]
        center = 2 * np.arange(above((n,), torus)[0])
        near = [g.take(within(center + a, n, torus), axis) for a in range(-2, 3)]
        g = _weighted(near, (1, 4, 6, 4, 1))
    return ((g + 2**11) >> 12).astype(np.int32)


def _expanded(coarse: NDArray[np.int32], shape: tuple[int, ...], torus: bool) -> NDArray[np.int64]:
    """2up(G_{i+1}) at a level of this shape."""
    g, bits = coarse.astype(np.int64), 0
    for axis in range(3):
        n = g.shape[axis]
        bits += 4 if torus and shape[axis] % 2 else 3
        if torus and shape[axis] % 2:
            whole = np.empty_like(g)
            whole[(slice(None),) * axis + (folded(n),)] = g  # back where they were
            g = _weighted([np.roll(whole, -a, axis) for a in range(-2, 3)], (1, 4, 6, 4, 1))
            continue
        near = [g.take(within(np.arange(n) + a, n, torus), axis) for a in (-1, 0, 1)]
        children = np.stack([_weighted(near, (1, 6, 1)), _weighted(near, (0, 4, 4))], axis + 1)
        g = children.reshape(*g.shape[:axis], 2 * n, *g.shape[axis + 1 :]).take(range(shape[axis]), axis)
    return (g + (1 << bits - 1)) >> bits


def _band(fine: NDArray[np.int32], coarse: NDArray[np.int32], torus: bool) -> NDArray[np.int32]:
    return (fine - _expanded(coarse, fine.shape, torus)).astype(np.int32)


def _collapse(band: NDArray[np.int32], coarse: NDArray[np.int32], torus: bool) -> NDArray[np.int32]:
    return (band + _expanded(coarse, band.shape, torus)).astype(np.int32)


def _turn(block: NDArray[np.int32], axes: Sequence[int]) -> NDArray[np.int32]:
    return np.ascontiguousarray(block.transpose(axes))


def _mean(blocks: Sequence[NDArray[np.int32]]) -> NDArray[np.int32]:
    k = len(blocks)
    _check_count(k)
    total = np.sum(blocks, axis=0, dtype=np.int64)
    return np.asarray((2 * total + k) // (2 * k), np.int32)


def _check_count(k: int) -> None:
    if not 1 <= k <= MOST_BLOCKS:
        raise ValueError(f"there are {k} blocks to average: give 1 to {MOST_BLOCKS}")


def _sizes(*numbers: int) -> tuple[np.int32, ...]:
    return tuple(np.int32(n) for n in numbers)


def _parts(slices: int, pixels: int) -> Iterator[tuple[np.int32, tuple[int, int]]]:
    """The first slice of each launch, and its work-items: pixels of a slice, and slices."""
    step = max(1, MOST_ITEMS // pixels)
    for first in range(0, slices, step):
        yield np.int32(first), (pixels, min(step, slices - first))


def _work(size: tuple[int, int], fma: int | None, values: int) -> Work:
    """The work of a launch whose items each do so many fma and read or write so many values."""
    items = prod(size)
    return Work(None if fma is None else float(fma * items), 4.0 * values * items)


def _launch_reduce(machine: Launcher, fine: Array, torus: bool) -> Array:
    depth, rows, cols = above(fine.shape, torus)
    coarse = machine.empty((depth, rows, cols), np.int32)
    kernel = machine.kernel("solid", "solid_reduce")
    for first, size in _parts(depth, rows * cols):
        work = _work(size, 125, 8 + 1)
        machine.launch(kernel, size, fine, first, *_sizes(*fine.shape, torus), coarse, work=work)
    return coarse


def _launch_expanded(machine: Launcher, function: str, known: Array, coarse: Array, torus: bool) -> Array:
    result = machine.empty(known.shape, np.int32)
    if torus and any(n % 2 for n in known.shape):
        sign = 1 if function == "solid_collapse" else -1
        depth, rows, cols = known.shape
        for first, size in _parts(depth, rows * cols):
            arguments = (known, coarse, first, *_sizes(*known.shape, sign), result)
            machine.launch(machine.kernel("solid", "solid_folded"), size, *arguments)
        return result
    depth, rows, cols = coarse.shape
    kernel = machine.kernel("solid", function)
    for first, size in _parts(depth, rows * cols):
        work = _work(size, 125, 8 + 8 + 1)
        machine.launch(kernel, size, known, coarse, first, *_sizes(*known.shape, torus), result, work=work)
    return result


def _launch_band(machine: Launcher, fine: Array, coarse: Array, torus: bool) -> Array:
    return _launch_expanded(machine, "solid_band", fine, coarse, torus)


def _launch_collapse(machine: Launcher, band: Array, coarse: Array, torus: bool) -> Array:
    return _launch_expanded(machine, "solid_collapse", band, coarse, torus)


def _launch_turn(machine: Launcher, block: Array, axes: Sequence[int]) -> Array:
    steps = (block.shape[1] * block.shape[2], block.shape[2], 1)
    depth, rows, cols = (block.shape[axis] for axis in axes)
    turned = machine.empty((depth, rows, cols), np.int32)
    kernel = machine.kernel("solid", "solid_turn")
    for first, size in _parts(depth, rows * cols):
        sizes = _sizes(depth, rows, cols, *(steps[axis] for axis in axes))
        machine.launch(kernel, size, block, first, *sizes, turned, work=_work(size, None, 2))
    return turned


def _launch_mean(machine: Launcher, blocks: Sequence[Array]) -> Array:
    k = len(blocks)
    _check_count(k)
    mean = machine.empty(blocks[0].shape, np.int32)
    four = [*blocks, *[blocks[0]] * (MOST_BLOCKS - k)]
    kernel, work = machine.kernel("solid", "solid_mean", COUNT=k), touching(*blocks, mean)
    machine.launch(kernel, (mean.size,), *four, np.int32(mean.size), mean, work=work)
    return mean


solid_reduce = Operation("solid", _reduce, _launch_reduce)
"""``solid_reduce(machine, fine, torus)``: G_{i+1} of the block G_i. Cost: 125 multiply-adds a voxel."""

solid_band = Operation("solid", _band, _launch_band)
"""``solid_band(machine, fine, coarse, torus)``: L_i of G_i and G_{i+1}. Cost: 12 multiply-adds a voxel of L_i."""

solid_collapse = Operation("solid", _collapse, _launch_collapse)
"""``solid_collapse(machine, band, coarse, torus)``: G_i of L_i and G_{i+1}, to the bit where they are its own."""

solid_turn = Operation("solid", _turn, _launch_turn)
"""``solid_turn(machine, block, axes)``: the block with its axes in this order, as `numpy.transpose` orders them.

(0, 1, 2) has the x-y slices one behind the other, (1, 0, 2) the x-z slices, (2, 0, 1) the y-z slices.
"""

solid_mean = Operation("solid", _mean, _launch_mean)
"""``solid_mean(machine, blocks)``: the mean of one to four int32 arrays of one shape, half rounded up.

Of k arrays floor((2 sum + k) / (2 k)), for any values. The sum is taken in 64 bits.
"""
