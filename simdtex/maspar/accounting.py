# SPDX-License-Identifier: BSD-3-Clause
"""The cost of a run on a processor array, and a model of the time on a MasPar MP-1.

The figures of the full MP-1 are the published ones; the model counts the distances of equation (12) and the fetching of
neighbourhoods only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.array import MAPPINGS, ProcessorArray
from simdtex.model.lattice import Grid

FULL = 16384
"""PEs of the full MP-1."""
FLOPS = 1200e6 / FULL
"""32-bit operations per second and PE."""
XNET = 23e9 / FULL
"""Bytes per second and PE to an adjacent PE."""
WORD = 4
FLOP = 4
"""Operations for one neighbour and channel of equation (12): x_r u - y_r u, squared, added."""


class Account:
    """The counts of SIMD passes and of their work.

    Parameters
    ----------
    array : ProcessorArray
    offsets : (n, 2) int32 array
        The neighbourhood, rows and columns of sites.
    channels : int
    words : int
        Words fetched from each neighbour: its channels, its temperature and, with coherence, its source.

    Notes
    -----
    Per step: one pass for each virtual layer with an active site. The model's seconds are ::

        passes candidates |N| channels 4 / FLOPS  +  shifts words 4 / XNET

    since the time of a pass does not depend on the number of active PEs.
    """

    def __init__(self, array: ProcessorArray, offsets: NDArray[np.int32], channels: int, words: int) -> None:
        self.array, self._offsets, self._words = array, offsets, words
        self._flop_each = FLOP * len(offsets) * channels
        keys = ("steps", "passes", "sites", "moved", "flop", "model_seconds")
        self.total: dict[str, Any] = dict.fromkeys(keys, 0)

    def begin(self, grid: Grid, candidates: int) -> None:
        """Start a level with its lattice and the number of candidates of a relaxation."""
        self._grid, self._shifts = grid, self.array.shifts(grid, self._offsets)
        self._flop = self._flop_each * candidates

    def step(self, sites: NDArray[np.int32]) -> None:
        """Count the sites of one step."""
        passes = np.unique(self.array.place(sites, self._grid)[0])
        moved = int(self._shifts[passes].sum()) * self._words
        seconds = passes.size * self._flop / FLOPS + WORD * moved / XNET
        counts = {"steps": 1, "passes": passes.size, "sites": sites.size, "moved": moved}
        for key, more in (counts | {"flop": sites.size * self._flop, "model_seconds": seconds}).items():
            self.total[key] += more

    def report(self) -> dict[str, Any]:
        """Return the totals, see `simdtex.run.Output`."""
        active = self.total["sites"] / max(1, self.total["passes"])
        rows, cols = self.array.layers(self._grid)
        arrays = {mapping: ProcessorArray(self.array.rows, self.array.cols, mapping) for mapping in MAPPINGS}
        return {
            "array": f"{self.array.rows}x{self.array.cols}",
            "mapping": self.array.mapping,
            "layers": rows * cols,
            "shifts": {name: int(array.shifts(self._grid, self._offsets).sum()) for name, array in arrays.items()},
            "active": active,
            "utilisation": active / self.array.size,
            **self.total,
        }
