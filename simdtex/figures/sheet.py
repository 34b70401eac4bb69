# SPDX-License-Identifier: BSD-3-Clause
"""Contact sheets and the stages of a run: 8-bit pictures for viewing only."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from numpy.typing import ArrayLike, NDArray

from simdtex.io.files import earlier_files
from simdtex.io.image import check_writable, to_display, write
from simdtex.model.display import temperature_colours
from simdtex.run import Progress

Picture = NDArray[np.uint8]
PathLike = str | os.PathLike[str]

LEAST_SIDE = 96  # a smaller picture is enlarged on a sheet, pixels
MOST_SIDE = 1024  # a larger picture is reduced on a sheet, pixels
PART = 1024  # of a picture that is read part by part, this much at a time, pixels a side
SHOWN_SIDE = 256  # smaller pictures are enlarged by a whole factor to about this, pixels
GAP = 8  # between the cells of a sheet, pixels
TEXT = 13  # height of a label's letters, pixels
STRIP = TEXT + 6  # height of a line of text, pixels


def contact_sheet(
    pictures: Sequence[tuple[str, ArrayLike]],
    path: PathLike | None = None,
    *,
    columns: int | None = None,
    captions: Sequence[str] | None = None,
    scale: int | None = None,
) -> Picture:
    """Return labelled pictures on one sheet, (rows, cols, 3) uint8, each under its label.

    Pictures are (rows, cols[, channels]) of any size and type; types other than uint8 are stretched over their own
    range, channels past the third are not shown. By default as many ``columns`` as make the sheet about square.
    ``captions`` are a line below each picture. ``scale`` enlarges every picture by a whole factor, without smoothing;
    by default pictures of less than 96 pixels are enlarged to 96 or more, those of more than 1024 are reduced. The
    sheet is written to ``path`` as well; the suffix names the format.
    """
    if not pictures:
        raise ValueError("there are no pictures for the sheet: give at least one")
    labels = [label for label, _ in pictures]
    below = [""] * len(pictures) if captions is None else captions
    shown = [_scaled(rgb(picture), scale) for _, picture in pictures]
    font = PIL.ImageFont.load_default(TEXT)
    heights = [len(picture) + STRIP * (1 if captions is None else 2) + GAP for picture in shown]
    width = GAP + max(*(len(p[0]) for p in shown), *(ceil(font.getlength(text)) for text in (*labels, *below)))
    across = min(columns or max(1, round((len(shown) * max(heights) / width) ** 0.5)), len(shown))
    rows = [max(heights[first : first + across]) for first in range(0, len(shown), across)]
    sheet = PIL.Image.new("RGB", (GAP + across * width, GAP + sum(rows)), "white")
    draw = PIL.ImageDraw.Draw(sheet)
    for place, (label, picture, caption) in enumerate(zip(labels, shown, below, strict=True)):
        top, left = GAP + sum(rows[: place // across]), GAP + place % across * width
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


def view(volume: ArrayLike, path: PathLike | None = None, size: int = 360) -> Picture:
    """Return pictures of a solid texture on one sheet: its first faces as a cube, and its middle slices.

    Parameters
    ----------
    volume : array_like, (depth, rows, cols) or (depth, rows, cols, channels)
        Types other than uint8 are stretched over their own range. Of three channels or more the first three are shown
        as colours, else the first as grey.
    path : path, optional
        A file for the sheet; the suffix names the format.
    size : int
        The most pixels of the longest side of a picture, 96 to 1024.

    Returns
    -------
    ndarray of uint8, (rows, cols, 3)
        The block with its first slice in front, its first rows above and its last columns to the right, two slices
        deep for each pixel; then the middle x-y, x-z and y-z slices. All have one scale.

    Raises
    ------
    ValueError
        The volume has another number of axes or is empty, `size` is out of range, or `path` cannot be written.
    """
    block = np.asarray(volume)
    if block.ndim not in (3, 4) or block.size == 0:
        raise ValueError(f"the volume has the shape {block.shape}: give (depth, rows, cols[, channels])")
    if not LEAST_SIDE <= size <= MOST_SIDE:
        raise ValueError(f"size is {size}: give {LEAST_SIDE} to {MOST_SIDE} pixels")
    if path is not None:
        check_writable(path, np.uint8, 3)  # before the work
    block = to_display(block[..., :3] if block.ndim == 4 else block)
    (rows, cols), behind = block.shape[1:3], (len(block) - 1) // 2
    cube = np.full((behind + rows, behind + cols, 3), 255, np.uint8)
    for z in reversed(range(len(block))):  # those in front hide the others but for their first rows and last columns
        cube[behind - z // 2 :, z // 2 :][:rows, :cols] = rgb(block[z]) if z == 0 else rgb(block[z]) // 4 * 3
    z, y, x = (n // 2 for n in block.shape[:3])
    pictures = {
        "block": cube,
        f"x-y slice, z = {z}": rgb(block[z]),
        f"x-z slice, y = {y}": rgb(block[:, y]),
        f"y-z slice, x = {x}": rgb(block[:, :, x]),
    }
    longest = max(*cube.shape[:2], len(block))
    least, most = -(-longest // size), max(1, size // longest)  # whole factors that reduce and enlarge all
    shown = [(name, magnified(fitted(part, -(-max(part.shape[:2]) // least)), most)) for name, part in pictures.items()]
    return contact_sheet(shown, path, columns=4, scale=1)


def rgb(picture: ArrayLike) -> Picture:
    """Return a picture of any type, (rows, cols[, channels]), as one to display, (rows, cols, 3)."""
    shown = np.atleast_3d(to_display(picture))
    return np.ascontiguousarray(shown[..., :3] if shown.shape[2] >= 3 else shown[..., [0, 0, 0]])


def magnified(picture: Picture, factor: int) -> Picture:
    """Return a picture with each pixel as a square of `factor` pixels a side."""
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def fitted(picture: Picture, side: int) -> Picture:
    """Return the means of square blocks of a picture (rows, cols[, 3]), with sides of at most `side` pixels."""
    factor = reduction(picture.shape, side)
    return picture if factor == 1 else np.array(PIL.Image.fromarray(picture).reduce(factor))


def reduction(shape: tuple[int, ...], side: int | None = None) -> int:
    """Return the factor that reduces a picture of ``shape`` to ``side``, by default to that of a sheet."""
    return -(-max(shape[:2]) // (side or MOST_SIDE))


def parts(shape: tuple[int, ...], multiple: int = 1) -> Iterator[tuple[slice, slice]]:
    """Yield the squares that cover a picture, row by row; their sides are multiples of ``multiple``, about `PART`."""
    side = multiple * max(1, PART // multiple)
    for top in range(0, shape[0], side):
        for left in range(0, shape[1], side):
            yield slice(top, min(top + side, shape[0])), slice(left, min(left + side, shape[1]))


def read_fitted(array: Any, show: Callable[[NDArray[Any]], Picture]) -> Picture:
    """Return a picture that fits on a sheet, `fitted` of ``show(array)``, of an array that is read part by part."""
    factor = reduction(array.shape)
    sheet = np.zeros((ceil(array.shape[0] / factor), ceil(array.shape[1] / factor), 3), np.uint8)
    for rows, cols in parts(array.shape, factor):
        small = PIL.Image.fromarray(show(array[rows, cols])).reduce(factor)
        sheet[rows.start // factor :, cols.start // factor :][: small.height, : small.width] = np.asarray(small)
    return sheet


_FILE = re.compile(r"((temperature|candidates)-)?(level\d+(-sweep\d+)?|iteration\d+)\.png")


class StageWriter:
    """A callback that writes the pictures of a run into a folder as they are completed.

    A file is ``level{l}-sweep{k}.png``, ``level{l}.png`` or ``iteration{k}.png``, an 8-bit preview, and beside it the
    temperatures or the numbers of candidates on a logarithmic scale. The folder is made at the first picture, when the
    stages of an earlier run are removed unless ``resumed()``. ``limits`` are the values shown as black and white if
    pixels are not uint8, by default those of the first picture. Raises ValueError if the folder cannot be used.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        limits: tuple[float, float] | None = None,
        resumed: Callable[[], bool] = lambda: False,
    ) -> None:
        self.folder = Path(folder)
        self._limits, self._resumed = limits, resumed
        self._earlier = earlier_files(self.folder, "the stages", lambda name: bool(_FILE.fullmatch(name)))
        self._started = False

    def __call__(self, progress: Progress) -> None:
        """Write one stage if it is complete; else do nothing."""
        name = progress.stage
        if name is None:
            return
        if not self._started:
            self._start()
        image = progress.image()
        values = image[len(image) // 2] if progress.solid else image
        if self._limits is None and values.dtype.kind != "b":
            self._limits = float(values.min()), float(values.max())
        picture = to_display(values, self._limits)
        write(self.folder / f"{name}.png", picture if picture.ndim == 2 else picture[..., :4])
        for kind, read in progress.maps.items():
            values = read()
            if values.dtype.kind in "iu":
                values = np.log(values) / np.log(max(2, values.max()))
            write(self.folder / f"{kind}-{name}.png", temperature_colours(values))

    def _start(self) -> None:
        """Make the folder, and remove the files of an earlier run."""
        self._started = True
        try:
            self.folder.mkdir(exist_ok=True)
            for path in [] if self._resumed() else self._earlier:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise ValueError(f"the folder {self.folder} cannot be written ({error.strerror}): choose another") from None


def common_scale(pictures: Sequence[NDArray[Any]]) -> int:
    """Return the whole factor for all pictures: the smallest is about `SHOWN_SIDE` wide, the largest at most twice."""
    sides: list[int] = [max(picture.shape[:2]) for picture in pictures]
    return max(1, min(round(SHOWN_SIDE / min(sides)), 2 * SHOWN_SIDE // max(sides)))
