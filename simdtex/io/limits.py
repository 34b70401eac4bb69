# SPDX-License-Identifier: BSD-3-Clause
"""How much a file may unpack to: looked at in its headers, before anything of it is decoded."""

from __future__ import annotations

import os
import stat
import zipfile
from collections.abc import Iterable
from math import prod
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from simdtex.options import whole

__all__ = ["BYTES", "PIXELS", "VARIABLE", "TooLarge", "max_pixels_or_default"]

PathLike = str | os.PathLike[str]

VARIABLE = "SIMDTEX_MAX_PIXELS"
"""The variable of the environment that says how many pixels a file may have."""

PIXELS = 2**27
"""Pixels of a picture, voxels of a volume or values' places of all realisations, at most, where nothing is said."""

BYTES = 8
"""Bytes that a file may unpack to for each of these pixels."""

PAGE = 2**13
"""There may be one page, slice or frame for so many pixels, since each takes time whatever its size."""


class TooLarge(ValueError):
    """A file has more in it than is allowed; the sentence goes on from the file's name."""


def max_pixels_or_default(max_pixels: int | None) -> int:
    """How many pixels a file may have: the argument, or `VARIABLE`, or `PIXELS`; raises where it is no such number."""
    if max_pixels is not None:
        whole("max_pixels", max_pixels, 1)
        return int(max_pixels)
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return PIXELS
    if not (text.isascii() and text.isdigit() and len(text) <= 18 and int(text) > 0):
        raise ValueError(f"{VARIABLE} is {text[:40]!r}: set it to a number of pixels, as 500000000, or leave it unset")
    return int(text)


def check_pixels(pixels: int, most: int) -> None:
    """Raise where a file has more pixels than `most`."""
    if pixels > most:
        raise TooLarge(f"has {pixels} pixels and no more than {most} are read: crop it, or set {VARIABLE} higher")


def check_parts(count: int, pixels: int, most: int) -> None:
    """Raise where so many pages, slices or frames of so many pixels are too many, or too many pixels together."""
    if count > max(1, most // PAGE):
        raise TooLarge(
            f"has {count} pages, slices or frames and no more than {max(1, most // PAGE)} are read: split it, or set "
            f"{VARIABLE} higher"
        )
    check_pixels(count * pixels, most)


def check_bytes(unpacked: int, most: int) -> None:
    """Raise where a file unpacks to more bytes than go with `most` pixels."""
    if unpacked > BYTES * most:
        raise TooLarge(
            f"unpacks to {unpacked} bytes and no more than {BYTES * most} are read: crop it, or set {VARIABLE} higher"
        )


def check_array(shape: Iterable[int], itemsize: int, axes: int, most: int) -> None:
    """Raise where an array is too large; its first `axes` are those of its pixels, and channels may follow."""
    sides = [int(side) for side in shape]
    check_pixels(prod(sides[:axes]), most)
    check_bytes(prod(sides) * itemsize, most)


def check_file(path: PathLike, what: str, most: int) -> None:
    """Raise unless a path is a regular file that is no larger than what it may unpack to.

    `what` says what it should be: ``"the volume"``.
    """
    name = os.fspath(path)
    try:
        found = os.stat(name)
    except FileNotFoundError:
        raise ValueError(f"{name} does not exist: check the path of {what}") from None
    except OSError as error:
        raise ValueError(f"{name} cannot be read ({error.strerror}): check the path of {what}") from None
    if stat.S_ISDIR(found.st_mode):
        raise ValueError(f"{name} is a folder: give the path of {what}, which is a file in it")
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"{name} is not a regular file: give the path of {what}")
    try:
        check_bytes(found.st_size, most)
    except TooLarge as error:
        raise ValueError(f"{name} {error}") from None


# ---------------------------------------------------------------- NumPy's own files


def read_npy(file: IO[bytes], length: int, axes: int, most: int) -> NDArray[Any]:
    """Read an array of `length` bytes with its header, if it is no larger than it may be."""
    begin = file.tell()
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    else:
        raise ValueError("it holds no plain array of numbers")
    if dtype.hasobject:
        raise ValueError("it holds objects of Python and no numbers")
    check_array(shape, dtype.itemsize, axes, most)
    if file.tell() - begin + prod(shape) * dtype.itemsize > length:
        raise ValueError("it ends before its last value")
    file.seek(begin)
    return np.asarray(np.lib.format.read_array(file, allow_pickle=False))


def check_zip(archive: zipfile.ZipFile, most: int) -> None:
    """Raise where a zip file unpacks to too much, or is packed in a way that does not say how much."""
    inside = archive.infolist()
    if any(one.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for one in inside):
        raise ValueError("it is packed by another method than deflate")
    check_bytes(sum(one.file_size for one in inside), most)


def read_npz(path: PathLike, name: str, axes: int, most: int, *, alone: bool = True) -> NDArray[Any]:
    """Read the array of a name from an ``.npz`` file or, if that suffices, the one that is `alone` in it."""
    with zipfile.ZipFile(path) as archive:
        check_zip(archive, most)
        names = [inside.removesuffix(".npy") for inside in archive.namelist()]
        if name not in names and not (alone and len(names) == 1):
            raise ValueError(f"it has the arrays {', '.join(names[:5])} and none called {name}")
        inside = archive.getinfo(f"{name if name in names else names[0]}.npy")
        with archive.open(inside) as file:
            return read_npy(file, inside.file_size, axes, most)
