# SPDX-License-Identifier: BSD-3-Clause
"""From pixels to the integers that equation (12) compares: working levels, and the structure channel.

Eight-bit pixels are their own levels. Other types are stretched over 0..top, all channels on one scale, like colours.
With weights each variable is scaled to the same spread, times its weight. A categorical variable has a channel for each
category, whose level is 0 or one height, so that all pairs of categories differ by the same amount: (12) then counts
the neighbours that differ.

The structure channel is the distance of each pixel of a sample from the border of its bright or its dark part.
Equation (12) matches it as an additional channel, so that a thin joint has an effect at a distance: Lefebvre and Hoppe
(2006). Its sign distinguishes bright parts from dark ones. All sums are of integers: the same bits on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import log2, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.pictures import Pictures

EXACT = 12
"""The most bits of a working level."""

SCORES = 1024
"""Steps of a normal score in a standard deviation."""


class Scale:
    """The map from the pixels of a sample to working levels, for neighbourhoods of so many ``values``.

    ``top`` is the highest working level; ``direct`` is True if the channels of working levels are those of the pixels,
    and ``unit`` is then one working level in the pixels' own unit.
    """

    def __init__(self, pictures: Pictures, values: int) -> None:
        pixels, self.unit = pictures.pixels, 1.0
        self._channels = variables = pixels[0].shape[-1]
        self.direct = not (pictures.weights or pictures.scores or (pictures.categorical and any(pictures.categorical)))
        eight = all(picture.dtype in (np.bool_, np.uint8) for picture in pixels)
        self.top = 255 if eight and self.direct else highest(values)
        self._variables: list[_Stretched | _Categories] = []
        self._common: _Stretched | None = None
        if not self.direct:
            for variable in range(variables):
                categories = pictures.categories(variable)
                here = np.concatenate([pictures.values(variable, picture) for picture in range(len(pixels))])
                continuous = _Scores if pictures.scores else _Stretched
                self._variables.append(continuous(here, self.top) if categories is None else _Categories(here))
            weights = pictures.weights or (1.0,) * variables
            most = max(w * kind.steepness for w, kind in zip(weights, self._variables, strict=True))
            for weight, kind in zip(weights, self._variables, strict=True):
                kind.scale = weight / most * self.top if most else 0.0
        elif not eight:
            self._common = _Stretched(_ends(pictures), self.top)
            self.unit = self._common.unit

    @property
    def units(self) -> NDArray[np.float64]:
        """One working level of each channel in the pixels' own unit, (channels,); 0 for a category."""
        if self.direct:
            return np.full(self._channels, self.unit)
        return np.array([unit for kind in self._variables for unit in (kind.step,) * kind.channels])

    @property
    def owners(self) -> list[int]:
        """The variable of each channel of working levels."""
        if self.direct:
            return list(range(self._channels))
        return [variable for variable, kind in enumerate(self._variables) for _ in range(kind.channels)]

    def levels(self, pixels: NDArray[Any]) -> NDArray[np.uint16]:
        """Return the working levels (channels, ...) of pixels (..., C) of the sample's type, clipped to its range."""
        planes = np.moveaxis(pixels, -1, 0)
        if not self.direct:
            levels = [kind.levels(plane) for plane, kind in zip(planes, self._variables, strict=True)]
            return np.concatenate(levels).astype(np.uint16)
        if self._common is None:
            return planes.astype(np.uint16)
        return self._common.stretched(planes).astype(np.uint16)


class _Stretched:
    """A variable stretched over 0..top."""

    scale, channels = 0.0, 1

    def __init__(self, values: NDArray[Any], top: int) -> None:
        self.ends, self.top, self._values = (values.min(), values.max()), top, values
        _, self.unit = stretch(values[:0], top, self.ends)

    @cached_property
    def spread(self) -> float:
        """The standard deviation."""
        stretched = self.stretched(self._values)
        n, total, squares = stretched.size, int(stretched.sum()), int((stretched * stretched).sum())
        return sqrt((n * squares - total * total) / n**2)

    @property
    def steepness(self) -> float:
        """The highest level divided by the spread."""
        return self.top / self.spread if self.spread else 0.0

    @property
    def step(self) -> float:
        """One of its levels in the pixels' own unit."""
        return self.unit * self.spread / self.scale if self.scale else 0.0

    def stretched(self, pixels: NDArray[Any]) -> NDArray[np.int64]:
        """Return integers 0..top for pixels of any shape."""
        return stretch(np.clip(pixels, *self.ends), self.top, self.ends)[0]

    def levels(self, plane: NDArray[Any]) -> NDArray[np.int64]:
        """Return the one channel of the variable."""
        if not self.spread:
            return np.zeros((1, *plane.shape), np.int64)
        levels: NDArray[np.int64] = np.rint(self.stretched(plane)[None] * (self.scale / self.spread)).astype(np.int64)
        return levels


class _Scores(_Stretched):
    """A variable by its normal scores: normal quantiles of its ranks. Equal values have their mean rank."""

    def __init__(self, values: NDArray[Any], top: int) -> None:
        from scipy.special import ndtri  # only for a simulation, since it loads slowly

        known, counts = np.unique(values, return_counts=True)
        self._known = known.astype(np.float64)
        below = (counts.cumsum() - counts / 2) / values.size
        self._scores = np.rint(ndtri(below) * SCORES)  # rounded, so that the last bit of a logarithm does not matter
        super().__init__(self.scores(values), top)

    def scores(self, pixels: NDArray[Any]) -> NDArray[np.float64]:
        """Return the scores of values; between two known values they are interpolated."""
        return np.asarray(np.interp(pixels.astype(np.float64), self._known, self._scores))

    def levels(self, plane: NDArray[Any]) -> NDArray[np.int64]:
        """Return the one channel of the variable."""
        return super().levels(self.scores(plane))


class _Categories:
    """A categorical variable; with two categories it has one channel, of level 0 or the highest."""

    scale = step = 0.0

    def __init__(self, values: NDArray[Any]) -> None:
        self.categories, counts = np.unique(values, return_counts=True)
        share = [int(n) for n in counts]
        total = sum(share)
        differing = 1 - sum(n * n for n in share) / total**2  # share of pairs of pixels
        alike = 1 if len(share) == 2 else 2  # number of channels in which two categories differ
        self.channels = 1 if len(share) < 3 else len(share)
        self.steepness = sqrt(2 / (alike * differing)) if differing else 0.0

    def levels(self, plane: NDArray[Any]) -> NDArray[np.int64]:
        """Return a channel for each category."""
        height = round(self.scale * self.steepness)
        those = self.categories[1:] if len(self.categories) < 3 else self.categories
        levels = [(plane == category) * height for category in those] or [np.zeros(plane.shape, np.int64)]
        return np.stack(levels).astype(np.int64)


def highest(values: int) -> int:
    """Return the highest level for which the distance of (12) over ``values`` values is exact in float64."""
    return int(2 ** min(EXACT, int((33 - log2(values)) / 2)) - 1)


def stretch(pixels: NDArray[Any], top: int, ends: tuple[Any, Any] | None = None) -> tuple[NDArray[np.int64], float]:
    """Return pixels stretched over the integers 0..top from ``ends``, and the size of 1 in the pixels' unit."""
    low, high = ends or (pixels.min(), pixels.max())
    if pixels.dtype.kind in "iu":
        bounds = np.array([low, high]).astype(np.uint64)  # modulo 2**64, so a difference from the least is exact
        half = (pixels.astype(np.uint64) - bounds[:1].reshape((1,) * pixels.ndim)) / np.float64(2)
        most = float((bounds - bounds[:1])[1] / np.float64(2))
    else:
        lower = np.float64(low) / 2  # so that no difference overflows
        half, most = pixels.astype(np.float64) / 2 - lower, float(np.float64(high) / 2 - lower)
    half_unit = most / top or 0.5
    return np.rint(half / half_unit).astype(np.int64), 2 * half_unit


def _ends(pictures: Pictures) -> NDArray[Any]:
    """Return the least and the greatest known value, (2,) of the pictures' type."""
    known = pictures.pixels
    if pictures.known:
        known = tuple(picture[there] for picture, there in zip(known, pictures.known, strict=True))
    values = np.concatenate([picture.ravel() for picture in known])
    return np.array([values.min(), values.max()])


REACH = 16
"""The distance in pixels beyond which all distances are equal."""

BINOMIAL = (1, 4, 6, 4, 1)
"""Weights of the smoothing, in 1/16: standard deviation 1."""

BOXES = (19, 21, 21)
"""Widths of the successive running sums of the surroundings: standard deviation 10."""

SQUARINGS = 12
"""Number of squarings of a covariance: its 4096th power gives the first principal component."""


def structure(
    pictures: Sequence[NDArray[np.integer]], weight: float, variance: float, top: int
) -> list[NDArray[np.uint16]]:
    """Return the signed distance to the border between the bright and the dark of pictures (C, rows, cols), as levels.

    A pixel is bright if the first principal component of the sample, smoothed, exceeds the mean of its surroundings.
    The standard deviation of the result is ``weight`` times the sample's, or less so that it fits 0..top.
    """
    smooth = [np.stack([smoothed(channel) for channel in levels]) for levels in pictures]
    by = principal(smooth)
    signed = []
    for levels in smooth:
        component = np.tensordot(by, levels, 1)
        around, total = surroundings(component)
        signed.append(_signed(component * total > around))
    least = min(int(plane.min()) for plane in signed)
    signed = [plane - least for plane in signed]
    n, total = sum(plane.size for plane in signed), sum(int(plane.sum()) for plane in signed)
    squares, most = sum(int((plane * plane).sum()) for plane in signed), max(int(plane.max()) for plane in signed)
    spread = sqrt((n * squares - total * total) / n**2)
    if not spread:
        return [np.zeros(plane.shape, np.uint16) for plane in signed]
    scale = min(weight * sqrt(variance) / spread, top / most)
    return [np.rint(plane * scale).astype(np.uint16) for plane in signed]


def principal(pictures: Sequence[NDArray[np.integer]]) -> NDArray[np.int64]:
    """Return the first principal component of pictures (C, rows, cols) of integers: (C,) weights, -127 to 127.

    All arithmetic is on integers, since the last bits of a library's eigenvectors differ from machine to machine.
    """
    channels = len(pictures[0])
    flat = [picture.reshape(channels, -1).astype(np.int64) for picture in pictures]
    n = sum(levels.shape[1] for levels in flat)
    sums = [sum(int(levels[a].sum()) for levels in flat) for a in range(channels)]
    power = [
        [n * sum(int(levels[a] @ levels[b]) for levels in flat) - sums[a] * sums[b] for b in range(channels)]
        for a in range(channels)
    ]
    for _ in range(SQUARINGS):
        shift = max(0, max(abs(value).bit_length() for row in power for value in row) - 64)
        power = [[value >> shift for value in row] for row in power]
        power = [[sum(x * y for x, y in zip(row, col, strict=True)) for col in power] for row in power]  # symmetric
    largest = max(range(channels), key=lambda a: power[a][a])
    vector = power[largest]
    most = max(map(abs, vector))
    if not most:
        return np.ones(channels, np.int64)
    weights = [(254 * value + most) // (2 * most) for value in vector]  # rounded, halves up
    sign = -1 if sum(weights) < 0 or (sum(weights) == 0 and next(filter(None, weights)) < 0) else 1
    return np.array(weights, np.int64) * sign


def smoothed(channel: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return 256 times a channel (rows, cols) smoothed by `BINOMIAL`; edge pixels continue beyond the border."""
    total = channel.astype(np.int64)
    for axis in (0, 1):
        around = np.pad(total, [(2, 2) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        n = total.shape[axis]
        total = np.zeros_like(total)
        for k, weight in enumerate(BINOMIAL):
            total += weight * np.take(around, np.arange(k, k + n), axis)
    return total


def surroundings(component: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return the sums of each pixel's surroundings (rows, cols), mirrored at borders, and the sum of their weights."""
    total = 1
    for width in BOXES:
        for axis in (0, 1):
            n, before = component.shape[axis], (width + 1) // 2  # one of them for the differences of running sums
            edges = [(before, width // 2) if a == axis else (0, 0) for a in (0, 1)]
            running = np.pad(component, edges, mode="symmetric").cumsum(axis)
            component = np.take(running, np.arange(width, width + n), axis) - np.take(running, np.arange(n), axis)
            total *= width
    return component, total


def _signed(bright: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the distance to the border between bright and dark, negative in the dark, in 1/256 of a pixel."""
    squared = np.where(bright, distance(~bright), distance(bright))
    apart = np.rint(np.sqrt(squared.astype(np.float64)) * 256).astype(np.int64) - 128
    signed: NDArray[np.int64] = np.where(bright, apart, -apart)
    return signed


def distance(marked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the squared distance of each pixel from the nearest marked one, at most REACH**2; (rows, cols)."""
    along = np.where(marked, 0, REACH).astype(np.int64)  # not SciPy's, whose import takes as long as a default run
    for _ in range(REACH):  # along columns first, then over up to REACH to either side in a row
        along[1:] = np.minimum(along[1:], along[:-1] + 1)
        along[:-1] = np.minimum(along[:-1], along[1:] + 1)
    squared = along * along
    nearest = squared.copy()
    for apart in range(1, min(REACH, marked.shape[1] - 1) + 1):
        nearest[:, apart:] = np.minimum(nearest[:, apart:], squared[:, :-apart] + apart * apart)
        nearest[:, :-apart] = np.minimum(nearest[:, :-apart], squared[:, apart:] + apart * apart)
    return nearest
