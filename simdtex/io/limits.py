# SPDX-License-Identifier: BSD-3-Clause
"""Limits on the size of files: the header is checked before anything is decoded."""

from __future__ import annotations

import os
import stat
import zipfile
from collections.abc import Iterable
from math import prod
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from simdtex.options import whole

PathLike = str | os.PathLike[str]

VARIABLE = "SIMDTEX_MAX_PIXELS"
"""The environment variable that sets how many pixels a file may have."""

PIXELS = 2**27
"""The default limit: pixels of a picture or of a source map, cells of a table."""

BYTES = 8
"""A file may unpack to this many bytes for each allowed pixel."""


class TooLarge(ValueError):
    """A file exceeds a limit; the message continues after the file's name."""


def max_pixels_or_default(max_pixels: int | None) -> int:
    """Return the limit in pixels: the argument, else `VARIABLE` of the environment, else `PIXELS`."""
    if max_pixels is not None:
        whole("max_pixels", max_pixels, 1)
        return int(max_pixels)
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return PIXELS
    if not (text.isascii() and text.isdigit() and len(text) <= 18 and int(text) > 0):
        raise ValueError(f"{VARIABLE} is {text[:40]!r}: set it to a number of pixels, as 500000000, or leave it unset")
    return int(text)


def check_size(pixels: int, unpacked: int, most: int) -> None:
    """Raise TooLarge if a file has more pixels than `most`, or unpacks to more bytes than `most` pixels may have."""
    for count, what, limit in ((pixels, "pixels", most), (unpacked, "bytes", BYTES * most)):
        if count > limit:
            raise TooLarge(f"has {count} {what} and no more than {limit} are read: crop it, or set {VARIABLE} higher")


def check_array(shape: Iterable[int], itemsize: int, most: int) -> None:
    """Raise TooLarge if an array (rows, cols, ...) has too many pixels or bytes."""
    sides = [int(side) for side in shape]
    check_size(prod(sides[:2]), prod(sides) * itemsize, most)


def check_file(path: PathLike, what: str, most: int) -> None:
    """Raise unless a path is a regular file of an allowed size; `what` names it, for example ``"the image"``."""
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
        check_size(0, found.st_size, most)
    except TooLarge as error:
        raise ValueError(f"{name} {error}") from None


def read_npy(file: IO[bytes], length: int, most: int) -> NDArray[Any]:
    """Read an ``.npy`` array of `length` bytes, header included, if it is within the limits."""
    begin = file.tell()
    version = np.lib.format.read_magic(file)
    try:
        if version == (1, 0):
            shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, _, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise ValueError("it holds no plain array of numbers")
    except TokenError:
        raise ValueError("its header is damaged") from None
    if dtype.hasobject:
        raise ValueError("it holds Python objects and no numbers")
    check_array(shape, dtype.itemsize, most)
    if file.tell() - begin + prod(shape) * dtype.itemsize > length:
        raise ValueError("it ends before its last value")
    file.seek(begin)
    return np.asarray(np.lib.format.read_array(file, allow_pickle=False))


def read_npz(path: PathLike, name: str, most: int) -> NDArray[Any]:
    """Read the array called `name` from an ``.npz`` file, if it is within the limits."""
    with zipfile.ZipFile(path) as archive:
        member = archive.getinfo(f"{name}.npy")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError("it is compressed by another method than deflate")
        with archive.open(member) as file:
            return read_npy(file, member.file_size, most)
