# SPDX-License-Identifier: BSD-3-Clause
"""The compared pictures, the unit of their differences, and the nearest of all patches of a picture."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample
from simdtex.options import moderate

Array = NDArray[Any]
Planes = NDArray[np.float32]
Indices = NDArray[np.intp]

BLOCK_ROWS = 4096  # patches looked up at once
BLOCK_BYTES = 48 << 20  # of one block of patches, and of one block of squared distances


def as_planes(array: ArrayLike) -> Array:
    """Return a picture as (rows, cols, channels), checked."""
    planes = check_sample(array, None if np.ndim(array) == 2 else -1)
    moderate("a picture", planes)
    return planes


def as_pair(sample: ArrayLike, output: ArrayLike, side: int) -> tuple[Array, Array]:
    """Return both pictures as (rows, cols, channels); raise unless their channels agree and each side is long enough.

    Values keep their type.
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
    return first, second


def spread(planes: Array) -> float:
    """Return the square root of the variance averaged over the channels; 0 if the picture is constant."""
    return float(np.sqrt(planes.var(axis=(0, 1), dtype=np.float64).mean()))


def deviation(planes: Array) -> float:
    """Return the sample standard deviation: `spread`, or 1 if the sample is constant."""
    return spread(planes) or 1.0


def in_deviations(sample: Array, *pictures: Array) -> list[Planes]:
    """Return pictures less the sample's mean, in sample standard deviations, in single precision."""
    centre, scale = sample.mean(dtype=np.float64), deviation(sample)
    # centred, so that the squared norms are small and their rounding with them
    return [((planes.astype(np.float64) - centre) / scale).astype(np.float32) for planes in pictures]


def halved(planes: Planes) -> Planes:
    """Return the means of 2 x 2 blocks; an odd last row or column is left out."""
    even = planes[: planes.shape[0] // 2 * 2, : planes.shape[1] // 2 * 2]
    quarters = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return np.asarray(quarters / np.float32(4), dtype=np.float32)


class Found(NamedTuple):
    """The nearest candidates: ``distance`` (n,) float64, infinite without a candidate, and ``where`` (n,) indices."""

    distance: NDArray[np.float64]
    where: Indices


def nearest(queries: Planes, asked: Indices, candidates: Planes, side: int, apart: int = 0) -> Found:
    """Return, for the patches ``asked`` of a picture, the nearest of all patches of another.

    Parameters
    ----------
    queries, candidates : float32 array, (rows, cols, channels)
    asked : (n,) int array
        The patches of `queries` to look up, by the number of their first pixel in raster order.
    side : int
        Side of a patch, pixels.
    apart : int
        A candidate counts only if its row or its column differs from the query's by at least ``apart`` pixels.

    Returns
    -------
    Found
        Distances are the root of the mean squared difference over the side^2 x channels values; of equally near
        candidates, the first.

    Notes
    -----
    Cost: queries x candidates x 2 side^2 channels operations in single precision; memory under 200 MB beyond the
    pictures, for any size.
    """
    size = side * side * queries.shape[2]
    step = max(1, min(BLOCK_ROWS, BLOCK_BYTES // (4 * size)))
    width = max(1, BLOCK_BYTES // (4 * max(step, size)))
    distance, places = np.empty(len(asked)), np.empty(len(asked), np.intp)
    for start in range(0, len(asked), step):
        part = asked[start : start + step]
        wanted = _patches(queries, part, side)
        least = np.full(len(part), np.inf, dtype=np.float32)
        where = np.zeros(len(part), dtype=np.intp)
        for first in range(0, count(candidates, side), width):
            block = np.arange(first, min(first + width, count(candidates, side)))
            offered = _patches(candidates, block, side)
            # |a|^2 is the same for all candidates of one query, so |b|^2 - 2ab ranks them
            score = wanted @ offered.T
            score *= -2.0
            score += np.einsum("ij,ij->i", offered, offered)
            if apart:
                away = [
                    np.abs(here[:, np.newaxis] - there)
                    for here, there in zip(_places(queries, part, side), _places(candidates, block, side), strict=True)
                ]
                score[(away[0] < apart) & (away[1] < apart)] = np.inf
            best = score.argmin(axis=1)
            found = score[np.arange(len(part)), best]
            closer = found < least
            least[closer], where[closer] = found[closer], block[best[closer]]
        # the distance itself without the cancellation of the product form
        difference = wanted - _patches(candidates, where, side)
        squares = np.einsum("ij,ij->i", difference, difference, dtype=np.float64)
        distance[start : start + step] = np.where(np.isinf(least), np.inf, np.sqrt(squares / size))
        places[start : start + step] = where
    return Found(distance, places)


def count(planes: Planes, side: int) -> int:
    """Return the number of patches of a picture."""
    rows, cols = planes.shape[:2]
    return int((rows - side + 1) * (cols - side + 1))


def hashes(numbers: NDArray[np.integer], side: int) -> NDArray[np.uint64]:
    """Return a hash of each patch of integers (rows, cols, channels), (rows - side + 1, cols - side + 1).

    It is the sum of its numbers modulo 2**64, each times an odd random weight of its row, one of its column and one of
    its channel. Of n different patches and m others, about n m / 2**64 have the same hash by chance.
    """
    weights = np.random.default_rng(0).integers(1, 2**64, (3, max(side, numbers.shape[2])), np.uint64) | 1
    found: NDArray[np.uint64] = numbers.astype(np.uint64) @ weights[2, : numbers.shape[2]]
    for axis in (0, 1):
        found = sliding_window_view(found, side, axis) @ weights[axis, :side]
    return found


def _places(planes: Planes, indices: Indices, side: int) -> tuple[Indices, Indices]:
    """Return rows and columns of the first pixels of patches."""
    return np.divmod(indices, planes.shape[1] - side + 1)


def _patches(planes: Planes, indices: Indices, side: int) -> Planes:
    windows = sliding_window_view(planes, (side, side), axis=(0, 1))
    return windows[_places(planes, indices, side)].reshape(len(indices), -1)
