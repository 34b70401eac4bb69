# SPDX-License-Identifier: BSD-3-Clause
"""Checks of ensembles and images, and their categories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.options import unmasked

Array = NDArray[Any]

MOST_CATEGORIES = 16  # integers with more values are continuous


def as_image(array: ArrayLike, name: str = "image") -> Array:
    """Return an image (rows, cols), checked."""
    return _checked(array, name, (2,), "(rows, cols)")


def as_map(array: ArrayLike) -> Array:
    """Return an image (rows, cols) or a volume (layers, rows, cols), checked."""
    return _checked(array, "image", (2, 3), "(rows, cols) or (layers, rows, cols)")


def as_ensemble(array: ArrayLike) -> Array:
    """Return an ensemble (realisations, rows, cols), checked."""
    return _checked(array, "ensemble", (3,), "(realisations, rows, cols)")


def _checked(given: ArrayLike, name: str, axes: tuple[int, ...], shape: str) -> Array:
    unmasked(f"the {name}", given)
    array = np.asarray(given)
    if array.ndim not in axes or array.size == 0:
        raise ValueError(f"the {name} has the shape {array.shape}: give {shape}, none of them 0")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"the {name} holds {array.dtype}: give integers or floats")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"the {name} holds values that are not finite: fill or cut out these pixels first")
    return array


def as_index(array: Array, categories: ArrayLike, name: str) -> tuple[NDArray[np.intp], int]:
    """Return the index of every value in a list of categories, checked, and the number of categories."""
    values = np.asarray(categories)
    if values.ndim != 1 or values.size == 0:
        raise ValueError("there are no categories: give a list of the values that stand for them, as [0, 1]")
    if len(np.unique(values)) < len(values):
        raise ValueError("a category is named twice: name each once")
    order = np.argsort(values)
    found = position(array, values[order])
    if (found < 0).any():
        raise ValueError(f"the {name} holds {array[found < 0][0]}, which is no category: name it among the categories")
    return order[found], len(values)


def position(array: Array, values: Array) -> NDArray[np.intp]:
    """Return the index of every element in a sorted list; -1 if it is not in the list."""
    found = np.minimum(np.searchsorted(values, array), len(values) - 1)
    return np.where(values[found] == array, found, -1)


def categories_of(training: ArrayLike, categories: Sequence[int] | None = None) -> Array:
    """Return the categories of a training image.

    Parameters
    ----------
    training : array_like, (rows, cols)
    categories : sequence of int, optional
        The values that are categories; an empty sequence means continuous values. By default the values of the training
        image if they are integers or bools, and at most 16.

    Returns
    -------
    ndarray, (K,)
        The categories, in the given order or in ascending order; empty if the values are continuous.

    Raises
    ------
    ValueError
        The training image is not (rows, cols), or holds a value that is none of the categories.
    """
    image = as_image(training, "training image")
    if categories is not None and len(categories):
        as_index(image, categories, "training image")
        return np.asarray(categories)
    values: Array = np.unique(image)
    if categories is not None or image.dtype.kind == "f" or len(values) > MOST_CATEGORIES:
        return np.empty(0, np.intp)
    return values
