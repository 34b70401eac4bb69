# SPDX-License-Identifier: BSD-3-Clause
"""The nearest patch among all of a picture, by comparing with each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from simdtex.experiments.quality.pictures import Planes

Indices = NDArray[np.intp]

BLOCK_ROWS = 4096  # patches looked up at once
BLOCK_BYTES = 48 << 20  # of one block of patches, and of one block of squared distances


class Found(NamedTuple):
    """The nearest candidates: ``distance`` (n,) float64, infinite where there was none, and ``where`` (n,) indices."""

    distance: NDArray[np.float64]
    where: Indices


def nearest(queries: Planes, asked: Indices, candidates: Planes, side: int, apart: int = 0) -> Found:
    """For some patches of a picture, the nearest of all patches of another.

    Parameters
    ----------
    queries, candidates : float32 array, (rows, cols, channels)
    asked : (n,) int array
        Which patches of `queries` to look up, in raster order of their first pixels.
    side : int
        Of a patch, pixels.
    apart : int
        A candidate counts only if its row or its column differs from the query's by at least so many pixels.

    Returns
    -------
    Found
        Distances are the root of the mean squared difference over the side^2 x channels values; among equals the first
        candidate is taken.

    Notes
    -----
    Cost: queries x candidates x 2 side^2 channels operations in single precision; memory under 200 MB beside the
    pictures, for any size.
    """
    size = side * side * queries.shape[2]
    step = max(1, min(BLOCK_ROWS, BLOCK_BYTES // (4 * size)))
    width = max(1, min(BLOCK_BYTES // (4 * step), BLOCK_BYTES // (4 * size)))
    starts = range(0, len(asked), step)
    found = [_nearest_of(asked[i : i + step], queries, candidates, side, apart, width) for i in starts]
    return Found(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _nearest_of(asked: Indices, queries: Planes, candidates: Planes, side: int, apart: int, width: int) -> Found:
    wanted = _patches(queries, asked, side)
    least = np.full(len(asked), np.inf, dtype=np.float32)
    where = np.zeros(len(asked), dtype=np.intp)
    rows = np.arange(len(asked))
    for block in _blocks(count(candidates, side), width):
        offered = _patches(candidates, block, side)
        # |a|^2 is the same for all candidates of one query, so |b|^2 - 2ab ranks them
        score = wanted @ offered.T
        score *= -2.0
        score += np.einsum("ij,ij->i", offered, offered)
        if apart:
            score[_close(asked, queries, block, candidates, side, apart)] = np.inf
        best = score.argmin(axis=1)
        found = score[rows, best]
        closer = found < least
        least[closer], where[closer] = found[closer], block[best[closer]]
    # the distance itself without the cancellation of the product form
    difference = wanted - _patches(candidates, where, side)
    squares = np.einsum("ij,ij->i", difference, difference, dtype=np.float64)
    return Found(np.where(np.isinf(least), np.inf, np.sqrt(squares / wanted.shape[1])), where)


def _close(
    asked: Indices, queries: Planes, block: Indices, candidates: Planes, side: int, apart: int
) -> NDArray[np.bool_]:
    """Which candidates (queries, candidates) stand too near to count."""
    row, column = np.divmod(asked, queries.shape[1] - side + 1)
    other_row, other_column = np.divmod(block, candidates.shape[1] - side + 1)
    same_rows = np.abs(row[:, np.newaxis] - other_row) < apart
    return np.asarray(same_rows & (np.abs(column[:, np.newaxis] - other_column) < apart))


def _blocks(total: int, width: int) -> Iterator[Indices]:
    for start in range(0, total, width):
        yield np.arange(start, min(start + width, total))


def count(planes: Planes, side: int) -> int:
    """The number of patches of a picture."""
    rows, cols = planes.shape[:2]
    return int((rows - side + 1) * (cols - side + 1))


def _patches(planes: Planes, indices: Indices, side: int) -> Planes:
    row, column = np.divmod(indices, planes.shape[1] - side + 1)
    windows = sliding_window_view(planes, (side, side), axis=(0, 1))
    return windows[row, column].reshape(len(indices), -1)
