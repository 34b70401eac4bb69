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
ROUTER = 1.28e9
"""Bytes per second through the global router, all PEs together."""
WORD = 4
FLOP = 4
"""Operations for one neighbour and channel of equation (12): x_r u - y_r u, squared, added."""


class Account:
    """Counts SIMD passes and their work.

    Parameters
    ----------
    array : ProcessorArray
    packed : bool
        Whether active sites are packed instead of staying on the PE of their pixel. A pass then takes as many sites as
        there are PEs, and neighbours come through the router.

    Notes
    -----
    Per step: one pass for each virtual layer with an active site, or ceil(sites / PEs) passes if packed. The model's
    seconds are ::

        passes candidates |N| channels 4 / FLOPS  +  shifts words 4 / XNET             on the array
        passes candidates |N| channels 4 / FLOPS  +  sites |N| words 4 / ROUTER        packed

    since a pass takes as long for one active PE as for all. ``words`` are those fetched of each neighbour: its
    channels, its temperature and, with coherence, its source.
    """

    def __init__(self, array: ProcessorArray, packed: bool) -> None:
        self.array, self.packed = array, packed
        keys = ("steps", "passes", "sites", "moved", "routed", "flop", "model_seconds")
        self.total: dict[str, Any] = dict.fromkeys(keys, 0)

    def begin(self, grid: Grid, offsets: NDArray[np.int32], candidates: int, channels: int, words: int) -> None:
        """Begin a level: its lattice, neighbourhood and candidates."""
        self._grid, self._offsets, self._words = grid, offsets, words
        self._shifts = np.zeros(0, np.int64) if self.packed else self.array.shifts(grid, offsets)
        self._flop = FLOP * candidates * len(offsets) * channels
        rows, cols = self.array.layers(grid)
        self._layers = -(-grid.plane // self.array.size) if self.packed else rows * cols

    def step(self, sites: NDArray[np.int32]) -> None:
        """Count the sites of one step."""
        layers = np.unique(self.array.place(sites, self._grid)[0])
        self._add(steps=1, sites=sites.size, passes=layers.size, moved=int(self._shifts[layers].sum()) * self._words)

    def packed_steps(self, sizes: NDArray[np.int64]) -> None:
        """Count steps by their numbers of sites, if sites are packed."""
        sites, passes = int(sizes.sum()), int((-(-sizes // self.array.size)).sum())
        self._add(steps=sizes.size, sites=sites, passes=passes, routed=sites * len(self._offsets) * self._words)

    def _add(self, *, steps: int, sites: int, passes: int, moved: int = 0, routed: int = 0) -> None:
        seconds = passes * self._flop / FLOPS + WORD * (moved / XNET + routed / ROUTER)
        work = {"steps": steps, "passes": passes, "sites": sites, "moved": moved, "routed": routed}
        for key, more in (work | {"flop": sites * self._flop, "model_seconds": seconds}).items():
            self.total[key] += more

    def report(self) -> dict[str, Any]:
        """Return the totals, as `simdtex.run.Output` describes them."""
        active = self.total["sites"] / max(1, self.total["passes"])
        arrays = {mapping: ProcessorArray(self.array.rows, self.array.cols, mapping) for mapping in MAPPINGS}
        return {
            "array": f"{self.array.rows}x{self.array.cols}",
            "mapping": "packed" if self.packed else self.array.mapping,
            "layers": self._layers,
            "shifts": {name: int(array.shifts(self._grid, self._offsets).sum()) for name, array in arrays.items()},
            "active": active,
            "utilisation": active / self.array.size,
            **self.total,
        }
