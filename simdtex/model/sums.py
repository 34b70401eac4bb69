# SPDX-License-Identifier: BSD-3-Clause
"""Sums over the square, or the cube, around each place of an array."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def sums_around(values: NDArray[Any], reach: int) -> NDArray[np.int64]:
    """Return the sum of integers over 2 reach + 1 places along each axis around each place, clipped to the array."""
    found: NDArray[np.int64] = values.astype(np.int64)
    for axis, n in enumerate(values.shape):
        running = np.zeros((*found.shape[:axis], n + 1, *found.shape[axis + 1 :]), np.int64)
        found.cumsum(axis, out=running[(slice(None),) * axis + (slice(1, None),)])
        at = np.arange(n)
        found = running.take(np.minimum(at + reach + 1, n), axis) - running.take(np.maximum(at - reach, 0), axis)
    return found
