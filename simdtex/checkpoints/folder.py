# SPDX-License-Identifier: BSD-3-Clause
"""The folder of a checkpoint: files that are written whole or not at all, each with a checksum.

``checkpoint.json`` says what run it is of. A state is a pair of files, ``NAME-000001.npz`` with arrays and
``NAME-000001.json`` with everything else and the checksums of both; the latter comes last, so a state without it is
none. Nothing is pickled.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile

import numpy as np

from simdtex.checkpoints.tree import packed, unpacked
from simdtex.io.atomic import lock

FORMAT = 1
"""Of the files; another one is refused."""

JOB, LOCK, NEW = "checkpoint.json", "lock", ".new"

_STATE = re.compile(r"([a-z]+\d*)-(\d{6,})\.(json|npz)")


class Damaged(ValueError):
    """A file is not what was written."""


class Folder:
    """A folder that holds one checkpoint, or nothing yet.

    Parameters
    ----------
    path : Path
        Made where there is none; its parent must be there.

    Attributes
    ----------
    path : Path
    damaged : list of str
        Names of states that were found damaged and passed over; who tells of them clears it.

    Raises
    ------
    ValueError
        It is a file, holds something else, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(os.path.abspath(path))
        self.damaged: list[str] = []
        self._numbers: dict[str, list[int]] = {}
        self._lock: int | None = None
        try:
            if self.path.is_dir():
                others = [] if (self.path / JOB).exists() else self._others()
                if others:
                    raise ValueError(
                        f"the folder {path} holds other files ({others[0]}) and no checkpoint; "
                        "give an empty or a new one"
                    )
            elif os.path.lexists(self.path):
                raise ValueError(f"{path} is a file; give a folder for the checkpoint")
            elif not self.path.parent.is_dir():
                raise ValueError(f"the folder {self.path.parent} does not exist; create it first")
            elif not os.access(self.path.parent, os.W_OK | os.X_OK):
                raise ValueError(f"the folder {self.path.parent} is not writable; choose another for the checkpoint")
        except OSError as error:
            raise ValueError(f"{path} cannot be used ({error.strerror}); give another folder") from None

    def _others(self) -> list[str]:
        """Files there that a run that was killed at its very beginning has not left."""
        return sorted(entry.name for entry in self.path.iterdir() if entry.name not in (LOCK, JOB + NEW))

    # -- one at a time ----------------------------------------------------------------------------------------

    def take(self) -> None:
        """Make the folder, and keep other processes off it until `release`; a killed process holds nothing.

        Raises
        ------
        ValueError
            Another one has it, or it cannot be written.
        """
        try:
            self.path.mkdir(exist_ok=True)
            self._lock = os.open(self.path / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise ValueError(f"the folder {self.path} cannot be written ({error.strerror}); choose another") from None
        try:
            lock(self._lock)
        except OSError:
            self.release()
            raise ValueError(f"another run keeps its state in {self.path} now; wait for it, or stop it") from None

    def release(self) -> None:
        """Let others have it."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    # -- what run it is ---------------------------------------------------------------------------------------

    def job(self) -> dict[str, Any] | None:
        """What `keep_job` was given last; None where there is nothing yet.

        Raises
        ------
        ValueError
            The file is damaged, or of another format.
        """
        try:
            found: dict[str, Any] = _read_json(self.path / JOB)
        except FileNotFoundError:
            return None
        except Damaged:
            raise ValueError(
                f"{self.path / JOB} is damaged, so nothing says what run this is; "
                "remove the folder, and run the command again"
            ) from None
        except OSError as error:
            raise ValueError(f"{self.path / JOB} cannot be read ({error.strerror}); make it readable") from None
        if found.get("format") != FORMAT:
            raise ValueError(
                f"the checkpoint in {self.path} is of format {found.get('format')} and this simdtex reads {FORMAT}; "
                f"go on with simdtex {found.get('version')}, or give an empty folder"
            )
        return found

    def keep_job(self, job: dict[str, Any]) -> None:
        """Write what run it is, in place of what was there; raises OSError."""
        _write(self.path / JOB, _json_of({"format": FORMAT, **job}))

    # -- states -----------------------------------------------------------------------------------------------

    def keep(self, name: str, tree: Any, *, beside: bool = False) -> None:
        """Write a state, and remove all of this name but the two latest; with ``beside`` none.

        Raises
        ------
        OSError
            It could not be written; what was there before is there still.
        """
        told, arrays = packed(tree)
        number = 1 + max((n for n, _ in self._files(name)), default=0)
        stem = f"{name}-{number:06d}"
        named: dict[str, Any] = {str(k): array for k, array in enumerate(arrays)}
        check = _write(self.path / f"{stem}.npz", lambda file: np.savez(file, **named))
        _write(self.path / f"{stem}.json", _json_of({"format": FORMAT, "arrays": check, "tree": told}))
        whole = self._numbers.setdefault(name, [])
        whole.append(number)
        if not beside:
            del whole[:-2]
            self._remove(name, set(whole))

    def latest(self, name: str, *, anew: bool = False) -> Any:
        """The last state of a name that is whole, None where there is none or, with ``anew``, all are damaged.

        Raises
        ------
        ValueError
            There are some and all are damaged.
        """
        numbers = sorted({n for n, kind in self._files(name) if kind == "json"}, reverse=True)
        for number in numbers:
            try:
                found = self._state(f"{name}-{number:06d}")
            except (Damaged, OSError):
                self.damaged.append(f"{name}-{number:06d}")
                continue
            self._numbers[name] = [number]
            return found
        if numbers and not anew:
            raise ValueError(
                f"the state {name}-{numbers[0]:06d} in {self.path} is damaged and there is no earlier one; "
                "remove the folder, and run the command again"
            )
        return None

    def all(self, name: str) -> Iterator[Any]:
        """Every whole state of a name, in the order in which they were written."""
        for number in sorted({n for n, kind in self._files(name) if kind == "json"}):
            try:
                found = self._state(f"{name}-{number:06d}")
            except (Damaged, OSError):
                self.damaged.append(f"{name}-{number:06d}")
                continue
            yield found

    def forget(self, name: str | None = None) -> None:
        """Remove the states of a name, or all, and what an interrupted run left half written."""
        self._remove(name, set())
        if name is None:
            self.tidy()

    def tidy(self) -> None:
        """Remove what an interrupted run left half written."""
        for path in self.path.glob(f"*{NEW}"):
            if _ours(path.name):
                _removed(path)

    def _state(self, stem: str) -> Any:
        told = _read_json(self.path / f"{stem}.json")
        with open(self.path / f"{stem}.npz", "rb") as file:
            if told.get("format") != FORMAT or hashlib.file_digest(file, "sha256").hexdigest() != told.get("arrays"):
                raise Damaged
            file.seek(0)
            try:
                with np.load(file, allow_pickle=False) as arrays:
                    return unpacked(told["tree"], [arrays[str(k)] for k in range(len(arrays.files))])
            except (ValueError, KeyError, IndexError, TypeError, BadZipFile):
                raise Damaged from None

    def _files(self, name: str | None) -> list[tuple[int, str]]:
        """Number and kind of the files of states."""
        matches = [_STATE.fullmatch(entry.name) for entry in self.path.iterdir()] if self.path.is_dir() else []
        return [(int(match[2]), match[3]) for match in matches if match and name in (None, match[1])]

    def _remove(self, name: str | None, but: set[int]) -> None:
        for entry in sorted(self.path.iterdir()):  # .json before .npz
            match = _STATE.fullmatch(entry.name)
            if match and name in (None, match[1]) and int(match[2]) not in but:
                _removed(entry)


def _ours(name: str) -> bool:
    name = name.removesuffix(NEW)
    return name in (JOB, LOCK) or bool(_STATE.fullmatch(name))


def _removed(path: Path) -> None:
    with contextlib.suppress(OSError):  # it does no harm
        path.unlink()


def _json_of(content: dict[str, Any]) -> Callable[[BinaryIO], Any]:
    """What writes this with its own checksum."""
    body = json.dumps(content)
    check = hashlib.sha256(body.encode()).hexdigest()
    return lambda file: file.write(f'{{"sha256": "{check}",\n"content": {body}}}\n'.encode())


def _read_json(path: Path) -> Any:
    """What was written by `_json_of`; raises Damaged where it is not that."""
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        content, check = told["content"], told["sha256"]
        whole = isinstance(content, dict) and hashlib.sha256(json.dumps(content).encode()).hexdigest() == check
    except (ValueError, KeyError, TypeError, RecursionError):
        raise Damaged from None
    if not whole:
        raise Damaged
    return content


def _write(path: Path, write: Callable[[BinaryIO], Any]) -> str:
    """Write a file beside its place, see it onto the disk, and put it there; its SHA-256."""
    new = path.with_name(path.name + NEW)
    try:
        with open(new, "w+b") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
            file.seek(0)
            check = hashlib.file_digest(file, "sha256").hexdigest()
        os.replace(new, path)
        _seen_to_disk(path.parent)
    except BaseException:
        _removed(new)
        raise
    return check


def _seen_to_disk(folder: Path) -> None:
    """See the names in a folder onto the disk, where folders can be opened."""
    if os.name == "nt":
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
