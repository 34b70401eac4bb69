# SPDX-License-Identifier: BSD-3-Clause
"""Reading, checking and writing of pictures, without a change of any value.

A picture is an array (rows, cols) or (rows, cols, channels), row 0 at the top, the northern edge. 8-bit, 16-bit and
float pixels keep their type from the file to the synthesis and back. Pillow reads and writes the 8-bit formats,
tifffile every TIFF, imagecodecs what has more bits, and OpenEXR the files of that name.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import PIL.Image
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io import rasters
from simdtex.io.decode import NOTHING, NUMPY, Metadata, decode, native
from simdtex.io.files import Refused, Unbuffered, atomic_path, check_target, explained, max_pixels_or_default, reading
from simdtex.options import Brief, check_real, require, unmasked

__all__ = ["Image", "Metadata", "check_sample", "check_writable", "read", "read_mask", "split_alpha", "write"]

Array = NDArray[Any]
PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False, repr=False)
class Image(Brief):
    """A picture and its channel axis.

    Attributes
    ----------
    pixels : ndarray, (rows, cols) or (rows, cols, channels)
        The values of the file, in native byte order.
    channel_axis : None or -1
        None for a grey picture with two axes, -1 for a picture with channels last.
    metadata : Metadata
        The metadata of the file, for `write`.
    """

    pixels: Array
    channel_axis: int | None
    metadata: Metadata = NOTHING


def read(
    path: PathLike, *, max_pixels: int | None = None, palette: bool = False, ascending: bool | None = None
) -> Image:
    """Return the picture in a file, whose format is recognised by its content and not by its name.

    Parameters
    ----------
    path : path
        PNG, JPEG, TIFF (first page), BMP, WebP, GIF (first frame), TGA, JPEG 2000, AVIF, PBM, PGM, PPM, or a NumPy
        ``.npy`` of shape (rows, cols) or (rows, cols, channels). HEIC and OpenEXR need ``simdtex[pictures]``. No other
        format is tried.
    max_pixels : int, optional
        The most pixels that are read, with 8 bytes for each; None: ``SIMDTEX_MAX_PIXELS``, else 2**27.
    palette : bool
        Whether a picture with a palette is read as the indices of its colours, (rows, cols) uint8, as categories
        need; the palette is then in the metadata. Other pictures are read as without it.
    ascending : bool, optional
        Whether row 0 is the smallest y, as in arrays of cells (True), or the northern edge (False). The first row of a
        picture is its northern edge, and that of an ``.npy`` the smallest y. None: rows are as in the file.

    Returns
    -------
    Image
        Pixels keep their 8-bit, 16-bit, integer or float values; PGM and PPM give the numbers in the file. Palettes and
        print colours (CMYK) become RGB. Fewer than 8 bits are scaled to 8, and 9 to 15 to 16, so that white is the
        largest value. A TIFF in which white is 0 is inverted. A fully opaque alpha channel is removed; any other is the
        last channel, and colours that were multiplied by it (TIFF, OpenEXR) are divided by it. OpenEXR has linear
        values. The orientation in the EXIF data of a camera is applied.

    Raises
    ------
    ValueError
        The file is missing, no regular file, empty, damaged, of another format, which is named, or too large.
    """
    with reading(path, "the image", max_pixels) as most:
        data = Path(path).read_bytes()
        picture = read_bytes(os.fspath(path), data, max_pixels=most, palette=palette)
    if ascending is None or ascending == data.startswith(NUMPY):
        return picture
    return replace(picture, pixels=picture.pixels[::-1])


def read_bytes(name: str, data: bytes, *, max_pixels: int | None = None, palette: bool = False) -> Image:
    """Return a picture from the bytes of its file, as `read` does; messages call it ``name``."""
    most = max_pixels_or_default(max_pixels)
    with explained(name, "the image", "an image"):
        if not data:
            raise Refused("is empty (0 bytes): give a file with an image in it")
        stored, metadata = decode(data, most, palette=palette)
    with explained(name, "the image"):
        pixels = native(pixels_of("the picture", np.ma.getdata(stored)))
    pixels = np.ma.MaskedArray(pixels, np.ma.getmaskarray(stored)) if np.ma.is_masked(stored) else pixels
    return Image(pixels, -1 if pixels.ndim == 3 else None, metadata)


def split_alpha(pixels: ArrayLike, opaque: bool = False, plain: bool = False) -> tuple[Array, NDArray[np.bool_]]:
    """Return a picture without its alpha channel, if any, and the mask of its transparent pixels.

    Parameters
    ----------
    pixels : array_like, (rows, cols) or (rows, cols, channels)
        The last of two or four channels is alpha; a picture with another number of channels has none.
    opaque : bool
        Whether all that is not fully opaque is transparent.
    plain : bool
        Whether no channel is alpha, as the metadata of the file say.

    Returns
    -------
    pixels : ndarray, (rows, cols) or (rows, cols, channels)
        The picture without alpha, its values unchanged: (rows, cols) from two channels, (rows, cols, 3) from four.
    transparent : ndarray of bool, (rows, cols)
        True where alpha is below half of full scale (255 in 8 bits, 65535 in 16, 1 in floats), or NaN.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The array has neither two nor three axes.

    Examples
    --------
    >>> colour, hole = split_alpha(np.array([[[1, 2, 3, 255], [4, 5, 6, 0]]], np.uint8))
    >>> colour.shape, hole.tolist()
    ((1, 2, 3), [[False, True]])
    """
    values = pixels_of("the picture", pixels)
    if plain or values.ndim == 2 or values.shape[2] not in (2, 4):
        return values, np.zeros(values.shape[:2], dtype=bool)
    least = _half(values.dtype) * (2 if opaque else 1)
    return values[..., 0] if values.shape[2] == 2 else values[..., :3], ~(values[..., -1] >= least)


def read_mask(
    path: PathLike, shape: tuple[int, ...], *, max_pixels: int | None = None, ascending: bool | None = None
) -> NDArray[np.bool_]:
    """Return the mask in a picture file.

    Parameters
    ----------
    path : path
        A picture as in `read`, grey or colour. Full scale is 255 in 8 bits and 65535 in 16, but the maximum in the
        header of a PGM or PPM, and always 1 for bool, floats, and integers that are all 0 or 1.
    shape : (rows, cols)
        The required size; further axes are ignored.
    max_pixels, ascending
        As in `read`.

    Returns
    -------
    ndarray of bool, (rows, cols)
        True where any channel is above half of full scale, except where alpha is below half.

    Raises
    ------
    ValueError
        `read` cannot read the file, or it has another size.
    """
    picture = read(path, max_pixels=max_pixels, ascending=ascending)
    pixels, white = picture.pixels, picture.metadata.white
    rows, cols = shape[:2]
    if pixels.shape[:2] != (rows, cols):
        raise ValueError(
            f"{os.fspath(path)}: the mask is {pixels.shape[1]} x {pixels.shape[0]} pixels (width x height) and must be "
            f"{cols} x {rows}: bring it to that size"
        )
    colours, transparent = split_alpha(pixels, plain=picture.metadata.plain)
    bright = colours > (0.5 if colours.max() <= 1 else white / 2 if white else _half(pixels.dtype))
    return (bright if bright.ndim == 2 else bright.any(axis=2)) & ~transparent


def _half(dtype: np.dtype[Any]) -> float:
    """Return half of full scale, which for integers lies between two of them."""
    return np.iinfo(dtype).max / 2 if dtype.kind in "iu" else 0.5


def as_array(name: str, values: Any) -> Array:
    """Return an array-like, also of xarray, dask or a tensor, as an ndarray, or a masked one as a masked array."""
    first = values
    while isinstance(first, (list, tuple)) and first:
        first = first[0]
    if isinstance(first, (str, os.PathLike)):
        raise TypeError(f"{name} is the path {os.fspath(first)}: read it first, by simdtex.io.image.read(path).pixels")
    if hasattr(values, "compute"):  # dask, which NumPy would convert without its mask
        values = values.compute()
    if getattr(values, "mode", None) in ("P", "PA"):  # Pillow
        raise ValueError(f"{name} is an image of palette indices, which are no colours; give image.convert('RGB')")
    try:
        exchanged = hasattr(values, "__dlpack__") and not hasattr(values, "__array__")
        array = np.from_dlpack(values) if exchanged else np.asanyarray(values)
    except ValueError:
        raise ValueError(f"{name} is ragged; give rows of equal length") from None
    except (TypeError, RuntimeError, BufferError) as error:  # as a tensor says
        raise TypeError(f"{name} is no array that NumPy can take: {error}") from None
    return array if isinstance(array, np.ma.MaskedArray) else np.asarray(array)


def cast(values: Array, dtype: DTypeLike) -> tuple[Array, NDArray[np.bool_]]:
    """Return values in another type, and the mask of those that it cannot hold: integers inexact, floats infinite."""
    with np.errstate(invalid="ignore", over="ignore"):
        kept = values.astype(dtype)
    if kept.dtype.kind == "f":
        return kept, np.isinf(kept) & np.isfinite(values)
    return kept, kept != values


def plain_array(name: str, values: Any) -> Array:
    """Return an array-like as `as_array` does; raise ValueError if a mask hides values."""
    array = as_array(name, values)
    unmasked(name, array)
    return np.asarray(array)


AXES = {2: "(rows, cols)", 3: "(layers, rows, cols)"}
"""The axes of a picture and of a volume."""


def check_sample(array: Any, channel_axis: int | None, *, unknown: bool = False, axes: int = 2) -> Array:
    """Return a sample with its channels last; raise if the array cannot be one.

    Parameters
    ----------
    array : array_like
        `axes` axes if `channel_axis` is None, else one more. bool, any integer and any real float type. An xarray or
        dask array is converted as a whole, with its axes by position.
    channel_axis : int or None
        The axis that holds the channels; negative counts from the end.
    unknown : bool
        Whether values may be unknown: NaN in floats, or masked; the result has no mask.
    axes : {2, 3}
        2: a picture (rows, cols); 3: a volume (layers, rows, cols).

    Returns
    -------
    ndarray, ([layers,] rows, cols, channels)
        The values with their type, contiguous and in native byte order; a view of the input if possible.

    Raises
    ------
    TypeError
        The values are not real numbers, or `channel_axis` is not an integer.
    ValueError
        The number of axes does not fit, an axis is empty, or a value is infinite, or NaN or masked unless `unknown` is
        true.
    """
    pixels = np.asarray(as_array("the sample", array)) if unknown else plain_array("the sample", array)
    check_real("the sample", pixels)
    if channel_axis is None and pixels.ndim != axes:
        hint = ", or channel_axis=-1 if its last axis holds the channels" * (pixels.ndim == axes + 1)
        raise ValueError(f"the sample is {pixels.ndim}-dimensional: give {AXES[axes]}{hint}")
    if channel_axis is not None:
        if isinstance(channel_axis, bool) or not isinstance(channel_axis, (int, np.integer)):
            raise TypeError(f"channel_axis is {channel_axis!r}: give None or an integer")
        if pixels.ndim != axes + 1:
            grey = " (grey)" * (pixels.ndim == 2)
            raise ValueError(
                f"the sample is {pixels.ndim}-dimensional{grey}: give {('three', 'four')[axes - 2]} axes for "
                f"channel_axis={channel_axis}, one of them the channels"
            )
        if not -axes - 1 <= channel_axis < axes + 1:
            raise ValueError(f"channel_axis is {channel_axis}: give one of {-axes - 1} to {axes}")
    if pixels.size == 0:
        raise ValueError(f"the sample is empty, of shape {pixels.shape}: give at least one pixel")
    planes = pixels[..., np.newaxis] if channel_axis is None else np.moveaxis(pixels, channel_axis, -1)
    if planes.dtype.kind == "f":
        bad = np.isinf(planes) if unknown else ~np.isfinite(planes)
        if count := int(np.count_nonzero(bad)):
            row, column = (int(i) for i in np.unravel_index(int(bad.argmax()), bad.shape)[:2])
            what = "value that is" if count == 1 else "values that are"
            kind = "infinite" if unknown else "NaN or infinite"
            remedy = "give NaN where they are unknown" if unknown else "fill them first"
            raise ValueError(f"the sample has {count} {what} {kind}, the first at row {row}, column {column}: {remedy}")
    return native(planes)


def parse_size(text: str) -> tuple[int, int]:
    """Return rows and columns from WIDTHxHEIGHT, for example 480 and 640 of ``640x480``, or a square's side."""
    width, height = parse_sides(text, "WIDTHxHEIGHT")
    return height, width


def parse_sides(text: str, form: str, sample: Sequence[int] = ()) -> tuple[int, ...]:
    """Return the sides in a text in the order of ``form``, say WIDTHxHEIGHT; ``2x`` and ``200%`` multiply `sample`."""
    sides, words = form.split("x"), re.split(r"\s*[xX\u00d7]\s*", text.strip())
    if sample and (times := re.fullmatch(r"([0-9]+\.?[0-9]*|\.[0-9]+)\s*([xX\u00d7%])", text.strip())):
        factor = float(times[1]) / (100 if times[2] == "%" else 1)
        words = [str(round(factor * side)) for side in sample]
    if len(words) not in (1, len(sides)) or not all(re.fullmatch("[0-9]{1,8}", word) and int(word) for word in words):
        example = "x".join(("640", "480", "100")[: len(sides)])
        more = ", or 2x or 200% of the sample" if sample else ""
        raise ValueError(f"size {text!r} is not {form}; give numbers of 1 or more, as {example}, or one for all{more}")
    return tuple(int(word) for word in (words * len(sides))[: len(sides)])


def pixels_of(name: str, values: Any, axes: int = 2) -> Array:
    """Return the values of a picture, or of a volume with 3 ``axes``, as an array; raise for a wrong type or axes."""
    pixels = plain_array(name, values)
    check_real(name, pixels)
    if pixels.ndim not in (axes, axes + 1) or pixels.size == 0:
        more = AXES[axes].replace(")", ", channels)")
        raise ValueError(f"{name} has the shape {pixels.shape}; give {AXES[axes]} or {more}")
    return pixels


class Format(NamedTuple):
    """The types and the numbers of channels that a format holds without loss, None for any; and options of Pillow."""

    types: frozenset[str] | None = None
    channels: tuple[int, ...] | None = None
    options: dict[str, Any] | None = None

    def holds(self, dtype: DTypeLike | None, channels: int | None) -> bool:
        """Return whether the format holds values of this type and number of channels; None is not checked."""
        return (dtype is None or self.types is None or np.dtype(dtype).name in self.types) and (
            channels is None or self.channels is None or channels in self.channels
        )


EIGHT = frozenset({"bool", "uint8"})
INTEGERS = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
FLOATS = frozenset({"float16", "float32", "float64"})

_JPEG = Format(EIGHT, (1, 3), {"quality": 95, "subsampling": 0})
_TIFF = Format(EIGHT | INTEGERS | FLOATS)
_FORMATS = {
    ".png": Format(EIGHT | {"uint16"}, (1, 2, 3, 4)),
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".webp": Format(EIGHT, (1, 3, 4), {"lossless": True, "exact": True}),
    ".bmp": Format(EIGHT, (1, 3)),
    ".exr": Format(frozenset({"float16", "float32"}), (1, 2, 3, 4)),
    ".npy": Format(),
}

LOSSY = (".jpg", ".jpeg")
"""The suffixes of a format that changes pixels."""

_ALPHA, _PLAIN = (2, 4), (".tif", ".tiff", ".npy")
"""Numbers of channels of which the last is alpha, and the suffixes of formats that can say that it is not."""


def check_writable(
    path: PathLike,
    dtype: DTypeLike | None = None,
    channels: int | None = None,
    *,
    suffixes: Collection[str] | None = None,
    metadata: Metadata | None = None,
    labels: bool = False,
) -> None:
    """Raise ValueError before a long run unless such pixels, or a file of other `suffixes`, can be written."""
    target = Path(path)
    suffix = target.suffix.lower()
    known = _FORMATS if suffixes is None else suffixes
    check_target(target)
    if suffix not in known:
        what = f"ends in {target.suffix}" if suffix else "has no suffix"
        raise ValueError(f"{target} {what}: end its name in one of {', '.join(sorted(known))}")
    if suffixes is not None:
        return
    if suffix == ".exr":
        require("pictures", "OpenEXR")
    metadata = metadata or NOTHING
    other = suitable_suffix(dtype, channels, plain=metadata.plain)
    check_holds(target, _FORMATS, dtype, channels, other)
    if suffix in LOSSY and (labels or metadata.palette):
        raise ValueError(f"{target}: JPEG changes labels and categories: end its name in {other} instead")
    if metadata.plain and channels in _ALPHA and suffix not in _PLAIN:
        raise ValueError(f"{target}: {suffix} shows band {channels} as alpha: end its name in {other} instead")


def check_holds(
    target: Path, formats: dict[str, Format], dtype: DTypeLike | None, channels: int | None, other: str
) -> None:
    """Raise unless the format of the target's suffix holds such values; the message recommends the suffix `other`."""
    suffix = target.suffix.lower()
    if formats[suffix].holds(dtype, channels):
        return
    what = "values" if dtype is None else f"{np.dtype(dtype)} values"
    if channels is not None:
        what += f" of {channels} channel" + "s" * (channels != 1)
    raise ValueError(f"{target}: {suffix or 'PNG slices'} cannot hold {what}: end its name in {other} instead")


def suitable_suffix(dtype: DTypeLike | None, channels: int | None, wanted: str = ".png", *, plain: bool = False) -> str:
    """Return the suffix of a lossless format for such pixels, ``plain`` without alpha: its own, .png, .tif or .npy."""
    lossless = {*_PLAIN} if plain and channels in _ALPHA else _FORMATS.keys() - LOSSY
    suffixes = (suffix for suffix in (wanted, ".png", ".tif", ".npy") if suffix.lower() in lossless)
    return next(suffix for suffix in suffixes if _FORMATS[suffix.lower()].holds(dtype, channels))


def write(path: PathLike, array: ArrayLike, metadata: Metadata | None = None) -> None:
    """Write a picture in the format of the suffix, atomically.

    Parameters
    ----------
    path : path
        ``.png`` (8 or 16 bits), ``.tif`` ``.tiff`` (every type), ``.jpg`` ``.jpeg`` (quality 95), ``.webp``
        (lossless), ``.bmp``, ``.exr`` (float16 and float32), or ``.npy``.
    array : array_like, (rows, cols) or (rows, cols, channels)
        The values are written unchanged, bool as 0 and 255 (as bool in ``.npy``). Two and four channels of a PNG or
        OpenEXR are grey and colour with alpha, by which OpenEXR has colours multiplied. WebP turns grey into equal RGB.
    metadata : Metadata, optional
        The metadata from `read`. PNG, TIFF, JPEG and WebP keep the colour profile, if it fits the number of channels,
        and the EXIF data (TIFF its texts); and all but WebP and ``.npy`` the pixels per inch. Of indices, PNG and BMP
        keep the palette, WebP shows the colours, TIFF and ``.npy`` hold the numbers, and JPEG is refused. A GeoTIFF
        keeps what the file said of its place and its bands. Of a grid, an ``.npy`` begins with the smallest y.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The path cannot be written, or its format cannot hold such pixels; the message names a suitable format.
    """
    pixels = pixels_of("the picture", array)
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    check_writable(path, pixels.dtype, channels, metadata=metadata)
    suffix = Path(path).suffix.lower()
    if suffix == ".npy":
        pixels = pixels[::-1] if metadata and metadata.ascending else pixels
    else:
        pixels = pixels * np.uint8(255) if pixels.dtype == bool else pixels
        pixels = native(pixels[..., 0] if channels == 1 and pixels.ndim == 3 else pixels)
    with atomic_path(path) as temporary:
        encode(temporary, suffix, pixels, metadata or NOTHING)


def encode(path: Path, suffix: str, pixels: Array, metadata: Metadata = NOTHING) -> None:
    """Write pixels in a format that holds them, over an existing file."""
    palette = None
    if pixels.ndim == 2 and pixels.dtype == np.uint8 and suffix not in (".tif", ".tiff", ".npy"):
        palette = metadata.palette
    if suffix not in (".png", ".bmp"):
        pixels, palette = coloured(pixels, palette), None
    channels = 3 if palette else 1 if pixels.ndim == 2 else pixels.shape[2]
    metadata = metadata._replace(profile=fitting(metadata.profile, channels))
    beside = {"icc_profile": metadata.profile, "dpi": metadata.dpi, "exif": metadata.exif}
    if suffix in LOSSY and len(metadata.exif or b"") > 65533:  # the most that a JPEG holds
        del beside["exif"]
    beside = {name: value for name, value in beside.items() if value}
    if suffix == ".npy":
        with path.open("wb") as file:
            np.save(Unbuffered(file), pixels, allow_pickle=False)
    elif suffix == ".png" and pixels.dtype == np.uint16:
        import imagecodecs  # here and below: loaded only for pictures that need it

        data = imagecodecs.png_encode(pixels)
        said = pillow_bytes(PIL.Image.new("RGB" if pixels.ndim == 3 else "L", (1, 1)), "PNG", **beside)
        head = 33  # bytes of the signature and the header; Pillow's chunks on colours and size follow
        path.write_bytes(data[:head] + said[head : said.rindex(b"IDAT") - 4] + data[head:])
    elif suffix in (".tif", ".tiff") and metadata.geo:
        rasters.write_raster(path, np.moveaxis(np.atleast_3d(pixels), -1, 0), metadata.geo)
    elif suffix == ".exr":
        import OpenEXR

        written = io.BytesIO()  # since OpenEXR does not notice a full disk
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        planes = np.moveaxis(np.atleast_3d(pixels), -1, 0)
        if channels in (2, 4):  # OpenEXR holds colours that are multiplied by alpha
            planes = np.concatenate([planes[:-1] * planes[-1], planes[-1:]])
        named = zip(("Y", "YA", "RGB", "RGBA")[channels - 1], map(np.ascontiguousarray, planes), strict=True)
        OpenEXR.File(header, dict(named)).write(written)
        path.write_bytes(written.getvalue())
    elif suffix in (".tif", ".tiff"):
        write_tiff(path, [pixels], metadata)
    else:
        PIL.Image.preinit()  # the modules of common formats; registered_extensions loads some 40 others
        kind = PIL.Image.EXTENSION.get(suffix) or PIL.Image.registered_extensions()[suffix]
        picture = PIL.Image.fromarray(pixels)
        if palette:
            picture.putpalette(palette.ljust(768, b"\0"))  # of 256 colours, so that indices keep 8 bits
        path.write_bytes(pillow_bytes(picture, kind, **(_FORMATS[suffix].options or {}), **beside))


def coloured(pixels: Array, palette: bytes | None) -> Array:
    """Return the colours of indices (rows, cols) or, with alpha, (rows, cols, 2); without a palette the pixels."""
    if palette is None:
        return pixels
    indices = np.atleast_3d(pixels)
    colours = np.frombuffer(palette.ljust(768, b"\0"), np.uint8).reshape(-1, 3)[indices[..., 0]]
    return np.concatenate([colours, indices[..., 1:]], -1)


def pillow_bytes(picture: PIL.Image.Image, kind: str, **options: Any) -> bytes:
    """Return the bytes of a picture in a format of Pillow, which itself would not notice a full disk."""
    buffer = io.BytesIO()
    picture.save(buffer, format=kind, **options)
    return buffer.getvalue()


def write_tiff(path: Path, pages: Sequence[Array] | Array, metadata: Metadata = NOTHING) -> None:
    """Write pictures of one shape as the pages of a TIFF."""
    import tifffile

    channels = 1 if pages[0].ndim == 2 else pages[0].shape[2]
    colours = 3 if channels in (3, 4) else 1
    alpha = channels in _ALPHA and not metadata.plain
    big = len(pages) * pages[0].nbytes > 2**32 - 2**25
    with tifffile.TiffWriter(path, bigtiff=big, byteorder="<") as file:
        for page in pages:
            file.write(
                page,
                photometric="rgb" if colours == 3 else "minisblack",
                planarconfig="contig" if channels > 1 else None,
                # a second or fourth channel is alpha unless the file says otherwise, more than four are plain numbers
                extrasamples=(["unassalpha"] if alpha else [0] * (channels - colours)) or None,
                compression="zlib",
                metadata=None,
                iccprofile=metadata.profile,
                resolution=metadata.dpi,
                resolutionunit="inch" if metadata.dpi else None,
                software=False,  # not the name of the library
                extratags=_tags(metadata.exif),
            )


def _tags(exif: bytes | None) -> list[tuple[int, str, int, bytes, bool]]:
    """Return the texts of EXIF data, such as camera, date, author and rights, as tags of a TIFF."""
    whole = PIL.Image.Exif()
    whole.load(exif or b"")
    return [(tag, "s", 0, text.encode("latin-1"), True) for tag, text in whole.items() if isinstance(text, str)]


def fitting(profile: bytes | None, channels: int) -> bytes | None:
    """Return a profile of grey or RGB if the picture has that number of channels, not counting alpha, else None."""
    space = {1: b"GRAY", 2: b"GRAY", 3: b"RGB ", 4: b"RGB "}.get(channels)
    return profile if profile and profile[16:20] == space else None


def profile_name(profile: bytes | None) -> str:
    """Return the name of a colour profile; without a profile, colours are sRGB."""
    if profile is None:
        return "sRGB"
    from PIL import ImageCms  # loaded only for pictures with a profile

    try:
        name = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(profile))).strip()
    except (ImageCms.PyCMSError, OSError):
        return "an unknown profile"
    return "sRGB" if name.startswith("sRGB") else name


def to_display(array: ArrayLike, limits: tuple[float, float] | None = None) -> NDArray[np.uint8]:
    """Return pixels in 8 bits for a preview; ``limits`` are the values shown as 0 and 255, by default the extremes."""
    pixels = np.asarray(array)
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.dtype == bool:
        return pixels * np.uint8(255)
    # halved, so that the range of any two doubles is finite
    low, high = (float(v) / 2 for v in (limits or (pixels.min(), pixels.max())))
    if not high > low:
        return np.full(pixels.shape, 128, dtype=np.uint8)
    share = (pixels.astype(np.float64) / 2 - low) / (high - low)
    return np.round(np.clip(share, 0.0, 1.0) * 255.0).astype(np.uint8)


EXAMPLES, TISSUE = ("brick", "grass", "gravel"), "tissue"
"""The names of the grey samples, and of the sample in colour."""

WALL, TOP, BOTTOM = (264, 216), (70, 360), (11, 499)
"""Rows and columns of brick seen from the front; first column and width of the photograph's first and last row."""


def example(name: str) -> NDArray[np.uint8]:
    """Return a picture of scikit-image: of `EXAMPLES` grey, `TISSUE` (128, 128, 3); brick is seen from the front."""
    import skimage

    library: Any = skimage  # which has no types
    if name == TISSUE:
        stained: NDArray[np.uint8] = library.data.immunohistochemistry()[40:168, 12:140]
        return stained
    picture: NDArray[np.uint8] = getattr(library.data, name)()
    if name != "brick":
        return picture
    rows, cols, last = 2 * WALL[0], 2 * WALL[1], len(picture) - 1  # every pixel is the mean of four
    left, tilt = TOP[0] / TOP[1], BOTTOM[0] / BOTTOM[1] - TOP[0] / TOP[1]
    smaller = 1 / BOTTOM[1] - 1 / TOP[1]  # farther parts look smaller
    front = [(1 / cols, tilt / rows, left), (0, last / BOTTOM[1] / rows, 0), (0, smaller / rows, 1 / TOP[1])]
    wall = library.transform.warp(picture.astype(np.float64), np.array(front), output_shape=(rows, cols))
    small: NDArray[np.float64] = library.transform.downscale_local_mean(wall, (2, 2))
    return np.rint(small).astype(np.uint8)
