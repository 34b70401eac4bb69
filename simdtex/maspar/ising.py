# SPDX-License-Identifier: BSD-3-Clause
"""The Ising model on the processor array: the first example of a program for it."""

from __future__ import annotations

from simdtex import random
from simdtex.maspar.machine import MP1, Plural
from simdtex.ops.ising import heat_bath_chances
from simdtex.ops.lcpdf import Key


def ising(mp1: MP1, temperature: float, sweeps: int, seed: int, synchronous: bool = False) -> Plural:
    """Return Ising spins, 0 or 1, after sweeps of heat-bath relaxation of a checkerboard, or of all sites together.

    The picture fills the array, so that the X-Net's edges are those of a torus. All spins are up at first.
    """
    chances = heat_bath_chances([temperature], 4)[0, 4]
    spin, chance, place = mp1.plural(), mp1.plural("uint64"), mp1.row * mp1.shape[1] + mp1.col
    spin.set(1)
    square = (mp1.row + mp1.col) % (1 if synchronous else 2)
    for sweep in range(1, sweeps + 1):
        for color in range(1 if synchronous else 2):
            with mp1.where(square == color):  # no other PE changes its spin
                up = mp1.xnet(spin, -1, 0) + mp1.xnet(spin, 0, -1) + mp1.xnet(spin, 0, 1) + mp1.xnet(spin, 1, 0)
                mp1.table(chance, chances, up)  # of this temperature, by the number of neighbours that are up
                bits = mp1.random(place, Key(seed, 0, sweep), random.DRAW) & (2**32 - 1)
                spin.set(bits < chance)
    return spin
