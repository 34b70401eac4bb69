# SPDX-License-Identifier: BSD-3-Clause
"""Colours without correlation, Heeger and Bergen's section 3.5: y = M (x - mean) with M = S^-1 U'."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simdtex.methods.pyramid.stretched import TOP

FINE = 2**14
"""Directions of axes are multiples of 2**-14, so that the last bit of a linear algebra library does not matter."""

INVERSE = 2**26
"""The inverse transform has multiples of 2**-26."""

BLOCK = 2**20
"""The most pixels that are summed together, so that sums of products fit 64 bits."""

FLAT = 2.0**-12
"""An axis with less than this share of the largest standard deviation is flat: it holds only rounding errors."""


@dataclass(frozen=True)
class Palette:
    """The decorrelating transform of one or more pictures.

    ``mean`` (C,) is on the stretched scale; ``axes`` (C, C) are U' in 2**-14, a row for each channel, the largest
    variance first; ``deviations`` (C,) are S, the standard deviation along each axis in 2**-14, or 0.
    """

    mean: NDArray[np.int64]
    axes: NDArray[np.int64]
    deviations: NDArray[np.float64]

    def decorrelated(self, planes: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return M (x - mean) of stretched planes (C, ...), with unit variance."""
        rotated = np.tensordot(self.axes, planes - self.mean.reshape(-1, *(1,) * (planes.ndim - 1)), 1)
        flat = self.deviations == 0
        divisor = np.where(flat, 1.0, self.deviations).reshape(-1, *(1,) * (planes.ndim - 1))
        return np.where(flat.reshape(divisor.shape), 0.0, rotated / divisor)

    def restored(self, channels: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return stretched planes (C, ...) from channels with unit variance: M^-1 y + mean.

        Flat axes are left out, so that grey stays grey to the bit. Sums are in the order of the channels, so that no
        bit depends on a library of linear algebra.
        """
        used = self.deviations > 0
        along = self.axes[used] / FINE
        back = np.rint(along.T @ np.linalg.inv(along @ along.T) * INVERSE) / INVERSE
        planes = np.empty(channels.shape, np.int32)
        for plane, row, mean in zip(planes, back, self.mean, strict=True):
            total = np.zeros(plane.shape)
            for weight, deviation, channel in zip(row, self.deviations[used], channels[used], strict=True):
                total += weight * (deviation / FINE) * channel
            plane[...] = np.clip(np.rint(total + mean), -(2**30), 2**30)
        return planes


def palette(pictures: Sequence[NDArray[np.int32]], weights: Sequence[float], decorrelate: bool = True) -> Palette:
    """Return the common decorrelating transform of pictures.

    ``pictures`` (C, rows, cols) int32 are stretched, on one scale; ``weights`` are the share of each in mean and
    covariance. Without ``decorrelate`` channels are only centred and scaled to unit variance. The covariance is a
    matrix of exact sums in integers, divided at the end.
    """
    shares = [float(weight) / float(sum(weights)) for weight in weights]
    means = [picture.reshape(len(picture), -1).mean(1, dtype=np.float64) for picture in pictures]
    mean = np.rint(sum(share * centre for share, centre in zip(shares, means, strict=True))).astype(np.int64)
    channels = len(mean)
    first, second = np.zeros(channels), np.zeros((channels, channels))
    for share, picture in zip(shares, pictures, strict=True):
        sums, products = _moments(picture, mean)
        first, second = first + share * sums, second + share * products
    covariance = second - first[:, None] * first
    axes = np.eye(channels, dtype=np.int64) * FINE
    if decorrelate and channels > 1:
        u, _, _ = np.linalg.svd(covariance)  # C = U S^2 U'
        u *= np.where(u[np.abs(u).argmax(0), np.arange(channels)] < 0, -1.0, 1.0)  # brighter is larger
        axes = np.rint(u.T * FINE).astype(np.int64)
    variances = np.zeros(channels)
    for i, j in np.ndindex(channels, channels):  # u' C u, in one order
        variances += axes[:, i] * covariance[i, j] * axes[:, j]
    deviations = np.sqrt(np.maximum(variances, 0.0))
    deviations[deviations <= FLAT * deviations.max(initial=0.0)] = 0.0
    return Palette(mean, axes, deviations)


def _moments(picture: NDArray[np.int32], about: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the means of x and of x x' about the integers ``about``, from sums in integers."""
    x = picture.reshape(len(picture), -1)
    sums, products = np.zeros(len(x), object), np.zeros((len(x), len(x)), object)
    for first in range(0, x.shape[1], BLOCK):
        part = x[:, first : first + BLOCK] - about[:, None]
        sums += part.sum(1).astype(object)
        products += np.array([[(a * b).sum() for b in part] for a in part]).astype(object)
    count = x.shape[1]
    return (sums / count).astype(np.float64), (products / count).astype(np.float64)


@dataclass(frozen=True)
class Decorrelated:
    """Pictures as decorrelated ``channels`` (C, rows, cols) in integers, whose largest value is 2**20, or 0 if flat.

    ``spans`` (C,) are the standard deviations that 2**20 represents.
    """

    channels: list[NDArray[np.int32]]
    spans: NDArray[np.float64]

    def normalised(self, channels: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return channels (C, ...) in standard deviations."""
        return channels * (self.spans / TOP).reshape(-1, *(1,) * (channels.ndim - 1))


def decorrelated(pictures: Sequence[NDArray[np.int32]], palettes: Sequence[Palette]) -> Decorrelated:
    """Return pictures (C, rows, cols) under one palette each, on one scale."""
    normal = [palette.decorrelated(picture) for palette, picture in zip(palettes, pictures, strict=True)]
    spans = np.array([np.abs(channels).max((1, 2)) for channels in normal]).max(0)
    scale = np.where(spans == 0, 0.0, TOP / np.where(spans == 0, 1.0, spans)).reshape(-1, 1, 1)
    return Decorrelated([np.rint(channels * scale).astype(np.int32) for channels in normal], spans)
