# SPDX-License-Identifier: BSD-3-Clause
"""Conditioning data and guides of an output, level by level: known sites, data between the sites, guides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine
from simdtex.methods.mrf.neighbourhood import Confidences, Field
from simdtex.methods.mrf.options import Options
from simdtex.methods.mrf.problem import Input
from simdtex.model.given import NO_STAND_IN, Stand, between, stand_ins
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import Grid


def heaviest(options: Options, neighbours: int) -> float:
    """Return the largest square of a confidence, except for that of a known variable at its own site."""
    return max(1.0, options.data_weight, neighbours / 4)


def centre_known(options: Options, neighbours: int, reduced: int = 1) -> int:
    """Return the confidence of a known variable at its own site, which counts more than all neighbours together.

    If the levels are ``reduced``, which it makes up for, it counts as much as all neighbours.
    """
    if reduced > 1:
        return round(reduced * sqrt(neighbours))
    return round(4 * sqrt(neighbours * heaviest(options, neighbours)))


class Held(NamedTuple):
    """Data and guides of a level's sites; free sites, which are not ``known``, have only ``values`` of guides."""

    values: NDArray[np.uint16]
    source: NDArray[np.int32]
    known: NDArray[np.bool_]


class Data(NamedTuple):
    """Data of an image: ``place`` (n, 2 or 3) int [layer,] row and column, ``values`` (n, C) uint16 working levels."""

    place: NDArray[np.integer]
    values: NDArray[np.uint16]


class Conditions(ABC):
    """Conditioning data and guides of an output, and their confidences: all in memory, or windows out of a store."""

    def __init__(self, confidences: Confidences) -> None:
        self.confidences = confidences

    @abstractmethod
    def at(self, level: int, grid: Grid) -> Held | None:
        """Return the data and guides of a level at the sites of its lattice or a window of it; None without any."""

    @abstractmethod
    def scattered(self, level: int) -> Data | None:
        """Return the conditioning data between the sites of a level; None if there are none."""

    @abstractmethod
    def coarser(self, plan: Input) -> Conditions:
        """Return the conditions of the levels that have a reduced input."""

    def entered(self, machine: Machine, level: int, grid: Grid, field: Field) -> Field:
        """Return the field at the beginning of a level, with its known sites at temperature 0."""
        held = self.at(level, grid)
        if held is None:
            return field
        values, source, temperature = (np.array(machine.get(plane)) for plane in field)
        guides, known = self.confidences.guides, held.known
        matched = len(values) - guides
        values[matched:] = held.values[len(held.values) - guides :]
        if known.any():
            values[:matched, known] = held.values[:matched, known]
            source[known], temperature[known] = held.source[known], 0
        return Field(*map(machine.put, (values, source, temperature)))

    def movable(self, machine: Machine, level: int, grid: Grid, kept: bool) -> Array | None:
        """Return an (H, W) uint16 array that is 0 at sites that a free sweep does not relax; None if it relaxes all.

        These are the known sites and, with ``kept``, those that are not on the lattice of the level above.
        """
        held, free = self.at(level, grid), np.ones(grid.shape, bool)
        if held is not None:
            free &= ~held.known
        for line in np.ix_(*grid.lines()) if kept else ():
            free &= line % 2 == 0
        return None if free.all() else machine.put(free.astype(np.uint16))


class Conditioning(Conditions):
    """Conditioning data and guides of a whole output, in memory; ``confidences`` are those of a larger size of it."""

    def __init__(self, plan: Input, confidences: Confidences | None = None) -> None:
        sample, planes, neighbours = plan.sample, plan.planes, len(plan.offsets)
        hard = planes is not None and bool((planes.source < 0)[planes.known].any())
        centre = np.float32(max(1, round(sqrt(neighbours) / 2)))
        weight = np.float32(round(8 * sqrt(plan.options.data_weight)) / 8)  # in eighths, so that sums stay exact
        guides, known = len(sample.guides), sample.known_variables
        reduced = plan.given.reduced(sample.pictures) if plan.given else 1
        here = np.float32(centre_known(plan.options, neighbours, reduced))
        standard = Confidences(guides, guides > 0 or hard, centre, weight, known, here)
        super().__init__(confidences or standard)
        self.guides, self.planes = sample.guides, planes
        self.plan = plan
        self._held: dict[int, Held] = {}

    def at(self, level: int, grid: Grid) -> Held | None:
        """Return the data and guides of a level at the sites of its lattice or a window of it."""
        if self.planes is None and not len(self.guides):
            return None
        if level not in self._held:
            self._held = {level: self._whole(self.plan.grid(level))}  # one level is enough
        held = self._held[level]
        return Held(*(grid.cut(plane) for plane in held))

    def coarser(self, plan: Input) -> Conditioning:
        """Return the conditions of the levels that have a reduced input, with the same confidences."""
        return Conditioning(plan, self.confidences)

    def scattered(self, level: int) -> Data | None:
        """Return the conditioning data between the sites of a level; None if there are none."""
        grid = self.plan.grid(level)
        if self.planes is None or grid.step == 1:
            return None
        place = between(self.planes.data, grid)
        values = self.planes.values[(slice(None), *place.T)].T
        return Data(place, np.ascontiguousarray(values)) if len(place) else None

    def _whole(self, grid: Grid) -> Held:
        """Return the data and guides of a whole lattice."""
        planes, matched = self.planes, 0 if self.planes is None else len(self.planes.values)
        values = np.zeros((matched + len(self.guides), *self.plan.shape), np.uint16)
        source, known = np.full(self.plan.shape, -1, np.int32), np.zeros(self.plan.shape, bool)
        if planes is not None:
            values[:matched] = np.where(planes.known, planes.values, 0)
            source, known = planes.source, planes.known
        gaps = bool((self.guides == UNKNOWN).any())
        for plane, guide in zip(values[matched:], self.guides, strict=True):
            stand: Stand = stand_ins(guide != UNKNOWN, grid) if gaps else NO_STAND_IN
            plane[:] = guide
            plane.flat[stand.site] = guide.flat[stand.datum]
        return Held(*(np.ascontiguousarray(grid.decimated(plane)) for plane in (values, source, known)))
