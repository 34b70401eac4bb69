# SPDX-License-Identifier: BSD-3-Clause
"""The threshold that leaves as much choice as seams allow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.methods.multires.analysis import Analysis
from simdtex.methods.multires.levels import (
    copied,
    first_launch,
    pixels,
    places,
    read_sources,
    structure_of,
    thresholds,
)
from simdtex.methods.multires.options import Options
from simdtex.ops.candidates import candidates
from simdtex.ops.laplacian import shifted, within
from simdtex.run import paced

STEPS = 100
"""`suggest_alpha` tries the multiples of 1/100."""

FREEST = 0.4
"""The largest alpha of the paper's figures, and the largest that is suggested."""

STRAIN = 0.05
"""The largest strain of a suggested alpha: 0 is nothing, 1 as much as unrelated pieces have."""

COARSENED = 6
"""Bits that strains leave out of a band, so that the sums of squares fit 64."""


def alpha_of(machine: Machine, analysis: Analysis, options: Options) -> float | None:
    """Return the alpha of a run; None if the options give a table of thresholds."""
    if options.thresholds is not None:
        return None
    return suggest_alpha(machine, analysis, options) if isinstance(options.alpha, str) else float(options.alpha)


def suggest_alpha(machine: Machine, analysis: Analysis, options: Options) -> float:
    """Return the largest alpha at which seams do not show.

    Parameters
    ----------
    machine : Machine
    analysis : Analysis
    options : Options
        ``beta`` and ``parity``, and those of the analysis.

    Returns
    -------
    float
        The largest multiple of 1/100 up to 0.4 at which a texture as large as the sample has a `strain` of 0.05 or
        less; 0 if there is none.

    Notes
    -----
    Cost: six textures of the sample's size without their pictures. The search bisects, since a strain hardly ever falls
    as alpha grows.
    """
    low, high = 0, 1 + round(FREEST * STEPS)
    while high - low > 1:
        middle = (low + high) // 2
        passes = strain(machine, analysis, options, middle / STEPS) <= STRAIN
        low, high = (middle, high) if passes else (low, middle)
    return low / STEPS


def strain(machine: Machine, analysis: Analysis, options: Options, alpha: float) -> float:
    """How much pieces of the sample that meet in a texture differ from what each would go on with.

    Of a texture as large as the sample, for each level of the finer half and each pair of neighbours p and q, where q
    is to the right of p or below, and s says which pixel of the band L each was copied from, this is ::

        mean of |L(s(p) + q - p) - L(s(q))|**2 / (2 mean of |L|**2)

    averaged over these levels. Neighbours that are neighbours in the sample add nothing, and strangers add 1. Coarser
    levels do not count: what is smooth shows no line.

    Parameters
    ----------
    machine : Machine
    analysis : Analysis
    options : Options
        As for `suggest_alpha`.
    alpha : float
        In place of that of the options.

    Returns
    -------
    float
        0 and more. The seed is always 0, and sums are of integers, so it is the same on every device.

    Notes
    -----
    Cost: a texture as large as the sample, without its picture. Memory: as `resample` takes.
    """
    structure = structure_of(machine, analysis, thresholds(analysis.levels, options, alpha))
    top, shapes = analysis.levels - 1, analysis.shapes
    sampled = copied(machine, shapes, shapes[top])
    strains = []
    for level in reversed(range(top)):
        for first, end in paced(pixels([shapes[level]]), first_launch(analysis, level)):
            sampled = candidates(machine, structure, sampled, level, range(first, end), options.parity == "match", 0)
            machine.sync()
        if level < max(1, top // 2):
            band = np.moveaxis(machine.get(analysis.bands[level]) >> COARSENED, 0, -1).astype(np.int64)
            strains.append(_strain(band, read_sources(machine, sampled, shapes, level)[0], analysis.torus))
    return float(np.mean(strains)) if strains else 0.0


def _strain(band: NDArray[np.int64], source: NDArray[np.int32], torus: bool) -> float:
    """Of one level: its band (rows, cols, channels) and the source of its pixels (rows, cols)."""
    squares = int((band * band).sum())
    if not squares:
        return 0.0
    place, differences = places(source, source.shape[1]), 0
    for axis, n in enumerate(source.shape):
        near, by = shifted(n, 1, torus)
        other, own = place.take(near, axis), place.copy()
        moved = own[..., axis] + by.reshape((-1, 1) if axis == 0 else -1)
        own[..., axis] = within(moved, n, torus)
        apart = band[own[..., 0], own[..., 1]] - band[other[..., 0], other[..., 1]]
        differences += int((apart * apart).sum())
    return differences / (4 * squares)  # of two directions
