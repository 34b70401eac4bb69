# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``multires``, and their defaults."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simdtex.options import build, check, integer, number_of, real, shown, unmasked, words

WIDEST = 100
"""The largest sigma; a filter of one far narrower does not know it from a larger one."""

DIRECTIONS, FILTER = 64, 101
"""The most orientations, and the largest filters: any more are alike, or larger than the levels they are for."""


@dataclass(frozen=True)
class Options:
    """The options of the method ``multires``.

    Parameters
    ----------
    alpha : float or "auto"
        Of T = alpha / k**beta (13), 0 or more: 0 tiles the sample (but for parts that are equal to the bit), infinity
        samples every band on its own. ``"auto"`` takes what `simdtex.suggest_alpha` finds for ``strain`` or ``target``.
    beta : float
        Of the same, 0 or more. k counts levels from the lowest frequency upward.
    strain : float
        With ``alpha="auto"``, how much pieces that meet may differ from what either would go on with: 0, nothing, to 1,
        as much as strangers. See `simdtex.methods.multires.strain`.
    target : float, optional
        With ``alpha="auto"``, in place of the strain: candidates that a pixel of the coarser levels is to have on
        average.
    thresholds : array, optional
        T itself, in place of alpha and beta: one row for each level but the finest, the lowest frequency first; one
        column for all features or one for each.
    orientations : int
        Of the first and of the second derivatives of a Gaussian in the filter bank (7), 64 or fewer; 0 leaves the bands
        alone.
    sigma : float
        Of that Gaussian, in pixels; 0.2 to 100.
    filter_size : int
        Rows and columns of the filters; odd, 3 to 101. A level smaller than that has no responses.
    features : {"luminance", "channels"}
        Whether features are made of the luminance or of every channel. Bands are copied with all their channels.
    levels : int, optional
        Of the pyramids. None: down to a single pixel.
    parity : {"match", "free"}
        Whether a candidate must stand in an even or odd row and column as the pixel does. ``"free"`` is the paper's
        text.
    boundary : {"torus", "open"}
        Whether pyramids wrap around, or continue as in a mirror.
    edges : {"mend", "keep"}
        Whether the edges of a sample that does not wrap around are first covered with a piece of itself, so that it
        does; see `simdtex.methods.multires.mend.mend`.
    seams : {"blend", "cut"}
        Whether the bands of pieces that meet fade into each other, over a pixel of each level, or end where they meet.
        ``"cut"`` is the paper's text.
    """

    alpha: float | str = 0.3
    beta: float = number_of(0.0, 0)
    strain: float = number_of(0.05, 0)
    target: float | None = number_of(None, 1, 2**31)
    thresholds: ArrayLike | None = None
    orientations: int = integer(4, 0, DIRECTIONS)
    sigma: float = number_of(0.7, 0.2, WIDEST)
    filter_size: int = integer(3, 3, FILTER)
    features: str = words("luminance", "luminance", "channels")
    levels: int | None = integer(None, 1)
    parity: str = words("match", "match", "free")
    boundary: str = words("torus", "torus", "open")
    edges: str = words("mend", "mend", "keep")
    seams: str = words("blend", "blend", "cut")

    def __post_init__(self) -> None:
        """Check every value."""
        if isinstance(self.alpha, str):
            if self.alpha != "auto":
                raise ValueError(f"alpha is {shown(self.alpha)}; give a number of at least 0, or 'auto'")
        elif not (isinstance(self.alpha, Real) and self.alpha == inf):
            real("alpha", self.alpha, 0, inf)
        check(self)
        if self.filter_size % 2 == 0:
            raise ValueError(f"filter_size is {self.filter_size}; give an odd number, 3 or 5")
        if self.thresholds is not None:
            _check_thresholds(self.thresholds)

    @property
    def analysis(self) -> dict[str, Any]:
        """Those that bear on the analysis."""
        names = ("orientations", "sigma", "filter_size", "features", "levels", "boundary", "edges")
        return {name: vars(self)[name] for name in names}


def make_options(**given: Any) -> Options:
    """Options from what the user gave; unknown names are a TypeError that lists the valid ones."""
    return build(Options, "multires", given)


def _check_thresholds(table: ArrayLike) -> None:
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
