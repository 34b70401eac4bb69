# SPDX-License-Identifier: BSD-3-Clause
"""What a run costs on a processor array, and how long the MasPar MP-1 would have taken: a model.

The figures of the full MP-1 are the published ones; the time leaves out all but the distances of equation (12) and the
fetching of neighbourhoods.
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
    """Counts SIMD passes, and what they do.

    Parameters
    ----------
    array : ProcessorArray
    packed : bool
        Whether active sites are packed instead of staying on the PE of their pixel. A pass then takes as many sites as
        there are PEs, and neighbours come through the router.

    Notes
    -----
    Per step: one pass for each virtual layer with an active site, or ceil(sites / PEs) passes where packed. The model's
    seconds are ::

        passes candidates |N| channels 4 / FLOPS  +  shifts words 4 / XNET             on the array
        passes candidates |N| channels 4 / FLOPS  +  sites |N| words 4 / ROUTER        packed

    since a pass takes as long for one active PE as for all. ``words`` are those fetched of each neighbour: its
    channels, its temperature and, with coherence, its source.
    """

    def __init__(self, array: ProcessorArray, packed: bool) -> None:
        self.array, self.packed = array, packed
        self.levels: list[dict[str, Any]] = []
        self._shifts: NDArray[np.int64] = np.zeros(0, np.int64)
        self._neighbours = 0

    def begin(self, grid: Grid, offsets: NDArray[np.int32], candidates: int, channels: int, words: int) -> None:
        """Begin a level: its lattice, neighbourhood and candidates."""
        self._grid, self._offsets, self._neighbours = grid, offsets, len(offsets)
        self._shifts = np.zeros(0, np.int64) if self.packed else self.array.shifts(grid, offsets)
        self._flop = FLOP * candidates * len(offsets) * channels
        self._words = words
        self.levels.append(
            {
                "layers": -(-grid.plane // self.array.size) if self.packed else int(np.prod(self.array.layers(grid))),
                **dict.fromkeys(("steps", "passes", "sites", "moved", "routed", "flop"), 0),
                "model_seconds": 0.0,
            }
        )

    def step(self, sites: NDArray[np.int32]) -> None:
        """Count the sites of one step."""
        if self.packed:
            self.packed_steps(np.array([sites.size]))
            return
        layers = np.unique(self.array.place(sites, self._grid).layer)
        self._add(1, sites.size, layers.size, int(self._shifts[layers].sum()) * self._words, 0)

    def packed_steps(self, sizes: NDArray[np.int64]) -> None:
        """Count steps of so many sites, where sites are packed."""
        sites = int(sizes.sum())
        routed = sites * self._neighbours * self._words
        self._add(sizes.size, sites, int((-(-sizes // self.array.size)).sum()), 0, routed)

    def _add(self, steps: int, sites: int, passes: int, moved: int, routed: int) -> None:
        report = self.levels[-1]
        report["steps"] += steps
        report["passes"] += passes
        report["sites"] += sites
        report["moved"] += moved
        report["routed"] += routed
        report["flop"] += sites * self._flop
        report["model_seconds"] += passes * self._flop / FLOPS + WORD * (moved / XNET + routed / ROUTER)

    def report(self) -> dict[str, Any]:
        """The totals, as `simdtex.run.Output` describes them."""
        total = {
            key: sum(level[key] for level in self.levels)
            for key in ("steps", "passes", "sites", "moved", "routed", "flop", "model_seconds")
        }
        active = total["sites"] / max(1, total["passes"])
        finest = self.levels[-1]
        return {
            "array": f"{self.array.rows}x{self.array.cols}",
            "mapping": "packed" if self.packed else self.array.mapping,
            "layers": finest["layers"],
            "shifts": {
                m: int(ProcessorArray(self.array.rows, self.array.cols, m).shifts(self._grid, self._offsets).sum())
                for m in MAPPINGS
            },
            "active": active,
            "utilisation": active / self.array.size,
            **total,
        }
