# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a realisation that occur unchanged in the training image."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from simdtex.experiments.ensemble.arrays import Array, as_ensemble, as_image, position
from simdtex.experiments.quality.patches import hashes

WINDOW = 16
"""Side of the windows to find, pixels."""

ABSENT, PLAIN = -1, -2
"""Marks of a window that is not in the training image, and of a window with a single value."""


def copies(ensemble: ArrayLike, training: ArrayLike, *, side: int = WINDOW) -> NDArray[np.int32]:
    """Return the position in the training image of each window of realisations that occurs there unchanged.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    training : array_like, (rows, cols)
    side : int
        Side of the square windows, pixels.

    Returns
    -------
    ndarray of int32, (realisations, rows - side + 1, cols - side + 1)
        For the window at each upper left pixel, the pixel index (row x columns + column) of the upper left pixel of the
        first equal window of the training image; -1 if there is none, and -2 for windows with a single value, which do
        not count as copies.

    Raises
    ------
    ValueError
        The arrays have another number of axes, or a side of fewer pixels than a window.

    Notes
    -----
    Windows are compared by their `simdtex.experiments.quality.patches.hashes`. Cost: 2 x side operations for every
    pixel, and a look-up, about 20 ms for 250 x 250 pixels; memory: 50 bytes for every pixel of the training image and
    of one realisation, beside the result.
    """
    array, image = as_ensemble(ensemble), as_image(training, "training image")
    if not 1 <= side <= min(*array.shape[1:], *image.shape):
        raise ValueError(f"side is {side}: give 1 to {min(*array.shape[1:], *image.shape)}, a side of the images")
    values = np.unique(image)

    def hashed(one: Array) -> NDArray[np.uint64]:
        return hashes(position(one, values)[..., np.newaxis], side)

    known, first = np.unique(hashed(image), return_index=True)
    row, col = np.divmod(first, image.shape[1] - side + 1)
    pixel = np.append(row * image.shape[1] + col, ABSENT).astype(np.int32)  # the last for -1
    middle = tuple(slice(side // 2, n - (side - 1) // 2) for n in array.shape[1:])

    def placed(one: Array) -> NDArray[np.int32]:
        plain = (minimum_filter(one, side) == maximum_filter(one, side))[middle]
        return np.where(plain, np.int32(PLAIN), pixel[position(hashed(one), known)])

    return np.stack([placed(one) for one in array])


def copied(places: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the share of windows that occur in the training image, among those with more than one value.

    Parameters
    ----------
    places : ndarray of int32, (realisations, rows, cols)
        The result of `copies`.

    Returns
    -------
    ndarray of float64, (realisations,)
        NaN where all windows have a single value.
    """
    counted = (places != PLAIN).sum(axis=(1, 2))
    found = (places >= 0).sum(axis=(1, 2))
    return np.where(counted > 0, found / np.maximum(counted, 1), np.nan)
