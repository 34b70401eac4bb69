# SPDX-License-Identifier: BSD-3-Clause
"""What is remembered from one process to the next, in the user's cache folder.

SIMDTEX_CACHE names another folder; SIMDTEX_TUNE=0 leaves the folder alone. A folder of the user's choice that cannot be
written is let be; where the usual one cannot, a folder for temporary files takes its place.
"""

from __future__ import annotations

import functools
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path

FOLDER, SWITCH = "SIMDTEX_CACHE", "SIMDTEX_TUNE"
POCL = "Portable Computing Language"
"""The platform whose own cache needs care."""
PREFIX, SUFFIX = "simdtex-", ".tmp"
"""Of the name of a file that is being written."""
STALE = 24 * 60 * 60
"""Seconds after which nobody is still writing a file."""
ROOM = 2**16
"""Bytes that a folder must have room for: about those of a program."""


def folder() -> Path | None:
    """The folder, which there may not be yet; None where nothing is to be remembered."""
    if os.environ.get(SWITCH) == "0":
        return None
    chosen = os.environ.get(FOLDER)
    place = Path(chosen) if chosen else usual("simdtex")
    _tidy(place, not chosen)
    return place


@functools.cache
def usual(name: str) -> Path:
    """The user's cache folder for a program; the same in `spare` where nothing can be written there."""
    import platformdirs

    place = Path(platformdirs.user_cache_dir(name))
    return place if writable(place) else (spare(name) or place)


def writable(place: Path) -> bool:
    """Whether there is, or can be, such a folder with room for some files. It makes none, and leaves nothing behind."""
    while not os.path.lexists(place) and place != place.parent:
        place = place.parent
    try:
        with tempfile.TemporaryFile(dir=place, buffering=0) as file:
            return file.write(bytes(ROOM)) == ROOM
    except OSError:
        return False


def spare(name: str) -> Path | None:
    """A folder among the temporary files that nobody else can write, since programs are run from it; None without one.

    It is the same in the next process, unless somebody else has taken its name.
    """
    who = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "")
    try:
        place = Path(tempfile.gettempdir(), f"simdtex-{who}")
        with suppress(FileExistsError):
            place.mkdir(0o700)
        about = place.lstat()  # a link of somebody else's is no folder
        mine = not hasattr(os, "getuid") or (about.st_uid == os.getuid() and about.st_mode & 0o170077 == 0o040000)
        place = place / name
        if mine and writable(place):
            place.mkdir(exist_ok=True)
            return place
    except OSError:
        pass
    return None


def keep(path: Path, data: bytes) -> None:
    """Write a file anew beside the old one and put it in its place, so that nobody reads a part of it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(SUFFIX, PREFIX, path.parent)
    except OSError:
        return
    try:
        with open(handle, "wb") as file:
            file.write(data)
        os.replace(name, path)
    except BaseException as error:  # also Ctrl-C leaves no part of a file behind
        with suppress(OSError):
            os.unlink(name)
        if not isinstance(error, OSError):
            raise


@functools.cache
def _tidy(place: Path, ours: bool) -> None:
    """Remove, once in a process, what killed ones were writing; in a folder that the user chose by our prefix alone."""
    for part in (place, place / "programs"):
        try:
            names = [name for name in os.listdir(part) if name.endswith(SUFFIX)]
        except OSError:
            continue
        for name in names:
            if name.startswith((PREFIX, "tmp") if ours else PREFIX):  # "tmp": as earlier versions named them
                with suppress(OSError):
                    if time.time() - os.lstat(part / name).st_mtime > STALE:
                        os.unlink(part / name)
