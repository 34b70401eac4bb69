# SPDX-License-Identifier: BSD-3-Clause
"""Guides: pictures of the sample and of the output that are matched and never synthesised.

A guide's channels are terms of equation (12) like those of the pixels, with two differences: they are known everywhere,
whatever the temperature, and the site itself counts, with the weight `centre`. So a candidate is near if its guide, at
and around it, equals that of the site: texture by numbers (Hertzmann et al. 2001), or a secondary variable.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.lattice import sums_around
from simdtex.model.pictures import Pictures, halved, unknown_in
from simdtex.model.scale import Scale, stretch

UNKNOWN = 2**16 - 1
"""The working level of an unknown value, which has no weight (kernels/mrf/confidence.h)."""


GuidePair = tuple[tuple[NDArray[Any], ...], NDArray[Any]]
"""A guide: (rows, cols, G) arrays, one for each picture of the sample, and (H, W, G) of the output."""


class GuidePlanes(NamedTuple):
    """Working levels of a guide: (G, rows, cols) arrays for the pictures of the sample, (G, H, W) for the output."""

    samples: list[NDArray[np.uint16]]
    output: NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Guide:
    """A guide, with a picture for each picture of the sample and one for the output."""

    samples: tuple[NDArray[Any], ...]  # (rows, cols, G), of the sizes of the sample's pictures
    output: NDArray[Any]  # (H, W, G), NaN where there is no guide
    labels: bool  # whether its numbers are only equal or different
    weight: float  # the variance of the guide in units of the pixels' variance
    names: tuple[NDArray[Any], ...] | None = None  # the labels of each channel; None: those of the samples

    @property
    def channels(self) -> int:
        """The number of channels: one for each of the guide's, or for each label if these are three or more."""
        if not self.labels:
            return int(self.output.shape[-1])
        names = [self._names(channel).size for channel in range(self.output.shape[-1])]
        return sum(1 if count < 3 else count for count in names)

    def halved(self) -> Guide:
        """Return the guide of pictures and an output of half the size: one of the pixels of each square of 2x2."""
        row, col = (np.minimum(np.arange(1, side + 1, 2), side - 1) for side in self.output.shape[:2])
        names = tuple(self._names(channel) for channel in range(self.output.shape[-1])) if self.labels else None
        samples, output = tuple(guide[1::2, 1::2] for guide in self.samples), self.output[np.ix_(row, col)]
        return replace(self, samples=samples, output=output, names=names)

    def _names(self, channel: int) -> NDArray[Any]:
        if self.names:
            return self.names[channel]
        return np.unique(np.concatenate([np.unique(sample[..., channel]) for sample in self.samples]))

    def planes(self, scale: Scale, spread: float, top: int) -> GuidePlanes:
        """Return one channel for each of the guide's, or for each label if these are three or more."""
        silent = unknown_in(self.output)
        parts = [self._channel(channel, silent, spread, top) for channel in range(self.output.shape[-1])]
        counts = zip(*(part.samples for part in parts), strict=True)
        output = np.concatenate([part.output for part in parts])
        output[:, silent] = UNKNOWN
        return GuidePlanes([np.concatenate(those) for those in counts], output)

    def _channel(self, channel: int, silent: NDArray[np.bool_], spread: float, top: int) -> GuidePlanes:
        samples = [sample[..., channel] for sample in self.samples]
        if self.output.dtype.kind == "f" or any(sample.dtype.kind == "f" for sample in samples):
            samples = [sample.astype(np.float64) for sample in samples]  # `stretch` takes the ends as the pixels' type
        output = np.where(silent, samples[0].flat[0], self.output[..., channel])
        every = np.concatenate([sample.ravel() for sample in samples])
        if self.labels:
            names = self._names(channel)
            names = names[1:] if len(names) < 3 else names
            unit = [np.stack([sample == name for name in names] or [sample != sample]) for sample in samples]
            wanted = np.stack([output == name for name in names] or [output != output])
        else:
            ends = min(every.min(), output.min()), max(every.max(), output.max())
            unit = [stretch(sample, top, ends)[0][None] for sample in samples]
            wanted = stretch(output, top, ends)[0][None]
        n, variance = every.size, 0.0
        for k in range(len(wanted)):
            total = sum(int(guide[k].sum()) for guide in unit)
            squares = sum(int((guide[k].astype(np.int64) ** 2).sum()) for guide in unit)
            variance += (n * squares - total * total) / n**2
        most = 1 if self.labels else top
        height = float(top) if self.weight else 0.0
        if variance:
            height = min(sqrt(self.weight * spread / self.output.shape[-1] / variance) * most, top)
        return GuidePlanes([_scaled(guide, height, most) for guide in unit], _scaled(wanted, height, most))


@dataclass(frozen=True, eq=False)
class Colocated:
    """A guide of the known variables at sites whose other variables are unknown."""

    pictures: Pictures  # the sample's
    values: NDArray[Any]  # (H, W, C), of the sample's type
    known: NDArray[np.bool_]  # (H, W, C)
    reduced: int  # the divisor of levels

    @property
    def channels(self) -> int:
        """The number of channels: one for each known variable, or for each category if these are three or more."""
        known = np.flatnonzero(self.known.reshape(-1, self.known.shape[-1]).any(0)).tolist()
        categories = [self.pictures.categories(variable) for variable in known]
        return sum(1 if names is None or len(names) < 3 else len(names) for names in categories)

    def planes(self, scale: Scale, spread: float, top: int) -> GuidePlanes:
        """Return the channels of the known variables."""
        owner, by = scale.owners, self.reduced
        those = [channel for channel, variable in enumerate(owner) if self.known[..., variable].any()]
        output = scale.levels(self.values)[those] // by
        for plane, channel in zip(output, those, strict=True):
            plane[~self.known[..., owner[channel]]] = UNKNOWN
        return GuidePlanes([scale.levels(sample)[those] // by for sample in self.pictures.pixels], output)


AROUND = 4
"""Pixels by which the squares of known colours reach beyond the rim of a hole, from its deepest pixel."""

NEARNESS, FAR = 3.0, 300
"""Variance of the place in a picture, in units of the colours' variance, for places ``FAR`` pixels apart."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The smooth colours of a picture, and the places in it: a guide for its holes."""

    sample: NDArray[Any]  # (rows, cols, C)
    known: NDArray[np.bool_]  # in the sample
    values: NDArray[Any]  # (H, W, C), the output
    given: NDArray[np.bool_]  # in the output
    corner: tuple[float, float]  # row and column in the sample of the output's first; NaN for no guide
    colours: bool = True  # whether colours guide too

    def halved(self) -> Surroundings:
        """Return the guide of a picture and an output of half the size."""
        values, mask = (halved(array, all_of_it=True) for array in (self.values, self.given))
        corner = self.corner[0] / 2, self.corner[1] / 2
        return Surroundings(halved(self.sample), halved(self.known), values, mask, corner, self.colours)

    @property
    def channels(self) -> int:
        """The number of channels: the colours, the row and the column."""
        return self.colours * int(self.sample.shape[-1]) + 2

    def planes(self, scale: Scale, spread: float, top: int) -> GuidePlanes:
        """Return the means of the known colours around each pixel, its row and its column."""
        from scipy.ndimage import distance_transform_cdt  # only for a hole, since it loads slowly

        step = min(sqrt(NEARNESS * spread) / FAR, top / max(self.sample.shape[:2]))
        reach = AROUND + int(distance_transform_cdt(~self.given, metric="chessboard").max())

        def levels(picture: NDArray[Any], known: NDArray[np.bool_], corner: tuple[float, ...]) -> NDArray[np.uint16]:
            colours = [smooth(scale.levels(picture), known, reach)] if self.colours else []
            return np.concatenate([*colours, _places(known.shape, corner, step, top)])

        sample = levels(self.sample, self.known, tuple(0 * side for side in self.corner))
        return GuidePlanes([sample], levels(self.values, self.given, self.corner))


AnyGuide = Guide | Colocated | Surroundings
"""A guide, whose planes are matched with those of the pixels."""


def smooth(levels: NDArray[np.uint16], known: NDArray[np.bool_], reach: int) -> NDArray[np.uint16]:
    """Return the mean of the known pixels in a square around each pixel of a picture (C, rows, cols); 0 without any."""
    # one size of square for hole and picture: means over smaller ones differ more, and a hole would get no joints
    count = np.maximum(sums_around(known, reach), 1)
    means = [sums_around(np.where(known, plane, 0), reach) // count for plane in levels]
    return np.array(means, np.uint16).reshape(levels.shape)


def _places(shape: tuple[int, ...], corner: tuple[float, ...], step: float, top: int) -> NDArray[np.uint16]:
    """Return row and column of each pixel as levels (2, rows, cols), rounded; 0 if the corner is NaN."""
    places = np.indices(shape) + np.array(corner)[:, None, None]
    levels: NDArray[np.uint16] = np.rint(np.clip(np.nan_to_num(places) * step, 0, top)).astype(np.uint16)
    return levels


def _scaled(unit: NDArray[Any], height: float, most: int) -> NDArray[np.uint16]:
    levels: NDArray[np.uint16] = np.rint(unit * (height / most)).astype(np.uint16)
    return levels
