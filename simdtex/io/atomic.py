# SPDX-License-Identifier: BSD-3-Clause
"""Files and folders that are written whole or not at all.

What is being written has a hidden name beside its final one, ``.simdtex-PLACE-PROCESS-TARGET-TOKEN`` and the target's
suffix. PLACE is of the host and its processes, so that what a killed process has left is told from what a live one
writes, and is removed when something is written into the same folder again.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import IO

__all__ = ["alone", "atomic_folder", "atomic_path", "check_place", "left_behind", "lock", "not_written"]

PathLike = str | os.PathLike[str]

_HEX = "[0-9a-f]{8}"
_PARTIAL = re.compile(rf"\.simdtex-({_HEX})-([0-9]+)-({_HEX})-{_HEX}(-old)?(\..*)?")


def check_place(target: Path) -> None:
    """Raise unless a file can be written there."""
    folder = target.parent
    try:
        if target.is_dir():
            raise ValueError(f"{target} is a folder: add a file name to it")
        if os.path.lexists(target) and target.exists() and not target.is_file():
            raise ValueError(f"{target} is not a regular file: give another name")
        if not folder.exists():
            raise ValueError(f"the folder {folder} does not exist: create it first")
        if not folder.is_dir():
            raise ValueError(f"{folder} is not a folder: give another path")
        os.stat(target)
    except FileNotFoundError:
        pass
    except OSError as error:
        raise ValueError(f"{_shortened(target)} cannot be written ({error.strerror}): give another path") from None
    if not os.access(os.path.dirname(os.path.realpath(target)), os.W_OK | os.X_OK):
        raise ValueError(f"the folder {folder} is not writable: choose another folder")


def _shortened(target: Path) -> str:
    text = str(target)
    return text if len(text) <= 100 else text[:97] + "..."


def not_written(path: PathLike, error: OSError) -> ValueError:
    """One sentence on a file or folder that could not be written, with its final name."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    if error.errno is None:  # NumPy and others tell how much was written, not why no more
        try:
            full = shutil.disk_usage(os.path.dirname(os.path.realpath(path))).free < 2**16
        except OSError:
            full = False
    if full:
        reason = os.strerror(error.errno or errno.ENOSPC)
    else:
        reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())[:100] or "unknown reason"
    return ValueError(
        f"{os.fspath(path)} could not be written ({reason}): {'free some space' if full else 'choose another path'}"
    )


@contextmanager
def atomic_path(path: PathLike) -> Iterator[Path]:
    """Give a temporary name beside `path`, and rename it to `path` when the block succeeds.

    A reader of `path` sees the old file or the whole new one, never a part. Whatever ends the
    block early, Ctrl-C included, removes the temporary file and leaves `path` as it was. What processes that were
    killed have left in the folder is removed first.

    Parameters
    ----------
    path : path
        The file to write; a link is followed. The temporary name has the same suffix.

    Yields
    ------
    Path
        An empty file to be overwritten.

    Raises
    ------
    ValueError
        The folder is missing or not writable, or `path` is a folder; or the block, or the renaming, raises an OSError,
        as for a full disk.
    """
    check_place(Path(path))
    target = Path(os.path.realpath(path))
    temporary = _beside(target)
    try:
        _sweep(target)
        # not tempfile: it would leave the finished file readable by its owner alone
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        _flush(temporary)
        os.replace(temporary, target)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        _remove(temporary)


@contextmanager
def atomic_folder(path: PathLike) -> Iterator[Path]:
    """Give an empty folder beside `path`, and rename it to `path` when the block succeeds.

    A folder that is at `path` is replaced whole at the end; whether it may be is for the caller to check. Whatever ends
    the block early, Ctrl-C included, removes the temporary folder and leaves `path` as it was. What processes that were
    killed have left beside it is removed first; an earlier folder that one had taken away is put back.

    Parameters
    ----------
    path : path
        The folder to write; a link is followed. The temporary name has the same suffix.

    Yields
    ------
    Path
        An empty folder to be filled.

    Raises
    ------
    ValueError
        The block, or the renaming, raises an OSError, as for a full disk.
    """
    target = Path(os.path.realpath(path))
    temporary, old = _beside(target), _beside(target, old=True)
    try:
        _sweep(target)
        temporary.mkdir()
        yield temporary
        for folder, _, names in os.walk(temporary):
            for name in names:
                _flush(Path(folder, name))
        try:
            if target.exists():
                target.rename(old)
            temporary.rename(target)
        except BaseException:
            if old.exists() and not target.exists():
                old.rename(target)
            raise
    except BaseException as error:
        _outlast(temporary)
        if isinstance(error, OSError):
            raise not_written(path, error) from None
        raise
    finally:
        _remove(temporary)
        if target.exists():
            _remove(old)


def _outlast(folder: Path) -> None:
    """Remove a folder in which threads of a library may go on to write for a while, as Zarr's do after Ctrl-C."""
    for _ in range(20):
        _remove(folder)
        time.sleep(0.05)
        if not folder.exists():
            return


@contextmanager
def scratch_folder(beside: PathLike) -> Iterator[Path]:
    """A folder for what is packed into the file `beside`, in the same place; it is gone afterwards."""
    temporary = _beside(Path(os.path.realpath(beside))).with_suffix("")
    try:
        temporary.mkdir()
        yield temporary
    finally:
        _remove(temporary)


@contextmanager
def alone(folder: PathLike) -> Iterator[None]:
    """Keep other processes off a folder; one that is killed keeps nobody off. Windows has no such thing.

    Raises
    ------
    ValueError
        Another one is at work in it.
    """
    if os.name == "nt":  # where a folder cannot be opened
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            lock(descriptor)
        except BlockingIOError:
            raise ValueError(f"another run is at work in {os.fspath(folder)} now; wait for it, or stop it") from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(descriptor)


def lock(descriptor: int) -> None:
    """Take an open file or folder for this process, until it is closed; on Windows nothing is done.

    Raises
    ------
    OSError
        BlockingIOError where another process has it; others where the file system has no locks.
    """
    try:
        import fcntl
    except ModuleNotFoundError:
        return
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Unbuffered:
    """A file for NumPy, which else writes past Python and does not find out that the last of it found no space."""

    def __init__(self, file: IO[bytes]) -> None:
        self.write = file.write


def _flush(file: Path) -> None:
    """Bring a file to the disk, which may find out only now that there is no space for it."""
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # there are file systems that cannot
            raise
    finally:
        os.close(descriptor)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


# ---------------------------------------------------------------- what is left behind


@cache
def _here() -> str:
    """Eight digits for the host and, in a container, its own numbering of processes."""
    try:
        numbering = os.readlink("/proc/self/ns/pid")
    except OSError:
        numbering = ""
    return _digits(f"{socket.gethostname()} {numbering}")


def _digits(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:8]


def _beside(target: Path, old: bool = False) -> Path:
    name = f".simdtex-{_here()}-{os.getpid()}-{_digits(target.name)}-{secrets.token_hex(4)}"
    return target.with_name(f"{name}-old" if old else f"{name}{target.suffix}")


def left_behind(name: str) -> re.Match[str] | None:
    """Whether a name is of something that a dead process of this host has not finished writing."""
    found = _PARTIAL.fullmatch(name) if name.startswith(".simdtex-") else None
    return None if found is None or found[1] != _here() or _is_alive(int(found[2])) else found


def _sweep(target: Path) -> None:
    """Remove what dead processes of this host have left in the target's folder."""
    for name in os.listdir(target.parent):
        if not (found := left_behind(name)):
            continue
        if not found[4]:
            _remove(target.with_name(name))
        elif found[3] == _digits(target.name):
            if target.exists():
                _remove(target.with_name(name))
            else:  # it was killed between taking the old folder away and putting the new one there
                target.with_name(name).rename(target)


def _is_alive(process: int) -> bool:
    if os.name != "posix":  # where there is no way to ask that does no harm
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
