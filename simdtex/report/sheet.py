# SPDX-License-Identifier: BSD-3-Clause
"""Contact sheets and animations, all 8-bit and all for the eye alone."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from numpy.typing import ArrayLike, NDArray

from simdtex.io.atomic import atomic_path
from simdtex.io.image import check_writable, pillow_bytes, to_display, write

__all__ = [
    "animation",
    "contact_sheet",
    "encoded",
    "enlarged",
    "fitted",
    "reduction",
    "thinned",
]

Picture = NDArray[np.uint8]
PathLike = str | os.PathLike[str]

LEAST_SIDE = 96  # a picture smaller than this is enlarged on a sheet, pixels
MOST_SIDE = 1024  # a picture larger than this is reduced on a sheet, pixels
GAP = 8  # between the cells of a sheet, pixels
TEXT = 13  # height of a label's letters, pixels
FRAMES = 200  # most frames of an animation
FRAME_SIDE = 512  # longest side of an animation's frames, pixels


# ---------------------------------------------------------------- sheets


def contact_sheet(
    pictures: Sequence[tuple[str, ArrayLike]],
    path: PathLike | None = None,
    *,
    columns: int | None = None,
    captions: Sequence[str] | None = None,
    one_to_one: bool = False,
) -> Picture:
    """Lay labelled pictures out on one sheet, each under its label.

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
    one_to_one : bool
        Whether pictures of any size stand as they are.

    Returns
    -------
    ndarray of uint8, (rows, cols, 3)
        Pictures stand at their own size; unless `one_to_one` is given, those of less than 96
        pixels are enlarged by a whole factor without smoothing, those of more than 1024 reduced.

    Raises
    ------
    ValueError
        There are no pictures, `columns` is less than 1, captions are more or fewer than pictures,
        or `path` cannot be written.
    """
    if not pictures:
        raise ValueError("there are no pictures for the sheet: give at least one")
    if columns is not None and columns < 1:
        raise ValueError(f"columns is {columns}: give 1 or more")
    if path is not None:
        check_writable(path, np.uint8, 3)
    below = [""] * len(pictures) if captions is None else list(captions)
    if len(below) != len(pictures):
        raise ValueError(f"there are {len(below)} captions for {len(pictures)} pictures: give one for each")
    plain = [(label, _rgb(to_display(picture))) for label, picture in pictures]
    shown = plain if one_to_one else [(label, _cell(picture)) for label, picture in plain]
    font = PIL.ImageFont.load_default(TEXT)
    strip = TEXT + 6
    height = max(picture.shape[0] for _, picture in shown) + strip + (0 if captions is None else strip) + GAP
    texts = [*(label for label, _ in shown), *below]
    width = GAP + max(*(picture.shape[1] for _, picture in shown), *(ceil(font.getlength(text)) for text in texts))
    across = columns or max(1, round(float(np.sqrt(len(shown) * height / width))))
    across = min(across, len(shown))
    down = -(-len(shown) // across)
    sheet = PIL.Image.new("RGB", (GAP + across * width, GAP + down * height), "white")
    draw = PIL.ImageDraw.Draw(sheet)
    for number, ((label, picture), caption) in enumerate(zip(shown, below, strict=True)):
        top, left = GAP + number // across * height, GAP + number % across * width
        draw.text((left, top), label, fill="black", font=font)
        sheet.paste(PIL.Image.fromarray(picture), (left, top + strip))
        draw.text((left, top + strip + picture.shape[0] + 2), caption, fill="black", font=font)
    pixels = np.array(sheet, dtype=np.uint8)
    if path is not None:
        write(path, pixels)
    return pixels


def _cell(picture: Picture) -> Picture:
    factor = -(-LEAST_SIDE // max(picture.shape[:2]))
    if factor > 1:
        return picture.repeat(factor, axis=0).repeat(factor, axis=1)
    return fitted(picture, MOST_SIDE)


def _rgb(picture: Picture) -> Picture:
    if picture.ndim == 2:
        picture = picture[..., np.newaxis]
    if picture.shape[2] < 3:  # grey, or grey and alpha
        return np.repeat(picture[..., :1], 3, axis=2)
    return np.ascontiguousarray(picture[..., :3])


def encoded(picture: Picture) -> bytes:
    """A picture (rows, cols[, channels]) as the bytes of a PNG."""
    buffer = io.BytesIO()
    PIL.Image.fromarray(picture).save(buffer, format="PNG")
    return buffer.getvalue()


def reduction(shape: tuple[int, ...], side: int) -> int:
    """Give the whole factor by which `fitted` reduces a picture of that shape."""
    return -(-max(shape[:2]) // side)


def fitted(picture: Picture, side: int) -> Picture:
    """Reduce a picture by a whole factor so that neither side is longer than `side` pixels.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, cols[, channels])
    side : int
        Pixels.

    Returns
    -------
    ndarray of uint8, (rows, cols[, channels])
        Means of square blocks; the picture itself where it fits.
    """
    factor = reduction(picture.shape, side)
    if factor == 1:
        return picture
    for axis in (0, 1):
        starts = np.arange(0, picture.shape[axis], factor)
        counts = np.diff(np.append(starts, picture.shape[axis]))
        sums = np.add.reduceat(picture.astype(np.float32), starts, axis=axis)
        shape = [-1 if i == axis else 1 for i in range(picture.ndim)]
        picture = np.round(sums / counts.reshape(shape)).astype(np.uint8)
    return picture


def enlarged(picture: Picture, shape: tuple[int, int], step: float) -> Picture:
    """Show a decimated picture at full size, each of its pixels as a square without smoothing.

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


def animation(frames: Iterable[ArrayLike], path: PathLike, *, ms: int = 120) -> None:
    """Write frames as an animation that repeats for ever.

    Parameters
    ----------
    frames : iterable of (rows, cols[, channels])
        All of one shape. They are reduced to at most 512 pixels a side, and of more than 200
        evenly spread ones are kept, with the last.
    path : path
        ``.gif``, ``.webp``, ``.apng`` or ``.png`` (an APNG).
    ms : int
        Time of one frame, milliseconds.

    Raises
    ------
    ValueError
        There are no frames, they differ in shape, `ms` is less than 1, or `path` cannot be
        written.

    Notes
    -----
    Holds at most 400 reduced frames, 315 MB for the largest in colour.
    """
    check_writable(path, suffixes=(".gif", ".webp", ".apng", ".png"))
    if ms < 1:
        raise ValueError(f"ms is {ms}: give the time of a frame, 1 millisecond or more")
    kept = thinned(fitted(_rgb(to_display(frame)), FRAME_SIDE) for frame in frames)
    if not kept:
        raise ValueError("there are no frames for the animation: give at least one")
    if len({frame.shape for frame in kept}) > 1:
        raise ValueError("the frames differ in shape: enlarge them to one shape first")
    pictures = [PIL.Image.fromarray(frame) for frame in kept]
    suffix = Path(path).suffix.lower()
    kind = {".gif": "GIF", ".webp": "WEBP"}.get(suffix, "PNG")
    options: dict[str, Any] = {"lossless": True} if kind == "WEBP" else {}
    with atomic_path(path) as temporary:
        more: dict[str, Any] = {"save_all": True, "append_images": pictures[1:], "duration": ms, "loop": 0}
        temporary.write_bytes(pillow_bytes(pictures[0], kind, **more, **options))


def thinned(frames: Iterable[Picture]) -> list[Picture]:
    """Keep at most about 200 frames, evenly spread, and always the last."""
    kept: list[Picture] = []
    every, last = 1, None
    for number, frame in enumerate(frames):
        last = frame
        if number % every == 0:
            kept.append(frame)
        if len(kept) == FRAMES:
            kept, every = kept[::2], every * 2
    return kept if last is None or kept[-1] is last else [*kept, last]
