# SPDX-License-Identifier: BSD-3-Clause
"""How much of a realisation stands in the training image as it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from simdtex.experiments.ensemble.arrays import Array, as_ensemble, as_image, as_index

WINDOW = 16
"""Side of the windows that are looked for, pixels."""

ABSENT, PLAIN = -1, -2
"""A window that is not in the training image, and one of a single value."""


def copies(ensemble: ArrayLike, training: ArrayLike, *, side: int = WINDOW) -> NDArray[np.int32]:
    """Return where in the training image the windows of realisations stand, pixel by pixel the same.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    training : array_like, (rows, cols)
    side : int
        Of the square windows, pixels.

    Returns
    -------
    ndarray of int32, (realisations, rows - side + 1, cols - side + 1)
        For the window at each upper left pixel, the pixel index (row x columns + column) of the upper left pixel of the
        first equal window of the training image; -1 where there is none, and -2 for windows of a single value, which
        are no copies of anything.

    Raises
    ------
    ValueError
        The arrays have another number of axes, or a side of fewer pixels than a window.

    Notes
    -----
    Windows are compared exactly: those of the training image are numbered, equal ones alike, side by side of 1, 2, 4
    and more pixels, each from the numbers of the parts, and those of a realisation are looked up (Karp, Miller and
    Rosenberg, "Rapid identification of repeated patterns in strings, trees and arrays", 1972). The cost is 2 log2(side)
    look-ups for every pixel, about 20 ms for 250 x 250 pixels, and the memory 50 bytes for every pixel of the training
    image and of one realisation, beside the result.
    """
    array, image = as_ensemble(ensemble), as_image(training, "training image")
    if not 1 <= side <= min(*array.shape[1:], *image.shape):
        raise ValueError(f"side is {side}: give 1 to {min(*array.shape[1:], *image.shape)}, a side of the images")
    values = np.unique(image)
    tables, first = _numbered(as_index(image, values, "training image")[0], len(values), side)
    cols = image.shape[1] - side + 1
    pixel = (first // cols * image.shape[1] + first % cols).astype(np.int32)
    made = [_places(one, values, tables, pixel, side) for one in array]
    return np.stack(made)


def _numbered(
    numbers: NDArray[np.intp], count: int, side: int
) -> tuple[list[tuple[int, int, int, NDArray[np.int64]]], NDArray[np.intp]]:
    """Number the windows of an image by what is in them.

    Returns what makes the numbers of larger windows, step by step: the axis along which two overlapping or adjacent
    ones go together, how far apart, how many numbers there were, and the pairs in the order of their new numbers; and
    where the first window of each last number is.
    """
    tables, length = [], 1
    _, first = np.unique(numbers, return_index=True)
    while length < side:
        apart = min(length, side - length)
        for axis in (0, 1):
            paired = _pairs(numbers.astype(np.int64), axis, apart, count)
            pairs, first, inverse = np.unique(paired, return_index=True, return_inverse=True)
            tables.append((axis, apart, count, pairs))
            numbers, count = inverse.reshape(paired.shape), len(pairs)
        length += apart
    return tables, first


def _pairs(numbers: NDArray[np.int64], axis: int, apart: int, count: int) -> NDArray[np.int64]:
    """Return a number for each two windows so far apart along an axis; -1 where one of them has none."""
    along = np.moveaxis(numbers, axis, 0)
    left, right = along[:-apart], along[apart:]
    return np.moveaxis(np.where((left < 0) | (right < 0), ABSENT, left * count + right), 0, axis)


def _places(
    image: Array,
    values: Array,
    tables: list[tuple[int, int, int, NDArray[np.int64]]],
    pixel: NDArray[np.int32],
    side: int,
) -> NDArray[np.int32]:
    """Return where each window of an image stands, by the tables of the training image."""
    numbers = _found(image, values)
    for axis, apart, count, pairs in tables:
        numbers = _found(_pairs(numbers, axis, apart, count), pairs)
    whole = tuple(slice(side // 2, n - (side - 1) // 2) for n in image.shape)
    plain = minimum_filter(image, side)[whole] == maximum_filter(image, side)[whole]
    return np.where(plain, PLAIN, np.where(numbers < 0, ABSENT, pixel[numbers])).astype(np.int32)


def _found(array: Array, values: Array) -> NDArray[np.int64]:
    """Return the place of every element in a sorted list; -1 where it is not there."""
    place = np.minimum(np.searchsorted(values, array), len(values) - 1)
    return np.where(values[place] == array, place, ABSENT).astype(np.int64)


def copied(places: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the share of windows that stand in the training image, of those of more values than one.

    Parameters
    ----------
    places : ndarray of int32, (realisations, rows, cols)
        As `copies` returns it.

    Returns
    -------
    ndarray of float64, (realisations,)
        NaN where all windows have a single value.
    """
    counted = (places != PLAIN).sum(axis=(1, 2))
    found = (places >= 0).sum(axis=(1, 2))
    return np.where(counted > 0, found / np.maximum(counted, 1), np.nan)
