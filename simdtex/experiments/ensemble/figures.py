# SPDX-License-Identifier: BSD-3-Clause
"""Figures of categories and of lags: shares, entropy, variograms and connectivity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.special import entr

from simdtex.experiments.ensemble.arrays import as_ensemble, as_image, as_index

Floats = NDArray[np.float64]


def shares(ensemble: ArrayLike, categories: ArrayLike) -> Floats:
    """Return the share of each category in each realisation.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
        For a training image pass ``training[np.newaxis]``.
    categories : array_like, (K,)

    Returns
    -------
    ndarray of float64, (realisations, K)
        Each row adds up to 1.

    Raises
    ------
    ValueError
        The ensemble has another number of axes, or holds a value that is no category.
    """
    index, count = as_index(as_ensemble(ensemble), categories, "ensemble")
    return np.stack([(index == k).mean(axis=(1, 2)) for k in range(count)], axis=1)


def share_maps(ensemble: ArrayLike, categories: ArrayLike) -> Floats:
    """Return the share of the realisations in which a pixel has each category: the ensemble's probability maps.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    categories : array_like, (K,)

    Returns
    -------
    ndarray of float64, (K, rows, cols)
        They add up to 1 at every pixel.

    Raises
    ------
    ValueError
        The ensemble has another number of axes, or holds a value that is no category.
    """
    index, count = as_index(as_ensemble(ensemble), categories, "ensemble")
    return np.stack([(index == k).mean(axis=0) for k in range(count)])


def entropy(maps: ArrayLike) -> Floats:
    """Return the entropy of each pixel's distribution over the categories: how much the ensemble leaves open there.

    Parameters
    ----------
    maps : array_like, (K, rows, cols)
        Of `share_maps`; they must add up to 1 at every pixel.

    Returns
    -------
    ndarray of float64, (rows, cols)
        Bits: 0 where all realisations agree, log2 K where all categories are equally frequent. Of n realisations it is
        at most log2 n.

    Raises
    ------
    ValueError
        The maps do not add up to 1 or are negative.
    """
    array = np.asarray(maps, dtype=np.float64)
    if array.ndim != 3 or (array < 0).any() or not np.allclose(array.sum(axis=0), 1.0):
        raise ValueError("the maps do not add up to 1 at every pixel: give those of share_maps, (K, rows, cols)")
    return np.asarray(entr(array).sum(axis=0) / np.log(2.0))


def variogram(field_or_indicator: ArrayLike, axis: int, max_lag: int) -> Floats:
    r"""Return the experimental variogram along one axis.

    .. math::

       \gamma(h) = \frac{1}{2 N(h)} \sum_{x} (z(x + h) - z(x))^2 ,

    over the :math:`N(h)` pairs of pixels at a distance of h along the axis (Matheron's estimator, by
    `gstools.vario_estimate_axis`).

    Parameters
    ----------
    field_or_indicator : array_like, (rows, cols)
        Continuous values, or a category's indicator, as ``image == 1``.
    axis : int
        0 is down the columns of pixels, 1 is along the rows.
    max_lag : int
        The largest h, pixels, less than the image is long along the axis.

    Returns
    -------
    ndarray of float64, (max_lag + 1,)
        For h = 0, 1, ... in squared units of the values; the first is 0. An indicator's levels off at p (1 - p), where
        p is the share of the category, if pixels far apart are independent.

    Raises
    ------
    ValueError
        The image is not (rows, cols), there is no such axis, or it is too short; or GSTools is not installed.

    Notes
    -----
    About 12 ms for 250 x 250 pixels, whatever `max_lag` is.
    """
    field = as_image(field_or_indicator).astype(np.float64)
    _check_lags(field.shape, axis, max_lag)
    try:
        from gstools import vario_estimate_axis  # late: it takes a second and is an extra
    except ImportError:
        raise ValueError("gstools is not installed; pip install 'simdtex[simulate]'") from None
    return np.asarray(vario_estimate_axis(field, axis)[: max_lag + 1], dtype=np.float64)


class Connectivity(NamedTuple):
    """How a category is connected.

    Attributes
    ----------
    function : ndarray of float64, (max_lag + 1,)
        For h = 0, 1, ...: of the pairs of pixels at a distance of h along the axis that both have the category, the
        share whose pixels lie in the same component, 0 to 1. NaN where there is no such pair.
    components : float
        Connected components in 10,000 pixels of the image.
    largest : float
        Share of the category's pixels that the largest component has, 0 to 1; NaN where the category is missing.
    """

    function: Floats
    components: float
    largest: float


def connectivity(image: ArrayLike, category: int, max_lag: int, axis: int) -> Connectivity:
    """Return the connectivity function of a category along an axis, its components, and the share of the largest.

    Parameters
    ----------
    image : array_like, (rows, cols)
    category : int
        The value of the pixels that are meant.
    max_lag : int
        The largest distance, pixels, less than the image is long along the axis.
    axis : int
        0 is down the columns of pixels, 1 is along the rows.

    Returns
    -------
    Connectivity

    Raises
    ------
    ValueError
        The image is not (rows, cols), there is no such axis, or it is too short.

    Notes
    -----
    Pixels are connected by their sides, because flow is reckoned through the sides that two cells share; by corners, a
    channel and the ground on both sides of it would each pass through the other. Two pieces that meet outside of the
    image are two. Cost: a few passes over the image, and one for each lag.
    """
    pixels = as_image(image)
    _check_lags(pixels.shape, axis, max_lag)
    labels, count = ndimage.label(pixels == category)
    sizes = np.bincount(labels.ravel())[1:]
    along = np.moveaxis(labels, axis, 0)
    function = np.full(max_lag + 1, np.nan)
    for lag in range(max_lag + 1):
        first, second = along[: len(along) - lag], along[lag:]
        pairs = np.count_nonzero((first > 0) & (second > 0))
        if pairs:
            function[lag] = np.count_nonzero((first == second) & (first > 0)) / pairs
    largest = float(sizes.max() / sizes.sum()) if count else float("nan")
    return Connectivity(function, 1e4 * count / pixels.size, largest)


def _check_lags(shape: tuple[int, ...], axis: int, max_lag: int) -> None:
    if axis not in (0, 1):
        raise ValueError(f"axis is {axis}: give 0 (down) or 1 (to the right)")
    if not 1 <= max_lag < shape[axis]:
        raise ValueError(f"max_lag is {max_lag}: give 1 to {shape[axis] - 1}, less than the image is long")
