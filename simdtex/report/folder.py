# SPDX-License-Identifier: BSD-3-Clause
"""Folders that a command writes several files into."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from pathlib import Path

from simdtex.io.atomic import is_leftover


def earlier_files(folder: Path, what: str, own: Callable[[Path], Collection[str]]) -> list[Path]:
    """What an earlier run has left in a folder that is about to be written; raises before the work, not after it.

    Parameters
    ----------
    folder : Path
        It may exist if it is empty or holds files of its own kind only; its parent must.
    what : str
        Is to be written there, for the sentence: ``"the report"``.
    own : callable
        The names, of those in the folder, that an earlier run may have written.

    Returns
    -------
    list of Path
        All files there, by name, but for those that a killed process has not finished; writing removes them.

    Raises
    ------
    ValueError
        It is a file, holds other files, is not writable, or its parent is missing.
    """
    try:
        if folder.is_dir():
            found = sorted(path for path in folder.iterdir() if not is_leftover(path.name))
        elif folder.exists() or folder.is_symlink():
            raise ValueError(f"{folder} is a file: give a folder for {what}")
        elif not folder.parent.is_dir():
            raise ValueError(f"the folder {folder.parent} does not exist: create it first")
        else:
            found = []
    except OSError as error:
        raise ValueError(f"{folder} cannot be used ({error.strerror}): give another folder") from None
    ours = own(folder) if found else ()
    others = [path.name for path in found if path.name not in ours or not path.is_file()]
    if others:
        raise ValueError(f"the folder {folder} holds other files ({others[0]}): give an empty or a new one")
    if not os.access(folder if folder.is_dir() else folder.parent, os.W_OK | os.X_OK):
        raise ValueError(f"the folder {folder} is not writable: choose another folder")
    return found
