# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit that compare patches: plausibility, coverage, copying, innovation and repeats."""

from __future__ import annotations

from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from simdtex.experiments.quality.patches import Array, Indices, Planes, as_pair, count, halved, in_deviations, nearest

PATCH = 7  # side of the patches, pixels
SCALES = 3  # full size, 1/2 and 1/4
QUERIES = 4096  # patches looked up per scale, at most
COPIED_PATCH = 9  # side of the patches, pixels
REPEATED_PATCH = 32  # side of the patches, pixels of the full size
APART = 16  # least displacement of a repeat in one direction, pixels of the full size
ALIKE = 0.35  # standard deviations of the sample at half its size
GRID = 8  # from patch to patch, pixels of the full size
PATCHES = 1024  # of that grid looked up, at most


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
    About 4096 patches are looked up at each scale, spread evenly. The nearest one is exact, by comparing with all.
    Cost: queries x candidates x 98 x channels operations in single precision; memory under 200 MB beyond the pictures,
    for any size.
    """
    return _mean_nearest(sample, output, of_output=True)


def coverage(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the mean distance from a 7 x 7 patch of the sample to the nearest patch of the output.

    `plausibility` with the pictures exchanged: it grows with every part of the sample that the output lacks.
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
    """Return the patches of a picture that are looked up."""
    total = count(planes, PATCH)
    stride = -(-total // QUERIES)
    # no common divisor with a row of patches, or the queries would line up in columns
    while gcd(stride, planes.shape[1] - PATCH + 1) > 1:
        stride += 1
    return np.arange(0, total, stride)


def innovation(sample: ArrayLike, output: ArrayLike) -> float:
    r"""Return the share of neighbour pixels of the output that do not continue one another in the sample.

    With :math:`s(x)` the position of the sample's patch that is nearest to the 7 x 7 patch at :math:`x` of the output,
    and :math:`e` one pixel down or to the right, this is

    .. math::

       1 - \operatorname{mean}_{x, e} [ s(x + e) = s(x) + e ] ,

    the mean over both directions. It is the innovation capacity of R. Webster, "Innovative non-parametric texture
    synthesis via patch permutations", 2018.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 8 x 8 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1: 0 if the output is one piece of the sample, 1 if it continues nothing of it. Patches across the
        joints of pieces have sources of their own. Of identical patches of the sample the first
        is taken, so flat parts count as innovation.

    Notes
    -----
    Taken from the pictures alone, over pairs of neighbour rows of patches, as many as have about 4096 patches and
    evenly spread. The nearest patch is exact; cost and memory are those of one scale of `plausibility`.
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
    Patches are compared by hashes of 64 bits: of n different patches of the output and m of the sample, n m / 2**64 on
    average are wrongly taken as equal.
    """
    first, second = as_pair(sample, output, COPIED_PATCH)
    numbers = np.unique(np.concatenate([first.ravel(), second.ravel()]), return_inverse=True)[1]
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(np.isin(_hashes(made), _hashes(known)).mean())


def _hashes(numbers: Array) -> NDArray[np.uint64]:
    """Return a hash of each patch: the sum of its numbers, each times an odd random weight, modulo 2**64."""
    weights = np.random.default_rng(0).integers(1, 2**64, (COPIED_PATCH, COPIED_PATCH, numbers.shape[2]), np.uint64) | 1
    patches = sliding_window_view(numbers.astype(np.uint64), (COPIED_PATCH, COPIED_PATCH), (0, 1))
    found: NDArray[np.uint64] = np.einsum("rckij,ijk->rc", patches, weights)
    return found


class Repeats(NamedTuple):
    """Shares of the patches of the output and of the sample that recur, see `repeats`."""

    share: float
    own: float


def repeats(sample: ArrayLike, output: ArrayLike) -> Repeats:
    r"""Return the share of the 32 x 32 patches of the output that occur elsewhere in the output.

    The output is reduced to half its size by means of 2 x 2 blocks, where patches :math:`a_x` have 16 x 16 pixels. A
    patch is repeated if

    .. math::

       \min_y \frac{1}{\sigma} \sqrt{\frac{1}{256 c} \sum_i (a_{x,i} - a_{y,i})^2} < 0.35

    over all places :math:`y` of the half size that are at least half a patch from :math:`x` in rows or in columns. Here
    :math:`\sigma` is the standard deviation of the sample at half its size, so fine grain, which is lost there, makes
    nothing alike. The picture is not continued around its border: a repeat across it is not seen.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 48 x 48 pixels each, with the same number of channels.

    Returns
    -------
    share : float
        Of the output's patches, 0 to 1.
    own : float
        The same of the sample's own patches in the sample: about 0 for most materials, and large for a regular one such
        as bricks, where repeats are right. A small sample has fewer places where a patch could recur, so `own` is
        biased towards 0.

    Notes
    -----
    Every 8th patch both ways is looked up, fewer if there are more than 1024, by comparing with all. Cost: about 16 G
    operations in single precision for 256 x 256 pixels in colour, growing as their number squared up to 1024 patches
    and in proportion to it beyond.
    """
    first, second = as_pair(sample, output, REPEATED_PATCH + APART)
    small, large = (halved(planes) for planes in in_deviations(first, first, second))
    own, made = (_share(planes) for planes in in_deviations(small, small, large))
    return Repeats(share=made, own=own)


def _share(planes: Planes) -> float:
    """Return the share of a picture's patches, at half its size, that recur in it."""
    side = REPEATED_PATCH // 2
    rows, cols = (length - side + 1 for length in planes.shape[:2])
    spacing = GRID // 2
    while -(-rows // spacing) * -(-cols // spacing) > PATCHES:
        spacing += 1
    asked = np.add.outer(np.arange(0, rows, spacing) * cols, np.arange(0, cols, spacing)).ravel()
    found = nearest(planes, asked, planes, side, apart=APART // 2)
    return float((found.distance < ALIKE).mean())
