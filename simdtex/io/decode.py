# SPDX-License-Identifier: BSD-3-Clause
"""Decoding of picture files: each format by the library that keeps its values."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from threading import Lock
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from simdtex.io.limits import check_array, check_size, read_npy

Array = NDArray[Any]

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF")
"""The only Pillow readers in use: others start programs, for example that of PostScript."""

_COMPRESSIONS = frozenset((1, 2, 3, 4, 5, 8, 32773, 32946, 34925, 50000))
"""TIFF compressions whose decoders stop at the end of a page: none, CCITT, LZW, Deflate, PackBits, LZMA, Zstandard."""

_PILLOW = Lock()


def decode(data: bytes, most: int) -> Array:
    """Decode the bytes of a picture file of at most so many pixels; the format is recognised by its content.

    Return a (rows, cols) or (rows, cols, channels) array, upright, palettes and print colours as RGB, without a fully
    opaque alpha channel. Raise TooLarge before anything is decoded, and each decoder's own errors for a damaged file.
    """
    with _quiet():
        if data.startswith(b"\x93NUMPY"):
            return read_npy(io.BytesIO(data), len(data), most)
        if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
            return _read_tiff(data, most)
        if data.startswith(b"\x89PNG\r\n\x1a\n") and data[24:25] == b"\x10":  # bits per sample: 16
            return _read_png16(data, most)
        return _read_pillow(data, most)


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress warnings and the log of tifffile: a damaged file is reported in one sentence."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before


def _opened(data: bytes, most: int) -> PIL.Image.Image:
    """Return the picture, of which only the header has been read, if it is within the limits."""
    with _PILLOW:  # Pillow has a limit of its own, one for the whole process
        before, PIL.Image.MAX_IMAGE_PIXELS = PIL.Image.MAX_IMAGE_PIXELS, None
        try:
            picture = PIL.Image.open(io.BytesIO(data), formats=FORMATS)
        finally:
            PIL.Image.MAX_IMAGE_PIXELS = before
    itemsize = 4 if picture.mode in ("F", "I") else 1
    check_array((picture.height, picture.width, len(picture.getbands())), itemsize, most)
    return picture


def _read_pillow(data: bytes, most: int) -> Array:
    with _opened(data, most) as picture:
        picture.load()
        orientation = int(picture.getexif().get(0x0112, 1))
        transparent = picture.has_transparency_data
        if picture.mode in ("1", "L"):
            mode = "LA" if transparent else "L"
        elif picture.mode in ("LA", "F", "I") or picture.mode.startswith("I;"):
            mode = picture.mode
        else:
            mode = "RGBA" if transparent else "RGB"
        pixels = np.asarray(picture.convert(mode))
    return _finished(pixels, orientation, mode in ("LA", "RGBA"))


def _read_png16(data: bytes, most: int) -> Array:
    import imagecodecs  # here and below: loaded only for pictures that need it

    with _opened(data, most) as picture:  # Pillow has no 16-bit colour, but checks the header and knows EXIF
        check_size(0, 2 * prod(picture.size) * len(picture.getbands()), most)
        orientation = int(picture.getexif().get(0x0112, 1))
    pixels: Array = imagecodecs.png_decode(data)
    return _finished(pixels, orientation, pixels.ndim == 3 and pixels.shape[2] in (2, 4))


def _read_tiff(data: bytes, most: int) -> Array:
    import tifffile

    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        page = tiff.pages.first
        if not isinstance(page, tifffile.TiffPage):
            raise ValueError("it has no pictures")
        _check_page(page, most)
        ends = zip(page.dataoffsets, page.databytecounts, strict=True)
        if any(offset + count > len(data) for offset, count in ends):
            raise ValueError("it ends before its last pixel")
        kind, compression = int(page.photometric), int(page.compression)
        if kind > 2 or compression in (6, 7):
            return _read_pillow(data, most)  # JPEG, palettes, and print and video colours, which Pillow converts to RGB
        if compression not in _COMPRESSIONS:
            raise ValueError(f"it is compressed by the method {compression}; save it with Deflate or uncompressed")
        pixels = page.asarray()
        if pixels.size == 0:
            raise ValueError("it has no pixels")
        if page.axes == "SYX":
            pixels = np.moveaxis(pixels, 0, -1)
        elif page.axes not in ("YX", "YXS"):
            raise ValueError(f"its axes are {page.axes}, not rows, columns and channels")
        orientation = int(page.tags.valueof(274, 1))
        alpha = bool(page.extrasamples) and int(page.extrasamples[-1]) in (1, 2)
    if kind == 0:  # white is zero
        pixels = ~pixels
    if pixels.dtype == bool:
        pixels = pixels * np.uint8(255)
    return _finished(pixels, orientation, alpha)


def _check_page(page: Any, most: int) -> None:
    """Raise TooLarge if a TIFF page, or one of its tiles or strips, exceeds the limits."""
    size = prod(page.shape) * (page.dtype.itemsize if page.dtype else 8)
    check_size(page.imagewidth * page.imagelength * page.imagedepth, size, most)
    if page.is_tiled:
        check_size(page.tilewidth * page.tilelength, 0, most)


def _finished(pixels: Array, orientation: int, alpha: bool) -> Array:
    """Return the pixels upright, and without their last channel if it is alpha and opaque everywhere."""
    if alpha:
        opaque = 1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
        if (pixels[..., -1] == opaque).all():
            pixels = pixels[..., 0] if pixels.shape[-1] == 2 else pixels[..., :-1]
    # the eight values of the EXIF and TIFF tag 274
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels


def native(pixels: Array) -> Array:
    """Return contiguous pixels in the machine's byte order."""
    return np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("="))
