# SPDX-License-Identifier: BSD-3-Clause
"""The names of processor arrays: the models of the MasPar MP-1, other sizes, and the mapping of pixels onto them."""

from __future__ import annotations

import re
from typing import NamedTuple

from simdtex.options import one_of, shown

MAPPINGS = ("cut-and-stack", "hierarchical")

PREFIX = "maspar-mp1-"
ARRAYS = {
    "maspar-mp1-1k": (32, 32),
    "maspar-mp1-2k": (32, 64),
    "maspar-mp1-4k": (64, 64),
    "maspar-mp1-8k": (64, 128),
    "maspar-mp1-16k": (128, 128),
}
"""Rows and columns of the models of the MP-1."""

LARGEST = 2**22
"""PEs of the largest array."""


class ArraySize(NamedTuple):
    """Rows and columns of an array, and the mapping of pixels onto it, see `simdtex.maspar.array.ProcessorArray`."""

    rows: int
    cols: int
    mapping: str


def parse_array(text: str, mapping: str = MAPPINGS[0]) -> ArraySize:
    """Return the size and the mapping of the processor array that a text describes.

    Parameters
    ----------
    text : str
        ``"ROWSxCOLS"`` or a key of `ARRAYS`, which may be short as in ``"16k"``; either may be followed by
        ``":cut-and-stack"`` or ``":hierarchical"``.
    mapping : str
        The mapping if the text names none.

    Raises
    ------
    ValueError
        The text names no array, or more than `LARGEST` PEs.
    """
    models = "|".join(name.removeprefix(PREFIX) for name in ARRAYS)
    form = rf"(?:([1-9]\d{{0,4}})x([1-9]\d{{0,4}})|(?:{PREFIX})?({models}))(?::(.*))?"
    match = re.fullmatch(form, text if isinstance(text, str) else "")
    if not match:
        raise ValueError(
            f"unknown array {shown(text)}; give rows x columns such as 128x128, or one of: {', '.join(ARRAYS)}"
        )
    rows, cols = ARRAYS[PREFIX + match[3]] if match[3] else (int(match[1]), int(match[2]))
    if rows * cols > LARGEST:
        raise ValueError(f"an array of {text} PEs is beyond {LARGEST}; give a smaller one, say 128x128")
    mapping = mapping if match[4] is None else match[4]
    one_of("mapping", mapping, MAPPINGS)
    return ArraySize(rows, cols, mapping)
