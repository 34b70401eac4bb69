# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: plausibility, coverage, copying, the distance of histograms, and the seam."""

from __future__ import annotations

from math import gcd

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import wasserstein_distance

from simdtex.experiments.quality.patches import (
    Array,
    Indices,
    Planes,
    as_pair,
    as_planes,
    count,
    deviation,
    halved,
    hashes,
    in_deviations,
    nearest,
)

PATCH = 7  # side of the patches, pixels
SCALES = 3  # full size, 1/2 and 1/4
QUERIES = 4096  # patches looked up per scale, at most
COPIED_PATCH = 9  # side of the patches, pixels


def plausibility(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the mean distance from a 7 x 7 patch of the output to the nearest patch of the sample.

    The distance is the root of the mean squared difference over the 49 x channels values, in sample standard
    deviations; the mean is over patches, then over three scales (full size, 1/2 and 1/4 by means of 2 x 2 blocks). A
    scale at which a picture has no 7 x 7 patch is left out.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 7 x 7 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 if every patch looked up occurs in the sample.

    Notes
    -----
    About 4096 evenly spaced patches are looked up at each scale. The nearest one is exact, by comparison with all.
    Cost: queries x candidates x 98 x channels operations in single precision; memory under 200 MB beyond the pictures,
    for any size.
    """
    return _mean_nearest(sample, output, of_output=True)


def coverage(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the mean distance from a 7 x 7 patch of the sample to the nearest patch of the output.

    It is `plausibility` with the pictures exchanged, and grows with every part of the sample that the output lacks.
    Parameters, units and cost are those of `plausibility`.
    """
    return _mean_nearest(sample, output, of_output=False)


def _mean_nearest(sample: ArrayLike, output: ArrayLike, *, of_output: bool) -> float:
    first, second = as_pair(sample, output, PATCH)
    pair = in_deviations(first, first, second)
    means = []
    for _ in range(SCALES):
        if min(side for planes in pair for side in planes.shape[:2]) < PATCH:
            break
        candidates, queries = pair if of_output else pair[::-1]
        means.append(float(nearest(queries, _every(queries), candidates, PATCH).distance.mean()))
        pair = [halved(planes) for planes in pair]
    return float(np.mean(means))


def _every(planes: Planes) -> Indices:
    """Return the numbers of the patches of a picture to look up."""
    total = count(planes, PATCH)
    stride = -(-total // QUERIES)
    # no common divisor with a row of patches, or the queries would line up in columns
    while gcd(stride, planes.shape[1] - PATCH + 1) > 1:
        stride += 1
    return np.arange(0, total, stride)


def copying(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the share of the 9 x 9 patches of the output that occur unchanged in the sample.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1. Flat parts count as copied, since the same flat patch occurs in the sample.

    Notes
    -----
    Patches are compared by their `simdtex.experiments.quality.patches.hashes`.
    """
    first, second = as_pair(sample, output, COPIED_PATCH)
    numbers = np.unique(np.concatenate([first.ravel(), second.ravel()]), return_inverse=True)[1]
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(np.isin(hashes(made, COPIED_PATCH), hashes(known, COPIED_PATCH)).mean())


def histogram_distance(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the earth mover's distance between the marginal histograms, mean over channels.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        Any sizes, the same number of channels.

    Returns
    -------
    float
        In sample standard deviations; 0 if the histograms agree.
    """
    first, second = as_pair(sample, output, 1)
    channels = range(first.shape[2])
    moved = [wasserstein_distance(first[..., k].ravel(), second[..., k].ravel()) for k in channels]
    return float(np.mean(moved) / deviation(first))


def seam(output: ArrayLike) -> float:
    """Return the visibility of the seam between copies of the output side by side.

    It is the mean absolute difference between the last and the first row, divided by that between neighbouring inner
    rows, the same for columns, and the mean of the two.

    Parameters
    ----------
    output : array_like, (rows, cols) or (rows, cols, channels)
        At least 2 x 2 pixels.

    Returns
    -------
    float
        About 1 for a picture that tiles (and for a constant one), larger if the seam is an edge; infinite if it is
        the only edge.
    """
    planes = as_planes(output).astype(np.float64)
    if min(planes.shape[:2]) < 2:
        raise ValueError("the output is less than 2 pixels wide or high: give at least 2 x 2")
    return float(np.mean([_seam_along(planes, axis) for axis in (0, 1)]))


def _seam_along(planes: Array, axis: int) -> float:
    inside = float(np.abs(np.diff(planes, axis=axis)).mean())
    across = float(np.abs(planes.take(0, axis) - planes.take(-1, axis)).mean())
    if inside == 0.0:
        return 1.0 if across == 0.0 else float("inf")
    return across / inside
