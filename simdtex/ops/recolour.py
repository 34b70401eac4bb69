# SPDX-License-Identifier: BSD-3-Clause
"""The grey levels that the sources of a level's sites have at that level."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Field


def _reference(field: Field, grid: Grid, planes: NDArray[np.float32]) -> Field:
    grid.view(field.values)[...] = planes[:, grid.view(field.source)]
    return field


def _launch(machine: Launcher, field: Field, grid: Grid, planes: Array) -> Field:
    channels, plane = planes.shape
    sites = grid.rows * grid.cols
    machine.launch(
        machine.kernel("recolour", "recolour", C=channels),
        (sites,),
        *(grid.struct, np.int32(sites), planes, np.int32(plane), field.source, np.int32(prod(field.source.shape))),
        field.values,
    )
    return field


recolour = Operation("recolour", _reference, _launch)
"""``recolour(machine, field, grid, planes)``: the field with x_s = y at p_s for all sites of the grid, in place."""
