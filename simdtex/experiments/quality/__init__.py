# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: how well a synthesised texture stands for its sample.

No figure is enough alone. An output that repeats one patch is plausible and covers nothing; one
that copies the sample whole is perfect in both and says so in the copying. Pictures are arrays
(rows, cols) or (rows, cols, channels) in any one unit; "sample standard deviation" is everywhere
the square root of the sample's variance averaged over its channels, at full resolution (1 where
the sample is constant).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from simdtex.experiments.quality.likeness import coverage, innovation, plausibility
from simdtex.experiments.quality.repetition import APART, REPEATED_PATCH, Repeats, repeats
from simdtex.experiments.quality.values import BLOCK, Tones, histogram_distance, salt, seam, tones
from simdtex.experiments.quality.verbatim import COPIED_PATCH, copying
from simdtex.model.use import MostUsed, Use, effective_use

__all__ = [
    "COPIED_PATCH",
    "FIGURES",
    "MostUsed",
    "Quality",
    "Repeats",
    "Tones",
    "Use",
    "copying",
    "coverage",
    "effective_use",
    "histogram_distance",
    "innovation",
    "measure",
    "plausibility",
    "repeats",
    "salt",
    "seam",
    "tones",
]

LEAST = {"repeats": REPEATED_PATCH + APART, "tones": 2 * BLOCK}
"""Sides that pictures must have for these figures, pixels; `COPIED_PATCH` is enough for all others."""

OF_SOURCE = {"effective_use"}
"""The figures that need a source map."""


@dataclass(frozen=True)
class Quality:
    """The figures of one output, see the functions of the same names; None for each that was not computed.

    Attributes
    ----------
    plausibility, coverage, histogram_distance : float or None
        In sample standard deviations; 0 is best.
    copying : float or None
        Share of the output's patches, 0 to 1.
    seam : float or None
        Ratio; 1 is a seam that does not show.
    repeats, own_repeats : float or None
        Share of the output's patches that stand in it again, and of the sample's in the sample, 0 to 1; None where a
        picture is smaller than 48 x 48 pixels.
    salt : float or None
        Odd pixels as a multiple of the sample's; 1 is as many.
    contrast, shift, coarse_contrast : float or None
        `tones`: a ratio, where 1 is best, and two differences in sample standard deviations, where 0 is; None where a
        picture is smaller than 32 x 32 pixels.
    innovation : float or None
        Share of neighbour pixels, 0 to 1; 0 is a copy.
    effective_share, most_used : float or None
        `effective_use`: a share above 0, to 1, and how many times its fair share the most used piece is taken; None
        where no source map was given.
    """

    plausibility: float | None = None
    coverage: float | None = None
    copying: float | None = None
    histogram_distance: float | None = None
    seam: float | None = None
    repeats: float | None = None
    own_repeats: float | None = None
    salt: float | None = None
    contrast: float | None = None
    shift: float | None = None
    coarse_contrast: float | None = None
    innovation: float | None = None
    effective_share: float | None = None
    most_used: float | None = None


def measure(
    sample: ArrayLike,
    output: ArrayLike,
    source: ArrayLike | None = None,
    *,
    stride: int | None = None,
    figures: Collection[str] | None = None,
) -> Quality:
    """Compute the figures of merit of one output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.
    source : array_like of int, (rows, cols, 2), optional
        The output's source map.
    stride : int, optional
        As in `plausibility`.
    figures : collection of str, optional
        Names out of `FIGURES`, as ``("plausibility", "repeats")``. By default all for which the pictures are large
        enough and a source map is there.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        There is no figure of a name, one that was named cannot be computed, or the pictures do not suit each other.

    Notes
    -----
    About 2.5 s on two CPU cores for a 128 x 128 sample and a 256 x 256 output in colour, half of it for plausibility
    and coverage.
    """
    job = _Job(sample, output, source, stride)
    wanted = _possible(job) if figures is None else _checked(figures, job)
    found: dict[str, float] = {}
    for name in wanted:
        found |= _COMPUTED[name](job)
    return Quality(**found)


class _Job(NamedTuple):
    """What `measure` is given."""

    sample: ArrayLike
    output: ArrayLike
    source: ArrayLike | None
    stride: int | None

    @property
    def use(self) -> tuple[ArrayLike, tuple[int, ...]]:
        assert self.source is not None  # only then it is asked for
        return self.source, np.shape(self.sample)[:2]


def _repeats(job: _Job) -> dict[str, float]:
    found = repeats(job.sample, job.output)
    return {"repeats": found.share, "own_repeats": found.own}


def _effective_use(job: _Job) -> dict[str, float]:
    found = effective_use(*job.use)
    return {"effective_share": found.effective_share, "most_used": found.most_used.times_fair_share}


_COMPUTED: dict[str, Callable[[_Job], dict[str, float]]] = {
    "plausibility": lambda job: {"plausibility": plausibility(job.sample, job.output, stride=job.stride)},
    "coverage": lambda job: {"coverage": coverage(job.sample, job.output, stride=job.stride)},
    "copying": lambda job: {"copying": copying(job.sample, job.output)},
    "histogram_distance": lambda job: {"histogram_distance": histogram_distance(job.sample, job.output)},
    "seam": lambda job: {"seam": seam(job.output)},
    "repeats": _repeats,
    "salt": lambda job: {"salt": salt(job.sample, job.output)},
    "tones": lambda job: tones(job.sample, job.output)._asdict(),
    "innovation": lambda job: {"innovation": innovation(job.sample, job.output)},
    "effective_use": _effective_use,
}

FIGURES = tuple(_COMPUTED)
"""What `measure` can compute: the names of the functions."""


def _possible(job: _Job) -> list[str]:
    """The figures for which the pictures are large enough, and there is a source map."""
    side = min(*np.shape(job.sample)[:2], *np.shape(job.output)[:2])
    known = [name for name in FIGURES if job.source is not None or name not in OF_SOURCE]
    return [name for name in known if side >= LEAST.get(name, 0)]


def _checked(figures: Collection[str], job: _Job) -> list[str]:
    """The figures that were named, in the order of `FIGURES`."""
    names = {figures} if isinstance(figures, str) else set(figures)
    for name in sorted(names - set(FIGURES)):
        raise ValueError(f"there is no figure {name}: choose of {', '.join(FIGURES)}")
    for name in sorted(names & OF_SOURCE):
        if job.source is None:
            raise ValueError(f"the figure {name} needs a source map: give source, the one of the run")
    return [name for name in FIGURES if name in names]
