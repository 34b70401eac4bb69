# SPDX-License-Identifier: BSD-3-Clause
"""Reading and writing solid textures without changing a single value of them.

A volume is an array (depth, rows, cols) or (depth, rows, cols, channels): x-y slices one behind the other, each like a
picture with row 0 at the top. x is the column, y the row, z the depth.
"""

from __future__ import annotations

import bz2
import gzip
import os
import re
import warnings
from collections.abc import Callable
from math import prod
from pathlib import Path
from typing import IO, Any

import imagecodecs
import nrrd
import numpy as np
import tifffile
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io import image
from simdtex.io.atomic import Unbuffered
from simdtex.io.decode import check_page, check_png, count_pages, native, quiet
from simdtex.io.limits import (
    TooLarge,
    check_array,
    check_bytes,
    check_file,
    check_parts,
    max_pixels_or_default,
    read_npy,
    read_npz,
)
from simdtex.options import unmasked

__all__ = ["check_writable", "read", "write"]

Array = NDArray[Any]
PathLike = str | os.PathLike[str]

KEY = "volume"
"""The name of the array in an ``.npz`` file."""

_WHOLE = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_NRRD = _WHOLE | {"float32", "float64"}
# suffix, "" for a folder of slices: the types and the numbers of channels it holds without loss; None is any
_FORMATS: dict[str, tuple[frozenset[str] | None, tuple[int, ...] | None]] = {
    ".npz": (None, None),
    ".npy": (None, None),
    ".tif": (_NRRD | {"float16"}, None),
    ".tiff": (_NRRD | {"float16"}, None),
    ".nrrd": (_NRRD, None),
    "": (frozenset({"uint8", "uint16"}), (1, 2, 3, 4)),
}
_SLICE = re.compile(r"slice-([0-9]{3,})\.png")
_BIG = 2**32 - 2**25  # bytes from which on a TIFF must be a BigTIFF


# ---------------------------------------------------------------- writing


def check_writable(path: PathLike, dtype: DTypeLike | None = None, channels: int | None = None) -> None:
    """Find out before long work whether its result can be written there.

    Parameters
    ----------
    path : path
        The file, or the folder of slices, to be written later; nothing is created now.
    dtype : dtype, optional
        The type of the values; None leaves it unchecked.
    channels : int, optional
        The number of channels; None leaves it unchecked.

    Raises
    ------
    ValueError
        The suffix names no format that holds such values, or the place cannot be written; a folder is only replaced
        where nothing but slices is in it.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(
            f"{target} ends in {target.suffix}: end its name in one of {', '.join(sorted(filter(None, _FORMATS)))}, "
            "or give a name without suffix for a folder of PNG slices"
        )
    if not suffix and os.path.isdir(target):
        _check_folder(target)
    else:
        image.check_writable(target, suffixes=(suffix,))
        if not suffix and target.exists():
            raise ValueError(f"{target} is a file: give another name for the folder of slices, or a suffix")
    if _holds(suffix, dtype, channels):
        return
    other = next(s for s in (".nrrd", ".tif", ".npz") if _holds(s, dtype, channels))
    what = "values" if dtype is None else f"{np.dtype(dtype)} values"
    if channels is not None:
        what += f" of {channels} channel" + "s" * (channels != 1)
    raise ValueError(f"{target}: {suffix or 'PNG slices'} cannot hold {what}: end its name in {other} instead")


def _holds(suffix: str, dtype: DTypeLike | None, channels: int | None) -> bool:
    types, counts = _FORMATS[suffix]
    return (dtype is None or types is None or np.dtype(dtype).name in types) and (
        channels is None or counts is None or channels in counts
    )


def _check_folder(target: Path) -> None:
    if any(not _SLICE.fullmatch(name) for name in os.listdir(target)):
        raise ValueError(f"{target} is a folder with other files in it: give a new name for the folder of slices")
    if not os.access(os.path.dirname(os.path.realpath(target)), os.W_OK | os.X_OK):
        raise ValueError(f"the folder {target.parent} is not writable: choose another folder")


def write(path: PathLike, volume: ArrayLike, channel_axis: int | None = None) -> None:
    """Write a solid texture in the format that the suffix names, whole or not at all.

    Parameters
    ----------
    path : path
        ``.npz`` (compressed, key ``"volume"``) or ``.npy``, of any type; ``.tif`` ``.tiff``, a page for each slice, of
        any type but bool; ``.nrrd``, integers and floats of 32 and 64 bits; or a name without suffix for a folder
        of slices ``slice-000.png``, 8 or 16 bits, up to 4 channels. A folder of slices that is there is replaced.
    volume : array_like, (depth, rows, cols) or with channels
        Real numbers, written as they are.
    channel_axis : int, optional
        The axis of the channels; None takes the last one of four.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The path cannot be written, or its format cannot hold such values; it names one that can.

    Notes
    -----
    A single channel is written as none, but in ``.npz`` and ``.npy``. In an NRRD file x runs fastest, then y, then z,
    with the channels as a vector before them: what ParaView, 3D Slicer and Fiji expect. It is not compressed, because
    not every version of ParaView decompresses.
    """
    values = _checked(volume, channel_axis)
    check_writable(path, values.dtype, values.shape[3] if values.ndim == 4 else 1)
    suffix = Path(path).suffix.lower()
    if suffix not in (".npz", ".npy") and values.ndim == 4 and values.shape[3] == 1:
        values = values[..., 0]
    with image.atomic_folder(path) if not suffix else image.atomic_path(path) as temporary:
        _ENCODERS[suffix](temporary, values)


def _checked(volume: ArrayLike, channel_axis: int | None) -> Array:
    """The values with their channels, if any, last; contiguous."""
    unmasked("the volume", volume)
    values = np.asarray(volume)
    if values.dtype.kind not in "buif":
        raise TypeError(f"the volume holds {values.dtype} values: give integers or real floats")
    if values.ndim not in (3, 4) or values.size == 0:
        raise ValueError(
            f"the volume has the shape {values.shape}: give (depth, rows, cols) or (depth, rows, cols, channels)"
        )
    if channel_axis is not None:
        if values.ndim != 4 or not -4 <= channel_axis < 4:
            raise ValueError(
                f"channel_axis is {channel_axis} and the volume has {values.ndim} axes: give None, or one of four axes"
            )
        values = np.moveaxis(values, channel_axis, -1)
    return native(values)


def _write_npz(path: Path, values: Array) -> None:
    with path.open("wb") as file:  # NumPy would add its own suffix to a name in capitals
        np.savez_compressed(file, volume=values)


def _write_npy(path: Path, values: Array) -> None:
    with path.open("wb") as file:
        np.save(Unbuffered(file), values, allow_pickle=False)


def _write_tiff(path: Path, values: Array) -> None:
    channels = values.shape[3] if values.ndim == 4 else 1
    colours = 3 if channels in (3, 4) else 1
    with tifffile.TiffWriter(path, bigtiff=values.nbytes > _BIG) as file:
        for page in values:
            file.write(
                page,
                photometric="rgb" if colours == 3 else "minisblack",
                planarconfig="contig" if channels > 1 else None,
                # a second or fourth channel is alpha, more than four are plain numbers
                extrasamples=(["unassalpha"] if channels in (2, 4) else [0] * (channels - colours)) or None,
                compression="zlib",
                metadata=None,
            )


def _write_nrrd(path: Path, values: Array) -> None:
    # without the fields of a space: VTK would read the sizes of a vector volume wrongly after them
    header = {"encoding": "raw", "kinds": ["vector"] * (values.ndim - 3) + ["domain"] * 3}
    with warnings.catch_warnings(), path.open("wb") as file:
        warnings.simplefilter("ignore", DeprecationWarning)  # pynrrd asks for the time in an old way
        nrrd.write(file, values, header, index_order="C")


def _write_slices(path: Path, values: Array) -> None:
    digits = max(3, len(str(len(values) - 1)))
    for number, picture in enumerate(values):
        image.encode(path / f"slice-{number:0{digits}}.png", ".png", native(picture))


_ENCODERS: dict[str, Callable[[Path, Array], None]] = {
    ".npz": _write_npz,
    ".npy": _write_npy,
    ".tif": _write_tiff,
    ".tiff": _write_tiff,
    ".nrrd": _write_nrrd,
    "": _write_slices,
}


# ---------------------------------------------------------------- reading


def read(path: PathLike, *, max_pixels: int | None = None) -> Array:
    """Read a solid texture that `write` or another program has written.

    Parameters
    ----------
    path : path
        A file ``.npz`` (key ``"volume"``, or its only array), ``.npy``, ``.tif``, ``.tiff`` (a page for each slice) or
        ``.nrrd`` (with its data in the same file), or a folder of slices ``slice-000.png``, ...
    max_pixels : int, optional
        Voxels that are read at most, and 8 bytes for each; and one slice for 8192 of them. None:
        ``SIMDTEX_MAX_PIXELS`` of the environment, else 2**27. The headers are asked, before anything is decoded.

    Returns
    -------
    ndarray, (depth, rows, cols) or (depth, rows, cols, channels)
        The values with their type, in native byte order.

    Raises
    ------
    ValueError
        There is no such file or folder, it is damaged, too large, or does not hold a volume.
    """
    target = Path(path)
    most = max_pixels_or_default(max_pixels)
    folder = os.path.isdir(target)
    suffix = "" if folder else target.suffix.lower()
    if not os.path.exists(target):
        raise ValueError(f"{target} does not exist: check the path of the volume")
    if suffix not in _DECODERS or (not suffix and not folder):
        raise ValueError(
            f"{target} is of no kind that is known here: give a folder of slices, or a file that ends in one of "
            f"{', '.join(sorted(filter(None, _DECODERS)))}"
        )
    if not folder:
        check_file(target, "the volume", most)
    try:
        return _checked(_DECODERS[suffix](target, most), None)
    except TooLarge as error:
        raise ValueError(f"{target} {error}") from None
    except MemoryError:
        raise ValueError(f"{target} is too large for the memory: crop it first") from None
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else _one_line(error)
        raise ValueError(f"{target} cannot be read ({reason}): check the file") from None
    except Exception as error:  # every decoder has its own exceptions for a damaged file
        raise ValueError(f"{target} cannot be read as a volume ({_one_line(error)}): write it again") from None


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 200 else text[:197] + "..."


def _read_npz(path: Path, most: int) -> Array:
    return read_npz(path, KEY, 3, most)


def _read_npy(path: Path, most: int) -> Array:
    with path.open("rb") as file:
        return read_npy(file, os.fstat(file.fileno()).st_size, 3, most)


def _read_tiff(path: Path, most: int) -> Array:
    with quiet("tifffile"), path.open("rb") as file:
        count = count_pages(file, most)
        with tifffile.TiffFile(file) as tiff:
            slices: list[Array] = []
            for number in range(count):
                page: Any = tiff.pages.get(number)
                check_page(page, most)
                pixels = page.imagewidth * page.imagelength * page.imagedepth
                check_parts(count, pixels, most)
                check_bytes(count * prod(page.shape) * (page.dtype.itemsize if page.dtype else 8), most)
                slices.append(_page(page))
                if slices[-1].shape != slices[0].shape or slices[-1].dtype != slices[0].dtype:
                    raise ValueError(f"page {number} is of another size or type than the first")
            return np.stack(slices)


def _page(page: Any) -> Array:
    separate = page.axes == "SYX"
    return np.moveaxis(page.asarray(), 0, -1) if separate else np.asarray(page.asarray())


_PACKED: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("gzip", "gz"), lambda file: gzip.GzipFile(fileobj=file)),
    **dict.fromkeys(("bzip2", "bz2"), bz2.BZ2File),
}
_PLAIN = ("raw", "ascii", "text", "txt")


def _read_nrrd(path: Path, most: int) -> Array:
    size = path.stat().st_size
    with warnings.catch_warnings(), path.open("rb") as file:
        warnings.simplefilter("ignore")
        header = nrrd.read_header(file)
        if any(field.lower().replace(" ", "") == "datafile" for field in header):
            raise ValueError("its data is in another file; save both as one .nrrd")
        sides = [int(side) for side in header["sizes"]]
        if min(sides) < 1 or int(header.get("line skip", header.get("lineskip", 0))) > size:
            raise ValueError("its header tells of sides or lines that cannot be")
        check_array(sorted(sides, reverse=True), 1, 3, most)
        encoding = str(header.get("encoding")).lower()
        if encoding in _PACKED:
            begin = file.tell()
            _check_packed(_PACKED[encoding](file), most)
            file.seek(begin)
        elif encoding not in _PLAIN:
            raise ValueError(f"its encoding is {encoding[:40]} and not raw, ascii, gzip or bzip2")
        return np.asarray(nrrd.read_data(header, file, str(path), index_order="C"))


def _check_packed(stream: IO[bytes], most: int) -> None:
    """Raise where data unpacks to too much; it is unpacked piece by piece, and nothing of it is kept."""
    unpacked = 0
    try:
        while piece := stream.read(2**20):
            unpacked += len(piece)
            check_bytes(unpacked, most)
    except EOFError:
        pass  # it ends early, which is for the reader to say


def _read_slices(path: Path, most: int) -> Array:
    numbered = {int(match[1]): name for name in os.listdir(path) if (match := _SLICE.fullmatch(name))}
    if sorted(numbered) != list(range(len(numbered))) or not numbered:
        raise ValueError("it has no slices slice-000.png, slice-001.png and so on without a gap")
    # not image.read, which leaves an opaque alpha channel out
    slices: list[Array] = []
    for number in range(len(numbered)):
        file = path / numbered[number]
        check_file(file, "the slice", most)
        data = file.read_bytes()
        check_png(data, most, len(numbered))
        slices.append(imagecodecs.png_decode(data))
        if slices[-1].shape != slices[0].shape or slices[-1].dtype != slices[0].dtype:
            raise ValueError(f"{file.name} is of another size or type than the first slice")
    return np.stack(slices)


_DECODERS: dict[str, Callable[[Path, int], Array]] = {
    ".npz": _read_npz,
    ".npy": _read_npy,
    ".tif": _read_tiff,
    ".tiff": _read_tiff,
    ".nrrd": _read_nrrd,
    "": _read_slices,
}
