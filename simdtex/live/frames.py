# SPDX-License-Identifier: BSD-3-Clause
"""The frames of the live page: layers of a run or a result, and the view of a layer that the page shows."""

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

MAX_PIXELS = 2**22  # of a frame
MAX_SIDE = 2**14  # of a frame, pixels
MAX_OFFSET = 2**20  # rows or columns between the corner of a view and that of the layer
MAX_STEP = 2**9
CHUNK = 2**22  # pixels of a layer that are averaged together, which bounds the memory


class View(NamedTuple):
    """The part of a layer that the page shows."""

    layer: str = "picture"
    left: int = 0  # its corner in the layer
    top: int = 0
    width: int = 256  # of the frame
    height: int = 256
    step: int = 1  # rows and columns of the layer whose mean is a pixel of the frame
    tiled: bool = False  # shows 3 x 3 copies of the layer


class Layer(NamedTuple):
    """A picture from which frames are cut."""

    shape: tuple[int, int]  # on the page
    values: Array  # (rows, cols[, channels]), fewer at a coarse level
    colours: Callable[[Array], NDArray[np.uint8]]


class ViewFrame(NamedTuple):
    """The pixels of a view within its layer: the corner in the layer, the size in pixels, and RGBA bytes."""

    left: int
    top: int
    width: int
    height: int
    pixels: bytes


def parse_view(message: Mapping[str, Any]) -> View:
    """Return the view in a message; raise ValueError or TypeError if the message has no valid one."""
    view = View(**{name: message[name] for name in View._fields if name in message})
    if not isinstance(view.layer, str):
        raise TypeError("the layer must be a name")
    for name in ("left", "top"):
        whole(name, getattr(view, name), -MAX_OFFSET, MAX_OFFSET)
    for name, most in (("width", MAX_SIDE), ("height", MAX_SIDE), ("step", MAX_STEP)):
        whole(name, getattr(view, name), 1, most)
    true_or_false("tiled", view.tiled)
    if view.width * view.height > MAX_PIXELS:
        raise ValueError(f"a window has at most {MAX_PIXELS} pixels; make it smaller")
    return view


def picture(pixels: Array, sample: Array, shape: tuple[int, int] | None = None) -> Layer:
    """Return a picture as a layer, black at the least value of ``sample``, white at the largest, unless of 8 bits."""
    limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
    return Layer(shape or (pixels.shape[0], pixels.shape[1]), pixels, partial(to_display, limits=limits))


def overlay(
    pixels: Array,
    labels: NDArray[np.uint8],
    colours: NDArray[np.uint8],
    shares: Sequence[float],
    shape: tuple[int, int] | None = None,
) -> Layer:
    """Return a layer of a picture and, over it, of the ``colours`` of its labels, each with a share of the pixel."""
    shown = picture(pixels, pixels).colours(pixels).reshape(*labels.shape, -1)
    shown = shown[..., :3] if shown.shape[2] > 2 else shown[..., :1]
    weights = np.asarray(shares, np.float32)[:, None]
    added = weights * colours

    def mixed(part: Array) -> NDArray[np.uint8]:
        below, label = part[..., :-1], part[..., -1]
        return (below * (1 - weights[label]) + added[label]).astype(np.uint8)

    size = shape or (labels.shape[0], labels.shape[1])
    return Layer(size, np.concatenate([shown, labels[..., None]], -1), mixed)


def layers(
    sample: Array,
    shape: tuple[int, int],
    image: Callable[[], Array],
    source: Callable[[], Array] | None = None,
    temperature: Callable[[], Array] | None = None,
) -> dict[str, Callable[[], Layer]]:
    """Return functions that make the layers of a run or a result from the arrays of its current level, by name."""
    made = {"picture": lambda: picture(image(), sample, shape)}
    if source:
        colours = partial(source_colours, sample_shape=sample.shape)
        made["arrangement"] = lambda: Layer(shape, source()[..., :2], colours)
        used = (sample.shape[0], sample.shape[1])
        made["use"] = lambda: Layer(used, use_colours(counts(source()[..., :2], sample.shape)), np.asarray)
    if temperature:
        made["temperature"] = lambda: Layer(shape, temperature(), temperature_colours)
    return made


def render(layer: Layer, view: View, *, smooth: bool = True) -> ViewFrame:
    """Return a view of a layer as RGBA; without ``smooth``, each pixel is the first of its step x step pixels."""
    fine = np.arange(view.step if smooth else 1)
    top, rows, row = _axis(view.top, view.height, view, fine, layer.shape[0], layer.values.shape[0])
    left, cols, col = _axis(view.left, view.width, view, fine, layer.shape[1], layer.values.shape[1])
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
    return ViewFrame(left, top, cols, rows, pixels.tobytes())


def thumbnail(layer: Layer, side: int) -> ViewFrame:
    """Return a whole layer, reduced by an integer factor so that no side is longer than ``side`` pixels."""
    rows, cols = layer.shape
    step = -(-max(rows, cols) // side)
    return render(layer, View(width=-(-cols // step), height=-(-rows // step), step=step))


def _axis(
    begin: int, count: int, view: View, fine: NDArray[np.intp], size: int, stored: int
) -> tuple[int, int, NDArray[np.intp]]:
    """Return the begin of the frame on an axis of the layer, its pixels, and the indices of the values to average."""
    places = begin + view.step * np.arange(count)
    beside = size if view.tiled else 0
    places = places[(places > -beside - view.step) & (places < size + beside)]
    index = (places[:, None] + fine).reshape(-1)
    index = index % size if view.tiled else index.clip(0, size - 1)
    side = next((2**level for level in range(16) if -(-size // 2**level) == stored), None)  # the spacing of its lattice
    index = index // side if side else index * stored // size
    return int(places[0]) if len(places) else begin, len(places), index
