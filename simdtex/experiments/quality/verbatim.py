# SPDX-License-Identifier: BSD-3-Clause
"""Which patches of the output stand verbatim in the sample."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

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
    Patches are compared by hashes of 64 bits: of n different patches of the output and m of the sample, n m / 2**64
    are taken for equal.
    """
    first, second = as_pair(sample, output, COPIED_PATCH, keep_type=True)
    numbers = np.unique(np.concatenate([first.ravel(), second.ravel()]), return_inverse=True)[1]
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(np.isin(_hashes(made), _hashes(known)).mean())


def _hashes(numbers: Array) -> NDArray[np.uint64]:
    """Return a hash of each patch: the sum of its numbers, each times an odd random weight, modulo 2**64."""
    weights = np.random.default_rng(0).integers(1, 2**64, (COPIED_PATCH, COPIED_PATCH, numbers.shape[2]), np.uint64) | 1
    patches = sliding_window_view(numbers.astype(np.uint64), (COPIED_PATCH, COPIED_PATCH), (0, 1))
    found: NDArray[np.uint64] = np.einsum("rckij,ijk->rc", patches, weights)
    return found
