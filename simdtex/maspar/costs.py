# SPDX-License-Identifier: BSD-3-Clause
"""The costs of the instructions of a MasPar MP-1: one table, each row with its source."""

from __future__ import annotations

from typing import NamedTuple

FULL = 16384
"""PEs of the full MP-1, for which rates are published."""

CLOCK = 80e-9
"""Seconds of a clock; sources give 80 to 83 ns."""

PUBLISHED = "published figures: Blank 1990, Nickolls 1990, netlib report on array processors"
"""Which of the three gives which figure is not verified."""

WORD = 4
"""Bytes of a word."""


class Cost(NamedTuple):
    """The seconds of one instruction, for one active PE or all, and the source of the figure."""

    seconds: float
    source: str


COSTS = {
    "integer": Cost(FULL / 26_000e6, PUBLISHED),  # 26,000 MIPS
    "float": Cost(FULL / 1_200e6, PUBLISHED),  # 1,200 Mflop/s
    "x-net": Cost(WORD * FULL / 23e9, PUBLISHED),  # a word to an adjacent PE, 23 GB/s
    "router": Cost(WORD * FULL / 1.28e9, PUBLISHED),  # a word to any PE, 1.28 GB/s
    "broadcast": Cost(8 * CLOCK, "assumption"),  # a word from the ACU: its 8 nibbles enter the 4-bit PEs in turn
    "reduction": Cost(32 * CLOCK, "assumption"),  # a word from all PEs to the ACU, bit by bit
}
"""The costs by kind of instruction, on 32-bit words."""

PHILOX = 10 * 12
"""Integer instructions of four random words: ten rounds of 2 wide multiplications, in halves, and 4 exclusive ors."""

NOISE = {"integer": PHILOX + 12, "float": 54}
"""Instructions of the Gumbel noise of a candidate, added to its distance: a random word and two logarithms.

Each logarithm has 23 float (10 fma, a product, a difference and a conversion) and 4 integer; the uniform number has two
forms, one for near 1, of 3 float each, and 4 integer for the choice; and the sum is an fma.
"""

EXP = 26
"""Float instructions of a weight (7): a difference, its scale, exp by 9 fma, and the conversion."""
