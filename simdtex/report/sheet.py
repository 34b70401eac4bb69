# SPDX-License-Identifier: BSD-3-Clause
"""Contact sheets and animations: 8-bit pictures for the eye alone."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from math import ceil
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from numpy.typing import ArrayLike, NDArray

from simdtex.io.atomic import atomic_path
from simdtex.io.image import check_writable, pillow_bytes, to_display, write

__all__ = ["animation", "contact_sheet", "encoded", "enlarged", "fitted", "magnified", "reduction"]

Picture = NDArray[np.uint8]
PathLike = str | os.PathLike[str]

LEAST_SIDE = 96  # a smaller picture is enlarged on a sheet, pixels
MOST_SIDE = 1024  # a larger picture is reduced on a sheet, pixels
GAP = 8  # between the cells of a sheet, pixels
TEXT = 13  # height of a label's letters, pixels
STRIP = TEXT + 6  # height of a line of text, pixels
FRAME_SIDE = 512  # longest side of an animation's frames, pixels
FRAME_MS = 120  # time of one frame, milliseconds


def contact_sheet(
    pictures: Sequence[tuple[str, ArrayLike]],
    path: PathLike | None = None,
    *,
    columns: int | None = None,
    captions: Sequence[str] | None = None,
    scale: int | None = None,
) -> Picture:
    """Arrange labelled pictures on one sheet, each under its label.

    Parameters
    ----------
    pictures : sequence of (label, picture)
        Pictures are (rows, cols) or (rows, cols, channels) of any size and type; types other than
        uint8 are stretched over their own range, channels past the third are not shown.
    path : path, optional
        Where to write the sheet as well; the suffix names the format.
    columns : int, optional
        Pictures in a row; by default as many as make the sheet about square.
    captions : sequence of str, optional
        A line below each picture.
    scale : int, optional
        The factor by which every picture is enlarged, without smoothing. By default pictures of
        less than 96 pixels are enlarged to 96 or more, those of more than 1024 are reduced.

    Returns
    -------
    ndarray of uint8, (rows, cols, 3)

    Raises
    ------
    ValueError
        There are no pictures, `columns` is less than 1, or `path` cannot be written.
    """
    if not pictures:
        raise ValueError("there are no pictures for the sheet: give at least one")
    if columns is not None and columns < 1:
        raise ValueError(f"columns is {columns}: give 1 or more")
    if path is not None:
        check_writable(path, np.uint8, 3)
    labels = [label for label, _ in pictures]
    below = [""] * len(pictures) if captions is None else captions
    shown = [_scaled(rgb(picture), scale) for _, picture in pictures]
    font = PIL.ImageFont.load_default(TEXT)
    height = max(len(picture) for picture in shown) + STRIP * (1 if captions is None else 2) + GAP
    width = GAP + max(*(len(p[0]) for p in shown), *(ceil(font.getlength(text)) for text in (*labels, *below)))
    across = min(columns or max(1, round((len(shown) * height / width) ** 0.5)), len(shown))
    sheet = PIL.Image.new("RGB", (GAP + across * width, GAP + ceil(len(shown) / across) * height), "white")
    draw = PIL.ImageDraw.Draw(sheet)
    for number, (label, picture, caption) in enumerate(zip(labels, shown, below, strict=True)):
        top, left = GAP + number // across * height, GAP + number % across * width
        draw.text((left, top), label, fill="black", font=font)
        sheet.paste(PIL.Image.fromarray(picture), (left, top + STRIP))
        draw.text((left, top + STRIP + len(picture) + 2), caption, fill="black", font=font)
    pixels = np.array(sheet, dtype=np.uint8)
    if path is not None:
        write(path, pixels)
    return pixels


def _scaled(picture: Picture, scale: int | None) -> Picture:
    if scale is None:
        scale = -(-LEAST_SIDE // max(picture.shape[:2]))
        picture = fitted(picture, MOST_SIDE)
    return magnified(picture, scale)


def rgb(picture: ArrayLike) -> Picture:
    """Return a picture of any type, (rows, cols[, channels]), as one to display, (rows, cols, 3)."""
    shown = np.atleast_3d(to_display(picture))
    return np.ascontiguousarray(shown[..., :3] if shown.shape[2] >= 3 else shown[..., [0, 0, 0]])


def encoded(picture: Picture) -> bytes:
    """Return a picture, (rows, cols[, channels]), as the bytes of a PNG."""
    buffer = io.BytesIO()
    PIL.Image.fromarray(picture).save(buffer, format="PNG")
    return buffer.getvalue()


def magnified(picture: Picture, factor: int) -> Picture:
    """Return a picture with each pixel as a square of `factor` pixels a side."""
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def reduction(shape: tuple[int, ...], side: int) -> int:
    """Return the whole factor by which `fitted` reduces a picture of a shape."""
    return -(-max(shape[:2]) // side)


def fitted(picture: Picture, side: int) -> Picture:
    """Return the means of square blocks of a picture, so that no side is longer than `side` pixels.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, cols) or (rows, cols, 3)
    side : int
        Pixels.

    Returns
    -------
    ndarray of uint8, (rows, cols) or (rows, cols, 3)
        The picture itself if it fits.
    """
    factor = reduction(picture.shape, side)
    return picture if factor == 1 else np.array(PIL.Image.fromarray(picture).reduce(factor))


def enlarged(picture: Picture, shape: tuple[int, int], step: float) -> Picture:
    """Return a decimated picture at full size, each of its pixels as a square without smoothing.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, cols[, channels])
        Pixel (i, j) stands for the full picture's sites from (step i, step j) on.
    shape : (rows, cols)
        Of the result.
    step : float
        Pixels of the result per pixel of `picture`, 1 or more.

    Returns
    -------
    ndarray of uint8, (rows, cols[, channels])
    """
    rows, cols = (
        np.minimum((np.arange(length) / step).astype(np.intp), limit - 1)
        for length, limit in zip(shape, picture.shape[:2], strict=True)
    )
    return np.asarray(picture[rows[:, np.newaxis], cols], dtype=np.uint8)


def animation(frames: Iterable[ArrayLike], path: PathLike) -> None:
    """Write frames as a GIF animation that repeats for ever.

    Parameters
    ----------
    frames : iterable of (rows, cols[, channels])
        All of one shape; reduced to at most 512 pixels a side.
    path : path
        ``.gif``

    Raises
    ------
    ValueError
        There are no frames, or `path` cannot be written.

    Notes
    -----
    Holds all reduced frames, 0.8 MB each for the largest.
    """
    check_writable(path, suffixes=(".gif",))
    pictures = [PIL.Image.fromarray(fitted(rgb(frame), FRAME_SIDE)) for frame in frames]
    if not pictures:
        raise ValueError("there are no frames for the animation: give at least one")
    film: dict[str, Any] = {"save_all": True, "append_images": pictures[1:], "duration": FRAME_MS, "loop": 0}
    with atomic_path(path) as temporary:
        temporary.write_bytes(pillow_bytes(pictures[0], "GIF", **film))
