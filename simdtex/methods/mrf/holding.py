# SPDX-License-Identifier: BSD-3-Clause
"""What a run is given, as its field has it: sites that keep their values, data that move, guides."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine
from simdtex.model.given import NOBODY, Planes, Stand, stand_ins
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import UNTOUCHED, Beside, Field

FREE, KNOWN, STANDING = 0, 1, 2
"""What a site of a level is: nobody's, given, or one that stands for a datum between the sites."""


class Held(NamedTuple):
    """What is given of a level's lattice, on the host.

    ``values`` (C, rows, cols) uint16, of free sites those of guides alone; ``source`` (rows, cols) int32; ``kind``
    (rows, cols) uint8: `FREE`, `KNOWN` or `STANDING`.
    """

    values: NDArray[np.uint16]
    source: NDArray[np.int32]
    kind: NDArray[np.uint8]


class Holder(Protocol):
    """Who knows what is given of an output: `Holding` of a whole one, or what cuts its windows out of a store."""

    def beside(self, neighbours: int, data_weight: float) -> Beside:
        """Which channels are guides, whether each value has a confidence of its own, and what counts how much."""
        ...

    def begun(self, field: Field) -> Field:
        """The field before the first level."""
        ...

    def entered(self, number: int, grid: Grid, field: Field) -> Field:
        """The field where a level begins on a grid."""
        ...

    def movable(self, number: int, grid: Grid) -> Array | None:
        """0 at the sites of a grid that nothing may relax; None where all may."""
        ...


@dataclass(frozen=True, eq=False)
class Holding:
    """What is given of an output.

    Parameters
    ----------
    machine : Machine
    grid : Grid
        The lattice of the finest level.
    levels : int
    guides : (G, H, W) uint16 array
        Working levels of the output's guides.
    laid : Planes, optional
        Given values, sources and sites. None: there are none.
    """

    machine: Machine
    grid: Grid
    levels: int
    guides: NDArray[np.uint16]
    laid: Planes | None = None
    _found: dict[int, Stand] = field(default_factory=dict, init=False, repr=False)

    def beside(self, neighbours: int, data_weight: float) -> Beside:
        """Which channels are guides, whether each value has a confidence of its own, and what counts how much."""
        laid, guides = self.laid, len(self.guides)
        from_nowhere = laid is not None and bool((laid.source < 0)[laid.known].any())
        hard = round(8 * sqrt(data_weight)) / 8  # in eighths, so that sums stay exact
        return Beside(
            guides, guides > 0 or from_nowhere, np.float32(max(1, round(sqrt(neighbours) / 2))), np.float32(hard)
        )

    def begun(self, field: Field) -> Field:
        """The field before the first level with what is given: at temperature 0."""
        if self.laid is None and not len(self.guides):
            return field
        values, source, temperature = (np.array(self.machine.get(plane)) for plane in field)
        matched = len(values) - len(self.guides)
        values[matched:] = self.guides
        if self.laid:
            known = self.laid.known
            values[:matched, known] = self.laid.values[:, known]
            source[known], temperature[known] = self.laid.source[known], 0
        return Field(*(self.machine.put(plane) for plane in (values, source, temperature)))

    def entered(self, number: int, grid: Grid, field: Field) -> Field:
        """The field where a level begins: data between its sites have moved to those that they stand for.

        The sites that stood for data at the level above are unknown again, at temperature 1.
        """
        released, (site, datum) = self._stand_ins(number + 1).site, self._stand_ins(number)
        gaps = bool((self.guides == UNKNOWN).any())
        if not (released.size or site.size or gaps):
            return field
        values, source, temperature = (np.array(self.machine.get(plane)) for plane in field)
        matched = len(values) - len(self.guides)
        temperature.flat[released] = UNTOUCHED
        if self.laid is not None:
            flat, given = values.reshape(len(values), -1), self.laid.values.reshape(matched, -1)
            flat[:matched, site] = given[:, datum]
            source.flat[site], temperature.flat[site] = -1, 0
        for plane, guide in zip(values[matched:], self.guides, strict=True):
            told = stand_ins(guide != UNKNOWN, self._lattice(number)) if gaps else NOBODY
            plane[:] = guide
            plane.flat[told.site] = guide.flat[told.datum]
        return Field(*(self.machine.put(plane) for plane in (values, source, temperature)))

    def movable(self, number: int, grid: Grid) -> Array | None:
        """0 at the sites of a level's grid, or of a window of it, that nothing may relax; None where all may."""
        if self.laid is None:
            return None
        movable = (~self.laid.known).astype(np.uint16)
        movable.flat[self._stand_ins(number).site] = 0
        if grid.part is not None:
            row = (grid.part.top + np.arange(grid.rows)) % grid.part.rows * grid.step
            col = (grid.part.left + np.arange(grid.cols)) % grid.part.cols * grid.step
            movable = movable[np.ix_(row, col)]
        return self.machine.put(movable)

    def held(self, number: int) -> Held | None:
        """What is given of a level, `begun` and `entered` in one; None where nothing is."""
        if self.laid is None and not len(self.guides):
            return None
        grid, (site, datum) = self._lattice(number), self._stand_ins(number)
        matched, shape = 0 if self.laid is None else len(self.laid.values), (grid.height, grid.width)
        values = np.zeros((matched + len(self.guides), *shape), np.uint16)
        source, kind = np.full(shape, -1, np.int32), np.full(shape, FREE, np.uint8)
        if self.laid is not None:
            values[:matched] = np.where(self.laid.known, self.laid.values, 0)
            source[:], kind[:] = self.laid.source, self.laid.known * np.uint8(KNOWN)
            values.reshape(len(values), -1)[:matched, site] = self.laid.values.reshape(matched, -1)[:, datum]
            source.flat[site], kind.flat[site] = -1, STANDING
        gaps = bool((self.guides == UNKNOWN).any())
        for plane, guide in zip(values[matched:], self.guides, strict=True):
            told = stand_ins(guide != UNKNOWN, grid) if gaps else NOBODY
            plane[:] = guide
            plane.flat[told.site] = guide.flat[told.datum]
        return Held(*(np.ascontiguousarray(grid.view(plane)) for plane in (values, source, kind)))

    def _lattice(self, number: int) -> Grid:
        return Grid(self.grid.height, self.grid.width, 2**number, self.grid.torus)

    def _stand_ins(self, number: int) -> Stand:
        """Who stands for whom at a level: nobody above the coarsest."""
        if self.laid is None or number == self.levels:
            return NOBODY
        if number not in self._found:
            self._found[number] = stand_ins(self.laid.known, self._lattice(number))
        return self._found[number]


__all__ = ["FREE", "KNOWN", "STANDING", "Held", "Holder", "Holding"]
