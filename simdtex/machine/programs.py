# SPDX-License-Identifier: BSD-3-Clause
"""A program that every process builds, kept as its binary.

Most runtimes, or pyopencl for them, look a program up by its text before they compile it. PoCL first reads a megabyte
of its own headers, a twentieth of a second for any program. Its binary loads in a thousandth; but it makes PoCL compile
every kernel once more, for work-groups of any size, which pays only for a tiny program that all processes build.
"""

from __future__ import annotations

import functools
import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import Any

import pyopencl as cl

from simdtex.machine import cache
from simdtex.machine.cache import POCL

FOLDER = "programs"
"""Of the cache folder."""


_ONE = RLock()  # what Python does with warnings is the same for all threads


@contextmanager
def building() -> Iterator[None]:
    """While a program is built: one thread at a time, and without the warning that a compiler has said something.

    Intel's runtime has a log even for a clean build.
    """
    with _ONE, warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        yield


def compiled(context: cl.Context, source: str, options: list[str]) -> Any:
    """Compile a program; the compiler's warnings, which Intel's prints by itself, are nobody's business.

    Returns
    -------
    pyopencl.Program

    Raises
    ------
    pyopencl.Error
        With the compiler's words.
    """
    options = ["-w", *options]
    with building():
        try:
            return cl.Program(context, source).build(options, cache_dir=_binaries())
        except (OSError, LookupError):  # pyopencl could not use its cache of binaries
            return cl.Program(context, source).build(options, cache_dir=False)  # type: ignore[arg-type]


@functools.cache
def _binaries() -> str | None:
    """Where pyopencl is to keep binaries for runtimes that do not: None is its own place."""
    import platformdirs

    if cache.writable(Path(platformdirs.user_cache_dir("pyopencl", "pyopencl"))):
        return None
    place = cache.spare("pyopencl")
    return str(place) if place else None


def build(context: cl.Context, source: str, options: list[str]) -> Any:
    """Build a program that includes nothing for the one device of a context, from what was kept where there is that.

    Returns
    -------
    pyopencl.Program

    Raises
    ------
    pyopencl.Error
        With the compiler's words.
    """
    with building():
        path = _place(context.devices[0], source, options)
        binary = _recall(path) if path else None
        if binary is not None:
            with suppress(cl.Error):  # one of a runtime that is gone is built anew
                return cl.Program(context, context.devices, [binary]).build(options)
        program = compiled(context, source, options)
        if path:
            with suppress(cl.Error):  # a runtime without a compiler for binaries is none the worse for it
                binary = program.get_info(cl.program_info.BINARIES)[0]
                cache.keep(path, hashlib.sha256(binary).digest() + binary)
        return program


def _place(device: cl.Device, source: str, options: list[str]) -> Path | None:
    """Where the binary is kept; None where it is not."""
    platform = device.platform
    folder = cache.folder() if platform.name == POCL else None
    if folder is None:
        return None
    told = [platform.version, device.name, device.version, device.driver_version, *options, source]
    return folder / FOLDER / hashlib.sha256("\0".join(told).encode()).hexdigest()


def _recall(path: Path) -> bytes | None:
    """The binary that was kept, if it is whole: a runtime need not survive any other."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    return data[32:] if hashlib.sha256(data[32:]).digest() == data[:32] else None
