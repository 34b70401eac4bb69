# SPDX-License-Identifier: BSD-3-Clause
"""Analysis of distance: between realisations, and between them and their training image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import jensenshannon

from simdtex.experiments.ensemble.arrays import Array, as_ensemble, as_image, as_index, categories_of

Floats = NDArray[np.float64]

LEVELS = 3  # at most
CLASSES = 3  # that continuous values are cut into, by quantiles
BLOCK = 1 << 21  # numbers compared at once
MOST_COUNTS = 1 << 26  # different patterns x images, 0.5 GB


class Anodi(NamedTuple):
    """Distances between the patterns of images, all of them 0 to 1.

    Attributes
    ----------
    variety : float
        Mean distance between two realisations: the larger, the greater the uncertainty. NaN for a single
        realisation.
    likeness : float
        Mean distance between a realisation and the training image: the smaller, the better its patterns are kept.
    ratio : float
        Variety over likeness. About 1 if realisations are as far from one another as from the training image, as
        other images of the same kind would be; near 0 if all are the same; NaN if the likeness is 0.
    by_level : ndarray of float64, (levels, 2)
        Variety and likeness at each level, the finest first.
    distances : ndarray of float64, (realisations + 1, realisations + 1)
        Between all pairs; the last row and column is the training image.
    """

    variety: float
    likeness: float
    ratio: float
    by_level: Floats
    distances: Floats


def anodi(ensemble: ArrayLike, training: ArrayLike, *, categories: Sequence[int] | None = None) -> Anodi:
    r"""Return the variety of an ensemble and its likeness to the training image.

    The distance of two images is the mean over three levels :math:`g = 0, 1, 2` with weights :math:`2^{-g}` of the
    Jensen-Shannon distance (to base 2) between their histograms of patterns. A pattern of level g is a square of pixels
    that are :math:`2^g` pixels apart, 4 x 4 of two categories, 3 x 3 of three categories or of continuous values, 2 x 2
    of more categories. All of them in the image are counted: the patterns of the images that keep every
    :math:`2^g`-th pixel, from every first pixel. A level at which an image has no pattern is left out.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    training : array_like, (rows, cols)
    categories : sequence of int, optional
        As in `categories_of`; those of the training image by default. Continuous values are cut into three classes, by
        quantiles of the training image. A value that is frequent enough to be such a quantile is a class of its own.

    Returns
    -------
    Anodi

    Raises
    ------
    ValueError
        The arrays have another number of axes or are too small, a value is no category, or there are too many different
        patterns for their counts to fit 0.5 GB.

    Notes
    -----
    After Tan, Tahmasebi and Caers, "Comparing training-image based algorithms using an analysis of distance",
    Mathematical Geosciences 46, 2014, and simpler: patterns are counted exactly where the paper
    clusters them; coarse levels take every second pixel instead of resampling the image; and the distance is the square
    root of the divergence. The paper compares two algorithms by the quotient of their ratios; the ratio here is that
    of one ensemble, so that two ensembles can be compared if they are of the same size.

    Histograms of finite images differ by chance even where the law is the same, the more so the smaller they are:
    compare ensembles of the same numbers of pixels. About a second for 50 realisations of 250 x 250 pixels of
    channels, and up to half a minute for noise, which has every pattern.
    """
    array, image = as_ensemble(ensemble), as_image(training, "training image")
    values = categories_of(image, categories)
    if len(values):
        index, count = as_index(array, values, "ensemble")
        own, _ = as_index(image, values, "training image")
    else:
        bounds = np.unique(np.quantile(image, np.arange(1, CLASSES) / CLASSES))
        index, own, count = _cut(array, bounds), _cut(image, bounds), 2 * len(bounds) + 1
    side = {1: 4, 2: 4, 3: 3}.get(len(values) or CLASSES, 2)
    least = min(*array.shape[1:], *image.shape)
    if least < side:
        raise ValueError(f"there are no patterns of {side} x {side} pixels: give larger images")
    spreads = [1 << level for level in range(LEVELS) if least > (side - 1) << level]
    tables = [_distances([*index, own], count, side, spread) for spread in spreads]
    distances = np.average(tables, axis=0, weights=1 / np.array(spreads))
    variety, likeness = _means(distances)
    ratio = variety / likeness if likeness > 0 else float("nan")
    return Anodi(variety, likeness, ratio, np.array([_means(table) for table in tables]), distances)


def _cut(values: Array, bounds: Array) -> NDArray[np.intp]:
    """Return the classes of values; a value that equals a bound is a separate class."""
    return np.searchsorted(bounds, values, side="left") + np.searchsorted(bounds, values, side="right")


def _distances(images: list[NDArray[np.intp]], count: int, side: int, spread: int) -> Floats:
    """Return the Jensen-Shannon distances between the histograms of all pairs of images."""
    coded = [_patterns(image, count, side, spread) for image in images]
    present = np.unique(np.concatenate([np.unique(codes) for codes in coded]))
    if len(present) * len(coded) > MOST_COUNTS:
        raise ValueError(f"there are {len(present)} different patterns: give smaller or fewer images")
    rows = [np.bincount(np.searchsorted(present, codes), minlength=len(present)) / len(codes) for codes in coded]
    histograms = np.stack(rows)
    found = np.zeros((len(rows), len(rows)))
    step = max(1, BLOCK // len(present))
    for one in range(len(rows)):
        for start in range(one + 1, len(rows), step):
            block = histograms[start : start + step]
            found[one, start : start + step] = jensenshannon(histograms[one][np.newaxis], block, base=2, axis=1)
    found = np.nan_to_num(found)  # rounding may leave the root of a negative number between equal ones
    return found + found.T


def _patterns(image: NDArray[np.intp], count: int, side: int, spread: int) -> NDArray[np.int64]:
    """Return every pattern of an image as one number."""
    rows, cols = (length - (side - 1) * spread for length in image.shape)
    codes = np.zeros((rows, cols), np.int64)
    for down in range(0, side * spread, spread):
        for right in range(0, side * spread, spread):
            codes = codes * count + image[down : down + rows, right : right + cols]
    return codes.ravel()


def _means(distances: Floats) -> tuple[float, float]:
    """Return the mean distance between realisations, and of them from the training image."""
    number = len(distances) - 1
    pairs = distances[np.triu_indices(number, 1)] if number > 1 else np.array([np.nan])
    return float(pairs.mean()), float(distances[-1, :-1].mean())
