# SPDX-License-Identifier: BSD-3-Clause
"""The sites of a level on the array: their neighbourhoods, and their colours, equation (14).

For the neighbourhood of every site at once all PEs shift one variable along a path through the offsets. A PE computes
its colour, which is that of `simdtex.schedules.sites`, from its row and column. Along the seam of a torus that cuts
through the pattern, neighbours compare random keys: in each round the sites with the highest keys around take the
lowest colour that is left.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.maspar.array import DIRECTIONS, path
from simdtex.maspar.machine import MP1, Mask, Plural
from simdtex.methods.mrf.lcpdf import Key
from simdtex.model.lattice import Grid, Sublattice, coloring_sublattice

BITS = 64
"""Colours in a word of taken colours."""


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
            for index, (down, right) in enumerate(offsets.tolist()):
                if grid.torus and (down % sides[0] or right % sides[1]):
                    self._inside[index] = self.sites
                elif not grid.torus:
                    with mp1.where(self._within(self.row + down, 0) & self._within(self.col + right, 1)) as inside:
                        self._inside[index] = inside
                        self.members.set(self.members + 1)
            if grid.torus:
                self.members.set(len(self._inside))
            self.members.set(self.members + (self.members == 0))

    def _within(self, place: Plural, axis: int) -> Plural:
        return (place >= 0) & (place < (self.grid.rows, self.grid.cols)[axis])

    def _seam(self, down: int, right: int) -> Mask:
        """Return the mask of sites whose neighbour in a direction is across a seam that the X-Net does not close."""
        beyond = self.row * 0
        for axis, by, place in ((0, down, self.row), (1, right, self.col)):
            if self._open[axis] and by:
                beyond = beyond | (place == ((self.grid.rows, self.grid.cols)[axis] - 1 if by > 0 else 0))
        with self.mp1.where(beyond) as mask:
            return mask

    def _pixel(self, axis: int, by: int) -> Plural:
        """Return the pixel row or column of the site that is ``by`` sites on, around the edges of the lattice."""
        sides, held = (self.grid.rows, self.grid.cols), self.mp1.plural()
        held.set(((self.row, self.col)[axis] + by) % sides[axis] * self.grid.step)
        return held

    def neighbours(self, plural: Plural) -> Iterator[tuple[int, Plural]]:
        """Yield the number of each offset, and all words of a variable from there; sites without it are then masked."""
        mp1 = self.mp1
        for down, right, offset in self._path:
            with mp1.where(self.sites if self.grid.torus else mp1.everywhere):  # values may pass outside the picture
                arrived = mp1.xnet(plural, down, right, self.grid.step)
            if (down, right) in self._beyond:
                with mp1.where(self._beyond[down, right]):
                    mp1.router(arrived, plural, self._wrapped[0, down], self._wrapped[1, right])
            plural = arrived
            if offset in self._inside:
                with mp1.where(self._inside[offset]):
                    yield offset, arrived


def coloring(mp1: MP1, walk: Walk, order: int, seed: int) -> tuple[Plural, int]:
    """Return the colour of each site, and the number of colours."""
    grid, enough = walk.grid, len(walk.offsets) + 1
    best, color = coloring_sublattice(order), mp1.plural()
    assert best is not None  # a square pattern always exists in the plane
    seamless: Sublattice | None = best
    if grid.torus:
        seamless = coloring_sublattice(order, grid.rows, grid.cols, limit=max(best.index, enough))
    with mp1.where(walk.sites), mp1.frame():
        colors = None
        if seamless != best:
            most = max(best.index, seamless.index - 1) if seamless else 0
            colors = along_seam(mp1, walk, best, seed, most)
        if colors is None:
            assert seamless is not None  # otherwise greedy colours have no limit
            colors = seamless.coset(walk.row, walk.col)
        numbers = 0
        for number in range(max(enough, best.index, seamless.index if seamless else 0)):
            here = colors == number
            if mp1.any(here):  # colours that are used get consecutive numbers
                with mp1.where(here):
                    color.set(numbers)
                numbers += 1
    return color, numbers


def along_seam(mp1: MP1, walk: Walk, pattern: Sublattice, seed: int, most: int) -> Plural | None:
    """Return the cosets, with other colours for sites that clash across the seam; None if one needs ``most`` colours.

    ``most`` 0 is no limit.
    """
    rows, cols = walk.grid.rows, walk.grid.cols
    site, coset, color = walk.row * cols + walk.col, pattern.coset(walk.row, walk.col), mp1.plural()
    color.set(coset)
    bare = mp1.plural()
    for down, right in walk.offsets.tolist():  # the later site of each pair of neighbours in one coset
        row, col = walk.row + down, walk.col + right
        across = (row < 0) | (row >= rows) | (col < 0) | (col >= cols)
        row, col = row % rows, col % cols
        met = (pattern.coset(row, col) == coset) & (row * cols + col < site)
        bare.set(bare | (across & met))
    carried = mp1.plural("uint64", 2)  # the colour plus 1, or 0 of a site without one; and then its key
    key = mp1.random(site, Key(seed, 0, 0), random.COLOR) & (2**32 - 1)
    carried[1].set((key * 2**32 + site.as_type("uint64")) * bare.as_type("uint64"))
    carried[0].set(((color + 1) * (bare == 0)).as_type("uint64"))
    taken, first = mp1.plural("uint64", max(len(walk.offsets) + 1, pattern.index) // BITS + 1), mp1.plural()
    while mp1.any(bare):
        with mp1.where(bare):
            _round(mp1, walk, carried, taken, first)
            with mp1.where(first):
                color.set(-1)
                for word in range(taken.data.shape[-1]):
                    lowest = taken[word].lowest().as_type("int32")
                    with mp1.where((color < 0) & (lowest < BITS)):
                        color.set(lowest + BITS * word)
                carried[0].set((color + 1).as_type("uint64"))
                carried[1].set(0)
                bare.set(0)
                if most and mp1.any(color >= most):
                    return None
    return color


def _round(mp1: MP1, walk: Walk, carried: Plural, taken: Plural, first: Plural) -> None:
    """Find out for each site which colours its neighbours have, and whether its key is above those of all others."""
    words = range(taken.data.shape[-1])
    with mp1.where(walk.sites):
        first.set(1)
        for word in words:
            taken[word].set(0)
        for _, there in walk.neighbours(carried):
            mp1.alu("and", first, first, there[1] < carried[1])
            for word in words:
                mp1.alu("or", taken[word], taken[word], (there[0] - (1 + BITS * word)).bit())
