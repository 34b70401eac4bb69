# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``classifier``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from simdtex import schedules
from simdtex.options import Number, Other, Whole, check, documented, option

ALL = ("classify",)

comparison = partial(option, group="Comparison of neighbourhoods")
field = partial(option, group="Field of labels", shown=ALL)
rejection = partial(option, group="Unknown textures")


@documented
@dataclass(frozen=True)
class Options:
    """The options of the method ``classifier``."""

    order: int = comparison(
        2,
        Whole(1, 64),
        "Compare neighbourhoods of this order: all pixels within its square root",
        more="Those with compressed contrast have twice this order.",
        symbol="o of equation (3)",
        shown=ALL,
    )
    levels: int = comparison(
        3,
        Whole(1, 5),
        "Compare at this many levels, at most: as many as have 32 pixels a side in every sample",
        shown=ALL,
    )
    exemplars: int = comparison(
        1500,
        Whole(16, 2**16),
        "Keep this many neighbourhoods of each class, drawn at random",
        slider=(100, 4000, 100),
        shown=ALL,
    )
    typical: float = comparison(
        0.25,
        Number(0, 1),
        "Take away this share of the distances that a class has to itself",
        more="At 0 a class of fine grain, whose neighbourhoods are many, loses to a class of few; at 1 every class "
        "explains as much as it explains of itself.",
        shown=(),
    )
    coupling: float = field(
        8.0,
        Number(0.5, 100),
        "Couple labels over this distance, the standard deviation of a Gaussian",
        unit="pixels",
        slider=(1, 30, 1),
    )
    weight: float = field(
        7.0,
        Number(0, 100),
        "Let neighbouring labels count so much: 0 labels each pixel by its own evidence",
        slider=(0, 20, 0.5),
    )
    sweeps: int = field(10, Whole(0, 1000), "Relax labels in this many sweeps, at most: fewer if no label changes")
    schedule: str | schedules.Schedule = field(
        "synchronous",
        Other(schedules.get, "str or simdtex.schedules.Schedule", valid=tuple(schedules.SCHEDULES)),
        "Relax labels together by this schedule",
        more="Each step of a sweep takes a pass over the picture.",
    )
    unknown: float = rejection(
        0.05,
        Number(0, 1),
        "Call a pixel unknown if a texture of its class would look so different with less than this probability",
        slider=(0, 0.5, 0.01),
        shown=ALL,
    )
    window: float = rejection(
        10.0,
        Number(1, 100),
        "Judge by the mean over this distance, the standard deviation of a Gaussian, within a segment",
        unit="pixels",
        shown=(),
    )

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
