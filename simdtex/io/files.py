# SPDX-License-Identifier: BSD-3-Clause
"""The one writer of files and folders, and the limits on the size of what is read.

An incomplete file has a hidden name in the target's folder, ``.simdtex-TOKEN`` with the target's suffix, is locked by
its writer, and is renamed at the end. A killed process leaves it; a later write into the folder removes it when it is
a day old. The header of a file to read is checked against the limits before anything is decoded.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import re
import secrets
import shutil
import stat
import time
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, BinaryIO

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


def check_beside(path: PathLike, others: Iterable[PathLike]) -> None:
    """Raise Refused unless all files to which a file refers are in its folder, also if they are links."""
    folders = Path(os.path.realpath(path)).parent, Path(path).parent.resolve()
    for other in map(os.path.realpath, others):
        if Path(other).parent not in folders:
            raise Refused(f"refers to {other} in another folder: save all values in one file")


@contextmanager
def reading(path: PathLike, what: str, max_pixels: int | None, *, each: int = BYTES, kind: str = "") -> Iterator[int]:
    """Check a regular file and yield the most pixels to read; errors of the block are those of `explained`."""
    name, most = os.fspath(path), max_pixels_or_default(max_pixels)
    with explained(name, what, kind):
        status = os.stat(name)
        if stat.S_ISDIR(status.st_mode):
            raise Refused(f"is a folder: give the path of {what}, which is a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise Refused(f"is not a regular file: give the path of {what}")
        check_size(0, status.st_size, most, each)
        yield most


@contextmanager
def explained(name: str, what: str, kind: str = "") -> Iterator[None]:
    """Raise errors of the block as Unreadable with a remedy; with ``kind`` any error means that it is no ``kind``."""
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


_HIDDEN = re.compile(r"\.simdtex-[0-9a-f]{16}(\..*)?")
_LEFT = 86400.0
"""Age in seconds above which a hidden file was left by a killed process."""

_HEADER = b"simdtex sha256 %s\n"
_HEADER_SIZE = len(_HEADER % (b"0" * 64))


class NotWritten(ValueError):
    """A file or folder could not be written; the message names it and a remedy."""


class Damaged(ValueError):
    """The content of a checked file differs from what was written."""


@contextmanager
def atomic_path(path: PathLike) -> Iterator[Path]:
    """Yield a temporary file in the folder of `path`, and rename it to `path` if the block succeeds.

    A reader of `path` sees the old file or the complete new one. If the block fails, also by Ctrl-C, the temporary file
    is removed and `path` is left as it was. The temporary file has the suffix of `path`; a symbolic link is followed,
    and the new file has the permissions of the old one. Raises ValueError if `check_target` does, and NotWritten if the
    block or the renaming raises OSError.
    """
    check_target(Path(path))
    replaced = Path(path).exists()
    # not tempfile, whose file would be readable only by its owner
    with _temporary(path, lambda new: new.touch(0o600 if replaced else 0o666, exist_ok=False)) as (target, temporary):
        yield temporary
        _sync(temporary)
        if replaced:
            shutil.copymode(target, temporary)
        os.replace(temporary, target)


@contextmanager
def atomic_folder(path: PathLike) -> Iterator[Path]:
    """Yield a temporary folder in the folder of `path`, and rename it to `path` if the block succeeds.

    An existing folder `path`, which the caller has checked, is replaced as a whole at the end, and the new one has its
    permissions. The block must not replace the temporary folder itself, which is locked. If the block fails, also by
    Ctrl-C, the temporary folder is removed and `path` is left as it was. Errors are those of `atomic_path`.
    """
    with _temporary(path, Path.mkdir) as (target, temporary):
        old = target.with_name(f".simdtex-old-{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]}")
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
        elif old.exists():  # a process was killed while it replaced the folder
            old.rename(target)
        yield temporary
        for folder, _, names in os.walk(temporary):
            for name in names:
                _sync(Path(folder, name))
            _sync_folder(Path(folder))
        try:
            if target.exists():
                shutil.copymode(target, temporary)
                target.rename(old)
            temporary.rename(target)
            _sync_folder(target.parent)
        except BaseException:
            if not temporary.exists():
                target.rename(temporary)
            if old.exists() and not target.exists():
                old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _temporary(path: PathLike, make: Callable[[Path], object]) -> Iterator[tuple[Path, Path]]:
    """Yield where `path` leads, and a locked hidden file or folder beside it that ``make`` creates."""
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".simdtex-{secrets.token_hex(8)}{target.suffix}")
    try:
        for entry in target.parent.iterdir():
            if is_leftover(entry):
                _remove(entry)
        make(temporary)
        with _locked(temporary):
            yield target, temporary
    except (OSError, NotWritten) as error:
        raise _not_written(path, error, temporary) from None
    finally:
        _remove(temporary)


def _remove(path: Path) -> None:
    """Remove a file or a folder, if it exists."""
    for _ in range(20):  # threads of a library, such as Zarr's, may write for a while after Ctrl-C
        if not path.is_dir():
            path.unlink(missing_ok=True)
            break
        shutil.rmtree(path, ignore_errors=True)
        time.sleep(0.05)


def write_checked(path: PathLike, write: Callable[[BinaryIO], Any]) -> None:
    """Write a file atomically, with a first line that holds the SHA-256 of the content, which ``write`` writes."""
    with atomic_path(path) as temporary, temporary.open("w+b") as file:
        file.write(_HEADER % (b"0" * 64))
        write(file)
        file.seek(_HEADER_SIZE)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0)
        file.write(_HEADER % digest.encode())
    try:
        _sync_folder(Path(os.path.realpath(path)).parent)
    except OSError as error:
        raise _not_written(path, error) from None


def write_durable(path: Path, data: Any) -> None:
    """Write bytes into a file atomically, and make its folders; everything is on the disk at the end."""
    try:
        made = [folder for folder in path.parents if not folder.exists()]
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
        for parent in (path.parent, *(folder.parent for folder in made)):
            _sync_folder(parent)
    except OSError as error:
        raise _not_written(path, error) from None


def read_checked(path: PathLike) -> BinaryIO:
    """Return an open file of `write_checked` at the beginning of its content; raise Damaged if the SHA-256 differs."""
    file = open(path, "rb")  # noqa: SIM115 - the caller closes it
    try:
        header = file.read(_HEADER_SIZE)
        if header != _HEADER % hashlib.file_digest(file, "sha256").hexdigest().encode():
            raise Damaged(f"{os.fspath(path)} is damaged: its checksum does not match")
        file.seek(_HEADER_SIZE)
    except BaseException:
        file.close()
        raise
    return file


class Unbuffered:
    """A file without ``fileno``, to which NumPy writes through Python: otherwise it does not notice a full disk."""

    def __init__(self, file: IO[bytes]) -> None:
        self.write = file.write


def _sync(path: Path, flags: int = os.O_RDWR) -> None:
    """Flush a file to the disk, which may not report before that it is full."""
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some file systems have no fsync
            raise
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk."""
    if os.name != "nt":  # Windows cannot open a folder
        _sync(folder, os.O_RDONLY)


def check_target(target: Path) -> None:
    """Raise ValueError unless a file can be written at `target`."""
    try:
        if target.is_dir():
            raise ValueError(f"{target} is a folder: add a file name to it")
        if target.exists() and not target.is_file():
            raise ValueError(f"{target} is not a regular file: give another name")
        if not target.parent.is_dir():
            raise ValueError(f"the folder {target.parent} does not exist: create it first")
        os.stat(target)
    except FileNotFoundError:
        pass
    except OSError as error:
        raise ValueError(f"{str(target)[:100]} cannot be written ({error.strerror}): give another path") from None
    check_folder_writable(target)


def check_folder_writable(target: Path) -> None:
    """Raise ValueError unless the folder that holds `target`, after following a link, is writable."""
    if not os.access(os.path.dirname(os.path.realpath(target)), os.W_OK | os.X_OK):
        raise ValueError(f"the folder {target.parent} is not writable: choose another folder")


def earlier_files(folder: Path, what: str, is_ours: Callable[[str], bool]) -> list[Path]:
    """Return the files of an earlier run in a folder of ``what``, all ``is_ours``; raise unless it can be written."""
    try:
        if folder.is_dir():
            earlier = sorted(path for path in folder.iterdir() if not is_leftover(path))
        elif folder.exists() or folder.is_symlink():
            raise ValueError(f"{folder} is a file: give a folder for {what}")
        elif not folder.parent.is_dir():
            raise ValueError(f"the folder {folder.parent} does not exist: create it first")
        else:
            with suppress(FileNotFoundError):
                os.lstat(folder)  # raises for a too long name, which `exists` hides since Python 3.14
            earlier = []
    except OSError as error:
        raise ValueError(f"{folder} cannot be written ({error.strerror}): give another folder") from None
    others = [path.name for path in earlier if not (is_ours(path.name) and path.is_file())]
    if others:
        raise ValueError(f"the folder {folder} holds other files ({others[0]}): give an empty or a new one")
    if not os.access(folder if folder.is_dir() else folder.parent, os.W_OK | os.X_OK):
        raise ValueError(f"the folder {folder} is not writable: choose another folder")
    return earlier


def _not_written(path: PathLike, error: OSError | NotWritten, temporary: Path | None = None) -> NotWritten:
    if isinstance(error, NotWritten):  # of a writer into the temporary path
        return NotWritten(str(error).replace(str(temporary), os.fspath(path)))
    code = error.errno or errno.ENOSPC  # NumPy and others give no reason if only a part was written
    remedy = "free some space" if code in (errno.ENOSPC, errno.EDQUOT) else "choose another path"
    return NotWritten(f"{os.fspath(path)} could not be written ({os.strerror(code)}): {remedy}")


@contextmanager
def exclusive(path: PathLike) -> Iterator[None]:
    """Lock a path by a hidden file beside it during the block; raise ValueError if another process holds the lock."""
    hidden = Path(os.path.realpath(path))
    hidden = hidden.with_name(f".{hidden.name}.lock")
    with ExitStack() as held:
        try:
            lock = held.enter_context(_locked(hidden, os.O_CREAT))
        except BlockingIOError:
            raise ValueError(f"another run is at work in {os.fspath(path)} now; wait for it, or stop it") from None
        except OSError as error:
            raise _not_written(path, error) from None
        try:
            yield
        finally:
            if _is_at(lock, hidden):
                hidden.unlink(missing_ok=True)


@contextmanager
def _locked(path: Path, flags: int = 0) -> Iterator[int | None]:
    """Lock a file or folder, and yield its descriptor (None on Windows); raise BlockingIOError if it is locked."""
    if os.name == "nt":
        yield None
        return
    import fcntl

    while True:
        descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR | flags, 0o666)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                if isinstance(error, BlockingIOError):  # else a file system without locks
                    raise
            if _is_at(descriptor, path):  # else the process that held the lock has removed the file
                yield descriptor
                return
        finally:
            os.close(descriptor)


def _is_at(descriptor: int | None, path: Path) -> bool:
    """Return whether an open file is the one at a path."""
    try:
        return descriptor is None or os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def is_leftover(path: Path) -> bool:
    """Return whether a path is an unfinished file, started more than a day ago, that no process is writing."""
    try:
        if not _HIDDEN.fullmatch(path.name) or time.time() - path.stat().st_mtime <= _LEFT:
            return False
        with _locked(path):
            return True
    except OSError:  # it is locked, or has meanwhile been renamed
        return False
