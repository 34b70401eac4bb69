# SPDX-License-Identifier: BSD-3-Clause
"""Decoding of picture files: each format by a library that preserves its values."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import prod
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
import PIL.ExifTags
import PIL.Image
from numpy.typing import NDArray

from simdtex.io import rasters
from simdtex.io.limits import check_array, check_size, read_npy

Array = NDArray[Any]

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF")
"""The only Pillow readers in use, since some others start programs, for example the one of PostScript."""

ORIENTATION, DESCRIPTION = 0x0112, 0x010E
"""The EXIF and TIFF tags of the orientation and of the description."""

_KEPT = (DESCRIPTION, 0x010F, 0x0110, 0x0131, 0x0132, 0x013B, 0x8298)
"""EXIF tags that are kept in addition to exposure and place: description, camera, software, date, author, rights."""

_OWN = (0xA002, 0xA003, 0xA005)
"""EXIF tags that belong to one file: width, height, and the position of a directory."""

_PNM = re.compile(rb"P([2356])" + 3 * rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" + rb"\s")
"""The header of PGM and PPM: the kind, the width, the height and the largest value."""

_COMPRESSIONS = frozenset((1, 2, 3, 4, 5, 8, 32773, 32946, 34925, 50000))
"""TIFF compressions whose decoders stop at the end of a page: none, CCITT, LZW, Deflate, PackBits, LZMA, Zstandard."""

_PILLOW = Lock()


class Metadata(NamedTuple):
    """The data of a picture file other than its pixels.

    Attributes
    ----------
    profile : bytes, optional
        The ICC profile, which defines the colours of values.
    dpi : (float, float), optional
        Pixels per inch, across and down.
    exif : bytes, optional
        Camera, exposure, date, place, author and rights; without the orientation, which is applied, and without size
        and preview.
    more : bool
        Whether the file has further frames or pages, which are not read.
    geo : Georeference, optional
        Where the pixels of a raster lie, and its number for unknown values.
    palette : bytes, optional
        Red, green and blue of each index of a palette, if the pixels are indices.
    """

    profile: bytes | None = None
    dpi: tuple[float, float] | None = None
    exif: bytes | None = None
    more: bool = False
    geo: rasters.Georeference | None = None
    palette: bytes | None = None


NOTHING = Metadata()
"""The metadata of a file that has only pixels."""

Decoded = tuple[Array, Metadata]


GREYS = np.arange(256, dtype=np.uint8).repeat(3).tobytes()
"""The palette whose colours are the indices."""


def decode(data: bytes, most: int, palette: bool = False) -> Decoded:
    """Decode a picture file of at most ``most`` pixels, whose format is recognised by its content.

    Return a (rows, cols) or (rows, cols, channels) array, upright, palettes and print colours as RGB, without a fully
    opaque alpha channel; and the metadata of the file. With ``palette`` palettes become indices. Raise TooLarge before
    anything is decoded, and each decoder's own errors for a damaged file.
    """
    with _quiet():
        if data.startswith(b"\x93NUMPY"):
            return read_npy(io.BytesIO(data), len(data), most), NOTHING
        if header := _PNM.match(data):
            return _read_pnm(data, header, most), NOTHING
        if data[:5].lower() == b"ncols" or (data[:4] in rasters.TIFF and rasters.is_raster(io.BytesIO(data))):
            pixels, geo, _ = rasters.read_raster(data, most)
            return pixels, Metadata(geo=geo)
        if data[:4] in rasters.TIFF:
            return _read_tiff(data, most, palette)
        if data.startswith(b"\x89PNG\r\n\x1a\n") and data[24:25] == b"\x10":  # bits per sample: 16
            return _read_png16(data, most)
        return _read_pillow(data, most, palette)


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
    """Return the picture, with only its header read, if it is within the limits."""
    with _PILLOW:  # Pillow has its own limit for the whole process
        before, PIL.Image.MAX_IMAGE_PIXELS = PIL.Image.MAX_IMAGE_PIXELS, None
        try:
            picture = PIL.Image.open(io.BytesIO(data), formats=FORMATS)
        finally:
            PIL.Image.MAX_IMAGE_PIXELS = before
    itemsize = 4 if picture.mode in ("F", "I") else 1
    check_array((picture.height, picture.width, len(picture.getbands())), itemsize, most)
    return picture


def _read_pnm(data: bytes, header: re.Match[bytes], most: int) -> Array:
    """Return decoded PGM or PPM, text or binary; Pillow changes values unless the maximum is 255 or 65535."""
    kind, width, height, largest = (int(word) for word in header.groups())
    if not 0 < largest < 65536:
        raise ValueError(f"its largest value is {largest}, not 1 to 65535")
    shape = (height, width, 3) if kind in (3, 6) else (height, width)
    dtype = np.dtype(np.uint8 if largest < 256 else ">u2")
    check_array(shape, dtype.itemsize, most)
    if kind > 3:
        pixels = np.frombuffer(data, dtype, prod(shape), header.end())
    else:
        text = re.sub(rb"#[^\r\n]*", b"", data[header.end() :])
        pixels = np.fromstring(text.decode("ascii"), np.int64, prod(shape), sep=" ")
    if pixels.size < prod(shape):
        raise ValueError("it ends before its last pixel")
    if pixels.max(initial=0) > largest or pixels.min(initial=0) < 0:
        raise ValueError(f"it has a value that is not 0 to {largest}")
    return pixels.reshape(shape).astype(dtype)


def _read_pillow(data: bytes, most: int, palette: bool) -> Decoded:
    with _opened(data, most) as picture:
        picture.load()
        transparent, colours = picture.has_transparency_data, None
        if palette and picture.mode == "P":
            colours = bytes(picture.getpalette() or ())
            picture.putpalette(GREYS)
        if colours is not None or picture.mode in ("1", "L"):
            mode = "LA" if transparent else "L"
        elif picture.mode in ("LA", "F", "I") or picture.mode.startswith("I;"):
            mode = picture.mode
        else:
            mode = "RGBA" if transparent else "RGB"
        pixels = np.asarray(_in_rgb(picture) if picture.mode == "CMYK" else picture.convert(mode))
        orientation, metadata = _metadata(picture)
    return _finished(pixels, orientation, mode in ("LA", "RGBA")), metadata._replace(palette=colours)


def _metadata(picture: PIL.Image.Image) -> tuple[int, Metadata]:
    """Return the orientation of a picture of Pillow, and the metadata of its file."""
    orientation, exif, more, profile = 1, None, False, picture.info.get("icc_profile")
    with suppress(Exception):  # a damaged second frame does not invalidate the first
        more = picture.format != "MPO" and getattr(picture, "is_animated", False)  # MPO is a JPEG with previews
    with suppress(Exception):  # nor is damaged EXIF
        found = picture.getexif()
        orientation = int(found.get(ORIENTATION, 1))
        exif = _exif(found)
    dpi = _dpi(picture.info.get("dpi"), orientation)
    return orientation, Metadata(None if picture.mode in ("CMYK", "LAB") else profile, dpi, exif, more)


def _exif(found: PIL.Image.Exif) -> bytes | None:
    """Return the part of the EXIF data that is kept."""
    kept = PIL.Image.Exif()
    for tag in _KEPT:
        if tag in found:  # a text in any encoding, which Pillow reads as Latin-1, but writes as ASCII
            kept[tag] = found[tag].encode("latin-1") if isinstance(found[tag], str) else found[tag]
    for ifd in (PIL.ExifTags.IFD.Exif, PIL.ExifTags.IFD.GPSInfo):
        if values := {tag: value for tag, value in found.get_ifd(ifd).items() if tag not in _OWN}:
            kept[ifd] = values
    return kept.tobytes() if kept else None


def _dpi(found: Any, orientation: int) -> tuple[float, float] | None:
    """Return pixels per inch across and down of an upright picture, or None if they are not numbers above 0."""
    across, down = (float(one) for one in found or (0, 0))
    if not (0 < across < np.inf and 0 < down < np.inf):
        return None
    return (down, across) if orientation > 4 else (across, down)


def _in_rgb(picture: PIL.Image.Image) -> PIL.Image.Image:
    """Return a CMYK picture in sRGB, by its colour profile if that can be used."""
    converted = None
    if found := picture.info.get("icc_profile"):
        from PIL import ImageCms

        with suppress(ImageCms.PyCMSError, OSError):
            profile = ImageCms.ImageCmsProfile(io.BytesIO(found))
            converted = ImageCms.profileToProfile(picture, profile, ImageCms.createProfile("sRGB"), outputMode="RGB")
    return converted or picture.convert("RGB")


def _read_png16(data: bytes, most: int) -> Decoded:
    import imagecodecs  # here and below: loaded only for pictures that need it

    with _opened(data, most) as picture:  # Pillow has no 16-bit colour, but checks the header and knows EXIF
        check_size(0, 2 * prod(picture.size) * len(picture.getbands()), most)
        orientation, metadata = _metadata(picture)
    pixels: Array = imagecodecs.png_decode(data)
    return _finished(pixels, orientation, pixels.ndim == 3 and pixels.shape[2] in (2, 4)), metadata


def _read_tiff(data: bytes, most: int, palette: bool) -> Decoded:
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
        orientation = int(page.tags.valueof(ORIENTATION, 1))
        metadata = Metadata(page.iccprofile)
        with suppress(Exception):  # a damaged resolution or second page does not invalidate the first
            told = 282 in page.tags and int(page.resolutionunit) in (2, 3)  # per inch or centimetre
            dpi = _dpi(page.get_resolution("inch") if told else None, orientation)
            metadata = metadata._replace(dpi=dpi, more=tiff.pages.is_multipage)
        with suppress(Exception):
            found = PIL.Image.Exif()
            found.load(data)
            if tiff.is_imagej or tiff.is_ome or tiff.is_shaped:  # programs that describe the axes of a stack
                found.pop(DESCRIPTION, None)
            metadata = metadata._replace(exif=_exif(found))
        if kind > 2 or compression in (6, 7):
            # JPEG, palettes, and print and video colours, which Pillow converts to RGB
            pixels, read = _read_pillow(data, most, palette)
            return pixels, metadata._replace(profile=read.profile, palette=read.palette)  # no profile of print colours
        if compression not in _COMPRESSIONS:
            raise ValueError(f"it is compressed by the method {compression}; save it with Deflate or uncompressed")
        pixels = page.asarray()
        if pixels.size == 0:
            raise ValueError("it has no pixels")
        if page.axes == "SYX":
            pixels = np.moveaxis(pixels, 0, -1)
        elif page.axes not in ("YX", "YXS"):
            raise ValueError(f"its axes are {page.axes}, not rows, columns and channels")
        extra = int(page.extrasamples[-1]) if page.extrasamples else 0  # 1: premultiplied alpha, 2: alpha
    if kind == 0:  # white is zero
        pixels = ~pixels
    if pixels.dtype == bool:
        pixels = pixels * np.uint8(255)
    if extra == 1 and pixels.ndim == 3:
        pixels = _divided(pixels)
    return _finished(pixels, orientation, extra in (1, 2)), metadata


def _divided(pixels: Array) -> Array:
    """Return pixels with their colours divided by alpha, by which they were multiplied; 0 where alpha is 0."""
    full = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    alpha = pixels[..., -1:].astype(np.float64)
    colours = pixels[..., :-1] * np.divide(full, alpha, out=np.zeros_like(alpha), where=alpha > 0)
    if pixels.dtype.kind != "f":
        colours = np.rint(np.clip(colours, 0, full))
    return np.concatenate([colours.astype(pixels.dtype), pixels[..., -1:]], -1)


def _check_page(page: Any, most: int) -> None:
    """Raise TooLarge if a TIFF page, or one of its tiles or strips, exceeds the limits."""
    size = prod(page.shape) * (page.dtype.itemsize if page.dtype else 8)
    check_size(page.imagewidth * page.imagelength * page.imagedepth, size, most)
    if page.is_tiled:
        check_size(page.tilewidth * page.tilelength, 0, most)


def _finished(pixels: Array, orientation: int, alpha: bool) -> Array:
    """Return the pixels upright, without the last channel if it is alpha and opaque everywhere."""
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
