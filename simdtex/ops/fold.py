# SPDX-License-Identifier: BSD-3-Clause
"""Every second pixel of a torus of any size, and back.

On a torus with an even number of rows, every second row is half of all rows. With an odd number, every second row is
taken over two turns around the torus, which reach each row once: the result is as large as the picture, and its
neighbours are two rows apart in the picture. A filter on the result is then the filter with holes that the next level
of a pyramid requires.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation


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
