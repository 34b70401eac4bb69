# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``multires``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf

from simdtex.options import Choice, Number, Whole, check, documented, option

DIRECTIONS = 64
"""The most orientations: any more are alike."""

appearance = partial(option, group="Appearance", shown=("synth",))
scales = partial(option, group="Scales and edges", shown=("synth",))


@documented
@dataclass(frozen=True)
class Options:
    """The options of the method ``multires``."""

    alpha: float = appearance(
        0.3,
        Number(0, inf),
        "Exchange places that differ by no more than this: 0 tiles the sample, more is freer",
        more="0 tiles the sample but for parts that are equal to the bit, infinity samples every band on its own.",
        symbol="alpha of T = alpha / k^beta, equation (13)",
        slider=(0, 1, 0.01),
    )
    beta: float = appearance(
        0.0,
        Number(0),
        "Be stricter at high frequencies, by alpha / k^beta; k counts levels from the lowest frequency upward",
        symbol="beta of equation (13)",
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

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
