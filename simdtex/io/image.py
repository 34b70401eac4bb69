# SPDX-License-Identifier: BSD-3-Clause
"""Reading, checking and writing pictures without changing a single value of them.

A picture is an array (rows, cols) or (rows, cols, channels), row 0 at the top. 8-bit, 16-bit and
float pixels stay what they are from the file to the synthesis and back to a file. Pillow reads and
writes the 8-bit formats, tifffile every TIFF, and imagecodecs the 16-bit PNG (Pillow has no 16-bit
colour) and the compressed strips of a TIFF.
"""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io.atomic import Unbuffered, atomic_folder, atomic_path, check_target
from simdtex.io.decode import decode, native
from simdtex.io.limits import TooLarge, check_file, max_pixels_or_default
from simdtex.options import unmasked

__all__ = [
    "Image",
    "atomic_folder",
    "atomic_path",
    "check_sample",
    "check_writable",
    "parse_size",
    "read",
    "read_bytes",
    "read_mask",
    "split_alpha",
    "suitable_suffix",
    "to_display",
    "write",
]

Array = NDArray[Any]
PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Image:
    """A picture and which of its axes, if any, holds the channels.

    Attributes
    ----------
    pixels : ndarray, (rows, cols) or (rows, cols, channels)
        The values as they stand in the file, in native byte order.
    channel_axis : None or -1
        None for a grey picture of two axes, -1 for one with channels last.
    """

    pixels: Array
    channel_axis: int | None


# ---------------------------------------------------------------- reading


def read(path: PathLike, *, unknown: bool = False, max_pixels: int | None = None) -> Image:
    """Read a picture file as a sample, telling the format by its content and not by its name.

    Parameters
    ----------
    path : path
        PNG, JPEG, TIFF (first page), BMP, WebP, GIF (first frame), PPM/PGM, or a NumPy ``.npy`` of
        shape (rows, cols) or (rows, cols, channels). No other format is tried, whatever the name.
    unknown : bool
        Whether float pixels may be NaN, which says that they are unknown.
    max_pixels : int, optional
        Pixels that are read at most, of all frames of an animation together, and 8 bytes for each.
        None: ``SIMDTEX_MAX_PIXELS`` of the environment, else 2**27. The file's header is asked, before
        anything is decoded.

    Returns
    -------
    Image
        Pixels keep their 8-bit, 16-bit, integer or float values. Palettes and print colours
        (CMYK) become RGB, 1-bit becomes uint8 0 and 255. A fully opaque alpha channel is dropped;
        any other is kept as the last channel, so that what is cut out stays cut out. The
        orientation that a camera noted (EXIF) is applied.

    Raises
    ------
    ValueError
        The file is missing, a folder, empty, truncated, not an image, too large, or holds infinite
        pixels, or NaN where none may be unknown.

    Notes
    -----
    The whole file is held in memory beside its pixels.
    """
    name = os.fspath(path)
    most = max_pixels_or_default(max_pixels)
    return read_bytes(name, _file_bytes(name, most), unknown=unknown, max_pixels=most)


def read_bytes(name: str, data: bytes, *, unknown: bool = False, max_pixels: int | None = None) -> Image:
    """Read a picture from the bytes of its file, as `read` does; sentences call it by `name`."""
    most = max_pixels_or_default(max_pixels)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pixels = np.asarray(decode(data, most))
    except TooLarge as error:
        raise ValueError(f"{name} {error}") from None
    except PIL.UnidentifiedImageError:
        raise ValueError(f"{name} is not an image: give a PNG, JPEG, TIFF, BMP, WebP, GIF, PPM or .npy file") from None
    except MemoryError:
        raise ValueError(f"{name} is too large for the memory: crop it first") from None
    except Exception as error:  # every decoder has its own exceptions for a damaged file
        raise ValueError(
            f"{name} cannot be decoded, it is truncated, damaged or of an unknown kind "
            f"({_one_line(error)}): save it again as PNG or TIFF"
        ) from None
    channel_axis = -1 if pixels.ndim == 3 else None
    try:
        check_sample(pixels, channel_axis, unknown=unknown)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None
    return Image(native(pixels), channel_axis)


def split_alpha(pixels: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """Take a picture and its alpha channel apart, if it has one.

    Parameters
    ----------
    pixels : array_like, (rows, cols) or (rows, cols, channels)
        The last of two or four channels is alpha; a picture of any other number has none.

    Returns
    -------
    pixels : ndarray, (rows, cols) or (rows, cols, channels)
        The picture without alpha, its values unchanged: (rows, cols) of two channels, (rows, cols, 3) of four.
    transparent : ndarray of bool, (rows, cols)
        Where alpha is below half of full (255 in 8 bits, 65535 in 16, 1 in floats), or NaN.

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
    unmasked("the picture", pixels)
    values = np.asarray(pixels)
    if values.dtype.kind not in "buif":
        raise TypeError(f"the picture holds {values.dtype} values: give integers or real floats")
    if values.ndim not in (2, 3):
        raise ValueError(f"the picture has the shape {values.shape}: give (rows, cols) or (rows, cols, channels)")
    if values.ndim == 2 or values.shape[2] not in (2, 4):
        return values, np.zeros(values.shape[:2], dtype=bool)
    return values[..., 0] if values.shape[2] == 2 else values[..., :3], ~(values[..., -1] >= _half(values.dtype))


def _half(dtype: np.dtype[Any]) -> float:
    """Half of full scale; of integers it is between two of them."""
    return np.iinfo(dtype).max / 2 if dtype.kind in "iu" else 0.5


def read_mask(path: PathLike, shape: tuple[int, ...], *, max_pixels: int | None = None) -> NDArray[np.bool_]:
    """Read a picture that says of every pixel whether it is meant.

    Parameters
    ----------
    path : path
        A picture as for `read`, grey or colour, of bool, 8 bits, 16 bits, or floats from 0 to 1.
    shape : (rows, cols)
        The size it must have; what comes after is not looked at.
    max_pixels : int, optional
        As for `read`.

    Returns
    -------
    ndarray of bool, (rows, cols)
        True where any channel is brighter than half of full scale; a pixel whose alpha is below half is not meant,
        whatever its colour.

    Raises
    ------
    ValueError
        The file cannot be read as by `read`, is of another size or type, has floats outside of 0 to 1, or no brighter
        value than 1 of 255 or 65535, which is a mask of 0 and 1 saved as integers.
    """
    name = os.fspath(path)
    pixels = read(path, max_pixels=max_pixels).pixels
    rows, cols = shape[:2]
    if pixels.shape[:2] != (rows, cols):
        raise ValueError(
            f"{name}: the mask is {pixels.shape[1]} x {pixels.shape[0]} pixels (width x height) and must be "
            f"{cols} x {rows}: bring it to that size"
        )
    if pixels.dtype.kind != "f" and pixels.dtype not in (bool, np.uint8, np.uint16):
        raise ValueError(
            f"{name}: the mask holds {pixels.dtype} values: save it as bool, 8 or 16 bits, or floats 0 to 1"
        )
    colours, transparent = split_alpha(pixels)
    if pixels.dtype.kind == "f" and not (colours.min() >= 0 and colours.max() <= 1):
        raise ValueError(f"{name}: the mask holds {colours.min()} to {colours.max()}: bring its floats to 0 to 1")
    if pixels.dtype.kind == "u" and colours.max() == 1:
        full = np.iinfo(pixels.dtype).max
        raise ValueError(f"{name}: the mask holds 0 and 1 of {full}: save it as bool, or multiply it by {full}")
    bright = colours > _half(pixels.dtype)
    return (bright if bright.ndim == 2 else bright.any(axis=2)) & ~transparent


def _file_bytes(name: str, most: int) -> bytes:
    check_file(name, "the image", most)
    try:
        data = Path(name).read_bytes()
    except OSError as error:
        raise ValueError(f"{name} cannot be read ({error.strerror}): check the path of the image") from None
    if not data:
        raise ValueError(f"{name} is empty (0 bytes): give a file with an image in it")
    return data


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 100 else text[:97] + "..."


# ---------------------------------------------------------------- checking


def check_sample(array: ArrayLike, channel_axis: int | None, *, unknown: bool = False) -> Array:
    """Check that an array can serve as a sample, and bring its channels last.

    Parameters
    ----------
    array : array_like
        Two axes (rows, cols) where `channel_axis` is None, else three. bool, any integer and any
        real float type.
    channel_axis : int or None
        The axis that holds the channels; negative counts from the end.
    unknown : bool
        Whether floats may be NaN, which says that they are unknown, and values masked, which is for the caller to see.

    Returns
    -------
    ndarray, (rows, cols, channels)
        The values with their type, contiguous and in native byte order; a view of the input where
        it is so already.

    Raises
    ------
    TypeError
        The values are not real numbers, or `channel_axis` is not an integer.
    ValueError
        The number of axes does not fit, an axis is empty, or a value is infinite, or NaN or masked where none may be
        unknown.
    """
    if not unknown:
        unmasked("the sample", array)
    try:
        pixels = np.asarray(array)
    except ValueError:
        raise ValueError("the sample is ragged: give rows of equal length") from None
    if pixels.dtype.kind not in "buif":
        raise TypeError(f"the sample holds {pixels.dtype} values: convert it to integers or real floats")
    if channel_axis is None and pixels.ndim != 2:
        hint = ", or channel_axis=-1 if its last axis holds the channels" * (pixels.ndim == 3)
        raise ValueError(f"the sample is {pixels.ndim}-dimensional: give (rows, cols){hint}")
    if channel_axis is not None:
        if isinstance(channel_axis, bool) or not isinstance(channel_axis, (int, np.integer)):
            raise TypeError(f"channel_axis is {channel_axis!r}: give None or an integer")
        if pixels.ndim != 3:
            raise ValueError(
                f"the sample is {pixels.ndim}-dimensional: give three axes for "
                f"channel_axis={channel_axis}, one of them the channels"
            )
        if not -3 <= channel_axis < 3:
            raise ValueError(f"channel_axis is {channel_axis}: give one of -3 to 2")
    if pixels.size == 0:
        raise ValueError(f"the sample is empty, of shape {pixels.shape}: give at least one pixel")
    planes = pixels[..., np.newaxis] if channel_axis is None else np.moveaxis(pixels, channel_axis, -1)
    _check_finite(planes, unknown)
    return native(planes)


def _check_finite(planes: Array, unknown: bool) -> None:
    if planes.dtype.kind != "f":
        return
    bad = np.isinf(planes) if unknown else ~np.isfinite(planes)
    count = int(np.count_nonzero(bad))
    if count:
        row, column = (int(i) for i in np.unravel_index(int(bad.argmax()), bad.shape)[:2])
        what = "value that is" if count == 1 else "values that are"
        kind = "infinite" if unknown else "NaN or infinite"
        remedy = "give NaN where they are unknown" if unknown else "fill them first"
        raise ValueError(f"the sample has {count} {what} {kind}, the first at row {row}, column {column}: {remedy}")


def parse_size(text: str) -> tuple[int, int]:
    """Read the size of a picture, written WIDTHxHEIGHT as image tools write it.

    Parameters
    ----------
    text : str
        ``"640x480"`` is 640 columns and 480 rows; ``"512"`` alone is a square.

    Returns
    -------
    rows, cols : int
        In the order of an array's shape: the height first.

    Raises
    ------
    ValueError
        It is not one or two integers from 1 to 99999999.
    """
    match = re.fullmatch(r"\s*([0-9]{1,8})(?:\s*[xX\u00d7]\s*([0-9]{1,8}))?\s*", text)
    sides = [int(side) for side in match.groups() if side is not None] if match else []
    if not sides or 0 in sides:
        raise ValueError(
            f"size {text!r} is not WIDTHxHEIGHT: give columns x rows of 1 or more, as 640x480, or "
            "one number for a square"
        )
    return sides[-1], sides[0]


# ---------------------------------------------------------------- writing

_EIGHT = frozenset({"bool", "uint8"})
_SIXTEEN = _EIGHT | {"uint16"}
_NUMBERS = _SIXTEEN | {
    "uint32", "uint64", "int8", "int16", "int32", "int64", "float16", "float32", "float64",
}  # fmt: skip
# suffix: the types and the numbers of channels it holds without loss; None is any
_FORMATS: dict[str, tuple[frozenset[str] | None, tuple[int, ...] | None]] = {
    ".png": (_SIXTEEN, (1, 2, 3, 4)),
    ".tif": (_NUMBERS, None),
    ".tiff": (_NUMBERS, None),
    ".jpg": (_EIGHT, (1, 3)),
    ".jpeg": (_EIGHT, (1, 3)),
    ".webp": (_EIGHT, (1, 3, 4)),
    ".bmp": (_EIGHT, (1, 3)),
    ".gif": (_EIGHT, (1,)),
    ".ppm": (_SIXTEEN, (3,)),
    ".pgm": (_SIXTEEN, (1,)),
    ".npy": (None, None),
}

_OPTIONS: dict[str, dict[str, Any]] = {
    ".jpg": {"quality": 95, "subsampling": 0},
    ".jpeg": {"quality": 95, "subsampling": 0},
    ".webp": {"lossless": True, "exact": True},
}


def check_writable(
    path: PathLike,
    dtype: DTypeLike | None = None,
    channels: int | None = None,
    *,
    suffixes: Collection[str] | None = None,
) -> None:
    """Find out before long work whether its result can be written there.

    Parameters
    ----------
    path : path
        The file to be written later; nothing is created now.
    dtype : dtype, optional
        The type of the pixels; None leaves it unchecked.
    channels : int, optional
        The number of channels; None leaves it unchecked.
    suffixes : collection of str, optional
        The suffixes allowed, for writers of something other than pictures, as ``{".npz"}``.
        With it, `dtype` and `channels` are not looked at.

    Raises
    ------
    ValueError
        The path is a folder or a device, its folder is missing or not writable, or its suffix
        does not name a format that holds such pixels.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    known = _FORMATS if suffixes is None else suffixes
    check_target(target)
    if suffix not in known:
        what = f"ends in {target.suffix}" if suffix else "has no suffix"
        raise ValueError(f"{target} {what}: end its name in one of {', '.join(sorted(known))}")
    if suffixes is not None or _holds(suffix, dtype, channels):
        return
    other = suitable_suffix(dtype, channels)
    what = f"{np.dtype(dtype)} pixels" if dtype is not None else "pixels"
    if channels is not None:
        what += f" of {channels} channel" + "s" * (channels != 1)
    raise ValueError(f"{target}: {suffix} cannot hold {what}: end its name in {other} instead")


def suitable_suffix(dtype: DTypeLike | None, channels: int | None) -> str:
    """The suffix of a format that holds such pixels without loss: PNG, else TIFF, else NumPy's own."""
    return next(suffix for suffix in (".png", ".tif", ".npy") if _holds(suffix, dtype, channels))


def _holds(suffix: str, dtype: DTypeLike | None, channels: int | None) -> bool:
    types, counts = _FORMATS[suffix]
    return (dtype is None or types is None or np.dtype(dtype).name in types) and (
        channels is None or counts is None or channels in counts
    )


def write(path: PathLike, array: ArrayLike) -> None:
    """Write a picture in the format that the suffix names, whole or not at all.

    Parameters
    ----------
    path : path
        ``.png`` (8 or 16 bits), ``.tif`` ``.tiff`` (every type), ``.jpg`` ``.jpeg`` (quality 95),
        ``.webp`` (lossless), ``.bmp``, ``.gif`` (grey), ``.ppm``, ``.pgm``, or ``.npy``.
    array : array_like, (rows, cols) or (rows, cols, channels)
        The values are written as they are, bool as 0 and 255 (as bool in ``.npy``). Two and four
        channels of a PNG are grey and colour with alpha; WebP turns grey into equal RGB.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The path cannot be written, or its format cannot hold such pixels; it names one that can.
    """
    unmasked("the picture", array)
    pixels = np.asarray(array)
    if pixels.dtype.kind not in "buif":
        raise TypeError(f"the picture holds {pixels.dtype} values: give integers or real floats")
    if pixels.ndim not in (2, 3) or pixels.size == 0:
        raise ValueError(f"the picture has the shape {pixels.shape}: give (rows, cols) or (rows, cols, channels)")
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    check_writable(path, pixels.dtype, channels)
    suffix = Path(path).suffix.lower()
    if suffix != ".npy":
        pixels = pixels * np.uint8(255) if pixels.dtype == bool else pixels
        pixels = native(pixels[..., 0] if channels == 1 and pixels.ndim == 3 else pixels)
    with atomic_path(path) as temporary:
        encode(temporary, suffix, pixels)


def encode(path: Path, suffix: str, pixels: Array) -> None:
    """Write pixels that the format of the suffix holds, over whatever is there."""
    if suffix == ".npy":
        with path.open("wb") as file:
            np.save(Unbuffered(file), pixels, allow_pickle=False)
    elif suffix == ".png" and pixels.dtype == np.uint16:
        import imagecodecs  # here and below: a picture that needs the library waits for it, and no other

        path.write_bytes(imagecodecs.png_encode(pixels))
    elif suffix in (".tif", ".tiff"):
        _write_tiff(path, pixels)
    elif suffix in (".ppm", ".pgm"):
        _write_pnm(path, pixels)
    else:
        options = _OPTIONS.get(suffix, {})
        kind = PIL.Image.registered_extensions()[suffix]
        path.write_bytes(pillow_bytes(PIL.Image.fromarray(pixels), kind, **options))


def pillow_bytes(picture: PIL.Image.Image, kind: str, **options: Any) -> bytes:
    """A picture in a format of Pillow, which does not find out that a disk has taken a part of it alone."""
    buffer = io.BytesIO()
    picture.save(buffer, format=kind, **options)
    return buffer.getvalue()


def _write_tiff(path: Path, pixels: Array) -> None:
    import tifffile

    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    colours = 3 if channels in (3, 4) else 1
    tifffile.imwrite(
        path,
        pixels,
        photometric="rgb" if colours == 3 else "minisblack",
        planarconfig="contig" if channels > 1 else None,
        # a second or fourth channel is alpha, more than four are plain numbers
        extrasamples=(["unassalpha"] if channels in (2, 4) else [0] * (channels - colours)) or None,
        compression="zlib",
        metadata=None,
    )


def _write_pnm(path: Path, pixels: Array) -> None:
    kind = b"P5" if pixels.ndim == 2 else b"P6"
    largest = np.iinfo(pixels.dtype).max
    header = b"%s\n%d %d\n%d\n" % (kind, pixels.shape[1], pixels.shape[0], largest)
    path.write_bytes(header + pixels.astype(pixels.dtype.newbyteorder(">")).tobytes())


# ---------------------------------------------------------------- showing


def to_display(array: ArrayLike, limits: tuple[float, float] | None = None) -> NDArray[np.uint8]:
    """Turn pixels of any type into 8 bits for a preview.

    Parameters
    ----------
    array : array_like
        Any shape. uint8 comes back as it is, bool as 0 and 255.
    limits : (low, high), optional
        The values shown as 0 and 255, for every other type; pass the sample's smallest and
        largest value so that all previews of a run agree. Without it, those of `array`.

    Returns
    -------
    ndarray of uint8
        The shape of `array`; values outside the limits are clipped, all are mid-grey where
        low equals high.
    """
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
