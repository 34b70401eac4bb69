# SPDX-License-Identifier: BSD-3-Clause
"""False colours for temperatures, source maps, the use of the sample, and labels."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Picture = NDArray[np.uint8]

OKABE_ITO = (
    *((0, 0, 0), (230, 159, 0), (86, 180, 233), (0, 158, 115)),
    *((240, 228, 66), (0, 114, 178), (213, 94, 0), (204, 121, 167)),
)
"""Black and seven colours that colour-blind people can distinguish, sRGB."""

# From light to dark in turn, so that neighbours differ in grey too; later categories begin again.
_CATEGORIES = ("#f2ead3", "#1f4e79", "#8fbf9f", "#d08c3a", "#7a5195", "#4a4a4a", "#b8d4e8", "#5c7a29")


def temperature_colours(temperature: ArrayLike) -> Picture:
    """Return temperatures as colours from near black (0, cold) to pale yellow (1, hot), sRGB in a last axis of 3.

    Values outside 0 to 1 are clipped. Lightness grows in equal perceptual steps, so the map also reads in grey.
    """
    share = np.clip(np.asarray(temperature, dtype=np.float64), 0.0, 1.0)
    return _temperature_table()[np.round(share * 255.0).astype(np.intp)]


@cache
def _temperature_table() -> Picture:
    t = np.linspace(0.0, 1.0, 256)
    # a path through OKLab: lightness a straight line, hue from violet over red to yellow
    lightness = 0.16 + 0.79 * t
    hue = np.radians(290.0 + 180.0 * t)
    chroma = np.interp(t, [0.0, 0.3, 0.55, 0.8, 1.0], [0.03, 0.13, 0.18, 0.15, 0.10])
    return _srgb(lightness, chroma * np.cos(hue), chroma * np.sin(hue))


def source_colours(source: ArrayLike, sample_shape: tuple[int, ...]) -> Picture:
    """Return a colour for each output pixel by its position in the sample, (rows, cols, 3) uint8.

    ``source`` (rows, cols, 2) are rows and columns in the sample; a negative position is black. Neighbours in the
    sample have similar colours of one lightness, so a copied patch is a smooth area and a seam is an edge.
    """
    positions = np.asarray(source)
    extent = np.maximum(np.asarray(sample_shape[:2]) - 1, 1)
    across = np.clip(positions / extent, 0.0, 1.0) - 0.5
    colours = _srgb(np.full(positions.shape[:2], 0.72), 0.19 * across[..., 0], 0.19 * across[..., 1])
    colours[(positions < 0).any(axis=2)] = 0
    return colours


def use_colours(counts: NDArray[np.intp]) -> Picture:
    """Return a colour for each pixel of the sample by its number of uses, (sample rows, sample cols, 3) uint8.

    The colours are those of `temperature_colours` for log(1 + u) / log(1 + max u), where u is the number of uses from
    `simdtex.model.use.counts`: near black for a pixel that was never taken, pale yellow for the most used one.
    """
    uses = np.log1p(counts)
    return temperature_colours(uses / (uses.max() or 1.0))


def label_colours(count: int) -> Picture:
    """Return colours for labels 0 to count - 1, (count, 3) uint8: black for 0, and distinct colours for all others.

    Labels 1 to 7 have the colours of Okabe and Ito (2008), which colour-blind people can distinguish, too.
    """
    number = np.arange(len(OKABE_ITO), max(count, len(OKABE_ITO)))
    hue = number * np.pi * (3 - np.sqrt(5))  # the golden angle: consecutive labels have distinct hues
    lightness = 0.62 + 0.16 * (number % 3 - 1)
    more = _srgb(lightness, 0.13 * np.cos(hue), 0.13 * np.sin(hue))
    return np.concatenate([np.array(OKABE_ITO, np.uint8), more])[:count]


def category_colours(count: int) -> Picture:
    """Return the colours of the categories of a training image, (count, 3) uint8."""
    table = np.array([list(bytes.fromhex(colour[1:])) for colour in _CATEGORIES], np.uint8)
    return table[np.arange(count) % len(table)]


def _srgb(lightness: NDArray[Any], a: NDArray[Any], b: NDArray[Any]) -> Picture:
    # OKLab to sRGB, B. Ottosson, "A perceptual color space for image processing", 2020
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    linear = np.stack(
        [
            4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
            -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
            -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short,
        ],
        axis=-1,
    ).clip(0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(curve * 255.0).astype(np.uint8)
