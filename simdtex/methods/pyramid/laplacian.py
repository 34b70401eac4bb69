# SPDX-License-Identifier: BSD-3-Clause
"""Operations on levels: white noise, folding, the Laplacian pyramid in integers, and local texture measures.

Folding takes every second pixel of a torus of any size, and back. With an even number of rows, every second row is half
of all rows. With an odd number, every second row is taken over two turns around the torus, which reach each row once:
the result is as large as the picture, and its neighbours are two rows apart in the picture. A filter on the result is
then the filter with holes that the next level of a pyramid requires.

The Laplacian pyramid is that of Burt and Adelson, De Bonet's equations (5) and (6). Pictures are (planes, rows, cols)
int32. A level has half the rows and columns of the one below it, rounded up. Sums fit 32 bits if the input of a
reduction is below 2**23, and that of a collapse below 2**25.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation


@Operation
def noise(machine: Launcher | None, planes: int, n: int, seed: int, level: int) -> Array:
    """Return white noise (planes, n) int32, uniform over all 32 bits.

    Plane p has word p % 4 of the draws of turn p // 4 at sites 0 .. n-1.
    """
    if machine is None:
        draws = [random.draw4(seed, level, turn, np.arange(n), random.NOISE) for turn in range(-(-planes // 4))]
        return np.concatenate(draws)[:planes].view(np.int32)
    values = machine.empty((planes, n), np.int32)
    machine.launch("noise", (n, -(-planes // 4)), np.uint64(seed), level, planes, n, values)
    return values


def folded(n: int) -> NDArray[np.intp]:
    """Return the indices, among n rows or columns of a picture, of those of the result, in order."""
    return np.arange(n if n % 2 else n // 2) * 2 % n


@Operation
def fold(machine: Launcher | None, picture: Array) -> Array:
    """Return every second row and column of (planes, rows, cols) int32; all of an odd number, see above."""
    planes, rows, cols = picture.shape
    row, col = folded(rows), folded(cols)
    if machine is None:
        return np.ascontiguousarray(picture[:, row[:, None], col])
    coarse = machine.empty((planes, row.size, col.size), np.int32)
    machine.launch("fold", (row.size * col.size, planes), picture, planes, rows, cols, coarse)
    return coarse


@Operation
def unfold(machine: Launcher | None, coarse: Array, shape: tuple[int, ...]) -> Array:
    """Return a picture (planes, rows, cols) with the pixels of ``coarse`` at their places and 0 between them."""
    planes, (rows, cols) = coarse.shape[0], shape
    if machine is None:
        spread = np.zeros((planes, rows, cols), np.int32)
        spread[:, folded(rows)[:, None], folded(cols)] = coarse
        return spread
    picture = machine.empty((planes, rows, cols), np.int32)
    machine.launch("fold_back", (rows * cols, planes), coarse, planes, rows, cols, picture)
    return picture


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
        index, place = np.divmod(np.arange(shape[axis - 1]), tile[axis - 1])
        parent = index * half(tile)[axis - 1] + place // 2
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
            within(axis[np.ix_(*near)].astype(np.intp) - by, n, torus)
            for axis, by, n in zip(place, (step[0][:, None], step[1]), (rows, cols), strict=True)
        )
        total += (2 - abs(a)) * (2 - abs(b)) * band[:, row, col].astype(np.int64)
    return (total + 8) >> 4


def shifted(n: int, by: int, torus: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the neighbours on one side of n pixels in a line, and their offsets; an end pixel may be its own."""
    line = np.arange(n)
    near = line + by
    return (near % n, np.full(n, by)) if torus else (np.clip(near, 0, n - 1), np.clip(near, 0, n - 1) - line)


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
        detail = _joined(band, source, torus) if blend else band.reshape(len(band), -1)[:, source]
        return (detail + _expanded(coarse, source.shape, band.shape[1:], torus)).astype(np.int32)
    planes, (rows, cols) = band.shape[0], source.shape
    fine = machine.empty((planes, rows, cols), np.int32)
    machine.launch(
        "laplacian_collapse",
        (rows * cols, planes),
        *(band, *band.shape, torus, source, rows, cols, coarse, *coarse.shape[1:], blend, fine),
    )
    return fine


UNIT_BITS = 14
"""Taps are integer multiples of 2**-14."""


FILTER_SIDE, SIGMA = 3, 0.7
"""Rows and columns of a filter, and the standard deviation of its Gaussian, pixels."""


def bank(orientations: int) -> NDArray[np.int32]:
    """Return first and second derivatives of a Gaussian in ``orientations`` directions: edges and lines.

    The derivatives have the angles pi a / n, a = 0 .. n-1, with n orientations, from the column axis towards the row
    axis.

    Returns
    -------
    (2 n, `FILTER_SIDE`, `FILTER_SIDE`) int32 array
        Filters for correlation in units of 2**-14, the n first derivatives first. The positive taps of a filter add up
        to about 1, and all its taps to 0.
    """
    y, x = np.mgrid[:FILTER_SIDE, :FILTER_SIDE] - FILTER_SIDE // 2
    gauss = np.exp(-(x * x + y * y) / (2 * SIGMA * SIGMA))
    taps = []
    for degree in (1, 2):
        for a in range(orientations):
            angle = np.pi * a / orientations
            u = (x * np.cos(angle) + y * np.sin(angle)) / SIGMA
            f = gauss * (u if degree == 1 else u * u - 1)
            if degree == 2:
                f -= gauss * f.sum() / gauss.sum()
            whole = np.rint(f / f[f > 0].sum() * 2**UNIT_BITS).astype(np.int32)
            whole[FILTER_SIDE // 2, FILTER_SIDE // 2] -= whole.sum()
            taps.append(whole)
    return np.array(taps, np.int32).reshape(-1, FILTER_SIDE, FILTER_SIDE)


@Operation
def filters(machine: Launcher | None, picture: Array, band: Array, taps: Array, torus: bool) -> Array:
    """Return F^0, F^1, ... of equation (7), (rows * cols, planes * (1 + filters)) int32.

    ``picture`` and ``band`` (planes, rows, cols) int32 are G and L of a level; ``taps`` comes from `bank`. Cost:
    side**2 multiply-adds of 64 bits for each pixel, plane and filter.
    """
    planes, rows, cols = picture.shape
    count, side, _ = taps.shape
    if machine is None:
        reach = side // 2
        row, col = (within(np.arange(-reach, n + reach), n, torus) for n in (rows, cols))
        responses = []
        for g, detail in zip(picture, band, strict=True):
            around = g[np.ix_(row, col)].astype(np.int64)
            responses.append(detail)
            for f in taps:
                total = np.zeros((rows, cols), np.int64)
                for a, b in np.ndindex(f.shape):
                    total += f[a, b] * around[a : a + rows, b : b + cols]
                responses.append((total + (1 << UNIT_BITS - 1)) >> UNIT_BITS)
        return np.stack(responses, -1).reshape(rows * cols, -1).astype(np.int32)
    features = machine.empty((rows * cols, planes * (1 + count)), np.int32)
    machine.launch(
        "filters",
        (rows * cols, planes * (1 + count)),
        *(picture, band, planes, rows, cols, torus, taps, count, side, features),
    )
    return features
