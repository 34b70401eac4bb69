# SPDX-License-Identifier: BSD-3-Clause
"""From the bytes of a picture file to pixels, each format by the library that keeps its values."""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

Array = NDArray[Any]


def decode(data: bytes) -> Array:
    """Decode the bytes of a picture file, telling its format by them.

    Parameters
    ----------
    data : bytes
        A whole file.

    Returns
    -------
    (rows, cols) or (rows, cols, channels) array
        Upright, palettes and print colours as RGB, without a fully opaque alpha channel.

    Raises
    ------
    Exception
        Each decoder's own, for a damaged file.
    """
    return _decoder(data)(data)


def _decoder(data: bytes) -> Callable[[bytes], Array]:
    if data.startswith(b"\x93NUMPY"):
        return _read_npy
    if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _read_tiff
    if data.startswith(b"\x89PNG\r\n\x1a\n") and data[24:25] == b"\x10":  # bits per sample: 16
        return _read_png16
    if (header := _pnm_header(data)) is not None and header[3] > 255:
        return _read_pnm16
    return _read_pillow


def _read_npy(data: bytes) -> Array:
    return np.asarray(np.load(io.BytesIO(data), allow_pickle=False))


def _read_pillow(data: bytes) -> Array:
    with PIL.Image.open(io.BytesIO(data)) as picture:
        picture.load()
        orientation = int(picture.getexif().get(0x0112, 1))
        transparent = picture.has_transparency_data
        if picture.mode in ("1", "L"):
            mode = "LA" if transparent else "L"
        elif picture.mode in ("LA", "F", "I") or picture.mode.startswith("I;"):
            mode = picture.mode
        else:
            mode = "RGBA" if transparent else "RGB"
        pixels = np.asarray(picture.convert(mode) if mode != picture.mode else picture)
    if mode in ("LA", "RGBA"):
        pixels = _without_opaque_alpha(pixels)
    return _upright(pixels, orientation)


def _read_png16(data: bytes) -> Array:
    import imagecodecs  # here and below: a picture that needs the library waits for it, and no other

    pixels: Array = imagecodecs.png_decode(data)
    if pixels.ndim == 3 and pixels.shape[2] in (2, 4):
        pixels = _without_opaque_alpha(pixels)
    with PIL.Image.open(io.BytesIO(data)) as picture:  # opened for its EXIF block alone
        return _upright(pixels, int(picture.getexif().get(0x0112, 1)))


def _read_tiff(data: bytes) -> Array:
    import tifffile

    with _quiet("tifffile"), tifffile.TiffFile(io.BytesIO(data)) as tiff:
        page = tiff.pages.first
        if not isinstance(page, tifffile.TiffPage):
            raise ValueError("it has no pictures")
        ends = zip(page.dataoffsets, page.databytecounts, strict=True)
        if any(offset + count > len(data) for offset, count in ends):
            raise ValueError("it ends before its last pixel")
        kind = int(page.photometric)
        if kind > 3 and not (kind == 6 and int(page.compression) in (6, 7)):
            return _read_pillow(data)  # print and video colours: Pillow turns them to RGB
        pixels = page.asarray()
        if pixels.size == 0:
            raise ValueError("it has no pixels")
        if page.axes == "SYX":
            pixels = np.moveaxis(pixels, 0, -1)
        elif page.axes not in ("YX", "YXS"):
            raise ValueError(f"its axes are {page.axes}, not rows, columns and channels")
        orientation = page.tags.valueof(274, 1)
        alpha = bool(page.extrasamples) and int(page.extrasamples[-1]) in (1, 2)
        colours = page.colormap
    if kind == 0:  # white is zero
        pixels = ~pixels if pixels.dtype.kind in "bu" else -pixels
    if kind == 3 and colours is not None:
        pixels = (np.moveaxis(colours, 0, -1)[pixels] >> 8).astype(np.uint8)
    if pixels.dtype == bool:
        pixels = pixels * np.uint8(255)
    if alpha:
        pixels = _without_opaque_alpha(pixels)
    return _upright(pixels, int(orientation))


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    # a damaged file gets one sentence, without the reader's log in front of it
    logger = logging.getLogger(name)
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def _pnm_header(data: bytes) -> tuple[int, int, int, int, int] | None:
    # channels, width, height, largest value, where the pixels begin
    space = rb"(?:\s|#[^\n]*\n)+"
    pattern = rb"P([56])" + space + rb"(\d+)" + space + rb"(\d+)" + space + rb"(\d{1,5})\s"
    match = re.match(pattern, data[:4096])
    if match is None:
        return None
    kind, width, height, largest = (int(group) for group in match.groups())
    return (1 if kind == 5 else 3), width, height, largest, match.end()


def _read_pnm16(data: bytes) -> Array:
    header = _pnm_header(data)
    assert header is not None
    channels, width, height, largest, start = header
    values = np.frombuffer(data, dtype=">u2", offset=start, count=width * height * channels)
    if largest != 65535:  # a picture of 10 or 12 bits is stretched to the full range
        values = np.round(values * (65535.0 / largest)).astype(np.uint16)
    shape = (height, width) if channels == 1 else (height, width, channels)
    return native(values.reshape(shape))


def _without_opaque_alpha(pixels: Array) -> Array:
    opaque = 1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
    if not (pixels[..., -1] == opaque).all():
        return pixels
    return pixels[..., 0] if pixels.shape[-1] == 2 else pixels[..., :-1]


def _upright(pixels: Array, orientation: int) -> Array:
    # the eight values of the EXIF and TIFF tag 274
    turned = {
        2: lambda p: p[:, ::-1],
        3: lambda p: p[::-1, ::-1],
        4: lambda p: p[::-1],
        5: lambda p: p.swapaxes(0, 1),
        6: lambda p: np.rot90(p, -1),
        7: lambda p: p[::-1, ::-1].swapaxes(0, 1),
        8: lambda p: np.rot90(p, 1),
    }
    return turned[orientation](pixels) if orientation in turned else pixels


def native(pixels: Array) -> Array:
    """Contiguous pixels in the machine's own byte order."""
    return np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("="))
