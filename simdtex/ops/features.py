# SPDX-License-Identifier: BSD-3-Clause
"""The whole neighbourhoods that a classifier compares: pixel and neighbours, raw or with contrast compressed."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.arithmetic import exp32, fma32, log32
from simdtex.ops.laplacian import within

SIXTEENTHS = 16
"""Units of a level's values in 1 of the scale 0..255."""


@Operation
def features(machine: Launcher | None, levels: Array, sites: Array, offsets: Array, contrast: bool) -> Array:
    """Return the neighbourhoods of sites, (B * N, S) float32 with integer values.

    ``levels`` (B, rows, cols) uint16 are bands in sixteenths of 0..255, mirrored beyond the border; ``sites`` (S,)
    int32 are row * cols + column; ``offsets`` (N, 2) int32 are the site itself and its neighbours. Raw values are
    rounded to 0..255. With ``contrast`` the mean of each band is subtracted, and the whole vector z becomes
    40 log(1 + |z| / 5) z / |z|. Cost: O(S B N).
    """
    bands, rows, cols = levels.shape
    count = offsets.shape[0]
    if machine is None:
        row, col = (within(axis[:, None] + near, n, False) for axis, near, n in _axes(sites, offsets, rows, cols))
        values = np.moveaxis(levels[:, row, col], 1, 2).astype(np.int64)  # (B, N, S)
        if not contrast:
            return ((values + 8) >> 4).astype(np.float32).reshape(bands * count, -1)
        z = values * count - values.sum(1, keepdims=True)
        unit = np.float32(1) / np.float32(SIXTEENTHS * count)
        square = (z * z).sum((0, 1)).astype(np.float32) * (unit * unit)
        inverse = exp32(np.float32(-0.5) * log32(np.maximum(square, np.float32(1))))
        gain = np.float32(40) * log32(fma32(square * inverse, np.float32(0.2), np.float32(1))) * inverse * unit
        return np.rint(z.reshape(bands * count, -1).astype(np.float32) * gain)
    found = machine.empty((bands * count, sites.size), np.float32)
    machine.launch(
        "features_contrast" if contrast else "features_raw",
        (sites.size,),
        *(levels, bands, rows, cols, sites, sites.size, offsets, count, found),
    )
    return found


def _axes(sites: Array, offsets: Array, rows: int, cols: int) -> tuple[tuple[Array, Array, int], ...]:
    row, col = np.divmod(sites.astype(np.intp), cols)
    return (row, offsets[:, 0], rows), (col, offsets[:, 1], cols)
