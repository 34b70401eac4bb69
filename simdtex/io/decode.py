# SPDX-License-Identifier: BSD-3-Clause
"""From the bytes of a picture file to pixels, each format by the library that keeps its values."""

from __future__ import annotations

import io
import logging
import os
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import prod
from threading import Lock
from typing import IO, Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from simdtex.io.limits import (
    PAGE,
    VARIABLE,
    TooLarge,
    check_array,
    check_bytes,
    check_parts,
    check_pixels,
    read_npy,
)

Array = NDArray[Any]


FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF", "PPM")
"""Of Pillow's readers, those that are let near a file: others start programs, as that of PostScript."""

_COMPRESSIONS = frozenset((1, 2, 3, 4, 5, 6, 7, 8, 32773, 32946, 34925, 50000))
"""Of a TIFF: none, CCITT, LZW, JPEG, Deflate, PackBits, LZMA and Zstandard, whose readers stop at a page's end."""

_PILLOW = Lock()


def decode(data: bytes, most: int) -> Array:
    """Decode the bytes of a picture file, telling its format by them.

    Parameters
    ----------
    data : bytes
        A whole file.
    most : int
        Pixels that it may have.

    Returns
    -------
    (rows, cols) or (rows, cols, channels) array
        Upright, palettes and print colours as RGB, without a fully opaque alpha channel.

    Raises
    ------
    TooLarge
        It has more pixels, or unpacks to more bytes than go with them; nothing has been decoded.
    Exception
        Each decoder's own, for a damaged file.
    """
    return _decoder(data)(data, most)


def _decoder(data: bytes) -> Callable[[bytes, int], Array]:
    if data.startswith(b"\x93NUMPY"):
        return _read_npy
    if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _read_tiff
    if data.startswith(b"\x89PNG\r\n\x1a\n") and data[24:25] == b"\x10":  # bits per sample: 16
        return _read_png16
    if (header := _pnm_header(data)) is not None and header[3] > 255:
        return _read_pnm16
    return _read_pillow


def _read_npy(data: bytes, most: int) -> Array:
    return read_npy(io.BytesIO(data), len(data), 2, most)


def _read_pillow(data: bytes, most: int) -> Array:
    with _opened(data, most) as picture:
        # an animation's canvas is made for its first frame, whatever that is
        frames = getattr(picture, "n_frames", 1) if picture.format in ("WEBP", "PNG") else 1
        width, height = picture.size
        check_parts(frames, width * height, most)
        check_bytes(width * height * len(picture.getbands()) * (4 if picture.mode in ("F", "I") else 1), most)
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


def _opened(data: bytes, most: int) -> PIL.Image.Image:
    """The picture, of which nothing but the header has been read."""
    if most <= (PIL.Image.MAX_IMAGE_PIXELS or most):
        try:
            return PIL.Image.open(io.BytesIO(data), formats=FORMATS)
        except PIL.Image.DecompressionBombError:
            raise TooLarge(
                f"has far too many pixels and no more than {most} are read: crop it, or set {VARIABLE} higher"
            ) from None
    with _PILLOW:  # more is wanted than Pillow's own limit, which is one for all
        before, PIL.Image.MAX_IMAGE_PIXELS = PIL.Image.MAX_IMAGE_PIXELS, None
        try:
            return PIL.Image.open(io.BytesIO(data), formats=FORMATS)
        finally:
            PIL.Image.MAX_IMAGE_PIXELS = before


def check_png(data: bytes, most: int, pages: int = 1) -> None:
    """Raise where the header of a PNG, one of `pages` alike, tells of too many pixels."""
    if not data.startswith(b"\x89PNG\r\n\x1a\n") or len(data) < 26:
        raise ValueError("it is no PNG")
    width, height, bits, colours = struct.unpack(">IIBB", data[16:26])
    channels = {0: 1, 2: 3, 3: 4, 4: 2, 6: 4}.get(colours, 4)
    check_parts(pages, width * height, most)
    check_bytes(pages * width * height * channels * (2 if bits == 16 else 1), most)


def _read_png16(data: bytes, most: int) -> Array:
    import imagecodecs  # here and below: a picture that needs the library waits for it, and no other

    check_png(data, most)
    pixels: Array = imagecodecs.png_decode(_bare(data))
    if pixels.ndim == 3 and pixels.shape[2] in (2, 4):
        pixels = _without_opaque_alpha(pixels)
    with _opened(data, most) as picture:  # for its EXIF block alone
        return _upright(pixels, int(picture.getexif().get(0x0112, 1)))


def _bare(data: bytes) -> bytes:
    """A PNG of the chunks alone that its pixels need: of others, libpng tells on standard error what it dislikes."""
    kept, at = [data[:8]], 8
    while at + 12 <= len(data):
        length, name = struct.unpack(">I4s", data[at : at + 8])
        if name[:1].isupper() or name == b"tRNS":
            kept.append(data[at : at + 12 + length])
        at += 12 + length
    return b"".join(kept)


def _read_tiff(data: bytes, most: int) -> Array:
    import tifffile

    with quiet("tifffile"), tifffile.TiffFile(io.BytesIO(data)) as tiff:
        page = tiff.pages.first
        if not isinstance(page, tifffile.TiffPage):
            raise ValueError("it has no pictures")
        check_page(page, most)
        ends = zip(page.dataoffsets, page.databytecounts, strict=True)
        if any(offset + count > len(data) for offset, count in ends):
            raise ValueError("it ends before its last pixel")
        kind = int(page.photometric)
        if kind > 3 and not (kind == 6 and int(page.compression) in (6, 7)):
            return _read_pillow(data, most)  # print and video colours: Pillow turns them to RGB
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


def check_page(page: Any, most: int) -> None:
    """Raise where a page of a TIFF is too large, or is packed in a way that does not keep to its size."""
    # in bytes alone, since not every page has its axes in the same order
    check_bytes(prod(page.shape) * (page.dtype.itemsize if page.dtype else 8), most)
    check_pixels(page.imagewidth * page.imagelength * page.imagedepth, most)
    wide, high = (page.tilewidth, page.tilelength) if page.is_tiled else (page.imagewidth, page.rowsperstrip)
    part = wide * min(high, page.imagelength if not page.is_tiled else high)
    check_pixels(part, most)
    kind = int(page.compression)
    if kind not in _COMPRESSIONS:
        raise ValueError(f"its pages are compressed by the method {kind}; save it with Deflate or without compression")
    if kind in (6, 7):  # whose data has a size of its own
        file = page.parent.filehandle
        for offset, count in zip(page.dataoffsets, page.databytecounts, strict=True):
            file.seek(offset)
            if _jpeg_pixels(file.read(min(count, 2**16))) > 2 * part + PAGE:
                raise ValueError("it holds JPEG data of more pixels than belong there")


def _jpeg_pixels(data: bytes) -> int:
    """Pixels that the first frame header of a JPEG stream tells of; 0 where there is none."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            high, wide = struct.unpack(">HH", data[at + 5 : at + 9])
            return int(high * wide)
        at += 2 + (0 if marker in (0x01, 0xFF) or 0xD0 <= marker <= 0xD8 else int.from_bytes(data[at + 2 : at + 4]))
    return 0


def count_pages(file: IO[bytes], most: int) -> int:
    """The pages of a TIFF; raises where they lead back to one another, or are too many."""
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 16:
        raise ValueError("it is no TIFF")
    big = struct.unpack(f"{order}H", head[2:4])[0] == 43
    counted, entry, pointer = (f"{order}Q", 20, f"{order}Q") if big else (f"{order}H", 12, f"{order}I")
    (at,) = struct.unpack_from(pointer, head, 8 if big else 4)
    seen: set[int] = set()
    while at:
        if at in seen:
            raise ValueError("its pages lead back to one another")
        seen.add(at)
        check_parts(len(seen), 1, most)
        file.seek(at)
        (entries,) = struct.unpack(counted, file.read(struct.calcsize(counted)))
        if entries > 4096:
            raise ValueError("a page has more than 4096 tags")
        file.seek(entries * entry, os.SEEK_CUR)
        (at,) = struct.unpack(pointer, file.read(struct.calcsize(pointer)))
    file.seek(0)
    return len(seen)


@contextmanager
def quiet(name: str) -> Iterator[None]:
    """Without a reader's log: a damaged file gets one sentence, and nothing in front of it."""
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


def _read_pnm16(data: bytes, most: int) -> Array:
    header = _pnm_header(data)
    assert header is not None
    channels, width, height, largest, start = header
    check_array((height, width, channels), 8, 2, most)
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
