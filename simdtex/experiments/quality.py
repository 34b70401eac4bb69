# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: how well a synthesised texture stands for its sample.

No figure is enough alone. An output that repeats one patch is plausible and covers nothing; one
that copies the sample whole is perfect in both and says so in the copying. Pictures are arrays
(rows, cols) or (rows, cols, channels) in any one unit; "sample standard deviation" is everywhere
the square root of the sample's variance averaged over its channels, at full resolution (1 where
the sample is constant).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample

__all__ = [
    "Quality",
    "SourceUse",
    "copying",
    "coverage",
    "histogram_distance",
    "measure",
    "plausibility",
    "seam",
    "source_use",
]

Array = NDArray[Any]
Planes = NDArray[np.float32]
Indices = NDArray[np.intp]

PATCH = 7  # side of the patches of plausibility and coverage, pixels
COPIED_PATCH = 9  # side of the patches of copying, pixels
SCALES = 3  # full size, 1/2 and 1/4
QUERIES = 4096  # patches looked up per scale where no stride is given
BLOCK_ROWS = 4096  # patches looked up at once
BLOCK_BYTES = 48 << 20  # of one block of patches, and of one block of squared distances


class SourceUse(NamedTuple):
    """How much of the sample the output was made from, see `source_use`."""

    share: float
    entropy: float


@dataclass(frozen=True)
class Quality:
    """All figures of one output, see the functions of the same names.

    Attributes
    ----------
    plausibility, coverage, histogram_distance : float
        In sample standard deviations; 0 is best.
    copying : float
        Share of the output's patches, 0 to 1.
    seam : float
        Ratio; 1 is a seam that does not show.
    source_share, source_entropy : float or None
        0 to 1; None where no source map was given.
    """

    plausibility: float
    coverage: float
    copying: float
    histogram_distance: float
    seam: float
    source_share: float | None = None
    source_entropy: float | None = None


def measure(
    sample: ArrayLike,
    output: ArrayLike,
    source: ArrayLike | None = None,
    *,
    stride: int | None = None,
) -> Quality:
    """Compute every figure of merit of one output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.
    source : array_like of int, (rows, cols, 2), optional
        The output's source map.
    stride : int, optional
        As in `plausibility`.

    Returns
    -------
    Quality

    Notes
    -----
    About 1 s on two CPU cores for a 128 x 128 sample and a 256 x 256 output in colour.
    """
    use = None if source is None else source_use(source, np.shape(sample)[:2])
    return Quality(
        plausibility=plausibility(sample, output, stride=stride),
        coverage=coverage(sample, output, stride=stride),
        copying=copying(sample, output),
        histogram_distance=histogram_distance(sample, output),
        seam=seam(output),
        source_share=None if use is None else use.share,
        source_entropy=None if use is None else use.entropy,
    )


# ---------------------------------------------------------------- nearest patches


def plausibility(sample: ArrayLike, output: ArrayLike, *, stride: int | None = None) -> float:
    """Mean distance from a 7 x 7 patch of the output to the nearest patch of the sample.

    The distance is the root of the mean squared difference over the 49 x channels values, in
    sample standard deviations; the mean is over patches, then over three scales (full size, 1/2
    and 1/4 by means of 2 x 2 blocks). A scale at which a picture has no 7 x 7 patch is left out.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 7 x 7 pixels each, with the same number of channels.
    stride : int, optional
        Every `stride`-th patch in raster order is looked up, 1 for all. By default as many as
        leave about 4096 at each scale, spread evenly.

    Returns
    -------
    float
        0 where every patch looked up stands in the sample.

    Notes
    -----
    The nearest patch is exact, by comparing with all. Cost: queries x candidates x 98 x channels
    operations in single precision; memory under 200 MB beside the pictures, for any size.
    """
    return _mean_nearest(sample, output, of_output=True, stride=stride)


def coverage(sample: ArrayLike, output: ArrayLike, *, stride: int | None = None) -> float:
    """Mean distance from a 7 x 7 patch of the sample to the nearest patch of the output.

    `plausibility` the other way round: it grows with every part of the sample that the output
    lacks. Parameters, units and cost are those of `plausibility`.
    """
    return _mean_nearest(sample, output, of_output=False, stride=stride)


def _mean_nearest(sample: ArrayLike, output: ArrayLike, *, of_output: bool, stride: int | None) -> float:
    if stride is not None and stride < 1:
        raise ValueError(f"stride is {stride}: give 1 or more")
    first, second = _pair(sample, output, PATCH)
    centre, scale = first.mean(), _deviation(first)
    # centred, so that the squared norms are small and their rounding with them
    pair = [((planes - centre) / scale).astype(np.float32) for planes in (first, second)]
    means = []
    for _ in range(SCALES):
        if min(side for planes in pair for side in planes.shape[:2]) < PATCH:
            break
        candidates, queries = pair if of_output else pair[::-1]
        means.append(float(_nearest(queries, candidates, stride).mean()))
        pair = [_halved(planes) for planes in pair]
    return float(np.mean(means))


def _nearest(queries: Planes, candidates: Planes, stride: int | None) -> NDArray[np.float64]:
    asked = _every(queries, stride)
    size = PATCH * PATCH * queries.shape[2]
    step = max(1, min(BLOCK_ROWS, BLOCK_BYTES // (4 * size)))
    width = max(1, min(BLOCK_BYTES // (4 * step), BLOCK_BYTES // (4 * size)))
    starts = range(0, len(asked), step)
    return np.concatenate([_nearest_of(asked[i : i + step], queries, candidates, width) for i in starts])


def _nearest_of(asked: Indices, queries: Planes, candidates: Planes, width: int) -> NDArray[np.float64]:
    wanted = _patches(queries, asked)
    least = np.full(len(asked), np.inf, dtype=np.float32)
    where = np.zeros(len(asked), dtype=np.intp)
    rows = np.arange(len(asked))
    for block in _blocks(_count(candidates), width):
        offered = _patches(candidates, block)
        # |a|^2 is the same for all candidates of one query, so |b|^2 - 2ab ranks them
        score = wanted @ offered.T
        score *= -2.0
        score += np.einsum("ij,ij->i", offered, offered)
        best = score.argmin(axis=1)
        found = score[rows, best]
        closer = found < least
        least[closer], where[closer] = found[closer], block[best[closer]]
    # the distance itself without the cancellation of the product form
    difference = wanted - _patches(candidates, where)
    squares = np.einsum("ij,ij->i", difference, difference, dtype=np.float64)
    return np.asarray(np.sqrt(squares / wanted.shape[1]), dtype=np.float64)


def _every(planes: Planes, stride: int | None) -> Indices:
    count = _count(planes)
    if stride is None:
        stride = -(-count // QUERIES)
        # no common divisor with a row of patches, or the queries would stand in columns
        while gcd(stride, planes.shape[1] - PATCH + 1) > 1:
            stride += 1
    return np.arange(0, count, stride)


def _blocks(count: int, width: int) -> Iterator[Indices]:
    for start in range(0, count, width):
        yield np.arange(start, min(start + width, count))


def _count(planes: Planes) -> int:
    rows, cols = planes.shape[:2]
    return int((rows - PATCH + 1) * (cols - PATCH + 1))


def _patches(planes: Planes, indices: Indices) -> Planes:
    row, column = np.divmod(indices, planes.shape[1] - PATCH + 1)
    windows = sliding_window_view(planes, (PATCH, PATCH), axis=(0, 1))
    return windows[row, column].reshape(len(indices), -1)


def _halved(planes: Planes) -> Planes:
    even = planes[: planes.shape[0] // 2 * 2, : planes.shape[1] // 2 * 2]
    quarters = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return np.asarray(quarters / np.float32(4), dtype=np.float32)


# ---------------------------------------------------------------- copying


def copying(sample: ArrayLike, output: ArrayLike) -> float:
    """Share of the 9 x 9 patches of the output that stand verbatim in the sample.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1. Flat parts count as copied: the same flat patch does stand in the sample.

    Notes
    -----
    Exact: patches are found by a 64-bit hash and then compared value by value.
    """
    first, second = _pair(sample, output, COPIED_PATCH, keep_type=True)
    together = np.concatenate([first.ravel(), second.ravel()])
    values, numbers = np.unique(together, return_inverse=True)
    numbers = numbers.astype(np.min_scalar_type(len(values)))
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(_verbatim(made, known).mean())


def _verbatim(made: Array, known: Array) -> NDArray[np.bool_]:
    known_hash, made_hash = _hashes(known), _hashes(made)
    order = np.argsort(known_hash, kind="stable")
    known_hash = known_hash[order]
    place = np.searchsorted(known_hash, made_hash)
    answer = np.zeros(len(made_hash), dtype=np.bool_)
    # equal hashes are almost always equal patches; the loop goes on only where they are not
    left = np.arange(len(made_hash))
    while len(left):
        inside = place[left] < len(known_hash)
        left = left[inside]
        left = left[known_hash[place[left]] == made_hash[left]]
        same = _equal_patches(made, left, known, order[place[left]])
        answer[left[same]] = True
        left = left[~same]
        place[left] += 1
    return answer


def _hashes(numbers: Array) -> NDArray[np.uint64]:
    rows, cols, channels = numbers.shape
    side = COPIED_PATCH
    weights = np.random.default_rng(0).integers(1, 2**64, (side, side, channels), dtype=np.uint64)
    total = np.zeros((rows - side + 1, cols - side + 1), dtype=np.uint64)
    wide = numbers.astype(np.uint64)
    for i, j, k in np.ndindex(side, side, channels):
        total += wide[i : i + total.shape[0], j : j + total.shape[1], k] * (weights[i, j, k] | 1)
    return total.ravel()


def _equal_patches(a: Array, at_a: Indices, b: Array, at_b: Indices) -> NDArray[np.bool_]:
    row_a, column_a = np.divmod(at_a, a.shape[1] - COPIED_PATCH + 1)
    row_b, column_b = np.divmod(at_b, b.shape[1] - COPIED_PATCH + 1)
    same = np.ones(len(at_a), dtype=np.bool_)
    for i, j in np.ndindex(COPIED_PATCH, COPIED_PATCH):
        same &= (a[row_a + i, column_a + j] == b[row_b + i, column_b + j]).all(axis=-1)
    return same


# ---------------------------------------------------------------- the others


def histogram_distance(sample: ArrayLike, output: ArrayLike) -> float:
    """Earth mover's distance between the marginal histograms, mean over channels.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        Any sizes, the same number of channels.

    Returns
    -------
    float
        In sample standard deviations; 0 where the histograms agree.
    """
    first, second = _pair(sample, output, 1)
    channels = range(first.shape[2])
    moved = [_earth_moved(first[..., k].ravel(), second[..., k].ravel()) for k in channels]
    return float(np.mean(moved) / _deviation(first))


def _earth_moved(a: Array, b: Array) -> float:
    # the area between the two cumulative distributions
    a, b = np.sort(a), np.sort(b)
    values = np.unique(np.concatenate([a, b]))
    below_a = np.searchsorted(a, values[:-1], side="right") / len(a)
    below_b = np.searchsorted(b, values[:-1], side="right") / len(b)
    return float(np.sum(np.abs(below_a - below_b) * np.diff(values)))


def seam(output: ArrayLike) -> float:
    """How much the seam shows when the output is laid side by side with itself.

    The mean absolute difference between the last and the first row over that between neighbour
    rows inside, the same for columns, and the mean of the two.

    Parameters
    ----------
    output : array_like, (rows, cols) or (rows, cols, channels)
        At least 2 x 2 pixels.

    Returns
    -------
    float
        About 1 for a picture that tiles (and for a constant one), larger where the seam is an
        edge; infinite where it is the only edge.
    """
    planes = _planes(output).astype(np.float64)
    if min(planes.shape[:2]) < 2:
        raise ValueError("the output is less than 2 pixels wide or high: give at least 2 x 2")
    return float(np.mean([_seam_along(planes, axis) for axis in (0, 1)]))


def _seam_along(planes: Array, axis: int) -> float:
    inside = float(np.abs(np.diff(planes, axis=axis)).mean())
    across = float(np.abs(planes.take(0, axis) - planes.take(-1, axis)).mean())
    if inside == 0.0:
        return 1.0 if across == 0.0 else float("inf")
    return across / inside


def source_use(source: ArrayLike, sample_shape: tuple[int, ...]) -> SourceUse:
    """How much of the sample the output was made from.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2)
        For every output pixel, the (row, column) of the sample that it was taken from.
    sample_shape : (rows, cols)
        The size of the sample, pixels.

    Returns
    -------
    share : float
        Of the sample's pixels, those used at least once; at most output pixels / sample pixels.
    entropy : float
        Of the distribution of use over the sample's pixels, over its largest value, the logarithm
        of their number: 1 where all are used alike, 0 where one is used alone.
    """
    rows, cols = sample_shape[:2]
    positions = np.asarray(source)
    if positions.ndim != 3 or positions.shape[2] != 2 or positions.dtype.kind not in "iu":
        raise ValueError("the source map is not (rows, cols, 2) integers: pass the one of the run")
    if positions.size == 0 or (positions < 0).any() or (positions >= (rows, cols)).any():
        raise ValueError(
            f"the source map points outside a sample of {rows} x {cols} pixels: pass the sample that it was made from"
        )
    flat = positions[..., 0].astype(np.intp) * cols + positions[..., 1].astype(np.intp)
    uses = np.bincount(flat.ravel(), minlength=rows * cols)
    used = uses[uses > 0] / flat.size
    entropy = float(-(used * np.log(used)).sum() / np.log(rows * cols)) if len(uses) > 1 else 1.0
    return SourceUse(share=len(used) / (rows * cols), entropy=max(0.0, min(1.0, entropy)))


def _planes(array: ArrayLike) -> Array:
    return check_sample(array, None if np.ndim(array) == 2 else -1)


def _pair(sample: ArrayLike, output: ArrayLike, side: int, *, keep_type: bool = False) -> tuple[Array, Array]:
    first, second = _planes(sample), _planes(output)
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
    if keep_type:
        return first, second
    return first.astype(np.float64), second.astype(np.float64)


def _deviation(planes: Array) -> float:
    return float(np.sqrt(planes.var(axis=(0, 1)).mean())) or 1.0
