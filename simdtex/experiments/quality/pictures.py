# SPDX-License-Identifier: BSD-3-Clause
"""The pictures that are compared: their axes, their sizes, and the unit of their differences."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample

Array = NDArray[Any]
Planes = NDArray[np.float32]

LARGEST = 1e100
"""Of values that figures are computed of: sums of their squares stay finite."""


def as_planes(array: ArrayLike) -> Array:
    """Return a picture as (rows, cols, channels), checked."""
    planes = check_sample(array, None if np.ndim(array) == 2 else -1)
    if np.abs(planes, dtype=np.float64).max() > LARGEST:
        raise ValueError(f"a picture has values beyond {LARGEST:g}: give them in a larger unit")
    return planes


def as_pair(sample: ArrayLike, output: ArrayLike, side: int, *, keep_type: bool = False) -> tuple[Array, Array]:
    """Both pictures as (rows, cols, channels), of at least `side` pixels each way.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
    side : int
        Pixels.
    keep_type : bool
        Whether the values keep their type; else they are float64.

    Raises
    ------
    ValueError
        The pictures differ in their number of channels, or one is too small.
    """
    first, second = as_planes(sample), as_planes(output)
    if first.shape[2] != second.shape[2]:
        raise ValueError(
            f"the sample has {first.shape[2]} channels and the output {second.shape[2]}: "
            "compare pictures of the same number of channels"
        )
    for name, planes in (("sample", first), ("output", second)):
        if min(planes.shape[:2]) < side:
            raise ValueError(
                f"the {name} is {planes.shape[0]} x {planes.shape[1]} pixels: give at least {side} x {side}"
            )
    return (first, second) if keep_type else (first.astype(np.float64), second.astype(np.float64))


def spread(planes: Array) -> float:
    """The square root of the variance averaged over the channels; 0 where the picture is constant."""
    return float(np.sqrt(planes.var(axis=(0, 1)).mean()))


def deviation(planes: Array) -> float:
    """The sample standard deviation: `spread`, or 1 where the sample is constant."""
    return spread(planes) or 1.0


def in_deviations(sample: Array, *pictures: Array) -> list[Planes]:
    """Pictures less the sample's mean, in sample standard deviations, in single precision."""
    centre, scale = sample.mean(), deviation(sample)
    # centred, so that the squared norms are small and their rounding with them
    return [((planes - centre) / scale).astype(np.float32) for planes in pictures]


def halved(planes: Planes) -> Planes:
    """The means of 2 x 2 blocks; an odd last row or column is left out."""
    even = planes[: planes.shape[0] // 2 * 2, : planes.shape[1] // 2 * 2]
    quarters = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return np.asarray(quarters / np.float32(4), dtype=np.float32)
