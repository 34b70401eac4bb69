# SPDX-License-Identifier: BSD-3-Clause
"""Figures from the nearest patches: whether either picture stands in the other, and in pieces how large."""

from __future__ import annotations

from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from simdtex.experiments.quality.nearest import Indices, count, nearest
from simdtex.experiments.quality.pictures import Planes, as_pair, halved, in_deviations

PATCH = 7  # side of the patches, pixels
SCALES = 3  # full size, 1/2 and 1/4
QUERIES = 4096  # patches looked up per scale where no stride is given


def plausibility(sample: ArrayLike, output: ArrayLike, *, stride: int | None = None) -> float:
    """Mean distance from a 7 x 7 patch of the output to the nearest patch of the sample.

    The distance is the root of the mean squared difference over the 49 x channels values, in
    sample standard deviations; the mean is over patches, then over three scales (full size, 1/2
    and 1/4 by means of 2 x 2 blocks). A scale at which a picture has no 7 x 7 patch is left out.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 7 x 7 pixels each, with the same number of channels.
    stride : int, optional
        Every `stride`-th patch in raster order is looked up, 1 for all. By default as many as
        leave about 4096 at each scale, spread evenly.

    Returns
    -------
    float
        0 where every patch looked up stands in the sample.

    Notes
    -----
    The nearest patch is exact, by comparing with all. Cost: queries x candidates x 98 x channels
    operations in single precision; memory under 200 MB beside the pictures, for any size.
    """
    return _mean_nearest(sample, output, of_output=True, stride=stride)


def coverage(sample: ArrayLike, output: ArrayLike, *, stride: int | None = None) -> float:
    """Mean distance from a 7 x 7 patch of the sample to the nearest patch of the output.

    `plausibility` the other way round: it grows with every part of the sample that the output
    lacks. Parameters, units and cost are those of `plausibility`.
    """
    return _mean_nearest(sample, output, of_output=False, stride=stride)


def _mean_nearest(sample: ArrayLike, output: ArrayLike, *, of_output: bool, stride: int | None) -> float:
    if stride is not None and stride < 1:
        raise ValueError(f"stride is {stride}: give 1 or more")
    first, second = as_pair(sample, output, PATCH)
    pair = in_deviations(first, first, second)
    means = []
    for _ in range(SCALES):
        if min(side for planes in pair for side in planes.shape[:2]) < PATCH:
            break
        candidates, queries = pair if of_output else pair[::-1]
        means.append(float(nearest(queries, _every(queries, stride), candidates, PATCH).distance.mean()))
        pair = [halved(planes) for planes in pair]
    return float(np.mean(means))


def _every(planes: Planes, stride: int | None) -> Indices:
    total = count(planes, PATCH)
    if stride is None:
        stride = -(-total // QUERIES)
        # no common divisor with a row of patches, or the queries would stand in columns
        while gcd(stride, planes.shape[1] - PATCH + 1) > 1:
            stride += 1
    return np.arange(0, total, stride)


def innovation(sample: ArrayLike, output: ArrayLike) -> float:
    r"""Share of neighbour pixels of the output that do not continue one another in the sample.

    With :math:`s(x)` the position of the sample's patch that is nearest to the 7 x 7 patch at
    :math:`x` of the output, and :math:`e` one pixel down or to the right, this is

    .. math::

       1 - \operatorname{mean}_{x, e} [ s(x + e) = s(x) + e ] ,

    the mean over both directions. It is the innovation capacity of R. Webster, "Innovative
    non-parametric texture synthesis via patch permutations", 2018.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 8 x 8 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1: 0 where the output is one piece of the sample, 1 where it continues nothing of it.
        Patches across the joints of pieces have sources of their own. Where patches of the sample
        are equal to the last bit the first stands for all, so flat parts count as innovation.

    Notes
    -----
    Taken from the pictures alone, over pairs of neighbour rows of patches, as many as have about
    4096 patches and evenly spread. The nearest patch is exact; cost and memory are those of one
    scale of `plausibility`.
    """
    first, second = as_pair(sample, output, PATCH + 1)
    candidates, queries = in_deviations(first, first, second)
    rows, cols = (length - PATCH + 1 for length in queries.shape[:2])
    pairs = min(rows // 2, max(1, QUERIES // (2 * cols)))
    upper = np.linspace(0, rows - 2, pairs).astype(np.intp)
    asked = np.stack([upper, upper + 1], axis=1)[..., np.newaxis] * cols + np.arange(cols)
    where = nearest(queries, asked.ravel(), candidates, PATCH).where
    places = np.stack(np.divmod(where, candidates.shape[1] - PATCH + 1), axis=-1).reshape(pairs, 2, cols, 2)
    across = (np.diff(places, axis=2) == (0, 1)).all(axis=-1)
    down = (np.diff(places, axis=1) == (1, 0)).all(axis=-1)
    return float(1.0 - (across.mean() + down.mean()) / 2)
