# SPDX-License-Identifier: BSD-3-Clause
"""The OpenCL runtimes of this machine: which platforms the loader knows, and what works on them."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import signal
import site
import struct
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simdtex.machine import cache

if TYPE_CHECKING:
    import pyopencl as cl

__all__ = ["DeviceError", "alive", "clean", "failure", "failures", "intel_library", "one_line", "platforms"]

_INTEL = "libintelocl.so"
_MARK = "simdtex-probe:"
_POCL_CACHE = "POCL_CACHE_DIR"
_UNFINISHED = "tempfile_"  # PoCL's passing names, which it gives up for the true ones once a file is whole
_SEARCH = 0.03
_MOMENT = 0.2  # in which a file of the cache, a megabyte at most, is written by far
_SECONDS = 60.0  # a first build takes a second or two; a busy machine, several times that
_FOLDERS = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")  # how users name a folder to the loader

# a*a - (1 + 2^-11) is 2^-24 for a = 1 + 2^-12 if fma rounds once, and 0 if it rounds twice.
_SOURCE = """
__kernel void probe(__global const float *a, __global float *b)
{
    const size_t i = get_global_id(0);
    b[i] = fma(a[i], a[i], -(1.0f + 0x1p-11f));
}
"""


LOST = (
    "OpenCL was in use before this process was forked, and its threads are not in the child; start processes with "
    'multiprocessing.get_context("spawn") or "forkserver", or take device="reference" here'
)
_asked, _lost = False, False


class DeviceError(ValueError):
    """No device, or no single device, fits what was asked for; or it cannot do it."""


def _forked() -> None:
    """In a child that shares a runtime's memory but none of its threads: whatever is asked of it waits for ever."""
    global _lost
    _lost = _asked


if hasattr(os, "register_at_fork"):  # Windows forks nothing
    os.register_at_fork(after_in_child=_forked)


def alive() -> None:
    """Raise DeviceError where this process was forked from one in which a runtime was in use."""
    if _lost:
        raise DeviceError(LOST)


def platforms() -> list[cl.Platform]:
    """Return the platforms that the loader knows, each once; the first call decides.

    A loader reads its folder once in a process. A program that asks pyopencl for
    platforms before simdtex does sees what its environment tells, and so do we.
    """
    import pyopencl

    global _asked
    alive()
    _asked = True
    _give_pocl_a_cache()
    _give_pyopencl_a_cache()
    try:
        try:
            with _folder():
                found = pyopencl.get_platforms()
        except OSError:  # no place for a temporary folder: what the loader sees by itself
            found = pyopencl.get_platforms()
    except pyopencl.Error:  # the loader's way to say that there is none
        return []
    return list(dict.fromkeys(found))


def pocl_cache() -> Path:
    """The folder in which PoCL keeps compiled kernels, by its own rules."""
    if chosen := os.environ.get(_POCL_CACHE):
        return Path(chosen)
    if home := os.environ.get("XDG_CACHE_HOME"):
        return Path(home, "pocl", "kcache")
    home = os.environ.get("HOME")
    return Path(home, ".cache", "pocl", "kcache") if home else Path("/tmp/pocl/kcache")


def _give_pocl_a_cache() -> None:
    """Name a folder to PoCL where nothing can be written in its own: it then would not start, or abort.

    PoCL reads the name when it is asked for its devices first. A folder that the user chose is let be.
    """
    if sys.platform == "win32" or os.environ.get(_POCL_CACHE) or cache.writable(pocl_cache()):
        return
    if place := cache.spare("pocl"):
        os.environ[_POCL_CACHE] = str(place)


def _give_pyopencl_a_cache() -> None:
    """Let pyopencl keep its Python code for launches elsewhere where its own file cannot be written, or is corrupt.

    It opens the file when this module of it is imported, and raises whatever goes wrong there.
    """
    import platformdirs

    with suppress(Exception):
        if cache.writable(Path(platformdirs.user_cache_dir("pytools", "pytools"))):
            import_module("pyopencl.invoker")
            return
    place = cache.spare("pyopencl") if sys.platform != "win32" else None
    if place:
        with _environment({"XDG_CACHE_HOME": str(place)}), suppress(Exception):  # what is left is said by the probe
            import_module("pyopencl.invoker")


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Variables for as long as the context lasts."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def cache_trouble() -> str:
    """Why PoCL may not start, where its cache is to blame; else nothing."""
    place = pocl_cache()
    if sys.platform == "win32" or cache.writable(place):
        return ""
    return f"nothing can be written in {place}, where PoCL keeps kernels; name another folder by {_POCL_CACHE}"


def broken_file(place: Path, seconds: float = _SEARCH) -> Path | None:
    """A file of PoCL's cache that is no kernel or program, or is cut off: PoCL would abort on it.

    What another process is writing just now does not count: PoCL writes kernels under a passing name, and programs
    in a moment.

    Parameters
    ----------
    place : Path
        PoCL's cache.
    seconds : float
        After which no more files are looked at; a thousand take some 20 ms.

    Returns
    -------
    Path or None
        None if all are in order, as far as their first bytes and their sizes tell.
    """
    end, folders = time.perf_counter() + seconds, [str(place)]
    while folders and time.perf_counter() < end:
        try:
            with os.scandir(folders.pop()) as entries:
                for entry in entries:
                    if entry.name.startswith(_UNFINISHED):
                        continue
                    if entry.name.endswith((".so", ".bc")):
                        if _stays_broken(entry.path):
                            return Path(entry.path)
                    elif entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
        except OSError:  # somebody else has just removed it
            continue
    return None


def _stays_broken(path: str) -> bool:
    """Whether a file is not whole, and is still not a moment later: another process may just be writing it."""
    if _whole(path):
        return False
    time.sleep(_MOMENT)
    return not _whole(path)


def _whole(path: str) -> bool:
    """Whether this is bitcode of LLVM, or a library whose last part, the table of its sections, is there."""
    with open(path, "rb") as file:
        head, size = file.read(64), os.fstat(file.fileno()).st_size
    if path.endswith(".bc"):
        return head[:4] in (b"BC\xc0\xde", b"\xde\xc0\x17\x0b") and size % 4 == 0
    if head[:4] != b"\x7fELF" or len(head) < 64:
        return False
    if head[4:6] != b"\x02\x01":  # not of 64 bits, the lowest first
        return True
    (table,), (each, count) = struct.unpack_from("<Q", head, 40), struct.unpack_from("<HH", head, 58)
    return bool(table + each * count <= size)


def intel_library() -> Path | None:
    """Return the library of the Intel CPU runtime installed from the package index, if any."""
    for base in (sys.prefix, site.getuserbase()):
        path = Path(base, "lib", _INTEL)
        if path.is_file():
            return path
    try:
        entries = importlib.metadata.files("intel-opencl-rt") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    paths = (Path(str(entry.locate())).resolve() for entry in entries if entry.name == _INTEL)
    return next((path for path in paths if path.is_file()), None)


@contextmanager
def _folder() -> Iterator[None]:
    """Let the loader also see the Intel CPU runtime, for as long as the context lasts.

    The .icd file in its wheel names a path that does not exist, and the loader reads one
    folder only, so it is given a folder with all of them. A folder the user chose wins,
    and Windows registers its runtimes itself.
    """
    chosen = any(os.environ.get(name) for name in _FOLDERS)
    library = intel_library() if sys.platform == "linux" and not chosen else None
    if library is None:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="simdtex-icd-") as folder:
        _copy(Path(folder))
        Path(folder, "intel.icd").write_text(f"{library}\n")
        with _environment({_FOLDERS[0]: folder}):
            yield


def _copy(folder: Path) -> None:
    """Copy the .icd files that the loader would have read itself."""
    import pyopencl

    sources = (
        Path("/etc/OpenCL/vendors"),
        Path(sys.prefix, "etc", "OpenCL", "vendors"),  # conda's place
        Path(pyopencl.__file__).parent / ".libs",  # PoCL's wheel puts its own beside the loader
    )
    for number, source in enumerate(sources):
        for entry in sorted(source.glob("*.icd")):
            try:
                library = Path(entry.read_text().strip())
            except (OSError, UnicodeDecodeError):
                continue  # the loader skips what it cannot read, too
            if library.name == _INTEL or (library.is_absolute() and not library.exists()):
                continue  # the Intel runtime is added by its true path
            if (source / library).is_file():
                library = source / library
            (folder / f"{number}-{entry.name}").write_text(f"{library}\n")


@functools.cache
def failure(handle: cl.Device) -> str:
    """Build and run a tiny program, once; return why the device is not usable, or nothing."""
    import pyopencl

    from simdtex.machine import programs

    try:
        alive()
        if handle.platform.name == cache.POCL and (wrong := broken_file(pocl_cache())):
            return f"its cache of kernels is corrupt, as {wrong} shows; delete the folder {pocl_cache()}"
        context = pyopencl.Context([handle])
        program = programs.build(context, _SOURCE, ["-cl-std=CL1.2"])
        queue = pyopencl.CommandQueue(context)
        host = np.full(64, 1 + 2.0**-12, np.float32)
        flags = pyopencl.mem_flags
        source = pyopencl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=host)
        target = pyopencl.Buffer(context, flags.WRITE_ONLY, host.nbytes)
        pyopencl.Kernel(program, "probe")(queue, host.shape, None, source, target)
        result = np.zeros_like(host)
        pyopencl.enqueue_copy(queue, result, target)
    except Exception as error:  # whatever goes wrong, this device is not usable
        return one_line(error)
    return "" if np.all(result == 2.0**-24) else "a tiny program ran, but gave a wrong answer"


def failures(indices: Sequence[int]) -> list[str]:
    """Run `failure` for lines of the listing, each in a process of its own.

    Parameters
    ----------
    indices : sequence of int
        Places in the listing of `simdtex.machine.devices`.

    Returns
    -------
    list of str
        For each, why the device is not usable, or nothing.
    """
    if _lost:
        return [LOST] * len(indices)
    # The children get this process's own path, so that they find the same package.
    code = (
        "import sys; sys.path[:] = {path!r}\n"
        "from simdtex.machine import devices as device\n"
        "line = device.probe(device.devices(probe=False)[{index}])\n"
        "print('\\n{mark}' + line.reason, flush=True)"
    )
    children = [
        subprocess.Popen(
            [sys.executable, "-c", code.format(path=sys.path, index=index, mark=_MARK)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            errors="replace",
        )
        for index in indices
    ]
    return [_answer(child) for child in children]


def _answer(child: subprocess.Popen[str]) -> str:
    try:
        output, _ = child.communicate(timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return f"a tiny program did not finish within {_SECONDS:.0f} seconds"
    answers = [line for line in output.splitlines() if line.startswith(_MARK)]
    if answers:
        return answers[-1].removeprefix(_MARK)
    names = {int(number): number.name for number in signal.Signals}
    how = names.get(-child.returncode, f"exit code {child.returncode}")
    return f"the runtime crashed on a tiny program ({how})"


def clean(text: str) -> str:
    """Return a runtime's text on one line, without its padding."""
    return " ".join(str(text).replace("\0", " ").split())


def one_line(error: BaseException) -> str:
    """Return the telling lines of a build log or message as one short line."""
    lines = [clean(line) for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines[1:] if "error" in line.lower()]
    text = " - ".join(lines[:1] + telling[:1]) or type(error).__name__
    return textwrap.shorten(text, 160, placeholder=" ...").rstrip(".")
