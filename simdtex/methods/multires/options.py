# SPDX-License-Identifier: BSD-3-Clause
"""De Bonet's multiresolution sampling (1997)."""

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
        "Exchange places whose features differ by at most this: 0 tiles the sample, more departs further from it",
        more="0 tiles the sample, except for parts that are equal to the bit; infinity samples every band separately.",
        symbol="alpha of T = alpha / k^beta, equation (13)",
        slider=(0, 1, 0.01),
        label="Threshold (alpha)",
    )
    beta: float = appearance(
        0.0,
        Number(0),
        "Lower the threshold at high frequencies to alpha / k^beta; k counts levels from the lowest frequency up",
        symbol="beta of equation (13)",
        shown=(),
    )
    seams: str = appearance(
        "blend",
        Choice(("blend", "cut")),
        "Fade the bands of adjacent pieces into each other over a pixel of each level (blend), or cut them (cut)",
        paper="cut",
        shown=(),
    )
    parity: str = appearance(
        "match",
        Choice(("match", "free")),
        "Take a candidate from rows and columns of the pixel's parity, even or odd (match), or from any (free)",
        symbol="equation (8)",
        paper="free",
        shown=(),
    )
    levels: int | None = scales(
        None,
        Whole(1),
        "Use this many levels of the pyramids, from coarse to fine",
        none="down to a single pixel",
        slider=(1, 10, 1),
    )
    boundary: str = scales(
        "torus",
        Choice(("torus", "open")),
        "Wrap the pyramids around, so that the output tiles (torus), or reflect the sample at its edges (open)",
    )
    edges: str = scales(
        "mend",
        Choice(("mend", "keep")),
        "Cover the seam of a sample that does not wrap around with a strip of the sample (mend), or keep its edges "
        "(keep)",
        more="See `simdtex.methods.multires.mend.mend`.",
        paper="keep",
    )
    orientations: int = scales(
        4,
        Whole(0, DIRECTIONS),
        "Look for edges and lines in this many directions; 0 compares the bands alone",
        more="The filter bank has this many first, and as many second, derivatives of a Gaussian.",
        symbol="equation (7)",
        slider=(0, 12, 1),
    )

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
