# SPDX-License-Identifier: BSD-3-Clause
"""Calls to the system that fail: the n-th of those that a command makes to write."""

import builtins
import contextlib
import errno
import io
import os
import resource
from pathlib import Path

ERRORS = ("ENOSPC", "EIO", "EACCES")
CALLS = ("open", "write", "fsync", "replace", "mkdir")
"""What may fail: files opened to be written, bytes written to them, and what makes them last."""

SIZES = (600, 900, 1500, 2500, 4000, 6000)
"""Bytes that files may have at most, for libraries that write by themselves: ``("size", 900, "EFBIG")``."""


class _Calls:
    """Counts calls within a folder, and fails the n-th, and with ``ENOSPC`` every later one that writes bytes."""

    def __init__(self, fault, folder):
        self.call, self.number, self.error = fault or ("", 0, "")
        self.folder, self.count, self.fired = str(folder), 0, False

    def note(self, call, path=None):
        if call != self.call or (path is not None and not self.inside(path)):
            return
        self.count += 1
        full = self.error == "ENOSPC" and call == "write"  # a disk that is full stays so
        if self.count == self.number or (full and self.fired):
            self.fired = True
            number = getattr(errno, self.error)
            raise OSError(number, os.strerror(number), *([os.fspath(path)] if path is not None else []))

    def inside(self, path):
        if not isinstance(path, (str, bytes, os.PathLike)):
            return True
        return os.path.abspath(os.fsdecode(path)).startswith(self.folder)


class _Raw(io.FileIO):
    """A file whose bytes may not be written."""

    calls: _Calls

    def write(self, data):
        self.calls.note("write")
        return super().write(data)


@contextlib.contextmanager
def failing(fault, folder):
    """Let a call fail, as ``("write", 3, "ENOSPC")``, the third write to a file within a folder; None: none."""
    calls = _Calls(fault, Path(folder).resolve())
    if not fault:
        yield calls
        return
    if fault[0] == "size":
        yield from _small_files(calls)
        return
    real = {name: getattr(os, name) for name in ("write", "fsync", "replace", "rename", "mkdir", "open")}
    plain = io.open

    def opened(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, closefd=True, opener=None):
        if not set(mode) & set("wax+") or not calls.inside(file):
            return plain(file, mode, buffering, encoding, errors, newline, closefd, opener)
        if not isinstance(file, int):
            calls.note("open", file)
        binary = mode.replace("b", "").replace("t", "")
        raw = _Raw(file, binary, closefd=closefd, opener=opener)
        raw.calls = calls
        if buffering == 0:
            return raw
        buffered = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding, errors, newline, buffering == 1)

    def wrapped(name, call):
        def function(first, *args, **kwargs):
            calls.note(call, None if isinstance(first, int) else first)
            return real[name](first, *args, **kwargs)

        return function

    def opening(path, flags, *args, **kwargs):
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            calls.note("open", path)
        return real["open"](path, flags, *args, **kwargs)

    calls_of = {"write": "write", "fsync": "fsync", "replace": "replace", "rename": "replace", "mkdir": "mkdir"}
    changed = {name: wrapped(name, call) for name, call in calls_of.items()}
    changed["open"] = opening
    for name, function in changed.items():
        setattr(os, name, function)
    builtins.open = io.open = opened
    try:
        yield calls
    finally:
        builtins.open = io.open = plain
        for name, function in real.items():
            setattr(os, name, function)


def _small_files(calls):
    """No file grows beyond a size; whether one would have, nobody can tell."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (calls.number, before[1]))
    try:
        yield calls
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
