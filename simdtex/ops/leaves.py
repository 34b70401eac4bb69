# SPDX-License-Identifier: BSD-3-Clause
"""Features of neighbourhoods, and leaves of candidates with similar features: the lowest level of a search tree.

Features are projections on the principal axes of the sample's neighbourhoods. They only exclude candidates that cannot
be the nearest, so no bit of a result depends on them.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array

FEATURES, FEW, LEAF = 16, 8, 64
"""The constants of kernels/nearest.cl."""
LANES = 16
"""The number of leaves is padded to a multiple of this."""
FAR = np.float32(1e18)
"""The feature of a slot without a candidate; its square is finite."""
LEAST, MOST = 512, 512
"""The fewest candidates, and the most values of a neighbourhood, for which leaves save time."""


class Leaves(NamedTuple):
    """The input of `nearest_leaves`: see kernels/nearest.cl.

    ``axes`` (values, FEATURES), ``box`` (FEW, 2, number), ``rows`` (FEATURES, number * LEAF) float32; ``order``
    (number * LEAF,) int32; ``number`` of leaves; ``middle`` grey level; ``blur``, the error of features.
    """

    axes: Array
    box: Array
    rows: Array
    order: Array
    number: int
    middle: float
    blur: float


def grow(
    machine: Any, working: NDArray[np.uint16], positions: NDArray[np.int32], reach: NDArray[np.int32], top: int
) -> Leaves | None:
    """Return the leaves of a level, or None if a search along rows is as fast.

    ``working`` (C, pixels) are grey levels of the sample, 0 to ``top``; ``positions`` (n,) the pixel index of each
    candidate; ``reach`` (N,) the pixel offset of each neighbour.

    With D values in a neighbourhood, at most ``top`` / 2 from the middle, the error of a float32 sum of D products is
    below (D + 2) 2**-24 sqrt(D) top per feature; `blur` is four times that for all 16 features together. Cost: n D 16
    fma, and a sort of n for each halving down to `LEAF`. Memory: 80 bytes per candidate.
    """
    values = reach.size * len(working)
    if positions.size < LEAST or not FEATURES <= values <= MOST:
        return None
    middle = top / 2

    def neighbourhoods(some: NDArray[np.int32]) -> NDArray[np.float64]:
        found = working[:, some[:, None] + reach].astype(np.float64) - middle  # (C, n, N)
        return np.ascontiguousarray(np.moveaxis(found, 0, 2)).reshape(some.size, values)

    few = neighbourhoods(positions[:: -(-positions.size // 4096)])
    few = few - few.mean(0)
    _, vectors = np.linalg.eigh(few.T @ few)
    axes = np.ascontiguousarray(vectors[:, ::-1][:, :FEATURES].astype(np.float32))
    parts = np.array_split(positions, -(-positions.size // 4096))
    features = np.concatenate([neighbourhoods(part) @ axes.astype(np.float64) for part in parts]).astype(np.float32)
    order = np.concatenate(_halve(np.arange(positions.size), features))
    count = -(-order.size // (LEAF * LANES)) * LANES
    rows = np.full((FEATURES, count * LEAF), FAR, np.float32)
    rows[:, : order.size] = features[order].T
    order = np.pad(order, (0, count * LEAF - order.size)).astype(np.int32)
    leaf = rows[:FEW].reshape(FEW, count, LEAF)
    box = np.stack([leaf.min(2), np.where(leaf < FAR, leaf, -FAR).max(2)], 1)
    blur = 4 * sqrt(FEATURES) * (values + 2) * 2.0**-24 * sqrt(values) * top
    return Leaves(machine.put(axes), machine.put(box), machine.put(rows), machine.put(order), count, middle, blur)


def _halve(some: NDArray[np.int64], features: NDArray[np.float32]) -> list[NDArray[np.int64]]:
    """Return the leaves by halving along the feature that varies most; all leaves but the last are full."""
    if some.size <= LEAF:
        return [some]
    here = features[some]
    widest = int(here.var(0).argmax())
    half = (-(-some.size // LEAF) + 1) // 2 * LEAF
    split = np.argpartition(here[:, widest], half - 1)
    return _halve(some[split[:half]], features) + _halve(some[split[half:]], features)
