# SPDX-License-Identifier: BSD-3-Clause
"""Figures from the source map: how much of the sample was used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from simdtex.model.use import counts


class SourceUse(NamedTuple):
    """How much of the sample the output was made from, see `source_use`."""

    share: float
    entropy: float


def source_use(source: ArrayLike, sample_shape: tuple[int, ...]) -> SourceUse:
    """How much of the sample the output was made from, pixel by pixel.

    `effective_use` is the figure over pieces of the sample, which is less noisy.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2)
        For every output pixel, the (row, column) of the sample that it was taken from, or -1 and -1 for none.
    sample_shape : (rows, cols)
        The size of the sample, pixels.

    Returns
    -------
    share : float
        Of the sample's pixels, those used at least once; at most output pixels / sample pixels.
    entropy : float
        Of the distribution of use over the sample's pixels, over its largest value, the logarithm
        of their number: 1 where all are used alike, 0 where one is used alone.

    Raises
    ------
    ValueError
        `source` is no source map, points outside the sample, or has no pixel with a source.
    """
    uses = counts(source, sample_shape).ravel()
    if not uses.any():
        raise ValueError("no pixel was taken from the sample, so its use has no figures: pass the map of another run")
    used = uses[uses > 0] / uses.sum()
    entropy = float(-(used * np.log(used)).sum() / np.log(len(uses))) if len(uses) > 1 else 1.0
    return SourceUse(share=len(used) / len(uses), entropy=max(0.0, min(1.0, entropy)))
