# SPDX-License-Identifier: BSD-3-Clause
"""The constants of a level as kernels take them: one struct instead of thirty arguments."""

from __future__ import annotations

from typing import Any

import numpy as np

from simdtex.model.lattice import LATTICE, Grid

LEVEL = np.dtype(
    [
        ("lattice", LATTICE),
        ("seed", np.uint64),
        ("level", np.uint32),
        *((name, np.int32) for name in ("area", "neighbours", "pixels", "candidates", "chance")),
        *((name, np.int32) for name in ("plane", "down", "first", "pitch", "size", "strip_rows", "strip_cols")),
        *((name, np.float32) for name in ("discount", "scale")),
        *((name, np.int32) for name in ("radius", "top", "draws", "xi")),
        ("novelty", np.float32),
        ("centre", np.float32),
        ("hard", np.float32),
    ],
    align=True,
)
"""The struct ``Level`` of kernels/common/level.h."""


def constants(grid: Grid, **values: Any) -> np.void:
    """Return a value of the type `LEVEL` with the grid and the fields that are given by name; the others are 0."""
    numbers = np.zeros((), LEVEL)
    numbers["lattice"] = grid.struct
    for name, value in values.items():
        numbers[name] = value
    struct: np.void = numbers[()]  # type: ignore[assignment]
    return struct
