# SPDX-License-Identifier: BSD-3-Clause
"""What is remembered from one process to the next, in the user's cache folder.

SIMDTEX_CACHE names another folder; SIMDTEX_TUNE=0 leaves the folder alone. A folder that cannot be written is let be.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

FOLDER, SWITCH = "SIMDTEX_CACHE", "SIMDTEX_TUNE"


def folder() -> Path | None:
    """The folder, which there may not be yet; None where nothing is to be remembered."""
    if os.environ.get(SWITCH) == "0":
        return None
    import platformdirs

    return Path(os.environ.get(FOLDER) or platformdirs.user_cache_dir("simdtex"))


def keep(path: Path, data: bytes) -> None:
    """Write a file anew beside the old one and put it in its place, so that nobody reads a part of it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("wb", dir=path.parent, suffix=".tmp", delete=False) as file:
            file.write(data)
        os.replace(file.name, path)
    except OSError:
        return
