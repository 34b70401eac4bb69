# SPDX-License-Identifier: BSD-3-Clause
"""What a page sees: a window of a plane, in the pixels of the screen and no more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.options import true_or_false, whole

MOST = 2**22
"""Pixels that a page is sent at once, at most."""

FARTHEST = 2**20
"""Rows or columns from the first one, at most."""

PART = 2**22
"""Pixels that are averaged together, at most."""


class Look(NamedTuple):
    """A window of a plane.

    ``layer`` what is looked at; ``left`` and ``top`` its first column and row, ``width`` and ``height`` in pixels that
    are shown, each the mean of ``step`` x ``step`` of the plane; ``tiled`` whether the plane repeats.
    """

    layer: str = "picture"
    left: int = 0
    top: int = 0
    width: int = 256
    height: int = 256
    step: int = 1
    tiled: bool = False


def parse(message: dict[str, Any]) -> Look:
    """The window that a message asks for; raises ValueError or TypeError where it is none."""
    look = Look(**{name: message[name] for name in Look._fields if name in message})
    if not isinstance(look.layer, str):
        raise TypeError("a layer has a name; choose one of those that are there")
    whole("left", look.left, -FARTHEST, FARTHEST)
    whole("top", look.top, -FARTHEST, FARTHEST)
    for name in ("width", "height", "step"):
        whole(name, getattr(look, name), 1, FARTHEST)
    true_or_false("tiled", look.tiled)
    if look.width * look.height > MOST:
        raise ValueError(f"a window has {MOST} pixels at most; make it smaller")
    return look


class Plane(NamedTuple):
    """What can be looked at.

    ``shape`` are its rows and columns as the page counts them; ``values`` may have fewer, of a coarse level, and are
    (rows, cols) or (rows, cols, channels); ``colours`` makes 8-bit pictures, (rows, cols[, channels]), of parts.
    """

    shape: tuple[int, int]
    values: NDArray[Any]
    colours: Callable[[NDArray[Any]], NDArray[np.uint8]]


class Seen(NamedTuple):
    """The part of a window that is within its plane: where it begins, its size in shown pixels, and RGBA bytes."""

    left: int
    top: int
    width: int
    height: int
    pixels: bytes


def seen(plane: Plane, look: Look, *, smooth: bool = True) -> Seen:
    """A window of a plane; without `smooth`, the first of step x step pixels stands for them."""
    rows, top = _axis(look.top, look.height, look.step, plane.shape[0], look.tiled)
    cols, left = _axis(look.left, look.width, look.step, plane.shape[1], look.tiled)
    picture = np.full((len(rows), len(cols), 4), 255, np.uint8)
    fine = look.step if smooth else 1
    down = max(1, PART // max(1, fine * fine * len(cols)))
    for first in range(0, len(rows), down):
        part = picture[first : first + down]
        own = _picked(plane, rows[first : first + down], cols, fine, look.tiled)
        part[..., :3] = own
    return Seen(left, top, len(cols), len(rows), picture.tobytes())


def _axis(begin: int, count: int, step: int, size: int, tiled: bool) -> tuple[NDArray[np.intp], int]:
    """The first rows of what is shown, and where it begins."""
    found = begin + step * np.arange(count)
    if not tiled:
        found = found[(found > -step) & (found < size)]
    return found, int(found[0]) if len(found) else begin


def _picked(plane: Plane, rows: NDArray[np.intp], cols: NDArray[np.intp], fine: int, tiled: bool) -> NDArray[np.uint8]:
    """Colours, (rows, cols, 3), each the mean of fine x fine pixels."""
    within = np.arange(fine)
    row, col = ((one[:, None] + within).reshape(-1) for one in (rows, cols))
    (height, width), sizes = plane.shape, plane.values.shape
    row, col = (row % height, col % width) if tiled else (row.clip(0, height - 1), col.clip(0, width - 1))
    found = plane.colours(plane.values[np.ix_(row * sizes[0] // height, col * sizes[1] // width)])
    colours = found[..., None] if found.ndim == 2 else found
    colours = colours[..., :3] if colours.shape[2] > 2 else np.broadcast_to(colours[..., :1], (*colours.shape[:2], 3))
    if fine == 1:
        return colours
    blocks = colours.reshape(len(rows), fine, len(cols), fine, 3)
    means: NDArray[np.float32] = blocks.mean(axis=(1, 3), dtype=np.float32)
    return np.round(means).astype(np.uint8)
