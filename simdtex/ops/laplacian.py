# SPDX-License-Identifier: BSD-3-Clause
"""The Laplacian pyramid of Burt and Adelson in integers, De Bonet's equations (5) and (6).

Pictures are (planes, rows, cols) int32. A level has half the rows and columns of the one below it, rounded up. Sums fit
32 bits if the input of a reduction is below 2**23, and that of a collapse below 2**25.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation


def half(shape: tuple[int, ...]) -> tuple[int, int]:
    """Return rows and columns of the level above a level of ``shape``."""
    return -(-shape[0] // 2), -(-shape[1] // 2)


def within(index: NDArray[np.intp], n: int, torus: bool) -> NDArray[np.intp]:
    """Return indices within 0 .. n-1: on a torus, or mirrored at the outer pixels (kernels/common/border.h)."""
    period = n if torus else max(1, 2 * n - 2)
    index = index % period
    return np.where(index < n, index, period - index)


def _expanded(
    coarse: NDArray[np.int32], shape: tuple[int, ...], tile: tuple[int, ...], torus: bool
) -> NDArray[np.int64]:
    """Return 2up(G_{i+1}) at a level of ``shape``, made of tiles of shape ``tile``."""
    g = coarse.astype(np.int64)
    for axis in (1, 2):
        n = g.shape[axis]
        number, place = np.divmod(np.arange(shape[axis - 1]), tile[axis - 1])
        parent = number * half(tile)[axis - 1] + place // 2
        near = [g.take(within(parent + a, n, torus), axis) for a in (-1, 0, 1)]
        first = (place % 2 == 0).reshape((-1, 1) if axis == 1 else -1)
        g = np.where(first, near[0] + 6 * near[1] + near[2], 4 * near[1] + 4 * near[2])
    return (g + 32) >> 6


def _joined(band: NDArray[np.int32], source: NDArray[np.int32], torus: bool) -> NDArray[np.int64]:
    """Return L_i of the output, (planes, rows, cols), with blended seams between pieces of the sample."""
    rows, cols = band.shape[1:]
    place, total = np.divmod(source, np.int32(cols)), np.zeros((len(band), *source.shape), np.int64)
    for a, b in product((-1, 0, 1), repeat=2):
        near, step = zip(*(shifted(n, d, torus) for n, d in zip(source.shape, (a, b), strict=True)), strict=True)
        row, col = (
            within(own[np.ix_(*near)].astype(np.intp) - by, n, torus)
            for own, by, n in zip(place, (step[0][:, None], step[1]), (rows, cols), strict=True)
        )
        total += (2 - abs(a)) * (2 - abs(b)) * band[:, row, col].astype(np.int64)
    return (total + 8) >> 4


def shifted(n: int, by: int, torus: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the neighbours on one side of n pixels in a line, and their offsets; an end pixel may be its own."""
    own = np.arange(n)
    near = own + by
    return (near % n, np.full(n, by)) if torus else (np.clip(near, 0, n - 1), np.clip(near, 0, n - 1) - own)


@Operation
def laplacian_reduce(machine: Launcher | None, fine: Array, torus: bool) -> Array:
    """Return G_{i+1} from G_i, equation (6). Cost: 25 multiply-adds per pixel of G_{i+1}."""
    if machine is None:
        g = fine.astype(np.int64)
        for axis in (1, 2):
            n = g.shape[axis]
            near = [g.take(within(np.arange(0, n, 2) + a, n, torus), axis) for a in range(-2, 3)]
            g = near[0] + 4 * near[1] + 6 * near[2] + 4 * near[3] + near[4]
        return ((g + 128) >> 8).astype(np.int32)
    planes, rows, cols = fine.shape
    coarse = machine.empty((planes, *half((rows, cols))), np.int32)
    machine.launch(
        "laplacian_reduce",
        (coarse.shape[1] * coarse.shape[2], planes),
        *(fine, planes, rows, cols, torus, coarse),
    )
    return coarse


@Operation
def laplacian_band(machine: Launcher | None, fine: Array, coarse: Array, torus: bool) -> Array:
    """Return L_i from G_i and G_{i+1}, equation (5)."""
    planes, rows, cols = fine.shape
    if machine is None:
        return (fine - _expanded(coarse, (rows, cols), (rows, cols), torus)).astype(np.int32)
    band = machine.empty(fine.shape, np.int32)
    machine.launch("laplacian_band", (rows * cols, planes), fine, coarse, planes, rows, cols, torus, band)
    return band


@Operation
def laplacian_collapse(
    machine: Launcher | None, band: Array, source: Array, coarse: Array, torus: bool, blend: bool = False
) -> Array:
    """Return G_i from L_i and G_{i+1}.

    ``source`` (rows, cols) int32 are the pixels of ``band`` that form L_i, whose size may differ. With ``blend`` there
    are no hard seams: where neighbours are not neighbours in the band, a pixel of L_i is the mean, weighted by
    (1, 2, 1) / 4 in each direction, of the pixels of the band that continue each neighbour's piece; elsewhere it is the
    pixel of the band, to the bit.
    """
    if machine is None:
        own = _joined(band, source, torus) if blend else band.reshape(len(band), -1)[:, source]
        return (own + _expanded(coarse, source.shape, band.shape[1:], torus)).astype(np.int32)
    planes, (rows, cols) = band.shape[0], source.shape
    fine = machine.empty((planes, rows, cols), np.int32)
    machine.launch(
        "laplacian_collapse",
        (rows * cols, planes),
        *(band, *band.shape, torus, source, rows, cols, coarse, *coarse.shape[1:], blend, fine),
    )
    return fine
