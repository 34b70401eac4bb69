# SPDX-License-Identifier: BSD-3-Clause
"""Figures of the studies beside `simdtex.quality`: what comes back, odd pixels, and contrast."""

import numpy as np
from scipy.ndimage import median_filter

from simdtex.experiments.quality import as_pair, halved, in_deviations, nearest, spread

SIDE, APART = 32, 16
"""The side of a patch, and how far from it at least it may come back, pixels."""

ALIKE = 0.35
"""Standard deviations of the sample at half its size below which two patches are alike."""

MOST = 1024
"""Patches looked up, of a grid of 8 pixels or wider."""

ODD = 0.005
"""Share of the sample's pixels that count as odd."""


def repeats(sample, output):
    """Return the shares of the 32 x 32 patches of output and sample that occur elsewhere in the same picture, 0 to 1.

    Both are reduced to half their size, so that fine grain makes nothing alike. Two patches are alike if the root of
    their mean squared difference is below `ALIKE`. Pictures have 48 x 48 pixels or more.
    """
    first, second = as_pair(sample, output, SIDE + APART)
    small, large = (halved(planes) for planes in in_deviations(first, first, second))
    own, made = (_share(planes) for planes in in_deviations(small, small, large))
    return made, own


def _share(planes):
    side, spacing = SIDE // 2, 4
    rows, cols = (length - side + 1 for length in planes.shape[:2])
    while -(-rows // spacing) * -(-cols // spacing) > MOST:
        spacing += 1
    asked = np.add.outer(np.arange(0, rows, spacing) * cols, np.arange(0, cols, spacing)).ravel()
    return float((nearest(planes, asked, planes, side, apart=APART // 2).distance < ALIKE).mean())


def salt(sample, output):
    """Return how many odd pixels the output has, as a multiple of the sample's.

    A pixel's deviation is its distance from the median of the 3 x 3 pixels around it, the largest over the channels; it
    is odd if that exceeds the 99.5 % point of the sample's deviations. Ties count so that the sample itself has 1.
    """
    had, has = (_off_median(planes) for planes in as_pair(sample, output, 3))
    threshold = np.quantile(had, 1 - ODD, method="inverted_cdf")
    weight = (ODD - (had > threshold).mean()) / (had == threshold).mean()
    return float(((has > threshold).mean() + weight * (has == threshold).mean()) / ODD)


def _off_median(planes):
    return np.abs(planes.astype(np.float64) - median_filter(planes, size=(3, 3, 1), mode="nearest")).max(axis=2)


def contrast(sample, output):
    """Return the standard deviation of the output over that of the sample; both over all channels."""
    first, second = as_pair(sample, output, 1)
    return spread(second) / spread(first) if spread(first) else 1.0


def further(sample, output):
    """Return all figures of this module by name; repeats only of pictures that are large enough."""
    found = {"salt": salt(sample, output), "contrast": contrast(sample, output)}
    if min(*sample.shape[:2], *output.shape[:2]) >= SIDE + APART:
        found["repeats"], found["own_repeats"] = repeats(sample, output)
    return found
