# SPDX-License-Identifier: BSD-3-Clause
"""Classification of textures: nearest whole neighbourhoods, a Potts field, and a test for unknown textures."""

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
    """The options of a classification."""

    order: int = comparison(
        2,
        Whole(1, 64),
        "Compare neighbourhoods of this order, all pixels within sqrt(order)",
        more="Neighbourhoods with compressed contrast have twice this order.",
        symbol="o of equation (3)",
        shown=ALL,
    )
    levels: int = comparison(
        3,
        Whole(1, 5),
        "Compare at no more than this many levels: every sample needs 32 pixels a side at each of them",
        shown=ALL,
    )
    exemplars: int = comparison(
        1500,
        Whole(16, 2**16),
        "Keep this many random neighbourhoods of each class as exemplars",
        slider=(100, 4000, 100),
        shown=ALL,
    )
    typical: float = comparison(
        0.25,
        Number(0, 1),
        "Subtract this share of the mean distance between a class and its own exemplars",
        more="With 0 a class of fine grain, which has many different neighbourhoods, loses pixels to a class of few. "
        "With 1 only the distance beyond that mean counts.",
        shown=(),
    )
    smoothing: float = option(
        2.0,
        Number(0, 20),
        "Average the evidence over a Gaussian of this standard deviation: 0 keeps that of single neighbourhoods",
        unit="pixels",
        group="Field of labels",
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
        2.0,
        Number(0, 100),
        "Set the weight of neighbouring labels: 0 labels each pixel by its own evidence",
        slider=(0, 20, 0.5),
        label="Weight of neighbours",
    )
    sweeps: int = field(10, Whole(0, 1000), "Relax labels in at most this many sweeps: fewer if no label changes")
    schedule: str | schedules.Schedule = field(
        "synchronous",
        Other(schedules.get, "str or simdtex.schedules.Schedule", valid=tuple(schedules.SCHEDULES)),
        "Relax labels by this schedule",
        more="Each step of a sweep is a pass over the picture.",
    )
    unknown: float = rejection(
        0.05,
        Number(0, 1),
        "Label a pixel unknown if its fit, a probability, is below this",
        slider=(0, 0.5, 0.01),
        label="Unknown below a fit of",
        shown=ALL,
    )
    window: float = rejection(
        20.0,
        Number(1, 100),
        "Average distances and patterns for the fit over a Gaussian of this standard deviation, within a segment",
        unit="pixels",
        shown=(),
    )

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
