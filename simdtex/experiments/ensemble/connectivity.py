# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity of the pixels of a category: the connectivity function, components and dead ends."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from skimage.morphology import skeletonize

from simdtex.experiments.ensemble.arrays import as_image, as_map

Mask = NDArray[np.bool_]

MARGIN = 8  # pixels along the border where an end does not count
HOLE = 16  # the most pixels of holes that are filled
AROUND = (0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)  # the neighbours of (1, 1), once around


class Connectivity(NamedTuple):
    """The connectivity of a category.

    Attributes
    ----------
    function : ndarray of float64, (axes, max_lag + 1)
        Along each axis of the image, for h = 0, 1, ...: among the pairs of pixels of the category at a distance of h,
        the share in the same component, 0 to 1. NaN if there is no such pair.
    components : float
        Number of connected components in 10,000 pixels of the image.
    largest : float
        Share of the category's pixels in the largest component, 0 to 1; NaN if the category is missing.
    """

    function: NDArray[np.float64]
    components: float
    largest: float


def connectivity(image: ArrayLike, category: int, max_lag: int) -> Connectivity:
    """Return the connectivity functions of a category, its components, and the share of the largest.

    Parameters
    ----------
    image : array_like, (rows, cols) or (layers, rows, cols)
    category : int
        The value of the pixels that are meant.
    max_lag : int
        The largest distance, pixels, less than a side of the image.

    Returns
    -------
    Connectivity

    Raises
    ------
    ValueError
        The image has other axes, or is too small.

    Notes
    -----
    Pixels are connected by their sides, because flow is computed through the common sides of cells; by corners, a
    channel and the ground on both sides of it would each cross the other. Two pieces that meet outside of the image are
    two. Cost: a few passes over the image, and two for each lag.
    """
    pixels = as_map(image)
    if not 1 <= max_lag < min(pixels.shape):
        raise ValueError(f"max_lag is {max_lag}: give 1 to {min(pixels.shape) - 1}, less than a side of the image")
    labels, count = ndimage.label(pixels == category)
    sizes = np.bincount(labels.ravel())[1:]
    function = np.full((pixels.ndim, max_lag + 1), np.nan)
    for axis in range(pixels.ndim):
        along = np.moveaxis(labels, axis, 0)
        for lag in range(max_lag + 1):
            first, second = along[: len(along) - lag], along[lag:]
            pairs = np.count_nonzero((first > 0) & (second > 0))
            if pairs:
                function[axis, lag] = np.count_nonzero((first == second) & (first > 0)) / pairs
    largest = float(sizes.max() / sizes.sum()) if count else float("nan")
    return Connectivity(function, 1e4 * count / pixels.size, largest)


def dead_ends(image: ArrayLike, category: int) -> NDArray[np.intp]:
    """Return the positions where channels of a category end inside the picture.

    A dead end is a free end of the category's skeleton, inside the picture, of an arm that is longer than wide:

    1. Holes of at most 16 pixels are filled, and the picture is continued beyond its border by its border pixels, so
       that a channel which leaves it continues.
    2. The skeleton (`skimage.morphology.skeletonize`) is pruned: its free ends are removed, a pixel at a time, 1.5
       times as often as the usual width has pixels, and once more. The usual width is twice the median distance of the
       skeleton's pixels from the ground. This removes the corners of an end, the bumps of a bank and short pieces.
    3. The remaining free ends count if the arm ended at least 8 pixels inside the border.

    Parameters
    ----------
    image : array_like, (rows, cols)
    category : int
        The value of the pixels that are meant.

    Returns
    -------
    ndarray of int, (n, 2)
        Rows and columns where the skeleton ends, about a half-width before the channel does, in raster order.

    Raises
    ------
    ValueError
        The image is not (rows, cols), or has a side of 16 pixels or less.

    Notes
    -----
    About 20 ms for 250 x 250 pixels of channels. Meant for categories of long, narrow bodies of about the same width;
    lobes of much wider ones count as ends. For the ground between channels, or for noise, the number has no plain
    meaning, but it can be compared.
    """
    pixels = as_image(image)
    if min(pixels.shape) <= 2 * MARGIN:
        raise ValueError(f"the image has a side of {min(pixels.shape)} pixels: give more than {2 * MARGIN}")
    beyond = 2 * MARGIN
    inside = np.pad(np.ones(pixels.shape, bool), beyond)
    figure = np.pad(_filled(pixels == category), beyond, mode="edge")
    distance = ndimage.distance_transform_edt(np.pad(figure, 1, mode="edge"))[1:-1, 1:-1]
    draw_lines: Any = skeletonize  # skimage is not typed
    lines = draw_lines(figure)
    width = 2.0 * float(np.median(distance[lines])) if lines.any() else 0.0
    pruned = lines
    for _ in range(int(np.ceil(1.5 * width)) + 1):
        pruned = pruned & ~(_free_ends(pruned) & inside)
    stumps = _free_ends(pruned) & inside
    pieces, _ = ndimage.label((lines & ~pruned) | stumps, np.ones((3, 3)))
    places = [_tip(np.argwhere(pieces == pieces[tuple(stump)]), stump, width / 2) for stump in np.argwhere(stumps)]
    found = np.array(sorted(places), dtype=np.intp).reshape(-1, 2) - beyond
    counts = (found >= MARGIN) & (found < np.array(pixels.shape) - MARGIN)
    return np.asarray(found[counts.all(axis=1)])


def _filled(figure: Mask) -> Mask:
    """Return the figure without its smallest holes, which would be rings of the skeleton."""
    holes, _ = ndimage.label(~figure)
    small = np.bincount(holes.ravel()) <= HOLE
    small[0] = False
    return np.asarray(figure | small[holes], dtype=np.bool_)


def _free_ends(lines: Mask) -> Mask:
    """Return the pixels of lines whose neighbours on the line, if any, are next to one another."""
    rows, cols = lines.shape
    beyond = np.pad(lines, 1)
    ring = np.stack([beyond[i : i + rows, j : j + cols] for i, j in AROUND])
    return np.asarray(lines & ((ring & ~np.roll(ring, 1, axis=0)).sum(axis=0) <= 1))


def _tip(piece: NDArray[np.intp], stump: NDArray[np.intp], reach: float) -> tuple[int, ...]:
    """Return the far end of a pruned piece: the mean of its pixels that are farthest from the stump."""
    far = np.linalg.norm(piece - stump, axis=1)
    return tuple(np.rint(piece[far >= far.max() - reach].mean(axis=0)).astype(int).tolist())
