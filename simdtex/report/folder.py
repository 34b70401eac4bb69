# SPDX-License-Identifier: BSD-3-Clause
"""Folders that a command writes several files into."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from simdtex.io.atomic import is_leftover


def earlier_files(folder: Path, what: str, own: Callable[[str], bool]) -> list[Path]:
    """Return the files of an earlier run in a folder, by name; raise before long work unless it can be written.

    The folder may exist if it holds files of its own kind only: ``own(name)`` says whether an earlier run may have
    written a file. ``what`` names in messages what is written there, as ``"the report"``. Unfinished files of a killed
    process are left to the atomic writer.
    """
    try:
        if folder.is_dir():
            found = sorted(path for path in folder.iterdir() if not is_leftover(path))
        elif folder.exists() or folder.is_symlink():
            raise ValueError(f"{folder} is a file: give a folder for {what}")
        elif not folder.parent.is_dir():
            raise ValueError(f"the folder {folder.parent} does not exist: create it first")
        else:
            with suppress(FileNotFoundError):
                os.lstat(folder)  # raises for a name that is too long, which `exists` hides since Python 3.14
            found = []
    except OSError as error:
        raise ValueError(f"{folder} cannot be used ({error.strerror}): give another folder") from None
    others = [path.name for path in found if not (own(path.name) and path.is_file())]
    if others:
        raise ValueError(f"the folder {folder} holds other files ({others[0]}): give an empty or a new one")
    if not os.access(folder if folder.is_dir() else folder.parent, os.W_OK | os.X_OK):
        raise ValueError(f"the folder {folder} is not writable: choose another folder")
    return found
