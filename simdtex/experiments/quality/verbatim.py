# SPDX-License-Identifier: BSD-3-Clause
"""Which patches of the output stand verbatim in the sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.experiments.quality.nearest import Indices
from simdtex.experiments.quality.pictures import Array, as_pair

COPIED_PATCH = 9  # side of the patches, pixels


def copying(sample: ArrayLike, output: ArrayLike) -> float:
    """Share of the 9 x 9 patches of the output that stand verbatim in the sample.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1. Flat parts count as copied: the same flat patch does stand in the sample.

    Notes
    -----
    Exact: patches are found by a 64-bit hash and then compared value by value.
    """
    first, second = as_pair(sample, output, COPIED_PATCH, keep_type=True)
    together = np.concatenate([first.ravel(), second.ravel()])
    values, numbers = np.unique(together, return_inverse=True)
    numbers = numbers.astype(np.min_scalar_type(len(values)))
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(_verbatim(made, known).mean())


def _verbatim(made: Array, known: Array) -> NDArray[np.bool_]:
    known_hash, made_hash = _hashes(known), _hashes(made)
    order = np.argsort(known_hash, kind="stable")
    known_hash = known_hash[order]
    place = np.searchsorted(known_hash, made_hash)
    answer = np.zeros(len(made_hash), dtype=np.bool_)
    # equal hashes are almost always equal patches; the loop goes on only where they are not
    left = np.arange(len(made_hash))
    while len(left):
        inside = place[left] < len(known_hash)
        left = left[inside]
        left = left[known_hash[place[left]] == made_hash[left]]
        same = _equal_patches(made, left, known, order[place[left]])
        answer[left[same]] = True
        left = left[~same]
        place[left] += 1
    return answer


def _hashes(numbers: Array) -> NDArray[np.uint64]:
    rows, cols, channels = numbers.shape
    side = COPIED_PATCH
    weights = np.random.default_rng(0).integers(1, 2**64, (side, side, channels), dtype=np.uint64)
    total = np.zeros((rows - side + 1, cols - side + 1), dtype=np.uint64)
    wide = numbers.astype(np.uint64)
    for i, j, k in np.ndindex(side, side, channels):
        total += wide[i : i + total.shape[0], j : j + total.shape[1], k] * (weights[i, j, k] | 1)
    return total.ravel()


def _equal_patches(a: Array, at_a: Indices, b: Array, at_b: Indices) -> NDArray[np.bool_]:
    row_a, column_a = np.divmod(at_a, a.shape[1] - COPIED_PATCH + 1)
    row_b, column_b = np.divmod(at_b, b.shape[1] - COPIED_PATCH + 1)
    same = np.ones(len(at_a), dtype=np.bool_)
    for i, j in np.ndindex(COPIED_PATCH, COPIED_PATCH):
        same &= (a[row_a + i, column_a + j] == b[row_b + i, column_b + j]).all(axis=-1)
    return same
