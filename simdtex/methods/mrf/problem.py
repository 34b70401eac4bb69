# SPDX-License-Identifier: BSD-3-Clause
"""The input of a run of the method ``mrf``."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.methods.mrf.options import Options
from simdtex.model.given import Given, GivenPlanes, Soft
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample
from simdtex.options import SMALLER


@dataclass(frozen=True)
class Input:
    """The validated input of a run, on the host.

    ``sample`` is Y with its structure channel and guides, ``shape`` (rows, cols) or (layers, rows, cols) of X, the
    output, ``offsets`` (N, 2) the neighbourhood, ``options`` as they are executed, and ``levels`` M of Algorithm 1.
    ``given`` are conditioning data, sites of X that keep their values, and ``planes`` the same in working levels;
    ``soft`` are soft data, and ``remedy`` is the user's remedy if the memory does not suffice.

    A pixel of ``sample`` and a site of X are means over squares of ``reduction`` pixels. ``coarser`` is the input, of
    half the size, of levels whose spacing is twice the reduction or more; if it is None, they have this input, too.
    ``key`` is that of random numbers (`simdtex.model.lattice.Grid`).
    """

    sample: Sample
    shape: tuple[int, ...]
    offsets: NDArray[np.int32] = field(repr=False)
    options: Options
    schedule: schedules.Schedule
    levels: int
    given: Given | None = None
    planes: GivenPlanes | None = None
    soft: Soft | None = None
    remedy: str = SMALLER
    reduction: int = 1
    coarser: Input | None = None
    key: tuple[int, int, int] = (0, 0, 1)

    @property
    def kinds(self) -> Soft | None:
        """The soft data; proportions are the same probabilities everywhere, unless there is a map of these."""
        wanted = self.options.proportions
        if not wanted or (self.soft and self.soft.categories is not None):
            return self.soft
        everywhere = (np.array(wanted) / sum(wanted)).reshape(-1, *[1] * len(self.shape))
        return Soft(everywhere, self.soft.images if self.soft else None)

    @property
    def sizes(self) -> list[Input]:
        """All inputs, the finest first."""
        return [self, *(self.coarser.sizes if self.coarser else ())]

    def keyed(self, first: int, cols: int) -> Self:
        """Return the input of an output that is part of a larger one, of ``cols`` columns, from a pixel on."""
        key = first, cols, self.reduction
        return replace(self, key=key, coarser=self.coarser and self.coarser.keyed(first, cols))

    def grid(self, level: int) -> Grid:
        """Return the lattice of a level, equation (10), in pixels of the sample."""
        grid = Grid.of(self.shape, 2**level // self.reduction, self.options.boundary == "torus")
        return replace(grid, key=self.key)

    def of(self, level: int) -> Input:
        """Return the input of a level: this one, or a coarser one."""
        return self.coarser.of(level) if self.coarser and 2**level > self.reduction else self
