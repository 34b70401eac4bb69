# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's pyramid matching (1995): pictures, solids and mixtures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from numpy.typing import ArrayLike

from simdtex.methods.pyramid.steerable import ORIENTATIONS
from simdtex.options import Choice, Other, Whole, check, documented, option, real_array

KINDS = ("steerable", "laplacian")

ALL = ("synth", "mix", "solid")

appearance = partial(option, group="Appearance", shown=ALL)
scales = partial(option, group="Scales and edges", shown=ALL)


@documented
@dataclass(frozen=True)
class Options:
    """The options of the method ``pyramid``, whose outputs always tile."""

    pyramid: str = appearance(
        "steerable",
        Choice(KINDS),
        "Match histograms of every scale and direction (steerable), or of every scale (laplacian)",
        more='A solid texture always matches a Laplacian pyramid; with ``"steerable"`` it also matches the steerable '
        "pyramids of all its slices.",
    )
    iterations: int = appearance(
        5,
        Whole(0),
        "Match the histograms of subbands and pixels this many times",
        slider=(0, 20, 1),
    )
    match: str = appearance(
        "rank",
        Choice(("rank", "lookup")),
        "Match histograms exactly by rank (rank), or by the paper's lookup tables (lookup)",
        paper="lookup",
        shown=(),
    )
    color: str = appearance(
        "decorrelate",
        Choice(("decorrelate", "channels")),
        "Match decorrelated channels (decorrelate), or the channels as they are (channels)",
        shown=("mix", "solid"),
    )
    start: ArrayLike | None = appearance(
        None,
        Other(partial(real_array, "start"), "array"),
        "Start from this array, of the output's shape and with the sample's channels",
        none="noise",
        shown=(),
    )
    levels: int | None = scales(
        None,
        Whole(0),
        "Use this many levels of the pyramids",
        none="as many as leave 8 pixels a side",
        slider=(0, 8, 1),
    )
    edges: str = scales(
        "reflect",
        Choice(("reflect", "wrap")),
        "Reflect the sample at its edges (reflect), or wrap it around (wrap)",
    )
    orientations: int = scales(
        4,
        Whole(1),
        "Split pictures into 1, 2, 4 or 6 directions, with the steerable pyramid",
        slider=(1, 6, 1),
    )

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
        if self.orientations not in ORIENTATIONS:
            valid = ", ".join(map(str, ORIENTATIONS))
            raise ValueError(f"orientations is {self.orientations}; the steerable filters have one of: {valid}")
