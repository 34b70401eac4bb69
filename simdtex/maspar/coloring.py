# SPDX-License-Identifier: BSD-3-Clause
"""The colours of sites, equation (14), which the PEs compute themselves: those of `simdtex.ops.sites`.

A PE computes its colour from its row and column. Along the seam of a torus that cuts through the pattern, neighbours
compare random keys: in each round the sites with the highest keys around take the lowest colour that is left.
"""

from __future__ import annotations

from simdtex import random
from simdtex.maspar.machine import MP1, Plural
from simdtex.maspar.walk import Walk
from simdtex.model.lattice import Sublattice, coloring_sublattice
from simdtex.ops.lcpdf import Key

BITS = 64
"""Colours in a word of taken colours."""


def coloring(mp1: MP1, walk: Walk, order: int, seed: int) -> tuple[Plural, int]:
    """Return the colour of each site, and the number of colours."""
    grid, enough = walk.grid, len(walk.offsets) + 1
    best, color = coloring_sublattice(order), mp1.plural()
    assert best is not None  # a square pattern always exists in the plane
    seamless: Sublattice | None = best
    if grid.torus:
        seamless = coloring_sublattice(order, grid.rows, grid.cols, limit=max(best.index, enough))
    with mp1.where(walk.sites), mp1.frame():
        found = None
        if seamless != best:
            most = max(best.index, seamless.index - 1) if seamless else 0
            found = along_seam(mp1, walk, best, seed, most)
        if found is None:
            assert seamless is not None  # otherwise greedy colours have no limit
            found = coset(seamless, walk.row, walk.col)
        numbers = 0
        for number in range(max(enough, best.index, seamless.index if seamless else 0)):
            here = found == number
            if mp1.any(here):  # colours that are used get consecutive numbers
                with mp1.where(here):
                    color.set(numbers)
                numbers += 1
    return color, numbers


def coset(pattern: Sublattice, row: Plural, col: Plural) -> Plural:
    """Return the cosets of sites in the sublattice spanned by (a, 0) and (b, c)."""
    a, b, c = pattern.a, pattern.b, pattern.c
    return (row + (col // c) * -b) % a * c + col % c


def along_seam(mp1: MP1, walk: Walk, pattern: Sublattice, seed: int, most: int) -> Plural | None:
    """Return the cosets, with other colours for sites that clash across the seam; None if one needs ``most`` colours.

    ``most`` 0 is no limit.
    """
    rows, cols = walk.grid.rows, walk.grid.cols
    number, own, color = walk.row * cols + walk.col, coset(pattern, walk.row, walk.col), mp1.plural()
    color.set(own)
    bare = mp1.plural()
    for down, right in walk.offsets.tolist():  # the later site of each pair of neighbours in one coset
        row, col = walk.row + down, walk.col + right
        across = (row < 0) | (row >= rows) | (col < 0) | (col >= cols)
        row, col = row % rows, col % cols
        met = (coset(pattern, row, col) == own) & (row * cols + col < number)
        bare.set(bare | (across & met))
    carried = mp1.plural("uint64", 2)  # the colour plus 1, or 0 of a site without one; and then its key
    key = mp1.random(number, Key(seed, 0, 0), random.COLOR) & (2**32 - 1)
    carried[1].set((key * 2**32 + number.as_type("uint64")) * bare.as_type("uint64"))
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
