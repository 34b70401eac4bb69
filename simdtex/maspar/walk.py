# SPDX-License-Identifier: BSD-3-Clause
"""The neighbourhood of every site at once: all PEs shift one variable along a path through the offsets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.array import DIRECTIONS, path
from simdtex.maspar.machine import MP1, Mask, Plural
from simdtex.model.lattice import Grid


class Walk:
    """The sites of a level on the array, and the walk through their neighbourhoods.

    Attributes
    ----------
    sites : Mask
        The PEs and layers that hold sites.
    row, col : Plural
        Row and column of the site on the lattice.
    members : Plural
        The number of neighbours of the site, 1 at least.
    """

    def __init__(self, mp1: MP1, grid: Grid, offsets: NDArray[np.int32]) -> None:
        self.mp1, self.grid, self.offsets, self._path = mp1, grid, offsets, path(offsets)
        s, sides = grid.step, (grid.rows, grid.cols)
        self.row, self.col, self.members = mp1.plural(), mp1.plural(), mp1.plural()
        with mp1.where((mp1.row % s == 0) & (mp1.col % s == 0)) as self.sites:
            self.row.set(mp1.row // s)
            self.col.set(mp1.col // s)
            around = [n * s != whole for n, whole in zip(sides, mp1.layout.padded.shape, strict=True)]
            self._open = [grid.torus and differs for differs in around]  # the last row is not next to the first
            self._beyond = {by: self._seam(*by) for by in DIRECTIONS if np.dot(np.abs(by), self._open)}
            self._wrapped = {(axis, by): self._pixel(axis, by) for axis in (0, 1) for by in (-1, 0, 1) if self._beyond}
            self._inside: dict[int, Mask] = {}
            for number, (down, right) in enumerate(offsets.tolist()):
                if grid.torus and (down % sides[0] or right % sides[1]):
                    self._inside[number] = self.sites
                elif not grid.torus:
                    with mp1.where(self._within(self.row + down, 0) & self._within(self.col + right, 1)) as inside:
                        self._inside[number] = inside
                        self.members.set(self.members + 1)
            if grid.torus:
                self.members.set(len(self._inside))
            self.members.set(self.members + (self.members == 0))

    def _within(self, place: Plural, axis: int) -> Plural:
        return (place >= 0) & (place < (self.grid.rows, self.grid.cols)[axis])

    def _seam(self, down: int, right: int) -> Mask:
        """Return the mask of sites whose neighbour in a direction is across a seam that the X-Net does not close."""
        found = self.row * 0
        for axis, by, place in ((0, down, self.row), (1, right, self.col)):
            if self._open[axis] and by:
                found = found | (place == ((self.grid.rows, self.grid.cols)[axis] - 1 if by > 0 else 0))
        with self.mp1.where(found) as mask:
            return mask

    def _pixel(self, axis: int, by: int) -> Plural:
        """Return the pixel row or column of the site that is ``by`` sites on, around the edges of the lattice."""
        sides, held = (self.grid.rows, self.grid.cols), self.mp1.plural()
        held.set(((self.row, self.col)[axis] + by) % sides[axis] * self.grid.step)
        return held

    def neighbours(self, plural: Plural) -> Iterator[tuple[int, Plural]]:
        """Yield the number of each offset, and all words of a variable from there; sites without it are then masked."""
        mp1 = self.mp1
        for down, right, number in self._path:
            with mp1.where(self.sites if self.grid.torus else mp1.everywhere):  # values may pass outside the picture
                arrived = mp1.xnet(plural, down, right, self.grid.step)
            if (down, right) in self._beyond:
                with mp1.where(self._beyond[down, right]):
                    mp1.router(arrived, plural, self._wrapped[0, down], self._wrapped[1, right])
            plural = arrived
            if number in self._inside:
                with mp1.where(self._inside[number]):
                    yield number, arrived
