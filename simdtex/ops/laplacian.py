# SPDX-License-Identifier: BSD-3-Clause
"""The Laplacian pyramid of Burt and Adelson in integers, De Bonet's equations (5) and (6).

Pictures are (planes, rows, cols) int32. A level has half the rows and columns of the one below it, rounded up. Sums
stay within 32 bits where what is reduced is below 2**23, and what is collapsed below 2**25.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation, touching


def half(shape: tuple[int, ...]) -> tuple[int, int]:
    """Rows and columns of the level above one of these rows and columns."""
    return -(-shape[0] // 2), -(-shape[1] // 2)


def within(index: NDArray[np.intp], n: int, torus: bool) -> NDArray[np.intp]:
    """Indices brought to 0 .. n-1, as on a torus or in a mirror on the outer pixels (kernels/common/border.h)."""
    period = n if torus else max(1, 2 * n - 2)
    index = index % period
    return np.where(index < n, index, period - index)


def _reduce(fine: NDArray[np.int32], torus: bool) -> NDArray[np.int32]:
    g = fine.astype(np.int64)
    for axis in (1, 2):
        n = g.shape[axis]
        near = [g.take(within(np.arange(0, n, 2) + a, n, torus), axis) for a in range(-2, 3)]
        g = near[0] + 4 * near[1] + 6 * near[2] + 4 * near[3] + near[4]
    return ((g + 128) >> 8).astype(np.int32)


def _expanded(
    coarse: NDArray[np.int32], shape: tuple[int, ...], tile: tuple[int, ...], torus: bool
) -> NDArray[np.int64]:
    """2up(G_{i+1}) at a level of these rows and columns, made of tiles of those."""
    g = coarse.astype(np.int64)
    for axis in (1, 2):
        n = g.shape[axis]
        number, place = np.divmod(np.arange(shape[axis - 1]), tile[axis - 1])
        parent = number * half(tile)[axis - 1] + place // 2
        near = [g.take(within(parent + a, n, torus), axis) for a in (-1, 0, 1)]
        first = (place % 2 == 0).reshape((-1, 1) if axis == 1 else -1)
        g = np.where(first, near[0] + 6 * near[1] + near[2], 4 * near[1] + 4 * near[2])
    return (g + 32) >> 6


def _band(fine: NDArray[np.int32], coarse: NDArray[np.int32], torus: bool) -> NDArray[np.int32]:
    shape = fine.shape[1:]
    return (fine - _expanded(coarse, shape, shape, torus)).astype(np.int32)


def _collapse(
    band: NDArray[np.int32], source: NDArray[np.int32], coarse: NDArray[np.int32], torus: bool
) -> NDArray[np.int32]:
    taken = band.reshape(len(band), -1)[:, source]
    return (taken + _expanded(coarse, source.shape, band.shape[1:], torus)).astype(np.int32)


def _joined(band: NDArray[np.int32], source: NDArray[np.int32], torus: bool) -> NDArray[np.int64]:
    """L_i of the output, (planes, rows, cols), where pieces of the sample that meet fade into each other."""
    rows, cols = band.shape[1:]
    place, total = np.divmod(source, np.int32(cols)), np.zeros((len(band), *source.shape), np.int64)
    for a, b in product((-1, 0, 1), repeat=2):
        near, step = zip(*(beside(n, d, torus) for n, d in zip(source.shape, (a, b), strict=True)), strict=True)
        row, col = (
            within(own[np.ix_(*near)].astype(np.intp) - by, n, torus)
            for own, by, n in zip(place, (step[0][:, None], step[1]), (rows, cols), strict=True)
        )
        total += (2 - abs(a)) * (2 - abs(b)) * band[:, row, col].astype(np.int64)
    return (total + 8) >> 4


def beside(n: int, by: int, torus: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The neighbours of n pixels in a line on one side, and how far they are: without a torus the last has itself."""
    own = np.arange(n)
    near = own + by
    return (near % n, np.full(n, by)) if torus else (np.clip(near, 0, n - 1), np.clip(near, 0, n - 1) - own)


def _blend(
    band: NDArray[np.int32], source: NDArray[np.int32], coarse: NDArray[np.int32], torus: bool
) -> NDArray[np.int32]:
    made = _joined(band, source, torus) + _expanded(coarse, source.shape, band.shape[1:], torus)
    return made.astype(np.int32)


def _sizes(*numbers: int) -> tuple[np.int32, ...]:
    return tuple(np.int32(n) for n in numbers)


def _launch_reduce(machine: Launcher, fine: Array, torus: bool) -> Array:
    planes, rows, cols = fine.shape
    coarse = machine.empty((planes, *half((rows, cols))), np.int32)
    machine.launch(
        machine.kernel("laplacian", "laplacian_reduce"),
        (coarse.shape[1] * coarse.shape[2], planes),
        *(fine, *_sizes(planes, rows, cols, torus), coarse),
        work=touching(fine, coarse, fma=25 * coarse.size),
    )
    return coarse


def _launch_band(machine: Launcher, fine: Array, coarse: Array, torus: bool) -> Array:
    planes, rows, cols = fine.shape
    band = machine.empty(fine.shape, np.int32)
    machine.launch(
        machine.kernel("laplacian", "laplacian_band"),
        (rows * cols, planes),
        *(fine, coarse, *_sizes(planes, rows, cols, torus), band),
        work=touching(fine, coarse, band, fma=25 / 4 * band.size),
    )
    return band


def _launch_collapse(machine: Launcher, band: Array, source: Array, coarse: Array, torus: bool) -> Array:
    return _launch_up(machine, "laplacian_collapse", 25 / 4, band, source, coarse, torus)


def _launch_blend(machine: Launcher, band: Array, source: Array, coarse: Array, torus: bool) -> Array:
    return _launch_up(machine, "laplacian_blend", 25 / 4 + 9, band, source, coarse, torus)


def _launch_up(
    machine: Launcher, kernel: str, each: float, band: Array, source: Array, coarse: Array, torus: bool
) -> Array:
    rows, cols = source.shape
    fine = machine.empty((band.shape[0], rows, cols), np.int32)
    machine.launch(
        machine.kernel("laplacian", kernel),
        (rows * cols, band.shape[0]),
        *(band, *_sizes(*band.shape, torus), source, *_sizes(rows, cols), coarse, *_sizes(*coarse.shape[1:]), fine),
        work=touching(band, source, coarse, fine, fma=each * fine.size),
    )
    return fine


laplacian_reduce = Operation("laplacian", _reduce, _launch_reduce)
"""``laplacian_reduce(machine, fine, torus)``: G_{i+1} of G_i, equation (6). Cost: 25 multiply-adds a pixel of it."""

laplacian_band = Operation("laplacian", _band, _launch_band)
"""``laplacian_band(machine, fine, coarse, torus)``: L_i of G_i and G_{i+1}, equation (5)."""

laplacian_collapse = Operation("laplacian", _collapse, _launch_collapse)
"""``laplacian_collapse(machine, band, source, coarse, torus)``: G_i of L_i and G_{i+1}.

``source`` (rows, cols) int32 are the pixels of ``band`` that make up L_i, which may be of another size.
"""

laplacian_blend = Operation("laplacian", _blend, _launch_blend)
"""``laplacian_blend(machine, band, source, coarse, torus)``: as `laplacian_collapse`, without hard seams.

Where neighbours are not neighbours in the band, a pixel of L_i is the mean, by (1, 2, 1) / 4 in each direction, of what
the band has there if each neighbour's piece goes on; elsewhere it is the band's own pixel, to the bit.
"""
