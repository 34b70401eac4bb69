# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: how well a synthesised texture represents its sample.

No figure is enough alone. An output that repeats one patch is plausible and covers nothing; one that copies the sample
whole is perfect in both, and only its copying tells. Pictures are arrays (rows, cols) or (rows, cols, channels) in any
one unit; "sample standard deviation" is everywhere the square root of the sample's variance averaged over its channels,
at full resolution (1 if the sample is constant).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simdtex.experiments.quality.likeness import (
    APART,
    COPIED_PATCH,
    REPEATED_PATCH,
    Repeats,
    copying,
    coverage,
    innovation,
    plausibility,
    repeats,
)
from simdtex.experiments.quality.values import BLOCK, Tones, histogram_distance, salt, seam, tones
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

_OF_BOTH = {
    figure.__name__: figure
    for figure in (plausibility, coverage, copying, histogram_distance, repeats, salt, tones, innovation)
}
FIGURES = (*_OF_BOTH, "seam", "effective_use")
"""What `measure` can compute: the names of the functions."""

LEAST = {"repeats": REPEATED_PATCH + APART, "tones": 2 * BLOCK}
"""Sides that pictures must have for these figures, pixels; `COPIED_PATCH` is enough for all others."""

_SEVERAL = {
    "repeats": ("repeats", "own_repeats"),
    "tones": ("contrast", "shift", "coarse_contrast"),
    "effective_use": ("effective_share", "most_used"),
}
"""Fields of `Quality` for figures of several numbers."""


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
        Share of the output's patches that recur in it, and of the sample's in the sample, 0 to 1; None if a picture
        is smaller than 48 x 48 pixels.
    salt : float or None
        Odd pixels as a multiple of the sample's; 1 is as many.
    contrast, shift, coarse_contrast : float or None
        `tones`: a ratio, 1 is best, and two differences in sample standard deviations, 0 is best; None if a picture is
        smaller than 32 x 32 pixels.
    innovation : float or None
        Share of neighbour pixels, 0 to 1; 0 is a copy.
    effective_share, most_used : float or None
        `effective_use`: a share above 0, to 1, and how many times its fair share the most used piece is taken; None
        if no source map was given.
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
    figures: Collection[str] | None = None,
) -> Quality:
    """Compute the figures of merit of one output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.
    source : array_like of int, (rows, cols, 2), optional
        The output's source map.
    figures : collection of str, optional
        Names out of `FIGURES`, as ``("plausibility", "repeats")``. By default all for which the pictures are large
        enough, and `source` if it is given.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        A name is unknown, a named figure cannot be computed, or the pictures have different channels.

    Notes
    -----
    About 2.5 s on two CPU cores for a 128 x 128 sample and a 256 x 256 output in colour, half of it for plausibility
    and coverage.
    """
    shape = np.shape(sample)[:2]
    side = min(*shape, *np.shape(output)[:2])
    if figures is None:
        names = {name for name in FIGURES if side >= LEAST.get(name, 0)}
        names -= {"effective_use"} if source is None else set()
    else:
        names = {figures} if isinstance(figures, str) else set(figures)
    for name in sorted(names - set(FIGURES)):
        raise ValueError(f"there is no figure {name}: choose of {', '.join(FIGURES)}")
    found: dict[str, Any] = {}
    for name in names:
        if name == "seam":
            value: Any = seam(output)
        elif name != "effective_use":
            value = _OF_BOTH[name](sample, output)
        elif source is None:
            raise ValueError(f"the figure {name} needs a source map: give source, the one of the run")
        else:
            use = effective_use(source, shape)
            value = use.effective_share, use.most_used.times_fair_share
        found |= zip(_SEVERAL[name], value, strict=True) if name in _SEVERAL else {name: value}
    return Quality(**found)
