# SPDX-License-Identifier: BSD-3-Clause
"""From pixels to working levels: the integers that equation (12) compares.

Eight-bit pixels are their own levels. Other types are stretched over 0..top, all channels on one scale, like colours.
With weights each variable is scaled to the same spread, times its weight. A categorical variable has a channel for each
category, whose level is 0 or one height, so that all pairs of categories differ by the same amount: (12) then counts
the neighbours that differ.
"""

from __future__ import annotations

from functools import cached_property
from math import log2, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.pictures import Pictures

EXACT = 12
"""The most bits of a working level."""


class Scale:
    """The map from the pixels of a sample to working levels.

    ``values`` is the number of values of a neighbourhood: channels of working levels times neighbours. ``top`` is the
    highest working level; ``direct`` is True if the channels of working levels are those of the pixels, and ``unit`` is
    then one working level in the pixels' own unit.
    """

    def __init__(self, pictures: Pictures, values: int) -> None:
        pixels, self.unit = pictures.pixels, 1.0
        self._channels = variables = pixels[0].shape[-1]
        self.direct = not (pictures.weights or (pictures.categorical and any(pictures.categorical)))
        eight = all(picture.dtype in (np.bool_, np.uint8) for picture in pixels)
        self.top = 255 if eight and self.direct else highest(values)
        self._variables: list[_Stretched | _Categories] = []
        self._common: _Stretched | None = None
        if not self.direct:
            for variable in range(variables):
                categories = pictures.categories(variable)
                here = np.concatenate([pictures.values(variable, number) for number in range(len(pixels))])
                self._variables.append(_Stretched(here, self.top) if categories is None else _Categories(here))
            weights = pictures.weights or (1.0,) * variables
            most = max(w * one.steepness for w, one in zip(weights, self._variables, strict=True))
            for weight, one in zip(weights, self._variables, strict=True):
                one.scale = weight / most * self.top if most else 0.0
        elif not eight:
            self._common = _Stretched(_ends(pictures), self.top)
            self.unit = self._common.unit

    @property
    def units(self) -> NDArray[np.float64]:
        """One working level of each channel in the pixels' own unit, (channels,); 0 for a category."""
        if self.direct:
            return np.full(self._channels, self.unit)
        return np.array([unit for one in self._variables for unit in (one.step,) * one.channels])

    @property
    def owners(self) -> list[int]:
        """The variable of each channel of working levels."""
        if self.direct:
            return list(range(self._channels))
        return [variable for variable, one in enumerate(self._variables) for _ in range(one.channels)]

    def levels(self, pixels: NDArray[Any]) -> NDArray[np.uint16]:
        """Return the working levels (channels, ...) of pixels (..., C) of the sample's type, clipped to its range."""
        planes = np.moveaxis(pixels, -1, 0)
        if not self.direct:
            found = [one.levels(plane) for plane, one in zip(planes, self._variables, strict=True)]
            return np.concatenate(found).astype(np.uint16)
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
        found: NDArray[np.int64] = np.rint(self.stretched(plane)[None] * (self.scale / self.spread)).astype(np.int64)
        return found


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
        found = [(plane == category) * height for category in those] or [np.zeros(plane.shape, np.int64)]
        return np.stack(found).astype(np.int64)


def highest(values: int) -> int:
    """Return the highest level for which the distance of (12) over ``values`` values is exact in float64."""
    return int(2 ** min(EXACT, int((33 - log2(values)) / 2)) - 1)


def stretch(pixels: NDArray[Any], top: int, ends: tuple[Any, Any] | None = None) -> tuple[NDArray[np.int64], float]:
    """Return pixels of any real type stretched over the integers 0..top, and the size of 1 in their own unit.

    ``ends`` are the pixels that become 0 and top; None: the least and the greatest pixel.
    """
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
    values = np.concatenate([one.ravel() for one in known])
    return np.array([values.min(), values.max()])
