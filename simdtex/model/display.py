# SPDX-License-Identifier: BSD-3-Clause
"""False colours, pictures of labels, and the HTML of results for notebooks."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from html import escape
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import ArrayLike, NDArray

from simdtex.io.files import PathLike
from simdtex.io.image import Metadata, pillow_bytes, read, split_alpha, to_display, write
from simdtex.io.rasters import Georeference

Picture = NDArray[np.uint8]

OKABE_ITO = (
    *((0, 0, 0), (230, 159, 0), (86, 180, 233), (0, 158, 115)),
    *((240, 228, 66), (0, 114, 178), (213, 94, 0), (204, 121, 167)),
)
"""Black and seven colours that colour-blind people can distinguish, sRGB."""

# From light to dark in turn, so that neighbours differ in grey too; later categories begin again.
_CATEGORIES = ("#f2ead3", "#1f4e79", "#8fbf9f", "#d08c3a", "#7a5195", "#4a4a4a", "#b8d4e8", "#5c7a29")


def temperature_colours(temperature: ArrayLike) -> Picture:
    """Return temperatures as colours from near black (0, cold) to pale yellow (1, hot), sRGB in a last axis of 3."""
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
    """Return a colour for each position (rows, cols, 2) in the sample; a negative one is black.

    Neighbours in the sample have similar colours of one lightness: a copied patch is smooth, and a seam is an edge.
    """
    positions = np.asarray(source)
    extent = np.maximum(np.asarray(sample_shape[:2]) - 1, 1)
    across = np.clip(positions / extent, 0.0, 1.0) - 0.5
    colours = _srgb(np.full(positions.shape[:2], 0.72), 0.19 * across[..., 0], 0.19 * across[..., 1])
    colours[(positions < 0).any(axis=2)] = 0
    return colours


def use_colours(counts: NDArray[np.intp]) -> Picture:
    """Return a colour for each pixel of the sample by its number of uses u: log(1 + u) / log(1 + max u)."""
    uses = np.log1p(counts)
    return temperature_colours(uses / (uses.max() or 1.0))


def label_colours(count: int) -> Picture:
    """Return colours for labels 0 to count - 1, (count, 3) uint8: those of Okabe and Ito (2008), then distinct ones."""
    label = np.arange(len(OKABE_ITO), max(count, len(OKABE_ITO)))
    hue = label * np.pi * (3 - np.sqrt(5))  # the golden angle: consecutive labels have distinct hues
    lightness = 0.62 + 0.16 * (label % 3 - 1)
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


def write_labels(path: PathLike, labels: NDArray[np.uint8], place: Georeference | None = None) -> None:
    """Write labels (rows, cols) as the values of a picture; PNG and BMP have them as indices of `label_colours`."""
    write(path, labels, Metadata(palette=label_colours(256).tobytes(), geo=place))


def read_labels(path: PathLike, transparent: int = 0) -> NDArray[Any]:
    """Read labels (rows, cols): the values of a picture, or the indices of its palette; ``transparent`` where it is."""
    picture = read(path, palette=True)
    pixels, gone = split_alpha(picture.pixels, plain=picture.metadata.plain)
    if pixels.dtype.kind not in "iu" or (pixels.ndim == 3 and pixels.shape[2] > 1):
        raise ValueError(f"{os.fspath(path)} is no picture of labels; save it grey or with a palette, 0, 1, 2...")
    labels = pixels.reshape(pixels.shape[:2])
    return np.where(gone, transparent, labels) if gone.any() else labels


DISPLAYED_SIDE = 512
"""The longest side of a displayed picture, pixels; larger pictures are displayed by every n-th row and column."""

CELL = 12
"""Side of a neighbour in the picture of a neighbourhood, pixels."""


def as_html(made: NDArray[Any] | None, source: NDArray[np.int32] | None, statistics: dict[str, Any]) -> str:
    """Return HTML with a picture, or the middle slice of a solid, its source map of one sample, and statistics."""
    figures = []
    if made is not None:
        picture = _thinned(made[len(made) // 2] if made.ndim == 4 else made)
        figures.append(_figure(to_display(picture), "the middle slice" if made.ndim == 4 else "the picture"))
    if source is not None and source.shape[-1] == 2:
        sample = [int(last) + 1 for last in source.reshape(-1, 2).max(axis=0)]
        figures.append(_figure(source_colours(_thinned(source), (sample[0], sample[1])), "where from in the sample"))
    facts = [f"{statistics['seconds']:.2f} s"] if "seconds" in statistics else []
    facts += [f"on {statistics['device']}"] if "device" in statistics else []
    facts += [f"seed {statistics['seed']}"] if "seed" in statistics else []
    row = f'<div style="display:flex;flex-wrap:wrap;gap:1em">{"".join(figures)}</div>'
    return f"<div>{row}<p>{escape(', '.join(facts))}</p></div>"


def choice_html(
    offsets: NDArray[np.int32],
    near: NDArray[Any],
    certain: NDArray[np.float32],
    candidates: NDArray[Any],
    probability: NDArray[np.float64],
    captions: Sequence[str],
    text: str,
) -> str:
    """Return HTML with a neighbourhood, candidates with bars of their probabilities, and a text below them.

    Of the neighbours those in the site's layer are shown, the whiter the less ``certain``; ``candidates`` (n, 1 + N,
    channels) are pixels of each candidate and of its neighbours.
    """
    layer = np.flatnonzero((offsets[:, :-2] == 0).all(1) & offsets.any(1))
    radius = int(np.abs(offsets[:, -1]).max())
    row, col = (offsets[layer, -2:] + radius).T
    limits = (min(near.min(), candidates.min()), max(near.max(), candidates.max()))
    shown, patches = to_display(near[layer], limits), to_display(candidates, limits)

    def square(pixels: NDArray[np.uint8], centre: NDArray[np.uint8]) -> NDArray[np.uint8]:
        cells = np.full((2 * radius + 1, 2 * radius + 1, pixels.shape[-1]), 255, np.uint8)
        cells[row, col], cells[radius, radius] = pixels, centre
        return cells.repeat(CELL, 0).repeat(CELL, 1)

    known = np.clip(certain[layer, None], 0, 1)
    faded = np.rint(shown * known + 255 * (1 - known)).astype(np.uint8)
    figures = [
        _figure(square(faded, np.full(faded.shape[-1], 255, np.uint8)), "the neighbourhood; white is not certain")
    ]
    for patch, share, caption in zip(patches, probability, captions, strict=True):
        bar = f'<div style="height:6px;background:#36c;width:{100 * share:.3g}%"></div>'
        figure = _figure(square(patch[1 + layer], patch[0]), escape(caption))
        figures.append(f'<div style="max-width:14em">{figure}{bar}</div>')
    row_of = f'<div style="display:flex;flex-wrap:wrap;gap:1em">{"".join(figures)}</div>'
    return f"<div>{row_of}<pre>{escape(text)}</pre></div>"


def _thinned(array: NDArray[Any]) -> NDArray[Any]:
    step = -(-max(array.shape[:2]) // DISPLAYED_SIDE)
    return array[::step, ::step]


def _figure(picture: NDArray[np.uint8], caption: str) -> str:
    flat = picture[..., 0] if picture.shape[2] < 3 else picture[..., :3]
    data = b64encode(pillow_bytes(PIL.Image.fromarray(np.ascontiguousarray(flat)), "PNG")).decode()
    image = f'<img src="data:image/png;base64,{data}" alt="{caption}">'
    return f'<figure style="margin:0">{image}<figcaption>{caption}</figcaption></figure>'
