# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of a sample, and turned and scaled copies of them with the probability of each copy at each site.

A sample knows which of its pixels are known, which may be used, and which variables are categories. The rotation of a
copy is rounded to the nearest eighth of a turn, and its scale to the nearest of 2**-1, 2**-1/2, 1, 2**1/2 and 2.
Quarter turns at the scale 1 are exact; a pixel of any other copy is the nearest pixel of the picture. Beyond the
borders of its picture a copy is a mirror image, whose pixels are never taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

PARTS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)
"""The quantiles that end the classes of values that are no categories; large values, which decide a mean, have more."""

SPIKE = 0.05
"""The least share of a value that is a class of its own."""

CATEGORIES = 16
"""Different pixels up to which a sample is taken for a map of categories."""


class NothingUsable(ValueError):
    """No pixel of a sample is a candidate of some level."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """Pictures, or volumes, of one type and of any sizes that a texture is taken from."""

    pixels: tuple[NDArray[Any], ...]  # ([layers,] rows, cols, C), NaN where a pixel is unknown
    unknown: tuple[Mask, ...] | None = None  # in addition to NaN: never taken, and no neighbours
    usable: tuple[Mask, ...] | None = None  # pixels that may be taken; None: all
    categorical: tuple[bool, ...] | None = None  # whether the numbers of a variable name categories; None: none do
    weights: tuple[float, ...] | None = None  # of variables, scaled to one spread; None: on one scale, as colours
    shares: tuple[float, ...] | None = None  # of the output, for each picture; None: all pixels have equal weights
    scores: bool = False  # whether values that are no categories are compared by their normal scores
    known: tuple[Mask, ...] | None = field(init=False)

    def __post_init__(self) -> None:
        """Replace unknown pixels by the nearest known one, so that every neighbourhood has values."""
        gaps = [unknown_in(picture) for picture in self.pixels]
        if self.unknown:
            gaps = [gap | more for gap, more in zip(gaps, self.unknown, strict=True)]
        if not any(gap.any() for gap in gaps):
            object.__setattr__(self, "known", None)
            return
        if any(gap.all() for gap in gaps):
            raise NothingUsable("a sample has no known pixel; leave it out")
        object.__setattr__(self, "unknown", tuple(gaps))  # lost in completed pixels; for `replace`
        object.__setattr__(self, "known", tuple(~gap for gap in gaps))
        object.__setattr__(self, "pixels", tuple(completed(*pair) for pair in zip(self.pixels, gaps, strict=True)))

    @property
    def deep(self) -> bool:
        """Whether the sample is of volumes."""
        return self.pixels[0].ndim > 3

    @property
    def clean(self) -> bool:
        """Whether there is only one picture, whose pixels are all known and may be taken."""
        return len(self.pixels) == 1 and self.known is None and self.usable is None

    def categories(self, variable: int) -> NDArray[Any] | None:
        """Return the categories of a variable in ascending order; None if it is not categorical."""
        if not (self.categorical and self.categorical[variable]):
            return None
        return np.unique(np.concatenate([self.values(variable, picture) for picture in range(len(self.pixels))]))

    @cached_property
    def classes(self) -> NDArray[Any]:
        """The greatest value of each class of the first variable, in ascending order.

        A class is a category; of other values, a part (`PARTS`) of all. A value of a large share (`SPIKE`) is alone.
        """
        names = self.categories(0)
        if names is not None:
            return names
        every = np.concatenate([image[..., 0][taken] for image, taken in zip(self.pixels, self.taken, strict=True)])
        values, counts = np.unique(every, return_counts=True)
        ends = np.searchsorted(counts.cumsum(), every.size * np.array(PARTS))
        alone = np.flatnonzero(counts >= SPIKE * every.size)
        return np.asarray(values[np.unique(np.concatenate([ends, alone, alone[alone > 0] - 1]))])

    def proportions(self) -> NDArray[np.number[Any]]:
        """Return the proportions of the classes of the first variable in what may be taken, by the pictures' shares."""
        pairs = zip(self.pixels, self.taken, strict=True)
        of = [np.searchsorted(self.classes, image[..., 0][taken]) for image, taken in pairs]
        counts = np.array([np.bincount(each, minlength=len(self.classes)) for each in of])
        each = counts / np.maximum(counts.sum(1, keepdims=True), 1)
        return np.asarray(counts.sum(0) if self.shares is None else self.shares @ each)

    @property
    def taken(self) -> tuple[Mask, ...]:
        """Where pixels may be taken: they are known and usable."""
        every = [np.ones(image.shape[:-1], bool) for image in self.pixels]
        return tuple(map(np.logical_and, self.known or every, self.usable or every))

    def values(self, variable: int, picture: int) -> NDArray[Any]:
        """Return the known values of a variable in one of the pictures, (n,)."""
        plane = self.pixels[picture][..., variable]
        return plane[self.known[picture]] if self.known else plane.ravel()

    def halved(self) -> Pictures:
        """Return pictures of half the size: the means of squares of 2x2 pixels, known and usable if all four are."""
        known, usable = (masks and tuple(map(halved, masks)) for masks in (self.known, self.usable))
        unknown = known and tuple(~mask for mask in known)
        return replace(self, pixels=tuple(map(halved, self.pixels)), unknown=unknown, usable=usable)

    @property
    def channels(self) -> int:
        """Number of channels of working levels: one for a variable, or one for each category if these are 3 or more."""
        every = [self.categories(variable) for variable in range(self.pixels[0].shape[-1])]
        return sum(1 if names is None or len(names) < 3 else len(names) for names in every)


def kind(picture: NDArray[Any]) -> str:
    """Return the channels and the type of a picture ([layers,] rows, cols, C) as text."""
    count = picture.shape[-1]
    return f"{count} channel{'s' * (count != 1)} of {picture.dtype}"


def check_alike(name: str, picture: NDArray[Any], other: str, like: NDArray[Any]) -> None:
    """Raise unless two pictures with a channel axis have the same type and number of channels."""
    if (picture.dtype, picture.shape[-1]) != (like.dtype, like.shape[-1]):
        raise ValueError(f"{name} has {kind(picture)} and {other} {kind(like)}; convert them to one type")


def unknown_in(picture: NDArray[Any]) -> Mask:
    """Return where a picture ([layers,] rows, cols, C) is NaN in any channel."""
    if picture.dtype.kind != "f":
        return np.zeros(picture.shape[:-1], bool)
    unknown: Mask = np.isnan(picture).any(-1)
    return unknown


def completed(picture: NDArray[Any], unknown: Mask) -> NDArray[Any]:
    """Return the picture (rows, cols, C) with each unknown pixel replaced by the nearest known one."""
    if not unknown.any():
        return picture
    from scipy.ndimage import distance_transform_edt  # only for unknown pixels, since it loads slowly

    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    filled: NDArray[Any] = np.ascontiguousarray(picture[tuple(nearest)])
    return filled


def few(pictures: Sequence[NDArray[Any]], most: int = CATEGORIES) -> bool:
    """Return whether a sample, pictures (rows, cols, C), has at most ``most`` different pixels: a map of them."""
    seen = np.zeros((0, pictures[0].shape[-1]), pictures[0].dtype)
    for picture in pictures:
        flat = picture.reshape(-1, picture.shape[-1])
        for part in np.split(flat, range(2**8, len(flat), 2**16)):  # the first, a small one, tells of most
            seen = np.unique(np.concatenate([seen, part]), axis=0)
            if len(seen) > most:
                return False
    return True


def halved(array: NDArray[Any], all_of_it: bool = False) -> NDArray[Any]:
    """Return the means of squares of 2x2, of masks whether all are True; ``all_of_it`` repeats an odd last line."""
    if all_of_it:
        array = np.pad(array, [(0, side % 2) for side in array.shape[:2]] + [(0, 0)] * (array.ndim - 2), "edge")
    rows, cols = (side - side % 2 for side in array.shape[:2])
    parts = [array[i:rows:2, j:cols:2] for i in (0, 1) for j in (0, 1)]
    if array.dtype == np.bool_:
        return np.asarray(np.logical_and.reduce(parts))
    mean = np.zeros(parts[0].shape)
    for part in parts:
        mean += part / 4
    return np.asarray(np.rint(mean) if array.dtype.kind in "iu" else mean).astype(array.dtype)


EIGHTHS = 8
"""Number of rotations."""

HALVES = 2
"""The most factors of sqrt(2) by which a picture is enlarged or reduced."""

MOST_COPIES = 64
"""The most copies of all pictures together."""


@dataclass(frozen=True, eq=False)
class Copy:
    """A copy of the picture with the number ``image``."""

    image: int
    at: tuple[NDArray[np.int32], ...]  # the [layer,] row and column of each pixel, which broadcast to the copy
    inside: Mask  # ([layers,] rows, cols), False in the mirror image

    def of(self, pictures: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Return the copy of an array ([layers,] rows, cols, ...) that belongs to the picture."""
        return np.ascontiguousarray(pictures[self.image][self.at])


def copy_of(image: int, shape: tuple[int, ...], eighths: int, halves: int) -> Copy:
    """Return the copy of a picture of ``shape``, turned by ``eighths`` from x to y and enlarged by sqrt(2)**halves."""
    half = sqrt(0.5)
    cosines = (1.0, half, 0.0, -half, -1.0, -half, 0.0, half)
    cos, sin = cosines[eighths], cosines[(eighths - 2) % EIGHTHS]
    by = 2.0 ** (halves // 2) * (sqrt(2.0) if halves % 2 else 1.0)
    *layers, rows, cols = shape
    high, wide = (abs(cos) * a + abs(sin) * b for a, b in ((rows, cols), (cols, rows)))
    sides = [max(1, ceil(side * by - 1e-6)) for side in (high, wide)]
    y, x = ((np.arange(side) - (side - 1) / 2) / by for side in sides)
    down = cos * y[:, None] - sin * x[None, :] + (rows - 1) / 2
    along = sin * y[:, None] + cos * x[None, :] + (cols - 1) / 2
    lines = [down, along]
    for n in layers:
        z = (np.arange(max(1, ceil(n * by - 1e-6))) / by)[:, None, None]
        lines.insert(0, z + (n - 1 - z.max()) / 2)
    places = [np.floor(at + 0.5 + 1e-9).astype(np.int64) for at in lines]  # halves up, even if inexact
    inside: Any = np.logical_and.reduce(
        np.broadcast_arrays(*((at >= 0) & (at < n) for at, n in zip(places, shape, strict=True)))
    )
    return Copy(image, tuple(_mirrored(at, n) for at, n in zip(places, shape, strict=True)), inside)


def _mirrored(at: NDArray[np.int64], side: int) -> NDArray[np.int32]:
    at = at % (2 * side)
    return np.minimum(at, 2 * side - 1 - at).astype(np.int32)


@dataclass(frozen=True, eq=False)
class Turned:
    """The ``copies`` that maps require, and the ``probability`` (copies, H, W) of each at each site, or NaN."""

    copies: tuple[Copy, ...]
    probability: NDArray[np.float64]

    def pictures(self, pictures: Pictures) -> Pictures:
        """Return the copies of pictures as pictures."""
        copies, unknown, usable = self.copies, None, None
        if pictures.known:
            unknown = tuple(copy.of([~known for known in pictures.known]) for copy in copies)
        if pictures.usable or not all(copy.inside.all() for copy in copies):
            everywhere = [np.ones(picture.shape[:-1], bool) for picture in pictures.pixels]
            usable = tuple(copy.inside & copy.of(pictures.usable or everywhere) for copy in copies)
        return Pictures(tuple(copy.of(pictures.pixels) for copy in copies), unknown, usable)

    def sources(self, place: NDArray[np.int32], several: bool) -> NDArray[np.int32]:
        """Return the source map in the pictures from one of the copies, with the picture's number if ``several``."""
        axes, none = len(self.copies[0].at), place[..., 0] < 0
        index = place[..., axes] if place.shape[-1] > axes else np.where(none, np.int32(-1), np.int32(0))
        source = np.full((*place.shape[:-1], axes + several), -1, np.int32)
        for k, copy in enumerate(self.copies):
            here = index == k
            at = tuple(place[here][:, :axes].T)
            lines = [line[at] for line in np.broadcast_arrays(*copy.at)]
            source[here] = np.stack([*lines, np.full(at[0].size, copy.image)][: axes + several], -1)
        return source


def turned(
    pictures: Pictures,
    images: NDArray[np.float64],
    rotation: NDArray[np.float64] | None,
    scale: NDArray[np.float64] | None,
) -> Turned:
    """Return the copies that any site requires, and their probabilities.

    ``images`` (pictures, [D,] H, W) are probabilities, ``rotation`` ([D,] H, W) degrees from x to y, and ``scale`` 1/2
    to 2; NaN takes any of another site.
    """
    shape = images.shape[1:]
    turns = np.zeros(shape) if rotation is None else np.floor(rotation / (360 / EIGHTHS) + 0.5) % EIGHTHS
    sizes = np.zeros(shape) if scale is None else np.clip(np.floor(2 * np.log2(scale) + 0.5), -HALVES, HALVES)
    free = np.isnan(images[0]) | np.isnan(turns) | np.isnan(sizes)
    kind = np.where(free, 0, turns * (2 * HALVES + 1) + sizes + HALVES).astype(np.int64)
    wanted = [(int(k), n) for k in np.unique(kind[~free]) for n in range(len(images))]
    wanted = [(k, n) for k, n in wanted if images[n][(kind == k) & ~free].any()]
    if not wanted:
        raise ValueError("the maps of training images, rotation and scale have no number; leave them out")
    if len(wanted) > MOST_COPIES:
        raise ValueError(
            f"the maps ask for {len(wanted)} different copies of training images; round rotation and scale so that "
            f"there are {MOST_COPIES} or fewer"
        )
    probability = np.stack([np.where(kind == k, images[n], 0) for k, n in wanted])
    probability[:, free] = np.nan
    copies = [(n, k // (2 * HALVES + 1), k % (2 * HALVES + 1) - HALVES) for k, n in wanted]
    sides = [picture.shape[:-1] for picture in pictures.pixels]
    return Turned(tuple(copy_of(n, sides[n], turn, halves) for n, turn, halves in copies), probability)
