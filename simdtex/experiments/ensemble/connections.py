# SPDX-License-Identifier: BSD-3-Clause
"""Connected components: whether pixels of a category hang together, and how far."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from simdtex.experiments.ensemble.arrays import as_image
from simdtex.experiments.ensemble.variograms import check_lags

TOUCHING = {4: ndimage.generate_binary_structure(2, 1), 8: ndimage.generate_binary_structure(2, 2)}


class Connectivity(NamedTuple):
    """How a category hangs together.

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

    function: NDArray[np.float64]
    components: float
    largest: float


def connectivity(image: ArrayLike, category: int, max_lag: int, axis: int, neighbours: int = 4) -> Connectivity:
    """Connectivity function of a category along an axis, its components, and the share of the largest.

    Parameters
    ----------
    image : array_like, (rows, cols)
    category : int
        The value of the pixels that are meant.
    max_lag : int
        The largest distance, pixels, less than the image is long along the axis.
    axis : int
        0 is down the columns of pixels, 1 is along the rows.
    neighbours : 4 or 8
        Whether pixels that share a side hang together, or those that share a corner too.

    Returns
    -------
    Connectivity

    Raises
    ------
    ValueError
        The image is not (rows, cols), there is no such axis or it is too short, or `neighbours` is another number.

    Notes
    -----
    Pixels hang together by their sides, because flow is reckoned through the sides that two cells share; by corners, a
    channel and the ground on both sides of it would each pass through the other. The figures know only of what is
    inside the image: two pieces that meet outside are two. Cost: a few passes over the image, and one for each lag.
    """
    pixels = as_image(image)
    check_lags(pixels.shape, axis, max_lag)
    if neighbours not in TOUCHING:
        raise ValueError(f"neighbours is {neighbours}: give 4 (sides) or 8 (corners too)")
    labels, count = ndimage.label(pixels == category, structure=TOUCHING[neighbours])
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
