# SPDX-License-Identifier: BSD-3-Clause
"""Limits on the size of files: the header is checked before anything is decoded."""

from __future__ import annotations

import logging
import os
import stat
import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from math import prod
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from simdtex.options import whole

PathLike = str | os.PathLike[str]

VARIABLE = "SIMDTEX_MAX_PIXELS"
"""The environment variable with the most pixels of a file."""

PIXELS = 2**27
"""The default limit: pixels of a picture or of a source map, cells of a table."""

BYTES = 8
"""The most bytes to which a file may unpack, for each allowed pixel."""


class Unreadable(ValueError):
    """A file is not read; the message is a sentence that names it."""


class Refused(ValueError):
    """A file is not read; the message starts after the file's name."""


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


def check_size(pixels: int, unpacked: int, most: int, each: int = BYTES) -> None:
    """Raise Refused if ``pixels`` exceeds ``most``, or the ``unpacked`` bytes exceed ``most`` times ``each``."""
    for count, what, limit in ((pixels, "pixels", most), (unpacked, "bytes", each * most)):
        if count > limit:
            raise Refused(f"has {count} {what} and no more than {limit} are read: crop it, or set {VARIABLE} higher")


def check_array(shape: Iterable[int], itemsize: int, most: int) -> None:
    """Raise Refused if an array (rows, cols, ...) has too many pixels or bytes."""
    sides = [int(side) for side in shape]
    check_size(prod(sides[:2]), prod(sides) * itemsize, most)


def needs(library: str, extra: str, what: str) -> None:
    """Raise Refused unless the library of an extra of the package is installed; ``what`` is the kind of the file."""
    if find_spec(library) is None:
        raise Refused(f"is {what}: pip install 'simdtex[{extra}]' to read it")


@contextmanager
def reading(path: PathLike, what: str, max_pixels: int | None, *, each: int = BYTES, kind: str = "") -> Iterator[int]:
    """Check a regular file and yield the most pixels to read; errors of the block name the file and a remedy.

    ``what`` names it, for example ``"the image"``; it may have ``each`` bytes for every allowed pixel. ``kind`` is that
    of `explained`.
    """
    name, most = os.fspath(path), max_pixels_or_default(max_pixels)
    with explained(name, what, kind):
        found = os.stat(name)
        if stat.S_ISDIR(found.st_mode):
            raise Refused(f"is a folder: give the path of {what}, which is a file in it")
        if not stat.S_ISREG(found.st_mode):
            raise Refused(f"is not a regular file: give the path of {what}")
        check_size(0, found.st_size, most, each)
        yield most


@contextmanager
def explained(name: str, what: str, kind: str = "") -> Iterator[None]:
    """Raise errors of the block as Unreadable, whose sentence names the file and a remedy.

    With ``kind`` any error comes from a library for which the file is damaged, and the message says that it is no
    ``kind``.
    """
    try:
        yield
    except Unreadable:
        raise
    except Refused as error:
        raise Unreadable(f"{name} {error}") from None
    except MemoryError:
        raise Unreadable(f"{name} is too large for the memory: crop it first") from None
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:
            missing = isinstance(error, FileNotFoundError)
            reason = "does not exist" if missing else f"cannot be read ({error.strerror})"
            raise Unreadable(f"{name} {reason}: check the path of {what}") from None
        text = " ".join(str(error).split()) or type(error).__name__
        if kind:
            text = text if len(text) <= 100 else text[:97] + "..."
            raise Unreadable(f"{name} cannot be read as {kind} ({text}): it may be damaged; save it again") from None
        if isinstance(error, (OSError, TypeError, ValueError)):
            raise Unreadable(f"{name}: {text}") from None
        raise


def read_npy(file: IO[bytes], length: int, most: int) -> NDArray[Any]:
    """Return an ``.npy`` array of ``length`` bytes, including its header, if it is within the limits."""
    begin = file.tell()
    headers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if not (read_header := headers.get(np.lib.format.read_magic(file))):
        raise ValueError("it holds no plain array of numbers")
    try:
        shape, _, dtype = read_header(file)
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
    """Return the array ``name`` of an ``.npz`` file, if it is within the limits."""
    with zipfile.ZipFile(path) as archive:
        member = archive.getinfo(f"{name}.npy")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError("it is compressed by another method than deflate")
        with archive.open(member) as file:
            return read_npy(file, member.file_size, most)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress warnings and the log of tifffile: a damaged file is reported in one sentence."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before
