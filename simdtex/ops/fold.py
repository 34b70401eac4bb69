# SPDX-License-Identifier: BSD-3-Clause
"""Every second pixel of a torus of any size, and back.

Around a torus of an even number of rows every second row is half of them. Where the number is odd they go around twice
and meet each row once, so the result is as large as the picture, and its neighbours are two apart in the picture
everywhere. A filter laid over it is the filter with holes that the next level of a pyramid asks for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation


def folded(n: int) -> NDArray[np.intp]:
    """The rows, or columns, of a picture with n of them that those of the result come from, in order."""
    return np.arange(n if n % 2 else n // 2) * 2 % n


def _fold(picture: NDArray[np.int32]) -> NDArray[np.int32]:
    _, rows, cols = picture.shape
    return np.ascontiguousarray(picture[:, folded(rows)[:, None], folded(cols)])


def _unfold(coarse: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.int32]:
    rows, cols = shape
    picture = np.zeros((len(coarse), rows, cols), np.int32)
    picture[:, folded(rows)[:, None], folded(cols)] = coarse
    return picture


def _launch_fold(machine: Launcher, picture: Array) -> Array:
    planes, rows, cols = picture.shape
    coarse = machine.empty((planes, folded(rows).size, folded(cols).size), np.int32)
    machine.launch(
        machine.kernel("fold", "fold"),
        (coarse.shape[1] * coarse.shape[2], planes),
        *(picture, np.int32(planes), np.int32(rows), np.int32(cols), coarse),
    )
    return coarse


def _launch_unfold(machine: Launcher, coarse: Array, shape: tuple[int, ...]) -> Array:
    rows, cols = shape
    picture = machine.empty((coarse.shape[0], rows, cols), np.int32)
    machine.launch(
        machine.kernel("fold", "fold_back"),
        (rows * cols, coarse.shape[0]),
        *(coarse, np.int32(coarse.shape[0]), np.int32(rows), np.int32(cols), picture),
    )
    return picture


fold = Operation("fold", _fold, _launch_fold)
"""``fold(machine, picture)``: every second row and column of (planes, rows, cols) int32; of an odd number, all."""

unfold = Operation("fold", _unfold, _launch_unfold)
"""``unfold(machine, coarse, shape)``: a picture (planes, rows, cols) with these at their place and 0 between them."""
