# SPDX-License-Identifier: BSD-3-Clause
"""OpenCL runtimes: the platforms the ICD loader finds, the compilation of a program, and the check of a device."""

from __future__ import annotations

import atexit
import faulthandler
import functools
import os
import shutil
import signal
import site
import subprocess
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pyopencl as cl

_INTEL = "libintelocl.so"
_ICD_VARIABLES = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")  # each names a folder of .icd files to the loader
_MARK = "simdtex-probe:"
_SECONDS = 60.0  # a first build takes a second or two, on a busy computer several times that
_SAID = "The user was warned.\n"  # the end of each report

# a*a - (1 + 2^-11) is 2^-24 for a = 1 + 2^-12 if fma rounds once, and 0 if it rounds twice.
_SOURCE = """
__kernel void probe(__global const float *a, __global float *b)
{
    const size_t i = get_global_id(0);
    b[i] = fma(a[i], a[i], -(1.0f + 0x1p-11f));
}
"""

FORKED = (
    "OpenCL was in use before this process was forked, and its threads are not in the child; start processes with "
    'multiprocessing.get_context("spawn") or "forkserver", or take device="reference" here'
)
forked = False
"""Whether this process was forked from one that had used OpenCL."""
_in_use = False
_lock = RLock()
"""For compilation, and for the environment variable that names the loader's folder."""
_report: Path | None = None
"""The file that gets a report of each crash of a process that uses OpenCL, and of each failed reading of a cache."""
_reported = 0
"""The length of the reports, an option of every program: none that was compiled before the last is read from a cache.
"""
apart = False
"""Whether devices are probed in separate processes, since a probe has crashed before."""


class DeviceError(ValueError):
    """No device, or more than one, matches a request, or the device cannot do the work."""


def _note_fork() -> None:
    """Remember in a forked child whether its parent used OpenCL; any call into a runtime would then hang."""
    global forked
    forked = _in_use


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_note_fork)


def check_fork() -> None:
    """Raise DeviceError if this process was forked from one that had used OpenCL."""
    if forked:
        raise DeviceError(FORKED)


def platforms() -> list[cl.Platform]:
    """Return the platforms that the ICD loader finds, each once.

    The loader reads its folder of .icd files only once in a process. If a program asks pyopencl for platforms before
    simdtex does, the Intel runtime from the package index is missing.
    """
    import pyopencl

    global _in_use
    check_fork()
    needed, limit = 2**30 + 2**26 * (os.cpu_count() or 1), address_space()
    if limit < needed:  # runtimes are not found, or abort
        raise DeviceError(
            f"the address space of this process is limited to {limit >> 20} MiB, and OpenCL needs {needed >> 20}; "
            'raise the limit (ulimit -v), or use device="reference", which is slow'
        )
    _in_use = True
    _prepare_caches()
    try:
        with _lock, _icd_folder():
            found = pyopencl.get_platforms()
    except pyopencl.Error:  # raised if there is no platform
        return []
    return list(dict.fromkeys(found))


def address_space() -> int:
    """Return the limit on this process's virtual memory in bytes, as ``ulimit -v`` sets it."""
    if sys.platform == "win32":
        return sys.maxsize
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return sys.maxsize if limit == resource.RLIM_INFINITY else limit


def _prepare_caches() -> None:
    """Set XDG_CACHE_HOME to a temporary folder if the user's cache folder is not writable, else read the report there.

    PoCL does not start, and pyopencl raises, without a writable cache; and a damaged cache may crash every process.
    """
    global _report, _reported, apart
    if sys.platform == "win32" or _report:
        return
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        report = folder / "simdtex" / "crashes.txt"
        report.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            if file.write(bytes(2**16)) < 2**16:
                raise OSError("the disk is full")
        text = report.read_text(errors="replace") if report.exists() else ""
    except (OSError, RuntimeError):  # the latter if there is no home folder
        temporary = tempfile.mkdtemp(prefix="simdtex-cache-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        os.environ["XDG_CACHE_HOME"] = temporary
        return
    _report, _reported, apart = report, len(text), " in failure\n" in text
    if text and not text.endswith(_SAID):
        _compile_anew("", "the OpenCL runtime crashed in an earlier run")


def report_crashes() -> None:
    """Let a crash of this process leave a report; called when PoCL, with its devices, has set its own handlers."""
    if _report and not faulthandler.is_enabled():
        faulthandler.enable(os.open(_report, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666))


def _compile_anew(report: str, why: str) -> None:
    """Warn that all kernels are compiled anew, and add to the reports, so that later processes do not read them."""
    global _reported
    _reported += len(report + _SAID)
    if _report:
        with suppress(OSError), _report.open("a") as file:
            file.write(report + _SAID)
    warnings.warn(
        f"{why}, perhaps because a cache is damaged, and kernels are compiled anew; delete the folders pocl, pyopencl, "
        f"pytools and simdtex in {_report.parent.parent if _report else 'the cache folder'}",
        stacklevel=3,
    )


def intel_library() -> Path | None:
    """Return the path of the Intel CPU runtime installed from the package index, or None."""
    folders = (Path(base, "lib", _INTEL) for base in (sys.prefix, sys.base_prefix, site.getuserbase()))
    return next((path for path in folders if path.is_file()), None)


@contextmanager
def _icd_folder() -> Iterator[None]:
    """Point the loader to a temporary folder that lists all runtimes and the Intel runtime from the package index.

    The .icd file in Intel's wheel names a path that does not exist, and the loader reads a single folder. A folder
    that the user has set is not changed, and on Windows runtimes are found in the registry.
    """
    library = intel_library() if sys.platform == "linux" else None
    if library is None or any(os.environ.get(name) for name in _ICD_VARIABLES):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="simdtex-icd-") as folder:
        _copy_icd_files(Path(folder))
        Path(folder, "intel.icd").write_text(f"{library}\n")
        os.environ[_ICD_VARIABLES[0]] = folder
        try:
            yield
        finally:
            del os.environ[_ICD_VARIABLES[0]]


def _copy_icd_files(folder: Path) -> None:
    """Copy the .icd files that the loader would have read, except that of the Intel runtime."""
    import pyopencl

    sources = (
        Path("/etc/OpenCL/vendors"),
        Path(sys.prefix, "etc", "OpenCL", "vendors"),  # conda
        Path(pyopencl.__file__).parent / ".libs",  # PoCL's wheel, whose library is beside its .icd file
    )
    for number, source in enumerate(sources):
        for entry in sorted(source.glob("*.icd")):
            library = entry.read_text(errors="replace").strip()
            if Path(library).name != _INTEL:
                beside = source / library
                (folder / f"{number}-{entry.name}").write_text(f"{beside if beside.is_file() else library}\n")


def build(context: cl.Context, source: str, options: Sequence[str]) -> dict[str, Any]:
    """Compile a program, and return its kernels by name; if that fails, try once more without the caches.

    One thread at a time compiles. The compiler's warnings, which pyopencl would repeat, are not shown.
    """
    import pyopencl

    def built() -> dict[str, Any]:
        anew = [f"-DREPORTED={_reported}"] * bool(_reported)
        program = pyopencl.Program(context, source).build(["-w", "-cl-std=CL1.2", *anew, *options])
        kernels = {kernel.function_name: kernel for kernel in program.all_kernels()}
        if not kernels:  # of a damaged file, PoCL makes an empty program
            raise DeviceError("the program is empty")
        return kernels

    global _reported
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore", pyopencl.CompilerWarning)
        try:
            return built()
        except Exception as error:
            before, why = (_reported, pyopencl._PYOPENCL_NO_CACHE), one_line(error)
            _reported, pyopencl._PYOPENCL_NO_CACHE = _reported + 1, True
            try:
                kernels = built()
            except Exception:
                _reported, pyopencl._PYOPENCL_NO_CACHE = before
                raise error from None
    _compile_anew(f"{why}\n", f"a compiled kernel could not be read ({why})")
    return kernels


@functools.cache
def failure(handle: cl.Device) -> str:
    """Build and run a tiny program on a device, once in a process; return why that failed, or an empty text."""
    import pyopencl

    try:
        check_fork()
        context = pyopencl.Context([handle])
        kernels = build(context, _SOURCE, [])
        queue = pyopencl.CommandQueue(context)
        host = np.full(64, 1 + 2.0**-12, np.float32)
        flags = pyopencl.mem_flags
        source = pyopencl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=host)
        target = pyopencl.Buffer(context, flags.WRITE_ONLY, host.nbytes)
        kernels["probe"](queue, host.shape, None, source, target)
        result = np.zeros_like(host)
        pyopencl.enqueue_copy(queue, result, target)
    except Exception as error:  # the device is not usable, whatever the reason
        if " " in str(intel_library() or "") and "Intel" in handle.platform.name:
            return (
                "Intel's runtime does not work in a folder with a space in its path; move the environment, or use PoCL"
            )
        return one_line(error)
    return "" if np.all(result == 2.0**-24) else "a tiny program ran, but gave a wrong answer"


def failures(indices: Sequence[int]) -> list[str]:
    """Return the results of `failure` for devices of the listing, each checked in a separate process."""
    with ThreadPoolExecutor() as pool:
        return list(pool.map(_failure_apart, indices))


def _failure_apart(index: int) -> str:
    if forked:
        return FORKED
    code = (
        f"import faulthandler, sys; sys.path[:] = {sys.path!r}\n"
        "faulthandler.enable()  # a crash of this process is not reported\n"
        "from simdtex.machine import devices, runtimes\n"
        f"reason = runtimes.failure(devices.devices(probe=False)[{index}].handle)\n"
        f"print('\\n{_MARK}' + reason, flush=True)"
    )
    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"a tiny program did not finish within {_SECONDS:.0f} seconds"
    answers = [line for line in done.stdout.decode(errors="replace").splitlines() if line.startswith(_MARK)]
    if answers:
        return answers[-1].removeprefix(_MARK)
    signals = {int(number): number.name for number in signal.Signals}
    how = signals.get(-done.returncode, f"exit code {done.returncode}")
    return f"the runtime crashed on a tiny program ({how})"


def clean(text: str) -> str:
    """Return a runtime's text on one line, without its padding."""
    return " ".join(text.replace("\0", " ").split())


def one_line(error: BaseException) -> str:
    """Return the first line of a message, and its first line about an error, as one short line."""
    lines = [clean(line) for line in str(error).splitlines() if line.strip()]
    errors = [line for line in lines[1:] if "error" in line.lower()]
    parts = " - ".join(lines[:1] + errors[:1]).split(" - ")  # pyopencl repeats the name of its error three times
    text = " - ".join(dict.fromkeys(parts)) or type(error).__name__
    return textwrap.shorten(text, 160, placeholder=" ...").rstrip(".")
