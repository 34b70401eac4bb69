# SPDX-License-Identifier: BSD-3-Clause
"""Figures of an ensemble of realisations: its uncertainty, and its likeness to the training image.

`probability`, `e_type`, `quantiles`, `connected_volume`, `vertical_proportions` and `standard_error` take and return an
`xarray.DataArray`: see `simdtex.jobs.simulation.uncertainty`. `reliability` compares probabilities with a truth.

For the other figures an ensemble is an array (realisations, rows, cols). Categorical ones hold the values of
categories, continuous ones integers or floats. The training image is (rows, cols), of the same kind and of any size.
Axis 0 is down, axis 1 to the right, lags are pixels. No single figure suffices: see the page on ensembles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.distance import jensenshannon
from scipy.stats import entropy
from skimage.morphology import skeletonize

from simdtex.io.image import read
from simdtex.jobs.simulation.uncertainty import (  # noqa: F401 - in __all__
    connected_volume,
    e_type,
    probability,
    quantiles,
    reliability,
    standard_error,
    vertical_proportions,
)
from simdtex.jobs.studies.quality import hashes
from simdtex.jobs.synthesis.report import WINDOW
from simdtex.options import moderate, unmasked

Array = NDArray[Any]

MOST_CATEGORIES = 16  # integers with more values are continuous
IMAGE, VOLUME, ENSEMBLE = "(rows, cols)", "(layers, rows, cols)", "(realisations, rows, cols)"


def checked(data: ArrayLike, name: str = "image", *shapes: str) -> Array:
    """Return an array of one of some shapes, by default an image, checked."""
    unmasked(f"the {name}", data)
    array, shapes = np.asarray(data), shapes or (IMAGE,)
    if array.size == 0 or array.ndim not in [shape.count(",") + 1 for shape in shapes]:
        raise ValueError(f"the {name} has the shape {array.shape}: give {' or '.join(shapes)}, none of them 0")
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
    index = position(array, values[order])
    if (index < 0).any():
        raise ValueError(f"the {name} holds {array[index < 0][0]}, which is no category: name it among the categories")
    return order[index], len(values)


def position(array: Array, values: Array) -> NDArray[np.intp]:
    """Return the index of every element in a sorted list; -1 if it is not in the list."""
    index = np.minimum(np.searchsorted(values, array), len(values) - 1)
    return np.where(values[index] == array, index, -1)


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
        The categories, in the order of ``categories`` or ascending; empty if the values are continuous.

    Raises
    ------
    ValueError
        The training image is not (rows, cols), or holds a value that is none of the categories.
    """
    image = checked(training, "training image")
    if categories is not None and len(categories):
        as_index(image, categories, "training image")
        return np.asarray(categories)
    values: Array = np.unique(image)
    if categories is not None or image.dtype.kind == "f" or len(values) > MOST_CATEGORIES:
        return np.empty(0, np.intp)
    return values


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
    """Return the `Connectivity` of a category: its functions, components, and the share of the largest.

    Parameters
    ----------
    image : array_like, (rows, cols) or (layers, rows, cols)
    category : int
        The value of the pixels that are meant.
    max_lag : int
        The largest distance, pixels, less than a side of the image.

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
    pixels = checked(image, "image", IMAGE, VOLUME)
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
        More than 16 pixels a side.
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
    Meant for categories of long, narrow bodies of about the same width; lobes of much wider ones count as ends. For the
    ground between channels, or for noise, the number can only be compared. About 20 ms for 250 x 250 pixels.
    """
    pixels = checked(image)
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
    sites = np.array(sorted(places), dtype=np.intp).reshape(-1, 2) - beyond
    counts = (sites >= MARGIN) & (sites < np.array(pixels.shape) - MARGIN)
    return np.asarray(sites[counts.all(axis=1)])


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


ABSENT, PLAIN = -1, -2
"""Marks of a window that is not in the training image, and of a window with a single value."""


def copies(ensemble: ArrayLike, training: ArrayLike, *, side: int = WINDOW) -> NDArray[np.int32]:
    """Return the position in the training image of each window of realisations that occurs there unchanged.

    Parameters
    ----------
    ensemble : array_like, (realisations, [layers,] rows, cols)
    training : array_like, ([layers,] rows, cols)
    side : int
        Side of the square windows, pixels; those of a volume are in its layers.

    Returns
    -------
    ndarray of int32, (realisations, [layers,] rows - side + 1, cols - side + 1)
        For the window at each upper left pixel, the pixel index (in C order) of the upper left pixel of the first equal
        window of the training image; -1 if there is none, and -2 for windows with a single value, which do not count as
        copies.

    Raises
    ------
    ValueError
        The arrays have another number of axes, or a side of fewer pixels than a window.

    Notes
    -----
    Windows are compared by `simdtex.jobs.studies.quality.hashes`. Cost: 2 x side operations for every pixel, and a
    look-up; 50 bytes for every pixel of the training image and of a realisation, beside the result.
    """
    image = checked(training, "training image", IMAGE, VOLUME)
    array = checked(ensemble, "ensemble", ENSEMBLE if image.ndim == 2 else "(realisations, layers, rows, cols)")
    least = min(*array.shape[-2:], *image.shape[-2:])
    if not 1 <= side <= least:
        raise ValueError(f"side is {side}: give 1 to {least}, a side of the images")
    values = np.unique(image)

    def hashed(layer: Array) -> NDArray[np.uint64]:
        return hashes(position(layer, values)[..., np.newaxis], side)

    layers = image.reshape(-1, *image.shape[-2:])
    codes = np.stack([hashed(layer) for layer in layers])
    known, first = np.unique(codes, return_index=True)
    pixel = np.append(np.ravel_multi_index(np.unravel_index(first, codes.shape), layers.shape), ABSENT)  # for -1
    middle = tuple(slice(side // 2, n - (side - 1) // 2) for n in array.shape[-2:])

    def placed(field: Array) -> NDArray[np.int32]:
        plain = (minimum_filter(field, side) == maximum_filter(field, side))[middle]
        return np.where(plain, np.int32(PLAIN), pixel[position(hashed(field), known)].astype(np.int32))

    places = np.stack([placed(field) for field in array.reshape(-1, *array.shape[-2:])])
    return places.reshape(*array.shape[:-2], *places.shape[1:])


def copied(places: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the share of windows, (realisations,), that occur in the training image; NaN if all have a single value.

    Parameters
    ----------
    places : ndarray of int32, (realisations, [layers,] rows, cols)
        The result of `copies`. Windows with a single value are left out.
    """
    places = places.reshape(len(places), -1)
    counted, held = (places != PLAIN).sum(1), (places >= 0).sum(1)
    return np.where(counted > 0, held / np.maximum(counted, 1), np.nan)


Floats = NDArray[np.float64]

LEVELS = 3  # at most
CLASSES = 3  # that continuous values are cut into, by quantiles
BLOCK = 1 << 21  # numbers compared at once
MOST_COUNTS = 1 << 26  # different patterns x images, 0.5 GB


class Anodi(NamedTuple):
    """Distances between the patterns of images, all of them 0 to 1.

    Attributes
    ----------
    variety : float
        Mean distance between two realisations: the larger, the greater the uncertainty. NaN for a single one.
    likeness : float
        Mean distance between a realisation and the training image: the smaller, the better its patterns are kept.
    ratio : float
        Variety over likeness: about 1 if realisations are as far from one another as from the training image, near 0 if
        all are the same; NaN if the likeness is 0.
    by_level : ndarray of float64, (levels, 2)
        Variety and likeness at each level, the finest first.
    distances : ndarray of float64, (realisations + 1, realisations + 1)
        Between all pairs; the last row and column is the training image.
    """

    variety: float
    likeness: float
    ratio: float
    by_level: Floats
    distances: Floats


def anodi(ensemble: ArrayLike, training: ArrayLike, *, categories: Sequence[int] | None = None) -> Anodi:
    """Return the variety of an ensemble and its likeness to the training image, an `Anodi`.

    The distance of two images is the mean over three levels :math:`g = 0, 1, 2` with weights :math:`2^{-g}` of the
    Jensen-Shannon distance (to base 2) between their histograms of patterns. A pattern of level g is a square of pixels
    that are :math:`2^g` pixels apart, 4 x 4 of two categories, 3 x 3 of three categories or of continuous values, 2 x 2
    of more categories. All of them in the image are counted: the patterns of the images that keep every
    :math:`2^g`-th pixel, from every first pixel. A level at which an image has no pattern is left out.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    training : array_like, (rows, cols)
    categories : sequence of int, optional
        As in `categories_of`; those of the training image by default. Continuous values are cut into three classes, by
        quantiles of the training image. A value that is frequent enough to be such a quantile is a class of its own.

    Raises
    ------
    ValueError
        The arrays have another number of axes or are too small, a value is no category, or there are too many different
        patterns for their counts to fit 0.5 GB.

    Notes
    -----
    After Tan, Tahmasebi and Caers, "Comparing training-image based algorithms using an analysis of distance",
    Mathematical Geosciences 46, 2014, and simpler: patterns are counted exactly where the paper
    clusters them; coarse levels take every second pixel instead of resampling the image; and the distance is the square
    root of the divergence. The paper compares two algorithms by the quotient of their ratios; the ratio here is that
    of one ensemble.

    Histograms of finite images differ by chance even where the law is the same, the more so the smaller they are:
    compare ensembles of the same numbers of pixels. About a second for 50 realisations of 250 x 250 pixels of
    channels, and up to half a minute for noise, which has every pattern.
    """
    array, image = checked(ensemble, "ensemble", ENSEMBLE), checked(training, "training image")
    values = categories_of(image, categories)
    if len(values):
        index, count = as_index(array, values, "ensemble")
        own, _ = as_index(image, values, "training image")
    else:
        bounds = np.unique(np.quantile(image, np.arange(1, CLASSES) / CLASSES))
        index, own, count = _cut(array, bounds), _cut(image, bounds), 2 * len(bounds) + 1
    side = {1: 4, 2: 4, 3: 3}.get(len(values) or CLASSES, 2)
    least = min(*array.shape[1:], *image.shape)
    if least < side:
        raise ValueError(f"there are no patterns of {side} x {side} pixels: give larger images")
    spreads = [1 << level for level in range(LEVELS) if least > (side - 1) << level]
    tables = [_distances([*index, own], count, side, spread) for spread in spreads]
    distances = np.average(tables, axis=0, weights=1 / np.array(spreads))
    variety, likeness = _means(distances)
    ratio = variety / likeness if likeness > 0 else float("nan")
    return Anodi(variety, likeness, ratio, np.array([_means(table) for table in tables]), distances)


def _cut(values: Array, bounds: Array) -> NDArray[np.intp]:
    """Return the classes of values; a value that equals a bound is a separate class."""
    return np.searchsorted(bounds, values, side="left") + np.searchsorted(bounds, values, side="right")


def _distances(images: list[NDArray[np.intp]], count: int, side: int, spread: int) -> Floats:
    """Return the Jensen-Shannon distances between the histograms of all pairs of images."""
    coded = [_patterns(image, count, side, spread) for image in images]
    present = np.unique(np.concatenate([np.unique(codes) for codes in coded]))
    if len(present) * len(coded) > MOST_COUNTS:
        raise ValueError(f"there are {len(present)} different patterns: give smaller or fewer images")
    rows = [np.bincount(np.searchsorted(present, codes), minlength=len(present)) / len(codes) for codes in coded]
    histograms = np.stack(rows)
    apart = np.zeros((len(rows), len(rows)))
    step = max(1, BLOCK // len(present))
    for row in range(len(rows)):
        for start in range(row + 1, len(rows), step):
            block = histograms[start : start + step]
            apart[row, start : start + step] = jensenshannon(histograms[row][np.newaxis], block, base=2, axis=1)
    apart = np.nan_to_num(apart)  # rounding may leave the root of a negative number between equal ones
    return apart + apart.T


def _patterns(image: NDArray[np.intp], count: int, side: int, spread: int) -> NDArray[np.int64]:
    """Return every pattern of an image as one number."""
    rows, cols = (length - (side - 1) * spread for length in image.shape)
    codes = np.zeros((rows, cols), np.int64)
    for down in range(0, side * spread, spread):
        for right in range(0, side * spread, spread):
            codes = codes * count + image[down : down + rows, right : right + cols]
    return codes.ravel()


def _means(distances: Floats) -> tuple[float, float]:
    """Return the mean distance between realisations, and of them from the training image."""
    last = len(distances) - 1
    pairs = distances[np.triu_indices(last, 1)] if last > 1 else np.array([np.nan])
    return float(pairs.mean()), float(distances[-1, :-1].mean())


LEAST_IMAGE_SIDE = 4
"""Smallest side of an image, pixels."""

MOST_LAG = 100  # of variograms and connectivity functions, pixels; half of the shortest side is less in small images


@dataclass(frozen=True, eq=False)
class Summary:
    """The figures of n realisations; in an axis of length n + 1 the last entry is that of the training image.

    Attributes
    ----------
    categories : ndarray, (K,)
        Empty if the values are continuous; then `shares`, `connectivity`, `components`, `largest` and `dead_ends`
        are empty too.
    lags : ndarray of int, (L,)
        Pixels.
    shares : ndarray of float64, (K, n + 1)
        Share of the pixels.
    open : ndarray of float64, (rows, cols)
        Entropy of each pixel's shares of categories in bits, 0 if all realisations agree, at most log2 n; of
        continuous values their standard deviation (divisor n - 1), in their unit.
    variograms : ndarray of float64, (2, K, n + 1, L)
        Along axis 0 (down) and 1 (to the right), of each category's indicator or, with K = 1, of continuous values:
        half the mean squared difference of two pixels at a lag, Matheron's estimator, in squared units.
    connectivity : ndarray of float64, (2, K, n + 1, L)
        Connectivity functions along both axes, see `connectivity`.
    components, largest : ndarray of float64, (K, n + 1)
        See `connectivity`.
    dead_ends : ndarray of float64, (K, n + 1)
        Number in 10,000 pixels of the area where they count, see `dead_ends`; NaN for too small images.
    anodi : Anodi
    copied : ndarray of float64, (n,)
        Share of the 16 x 16 windows of each realisation that occur in the training image, see `copied`; NaN for too
        small images.
    data : ndarray of float64, (m, 3)
        Hard data: x, y, value.
    misses : ndarray of float64, (n,)
        Number of data that each realisation misses; for continuous values, the root of the mean squared difference.
    """

    categories: Array
    lags: NDArray[np.intp]
    shares: Floats
    open: Floats
    variograms: Floats
    connectivity: Floats
    components: Floats
    largest: Floats
    dead_ends: Floats
    anodi: Anodi
    copied: Floats
    data: Floats
    misses: Floats


def summary(
    ensemble: ArrayLike,
    training: ArrayLike,
    *,
    data: ArrayLike | None = None,
    categories: Sequence[int] | None = None,
) -> Summary:
    """Return all figures of an ensemble, a `Summary`; about 8 s for 50 realisations of 250 x 250 pixels.

    Parameters
    ----------
    ensemble : array_like, (realisations, rows, cols)
    training : array_like, (rows, cols)
        The training image, of any size.
    data : array_like, (m, 3), optional
        Hard data: x (column), y (row), both in pixels of a realisation, and the value there.
    categories : sequence of int, optional
        As in `categories_of`: the training image's own by default, none for continuous values.

    Raises
    ------
    ValueError
        The arrays have other shapes, a value is no category or beyond 1e100, or a datum lies outside.
    """
    array, image = checked(ensemble, "ensemble", ENSEMBLE), checked(training, "training image")
    known = categories_of(image, categories)
    points = _checked_data(data, array.shape[1:])
    shortest = min(*array.shape[1:], *image.shape)
    if shortest < LEAST_IMAGE_SIDE:
        raise ValueError(
            f"an image has a side of {shortest} pixels: give at least {LEAST_IMAGE_SIDE} x {LEAST_IMAGE_SIDE}"
        )
    moderate("an image", array, image)
    lag = min(shortest // 2, MOST_LAG)
    images, number = [*array, image], len(array)
    at_data = array[:, points[:, 1].astype(np.intp), points[:, 0].astype(np.intp)]
    if len(known):
        left_open = np.asarray(entropy([(array == k).mean(axis=0) for k in known], base=2, axis=0))
        fields = [[field == k for field in images] for k in (known[-1:] if len(known) == 2 else known)]
        misses = (at_data != points[:, 2]).sum(axis=1).astype(np.float64)
    else:
        left_open = array.std(axis=0, ddof=int(number > 1), dtype=np.float64)
        fields = [images]
        misses = np.sqrt(((at_data - points[:, 2]) ** 2).mean(axis=1)) if len(points) else np.zeros(number)
    variograms = np.array([[[variogram(field, axis, lag) for field in row] for row in fields] for axis in (0, 1)])
    bodies = [[connectivity(field, k, lag) for field in images] for k in known]
    functions = np.array([body.function for row in bodies for body in row]).reshape(len(known), number + 1, 2, lag + 1)

    def table(figure: Callable[[int, int], float]) -> Floats:
        return np.array([[figure(k, n) for n in range(number + 1)] for k in range(len(known))]).reshape(-1, number + 1)

    return Summary(
        categories=known,
        lags=np.arange(lag + 1),
        shares=table(lambda k, n: (images[n] == known[k]).mean()),
        open=left_open,
        variograms=np.repeat(variograms, 2, axis=1) if len(known) == 2 else variograms,  # of two they are the same
        connectivity=np.moveaxis(functions, 2, 0),
        components=table(lambda k, n: bodies[k][n].components),
        largest=table(lambda k, n: bodies[k][n].largest),
        dead_ends=table(lambda k, n: _ends_per_area(images[n], known[k])),
        anodi=anodi(array, image, categories=known.tolist()),
        copied=copied(copies(array, image)) if shortest >= WINDOW else np.full(number, nan),
        data=points,
        misses=misses,
    )


def variogram(field: Array, axis: int, most: int) -> Floats:
    """Return half the mean squared difference at the lags 0 to ``most`` along an axis: Matheron's estimator."""
    along = np.moveaxis(np.asarray(field, np.float64), axis, 0)
    n = len(along)
    return np.array([((along[lag:] - along[: n - lag]) ** 2).mean() / 2 for lag in range(most + 1)])


def _ends_per_area(image: Array, category: int) -> float:
    """Return the dead ends in 10,000 pixels of the area where they count; NaN for a small image."""
    rows, cols = (side - 2 * MARGIN for side in image.shape)
    return 1e4 * len(dead_ends(image, category)) / (rows * cols) if min(rows, cols) > 0 else nan


def _checked_data(data: ArrayLike | None, shape: tuple[int, ...]) -> Floats:
    """Return hard data (m, 3), checked: x, y and value, inside of a shape."""
    points = np.empty((0, 3)) if data is None else np.asarray(data, dtype=np.float64)
    if points.size == 0:
        return np.empty((0, 3))
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"the data have the shape {points.shape}: give rows of x, y and value")
    places = points[:, :2]
    rows, cols = shape
    wrong = ~((places >= 0) & (places < (cols, rows)) & (places == np.floor(places))).all(axis=1)
    if wrong.any():
        x, y, _ = points[wrong][0]
        raise ValueError(f"the datum at x {x:g}, y {y:g} is at no pixel: give x 0 to {cols - 1}, y 0 to {rows - 1}")
    return points


__all__ = [
    *("Anodi", "Connectivity", "Summary", "anodi", "categories_of", "channels", "connected_volume", "connectivity"),
    *("copied", "copies", "dead_ends", "e_type", "probability", "quantiles", "reliability", "standard_error"),
    *("summary", "vertical_proportions"),
]


def channels() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a training image of sinuous channels, and another map of the same kind for taking hard data from it.

    Channels are about 8 pixels wide and cover 0.3 of each map; ``benchmarks/channels.py`` draws maps of any size.

    Returns
    -------
    training, hidden : ndarray of uint8, (256, 256)
        1 in channels, 0 elsewhere.
    """
    both = read(Path(__file__).with_name("channels.png")).pixels
    return both[:, :256], both[:, 256:]
