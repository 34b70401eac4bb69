# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``multires``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from simdtex.options import Choice, Number, Other, Whole, check, documented, option, unmasked

WIDEST = 100
"""The largest sigma; a filter of one far narrower does not know it from a larger one."""

DIRECTIONS, FILTER = 64, 101
"""The most orientations, and the largest filters: any more are alike, or larger than the levels they are for."""


def check_thresholds(table: ArrayLike) -> None:
    """Raise unless a table of thresholds is an array of numbers of 0 or more."""
    unmasked("thresholds", table)
    try:
        values = np.asarray(table)
    except ValueError:
        raise ValueError("thresholds is ragged; give rows of equal length") from None
    if values.dtype.kind not in "iuf":
        raise TypeError(f"thresholds must be an array of numbers, not of {values.dtype}")
    if values.ndim not in (1, 2) or not values.size:
        raise ValueError(f"thresholds has shape {values.shape}; give one row for each level but the finest")
    if not (values >= 0).all():
        raise ValueError("thresholds must be numbers of at least 0")


appearance = partial(option, group="Appearance", shown=("synth", "sheet"))
scales = partial(option, group="Scales and edges", shown=("synth", "sheet"))


@documented
@dataclass(frozen=True)
class Options:
    """The options of the method ``multires``."""

    alpha: float | str = appearance(
        0.3,
        Number(0, inf, word="auto"),
        "Exchange places that differ by no more than this: 0 tiles the sample, more is freer, auto finds a value",
        more="0 tiles the sample but for parts that are equal to the bit, infinity samples every band on its own. "
        '``"auto"`` takes what `simdtex.suggest_alpha` finds.',
        symbol="alpha of T = alpha / k^beta, equation (13)",
        shown=("synth",),
        slider=(0, 1, 0.01),
    )
    beta: float = appearance(
        0.0,
        Number(0),
        "Be stricter at high frequencies, by alpha / k^beta; k counts levels from the lowest frequency upward",
        symbol="beta of equation (13)",
        shown=("synth",),
        slider=(0, 3, 0.1),
    )
    thresholds: ArrayLike | None = appearance(
        None,
        Other(check_thresholds, "array"),
        "Take these thresholds in place of alpha and beta: a row for each level but the finest, the lowest frequency "
        "first, and a column for all features or one for each",
        none="those of alpha and beta",
        symbol="T of equation (13)",
        shown=(),
    )
    seams: str = appearance(
        "blend",
        Choice(("blend", "cut")),
        "Let the bands of pieces that meet fade into each other over a pixel of each level (blend), or end there (cut)",
        paper="cut",
        shown=(),
    )
    parity: str = appearance(
        "match",
        Choice(("match", "free")),
        "Take a candidate from even or odd rows and columns, as the pixel's are (match), or from any (free)",
        symbol="equation (8)",
        paper="free",
        shown=(),
    )
    features: str = appearance(
        "luminance",
        Choice(("luminance", "channels")),
        "Make features of the luminance, or of every channel",
        more="Bands are copied with all their channels.",
        shown=(),
    )
    levels: int | None = scales(
        None,
        Whole(1),
        "Go through this many levels of the pyramids, from coarse to fine",
        none="down to a single pixel",
        slider=(1, 10, 1),
    )
    boundary: str = scales(
        "torus",
        Choice(("torus", "open")),
        "Let pyramids wrap around, so that the output tiles (torus), or continue as in a mirror (open)",
    )
    edges: str = scales(
        "mend",
        Choice(("mend", "keep")),
        "Cover the edges of a sample that does not wrap around with a piece of itself, so that it does (mend), or keep "
        "them",
        more="See `simdtex.methods.multires.mend.mend`.",
        paper="keep",
    )
    orientations: int = scales(
        4,
        Whole(0, DIRECTIONS),
        "Look for edges and lines in this many directions; 0 compares the bands alone",
        more="The filter bank has so many first and second derivatives of a Gaussian.",
        symbol="equation (7)",
        slider=(0, 12, 1),
    )
    sigma: float = scales(
        0.7,
        Number(0.2, WIDEST),
        "Make the Gaussian of the filters this wide",
        unit="pixels",
        slider=(0.3, 3, 0.1),
        shown=(),
    )
    filter_size: int = scales(
        3,
        Whole(3, FILTER),
        "Give filters this many rows and columns, an odd number",
        more="A level smaller than that has no responses.",
        slider=(3, 15, 2),
        shown=(),
    )

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
        if self.filter_size % 2 == 0:
            raise ValueError(f"filter_size is {self.filter_size}; give an odd number, 3 or 5")
