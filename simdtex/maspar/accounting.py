# SPDX-License-Identifier: BSD-3-Clause
"""The cost of a run on a processor array, without executing it there.

The account is that of the paper's program (`simdtex.maspar.algorithm`) with the steps, the sites and the number of
candidates of any run: one step of it is executed on an array without a machine, which only counts.
"""

from __future__ import annotations

from collections import Counter
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.algorithm import ArrayLevel, Pass, Problem, Program
from simdtex.maspar.array import ProcessorArray
from simdtex.maspar.machine import COSTS, MP1, Mask
from simdtex.maspar.sites import Walk
from simdtex.methods.mrf.lcpdf import SiteChoice
from simdtex.methods.mrf.level import Lattices, MrfState, SweepInfo
from simdtex.model.array import MAPPINGS, parse_array
from simdtex.model.lattice import Grid
from simdtex.run import Observer

FLOP = 4
"""Operations for one neighbour and channel of equation (12): x_r u - y_r u, squared, added."""


class Account:
    """The counts of SIMD passes and of their instructions, and the modelled time of a MasPar MP-1.

    Parameters
    ----------
    array : ProcessorArray
    offsets : (n, 2) int32 array
        The neighbourhood, rows and columns of sites.
    channels : int

    Notes
    -----
    Per step, all neighbourhoods are fetched by one walk; then there is one pass for each virtual layer with an active
    site, which takes the same time for any number of active PEs. The account leaves out the start and the
    schedule.
    """

    def __init__(self, array: ProcessorArray, offsets: NDArray[np.int32], channels: int) -> None:
        self.array, self._offsets, self._channels = array, offsets, channels
        self.total: dict[str, Any] = dict.fromkeys(("steps", "passes", "sites", "flop", *COSTS), 0)

    def begin(self, grid: Grid, candidates: int, choice: SiteChoice) -> None:
        """Start a level with its lattice, the number of candidates of a relaxation, and the choice among them."""
        self._grid, self._flop = grid, FLOP * len(self._offsets) * self._channels * candidates
        mp1 = MP1(None, self.array, (grid.pixels[0], grid.pixels[1]), inf)
        any_value = np.broadcast_to(np.float32(0), (len(self._offsets), self._channels, candidates))
        index = any_value[0, 0].astype(np.int32)
        level = ArrayLevel(0, grid, choice, index, any_value[0], any_value, index)
        program = Program(mp1, Problem(np.zeros((1 + self._channels, 1), np.int32), self._offsets, 1, -1, 0))
        relaxation = Pass(program, level, Walk(mp1, grid, self._offsets))

        def counted(layers: int) -> Counter[str]:
            mp1.counts.clear()
            relaxation.relax(Mask(np.arange(mp1.layers)[:, None] < layers), 1)
            kinds: Counter[str] = Counter()
            for (_, kind), count in mp1.counts.items():
                kinds[kind] += count.instructions
            return kinds

        self._step = counted(0)
        self._pass = counted(1) - self._step

    def step(self, sites: NDArray[np.int32]) -> None:
        """Count the sites of one step."""
        passes = np.unique(self.array.place(sites, self._grid)[0]).size
        counts = {"steps": 1, "passes": passes, "sites": sites.size, "flop": sites.size * self._flop}
        counts |= {kind: self._step[kind] + passes * self._pass[kind] for kind in COSTS}
        for key, more in counts.items():
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
            "shifts": {name: array.shifts(self._grid, self._offsets) for name, array in arrays.items()},
            "active": active,
            "utilisation": active / self.array.size,
            **{key: self.total[key] for key in ("steps", "passes", "sites", "flop")},
            **{"moved": self.total["x-net"], "routed": self.total["router"]},
            "instructions": {kind: self.total[kind] for kind in COSTS},
            "model_seconds": sum(self.total[kind] * cost.seconds for kind, cost in COSTS.items()),
        }


class Accounting(Observer):
    """The observer of a run that keeps its `Account`; ``array`` is the value of the option."""

    def __init__(self, array: str, run: Lattices) -> None:
        super().__init__(run, None)
        self.account = Account(ProcessorArray(*parse_array(array)), run.offsets, run.sample.channels)
        self._level, self._launches = -1, run.machine.launches

    def step(self, state: MrfState, info: SweepInfo) -> None:
        """Count the cost of a sweep."""
        if info.level != self._level:
            self._begin(info.level)
        for chosen in info.chosen:
            for step in chosen.apart(self._run.machine):
                self.account.step(step.sites)

    def _begin(self, number: int) -> None:
        level, self._level = self._run.level(number), number
        self.account.begin(level.grid, level.proposal.slots, level.relaxation.choice)

    def statistics(self) -> dict[str, Any]:
        """Return the account, and the kernels that the machine has launched since the run began."""
        return {"accounting": self.account.report() | {"launches": self._run.machine.launches - self._launches}}

    def save(self) -> dict[str, Any]:
        """Return the level and the totals."""
        return {"level": self._level, "total": self.account.total}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from the totals that `save` returned."""
        if saved["level"] >= 0:
            self._begin(saved["level"])
        self.account.total.update(saved["total"])
