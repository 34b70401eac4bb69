# SPDX-License-Identifier: BSD-3-Clause
"""The frames of the live page: layers of a run or a result, and the window of a layer that the page shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import to_display
from simdtex.model.display import source_colours, temperature_colours, use_colours
from simdtex.model.source_map import counts
from simdtex.options import true_or_false, whole

Array = NDArray[Any]

MAX_PIXELS = 2**22
"""The most pixels of a frame."""

MAX_OFFSET = 2**20
"""The most rows or columns between the corner of a window and that of the layer."""

MAX_SIDE = 2**14
"""The most rows or columns of a frame."""

MAX_STEP = 2**9
"""The most rows and columns of a layer in one pixel of a frame."""

TILES = 3
"""Copies of a tiled layer along each axis: the layer and one on either side."""

CHUNK = 2**22
"""The most pixels of a layer that are averaged together, which bounds the memory."""


class Window(NamedTuple):
    """The part of a layer that the page shows.

    ``left`` and ``top`` are the first column and row in the layer, ``width`` and ``height`` the size of the frame. Each
    of its pixels is the mean of ``step`` x ``step`` pixels of the layer; ``tiled`` shows `TILES` x `TILES` copies of
    the layer.
    """

    layer: str = "picture"
    left: int = 0
    top: int = 0
    width: int = 256
    height: int = 256
    step: int = 1
    tiled: bool = False


class Layer(NamedTuple):
    """A picture from which frames are cut.

    ``shape`` are its rows and columns on the page; ``values`` are (rows, cols) or (rows, cols, channels), and may be
    smaller, at a coarse level; ``colours`` converts a part of them to 8-bit pixels.
    """

    shape: tuple[int, int]
    values: Array
    colours: Callable[[Array], NDArray[np.uint8]]


class Frame(NamedTuple):
    """The part of a window within its layer: its corner in the layer, its size in pixels, and RGBA bytes."""

    left: int
    top: int
    width: int
    height: int
    pixels: bytes


def parse_window(message: Mapping[str, Any]) -> Window:
    """Return the window in a message; raise ValueError or TypeError if the message has no valid one."""
    window = Window(**{name: message[name] for name in Window._fields if name in message})
    if not isinstance(window.layer, str):
        raise TypeError("the layer must be a name")
    for name in ("left", "top"):
        whole(name, getattr(window, name), -MAX_OFFSET, MAX_OFFSET)
    for name, most in (("width", MAX_SIDE), ("height", MAX_SIDE), ("step", MAX_STEP)):
        whole(name, getattr(window, name), 1, most)
    true_or_false("tiled", window.tiled)
    if window.width * window.height > MAX_PIXELS:
        raise ValueError(f"a window has at most {MAX_PIXELS} pixels; make it smaller")
    return window


def picture(pixels: Array, sample: Array, shape: tuple[int, int] | None = None) -> Layer:
    """Return a picture, (rows, cols[, channels]), as a layer; at a coarse level, ``shape`` is its size on the page.

    Black and white are the least and the largest value of ``sample``, unless the picture has 8 bits.
    """
    limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
    return Layer(shape or (pixels.shape[0], pixels.shape[1]), pixels, partial(to_display, limits=limits))


def overlay(
    pixels: Array,
    labels: NDArray[np.uint8],
    colours: NDArray[np.uint8],
    shares: Sequence[float],
    shape: tuple[int, int] | None = None,
) -> Layer:
    """Return a layer of a picture and the colours of its labels (rows, cols) over it.

    Each label has a colour in ``colours`` (labels, 3), which has a share in ``shares`` (labels,) of the pixel. At a
    coarse level, ``shape`` is the size of the picture on the page.
    """
    shown = picture(pixels, pixels).colours(pixels).reshape(*labels.shape, -1)
    shown = shown[..., :3] if shown.shape[2] > 2 else shown[..., :1]
    weights = np.asarray(shares, np.float32)[:, None]
    added = weights * colours

    def mixed(part: Array) -> NDArray[np.uint8]:
        own, label = part[..., :-1], part[..., -1]
        return (own * (1 - weights[label]) + added[label]).astype(np.uint8)

    size = shape or (labels.shape[0], labels.shape[1])
    return Layer(size, np.concatenate([shown, labels[..., None]], -1), mixed)


def layers(
    sample: Array,
    shape: tuple[int, int],
    image: Callable[[], Array],
    source: Callable[[], Array] | None = None,
    temperature: Callable[[], Array] | None = None,
) -> dict[str, Callable[[], Layer]]:
    """Return functions that make the layers of a run or a result, by name.

    ``shape`` are the rows and columns of the output, at any level. The functions ``image``, ``source`` and
    ``temperature`` return the arrays of the current level; they are None if the method has no such array.
    """
    found = {"picture": lambda: picture(image(), sample, shape)}
    if source:
        colours = partial(source_colours, sample_shape=sample.shape)
        found["arrangement"] = lambda: Layer(shape, source()[..., :2], colours)
        used = (sample.shape[0], sample.shape[1])
        found["use"] = lambda: Layer(used, use_colours(counts(source()[..., :2], sample.shape)), np.asarray)
    if temperature:
        found["temperature"] = lambda: Layer(shape, temperature(), temperature_colours)
    return found


def render(layer: Layer, window: Window, *, smooth: bool = True) -> Frame:
    """Return a window of a layer as RGBA; without ``smooth``, each pixel is the first of its step x step pixels."""
    fine = np.arange(window.step if smooth else 1)
    top, rows, row = _axis(window.top, window.height, window, fine, layer.shape[0], layer.values.shape[0])
    left, cols, col = _axis(window.left, window.width, window, fine, layer.shape[1], layer.values.shape[1])
    pixels = np.full((rows, cols, 4), 255, np.uint8)
    across = max(1, min(cols, CHUNK // len(fine) ** 2))
    down = max(1, CHUNK // (len(fine) ** 2 * across))
    for top_row, left_col in product(range(0, rows, down), range(0, cols, across)):
        part = pixels[top_row : top_row + down, left_col : left_col + across]
        begin, end = np.array([[top_row, left_col], [top_row + down, left_col + across]]) * len(fine)
        colours = layer.colours(layer.values[np.ix_(row[begin[0] : end[0]], col[begin[1] : end[1]])])
        colours = colours if colours.ndim == 3 else colours[..., None]
        colours = colours[..., :3] if colours.shape[2] > 2 else colours[..., :1]
        if len(fine) > 1:
            blocks = colours.reshape(part.shape[0], len(fine), part.shape[1], len(fine), colours.shape[2])
            colours = np.round(blocks.mean(axis=(1, 3), dtype=np.float32))
        part[..., :3] = colours
    return Frame(left, top, cols, rows, pixels.tobytes())


def thumbnail(layer: Layer, side: int) -> Frame:
    """Return a whole layer, reduced by an integer factor so that no side is longer than ``side`` pixels."""
    rows, cols = layer.shape
    step = -(-max(rows, cols) // side)
    return render(layer, Window(width=-(-cols // step), height=-(-rows // step), step=step))


def _axis(
    begin: int, count: int, window: Window, fine: NDArray[np.intp], size: int, stored: int
) -> tuple[int, int, NDArray[np.intp]]:
    """Return the begin of the frame on an axis of the layer, its pixels, and the indices of the values to average."""
    places = begin + window.step * np.arange(count)
    beside = size * (TILES // 2) if window.tiled else 0
    places = places[(places > -beside - window.step) & (places < size + beside)]
    index = (places[:, None] + fine).reshape(-1)
    index = index % size if window.tiled else index.clip(0, size - 1)
    side = next((2**level for level in range(16) if -(-size // 2**level) == stored), None)  # the spacing of its lattice
    index = index // side if side else index * stored // size
    return int(places[0]) if len(places) else begin, len(places), index
