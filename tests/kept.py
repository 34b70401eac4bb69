"""Results of runs that are computed once for a content of the source, and not again in each session.

This module imports nothing of the package: the key is computed before the code that it stands for is imported.
"""

import hashlib
import io
import os
import shutil
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

HERE = Path(__file__).resolve().parent
PACKAGE = Path(find_spec("simdtex").origin).resolve().parent
NEWEST = 4
"""Contents of the source whose results are kept."""


def sources():
    """Return every file that a result depends on, except the libraries."""
    folders = [one for one in (PACKAGE, PACKAGE / "kernels", PACKAGE.parent / "kernels") if one.is_dir()]
    found = {path for one in folders for path in one.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    return sorted(found | {HERE / "runs.py", HERE / "cases.py"})


def key(paths=None):
    """Return the hexadecimal hash of the names and bytes of files, and of the versions of Python and the libraries."""
    total = hashlib.sha256(sys.version.encode())
    for library in ("numpy", "scipy", "scikit-image"):
        total.update(version(library).encode())
    for path in sources() if paths is None else paths:
        data = path.read_bytes()
        total.update(f"\0{path}\0{len(data)}\0".encode() + data)
    return total.hexdigest()[:32]


class Kept:
    """The results by name, each some arrays and a text; ``folder`` keeps them across sessions, None does not."""

    def __init__(self, folder, key, now):
        self.made, self.key, self.now = {}, key, now
        self.folder = None if folder is None else Path(folder) / key
        if folder is not None:
            self.folder.mkdir(exist_ok=True)
            os.utime(self.folder)
            for old in sorted(Path(folder).iterdir(), key=os.path.getmtime)[:-NEWEST]:
                shutil.rmtree(old, ignore_errors=True)

    def __call__(self, name, make):
        """Return the result of a name: kept, or of ``make()``."""
        if name not in self.made:
            self.made[name] = self._read(name) or self._make(name, make)
        return self.made[name]

    def _file(self, name):
        return self.folder / f"{hashlib.sha256(name.encode()).hexdigest()[:32]}.npz"

    def _read(self, name):
        if self.folder is None or not self._file(name).is_file():
            return None
        try:
            with np.load(io.BytesIO(self._file(name).read_bytes()), allow_pickle=False) as found:
                return [found[str(n)] for n in range(len(found) - 1)], str(found["text"])
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None  # another process removed it, or it is damaged

    def _make(self, name, make):
        arrays, text = make()
        # The source as it is now, or the result is of code that was edited after it was imported.
        if self.folder is not None and self.now() == self.key:
            written = self._file(name).with_suffix(f".{os.getpid()}")
            with written.open("wb") as file:
                np.savez(file, text=text, **{str(n): one for n, one in enumerate(arrays)})
            os.replace(written, self._file(name))
        return arrays, text
