# SPDX-License-Identifier: BSD-3-Clause
"""Features of neighbourhoods, and candidates gathered into leaves of like features: a search tree's lowest level.

Features are projections on the principal axes of the sample's neighbourhoods. They only serve to tell which candidates
cannot win, so no bit of a result depends on them.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array

FEATURES, FEW, LEAF = 16, 8, 64
"""As in kernels/nearest.cl."""
LANES = 16
"""Leaves are filled up to a multiple of this."""
FAR = np.float32(1e18)
"""A feature of what is no candidate; its square is finite."""
LEAST, MOST = 512, 512
"""Candidates from which on, and values of a neighbourhood up to which, it pays."""


class Leaves(NamedTuple):
    """What `nearest_leaves` reads: see kernels/nearest.cl.

    ``axes`` (values, FEATURES), ``box`` (FEW, 2, number), ``rows`` (FEATURES, number * LEAF) float32; ``order``
    (number * LEAF,) int32; ``number`` of leaves; ``middle`` grey level; ``blur``.
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
    """Return the leaves of a level, or None if a search along rows is as good.

    ``working`` (C, pixels) grey levels of the sample, 0 to ``top``; ``positions`` (n,) pixel index of each candidate;
    ``reach`` (N,) pixel offset of each neighbour.

    With D values to a neighbourhood, of at most `top` / 2 about the middle, float32 sums of D products err by less than
    (D + 2) 2**-24 sqrt(D) top per feature; `blur` is four times that for each of 16 features together. Cost: n D 16 fma
    and a sort of n for each halving down to `LEAF`. Memory: 80 bytes per candidate.
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
    """Halves along the feature that varies most, down to leaves; all but the last are full."""
    if some.size <= LEAF:
        return [some]
    here = features[some]
    widest = int(here.var(0).argmax())
    half = (-(-some.size // LEAF) + 1) // 2 * LEAF
    split = np.argpartition(here[:, widest], half - 1)
    return _halve(some[split[:half]], features) + _halve(some[split[half:]], features)
