# SPDX-License-Identifier: BSD-3-Clause
"""What is measured: ensembles, single images, and the categories that they hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.options import unmasked

Array = NDArray[Any]

MOST_CATEGORIES = 16  # integers of more values are taken for continuous ones


def as_image(array: ArrayLike, name: str = "image") -> Array:
    """An image (rows, cols), checked."""
    unmasked(f"the {name}", array)
    return _checked(np.asarray(array), name, 2, "(rows, cols)")


def as_ensemble(array: ArrayLike) -> Array:
    """An ensemble (realisations, rows, cols), checked."""
    unmasked("the ensemble", array)
    return _checked(np.asarray(array), "ensemble", 3, "(realisations, rows, cols)")


def _checked(array: Array, name: str, axes: int, shape: str) -> Array:
    if array.ndim != axes or array.size == 0:
        raise ValueError(f"the {name} has the shape {array.shape}: give {shape}, none of them 0")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"the {name} holds {array.dtype}: give integers or floats")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"the {name} holds values that are not finite: fill or cut out these pixels first")
    return array


def as_categories(categories: ArrayLike) -> Array:
    """Categories (K,), checked, in the order in which they are given."""
    values = np.asarray(categories)
    if values.ndim != 1 or values.size == 0:
        raise ValueError("there are no categories: give a list of the values that stand for them, as [0, 1]")
    if len(np.unique(values)) < len(values):
        raise ValueError("a category is named twice: name each once")
    return values


def as_index(array: Array, categories: Array, name: str) -> NDArray[np.intp]:
    """Every value's place in the list of categories; raises where a value is none of them."""
    order = np.argsort(categories)
    place = np.minimum(np.searchsorted(categories, array, sorter=order), len(categories) - 1)
    found: NDArray[np.intp] = order[place]
    other = categories[found] != array
    if other.any():
        raise ValueError(f"the {name} holds {array[other][0]}, which is no category: name it among the categories")
    return found


def categories_of(training: ArrayLike, categories: Sequence[int] | None = None) -> Array:
    """Find out which categories a training image has.

    Parameters
    ----------
    training : array_like, (rows, cols)
    categories : sequence of int, optional
        The values that stand for categories; an empty one says that the values are continuous. By default the values
        of the training image where they are integers, or true and false, and at most 16.

    Returns
    -------
    ndarray, (K,)
        The categories, in the given order or in ascending order; empty where the values are continuous.

    Raises
    ------
    ValueError
        The training image is not (rows, cols), or holds a value that is none of the categories.
    """
    image = as_image(training, "training image")
    if categories is not None:
        if len(categories) == 0:
            return np.empty(0, np.intp)
        named = as_categories(categories)
        as_index(image, named, "training image")
        return named
    if image.dtype.kind == "f":
        return np.empty(0, np.intp)
    values: Array = np.unique(image)
    return values if len(values) <= MOST_CATEGORIES else np.empty(0, np.intp)
