# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's description of a texture: histograms of its pixels and of its subbands, as sorted values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.methods.pyramid.pyramids import Transform

Sorted = NDArray[np.int32]
"""(bands, m): the values of each band in ascending order."""


@dataclass(frozen=True)
class Histograms:
    """The histograms of one channel, as sorted values.

    ``pixels`` (1, m) int32; ``subbands`` (bands, m) int32 each, in the order of the pyramid:
    `simdtex.methods.pyramid.pyramids.Transform.make`.
    """

    pixels: Sorted
    subbands: list[Sorted]


def histograms(machine: Machine, channel: NDArray[np.int32], *pyramids: Transform) -> Histograms:
    """Return the histograms of a channel (rows, cols) and of its pyramids, one after another: analysis-pyr."""
    picture = machine.put(channel[None])
    subbands = [band for pyramid in pyramids for band in pyramid.make(picture)]
    values = [np.asarray(machine.get(band)) for band in subbands]
    return Histograms(np.sort(channel.reshape(1, -1)), [np.sort(band.reshape(len(band), -1)) for band in values])


def average(parts: Sequence[Sorted], weights: Sequence[float]) -> Sorted:
    """Return the average of the counts of each value in histograms, band by band.

    ``parts`` (bands, m_i) int32 are sorted, as is the result (bands, m), m the largest m_i; ``weights`` are shares, not
    all 0.
    """
    kept = [(part, float(weight)) for part, weight in zip(parts, weights, strict=True) if weight]
    if len(kept) == 1:
        return kept[0][0]
    m = max(part.shape[1] for part, _ in kept)
    total = sum(weight for _, weight in kept)
    shares = np.concatenate([np.full(part.shape[1], weight / total / part.shape[1]) for part, weight in kept])
    values = np.concatenate([part for part, _ in kept], 1)
    averaged = np.empty((len(values), m), np.int32)
    for band, own in zip(averaged, values, strict=True):
        order = np.argsort(own, kind="stable")
        below = np.cumsum(shares[order])
        at = np.searchsorted(below, (np.arange(m) + 0.5) / m * below[-1])
        band[:] = own[order][np.minimum(at, own.size - 1)]
    return averaged


def averaged(textures: Sequence[Histograms], weights: Sequence[float]) -> Histograms:
    """Return the average of the histograms of two or more textures, see `average`."""
    subbands = zip(*(texture.subbands for texture in textures), strict=True)
    return Histograms(
        average([texture.pixels for texture in textures], weights),
        [average(parts, weights) for parts in subbands],
    )


def spliced(low: Histograms, high: Histograms, split: int) -> Histograms:
    """Return the low frequencies of one texture, and its pixels, with the high frequencies of another.

    ``split`` is the number of subbands from ``high``, which are the finest.
    """
    return Histograms(low.pixels, [*high.subbands[:split], *low.subbands[split:]])
