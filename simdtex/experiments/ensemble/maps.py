# SPDX-License-Identifier: BSD-3-Clause
"""What an ensemble says of each pixel, and how much of each category it holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import entr

from simdtex.experiments.ensemble.arrays import as_categories, as_ensemble, as_index

Floats = NDArray[np.float64]


def shares(ensemble: ArrayLike, categories: ArrayLike) -> Floats:
    """Share of each category in each realisation.

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
    array, values = as_ensemble(ensemble), as_categories(categories)
    index = as_index(array, values, "ensemble").reshape(len(array), -1)
    counts = np.stack([np.bincount(one, minlength=len(values)) for one in index])
    return np.asarray(counts / index.shape[1], dtype=np.float64)


def share_maps(ensemble: ArrayLike, categories: ArrayLike) -> Floats:
    """Share of the realisations in which a pixel has each category: the ensemble's probability maps.

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
    array, values = as_ensemble(ensemble), as_categories(categories)
    index = as_index(array, values, "ensemble")
    return np.stack([(index == k).mean(axis=0) for k in range(len(values))])


def mean(ensemble: ArrayLike) -> Floats:
    """Mean over the realisations (rows, cols), in the unit of the values."""
    return np.asarray(as_ensemble(ensemble).mean(axis=0, dtype=np.float64))


def deviation(ensemble: ArrayLike) -> Floats:
    """Standard deviation over the realisations (rows, cols), in the unit of the values; 0 where all of them agree.

    The divisor is the number of realisations less one; a single realisation deviates by 0.
    """
    array = as_ensemble(ensemble).astype(np.float64)
    return np.asarray(array.std(axis=0, ddof=1)) if len(array) > 1 else np.zeros(array.shape[1:])


def entropy(maps: ArrayLike) -> Floats:
    """Entropy of each pixel's distribution over the categories: how much the ensemble leaves open there.

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
