# SPDX-License-Identifier: BSD-3-Clause
"""Local texture measures, De Bonet's equation (7): a level's band and its responses to a bank of filters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.laplacian import within

UNIT_BITS = 14
"""Taps are integer multiples of 2**-14."""


SIDE, SIGMA = 3, 0.7
"""Rows and columns of a filter, and the standard deviation of its Gaussian, pixels."""


def bank(orientations: int) -> NDArray[np.int32]:
    """Return first and second derivatives of a Gaussian in ``orientations`` directions: edges and lines.

    The derivatives have the angles pi a / n, a = 0 .. n-1, with n orientations, from the column axis towards the row
    axis.

    Returns
    -------
    (2 n, `SIDE`, `SIDE`) int32 array
        Filters for correlation in units of 2**-14, the n first derivatives first. The positive taps of a filter add up
        to about 1, and all its taps to 0.
    """
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE // 2
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
            whole[SIDE // 2, SIDE // 2] -= whole.sum()
            taps.append(whole)
    return np.array(taps, np.int32).reshape(-1, SIDE, SIDE)


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
        found = []
        for g, own in zip(picture, band, strict=True):
            around = g[np.ix_(row, col)].astype(np.int64)
            found.append(own)
            for f in taps:
                total = np.zeros((rows, cols), np.int64)
                for a, b in np.ndindex(f.shape):
                    total += f[a, b] * around[a : a + rows, b : b + cols]
                found.append((total + (1 << UNIT_BITS - 1)) >> UNIT_BITS)
        return np.stack(found, -1).reshape(rows * cols, -1).astype(np.int32)
    features = machine.empty((rows * cols, planes * (1 + count)), np.int32)
    machine.launch(
        "filters",
        (rows * cols, planes * (1 + count)),
        *(picture, band, planes, rows, cols, torus, taps, count, side, features),
    )
    return features
