# SPDX-License-Identifier: BSD-3-Clause
"""List, check and choose OpenCL devices.

The listing is sorted by preference: GPUs (those with their own memory first, then those with more compute units), CPUs,
other accelerators, simulators, and last the NumPy reference. The default is its first usable device. A device is usable
only if a tiny program has built and run on it and has given the right bits: runtimes that list a device, but cannot
build for it, are common.
"""

from __future__ import annotations

import atexit
import faulthandler
import functools
import os
import re
import shutil
import signal
import site
import subprocess
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
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

# The numbers come from the host, so that the device computes, and not its compiler.
_SOURCE = """
#pragma OPENCL FP_CONTRACT OFF
__kernel void probe(__global const float2 *a, __global const ulong *b, __global ulong4 *bits)
{
    const size_t i = get_global_id(0);
    const float x = a[i].x, y = a[i].y;
    bits[i] = (ulong4)(as_uint(fma(x, x, -(1.0f + 0x1p-11f))), as_uint(x * x - (1.0f + 0x1p-11f)), as_uint(y * y),
                       mul_hi(b[i], b[i]));
}
"""
_NUMBERS = (1 + 2.0**-12, 2.0**-70)  # the square of the first is rounded to 1 + 2^-11, that of the second is denormal
_WHOLE = 0xFEDCBA9876543211
_BITS = {
    "fma rounds twice": 0x33800000,  # 2^-24; 0 if it rounds twice
    "a product and a sum are contracted to an fma": 0,  # 2^-24 if they are
    "denormal numbers become 0": 1 << 9,  # 2^-140
    "mul_hi of 64-bit integers is wrong": _WHOLE**2 >> 64,
}
"""What is wrong with a device on which a number of the tiny program has other bits than these."""

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
            listed = pyopencl.get_platforms()
    except pyopencl.Error:  # raised if there is no platform
        return []
    return list(dict.fromkeys(listed))


def address_space() -> int:
    """Return the limit on this process's virtual memory in bytes, as ``ulimit -v`` sets it."""
    if sys.platform == "win32":
        return sys.maxsize
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return sys.maxsize if limit == resource.RLIM_INFINITY else limit


def _prepare_caches() -> None:
    """Set XDG_CACHE_HOME to a temporary folder if one of the user's caches is not writable, else read the report there.

    PoCL does not start, and pyopencl raises, without a writable cache; and a damaged cache may crash every process.
    """
    global _report, _reported, apart
    if sys.platform == "win32" or _report:
        return
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        report = folder / "simdtex" / "crashes.txt"
        report.parent.mkdir(parents=True, exist_ok=True)
        kernels = Path(os.environ.get("POCL_CACHE_DIR") or folder / "pocl" / "kcache")
        inner = [kernels, folder / "pocl", *(folder / name for name in ("pyopencl", "pytools"))]
        for each in [folder, report.parent, *filter(Path.is_dir, inner)]:
            with tempfile.TemporaryFile(dir=each, buffering=0) as file:
                if file.write(bytes(2**16)) < 2**16:
                    raise OSError("the disk is full")
        text = report.read_text(errors="replace") if report.exists() else ""
    except (OSError, RuntimeError):  # the latter if there is no home folder
        temporary = tempfile.mkdtemp(prefix="simdtex-cache-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        os.environ["XDG_CACHE_HOME"] = temporary
        os.environ.pop("POCL_CACHE_DIR", None)
        return
    _report, _reported, apart = report, len(text), " in failure\n" in text
    if text and not text.endswith(_SAID):
        last, again = text.rpartition(_SAID)[2], ""
        if " in built\n" not in last and " in failure\n" not in last:  # no compilation was under way
            (*_, program) = "it", *re.findall(r'File "(.*)", line \d+ in <module>', last)
            again = f"run {program} again and, if it crashes again, with another device, and report it"
        _compile_anew("", "an earlier process that used OpenCL crashed", again)


def _compile_anew(report: str, why: str, remedy: str = "") -> None:
    """Warn that all kernels are compiled anew, and add to the reports, so that later processes do not read them."""
    global _reported
    _reported += len(report + _SAID)
    if _report:
        with suppress(OSError), _report.open("a") as file:
            file.write(report + _SAID)
    folder = _report.parent.parent if _report else "the cache folder"
    cache = f"perhaps a cache is damaged: delete the folders pocl, pyopencl, pytools and simdtex in {folder}"
    warnings.warn(f"{why}, and kernels are compiled anew; {remedy or cache}", stacklevel=3)


def intel_library() -> Path | None:
    """Return the path of the Intel CPU runtime installed from the package index, or None."""
    folders = (Path(base, "lib", _INTEL) for base in (sys.prefix, sys.base_prefix, site.getuserbase()))
    return next((path for path in folders if path.is_file()), None)


@contextmanager
def _icd_folder() -> Iterator[None]:
    """Point the loader to a temporary folder that lists all runtimes and the Intel runtime from the package index."""
    # The .icd file in Intel's wheel names a path that does not exist, and the loader reads a single folder, which the
    # user may have set. On Windows runtimes are found in the registry.
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
    for index, source in enumerate(sources):
        for entry in sorted(source.glob("*.icd")):
            library = entry.read_text(errors="replace").strip()
            if Path(library).name != _INTEL:
                beside = source / library
                (folder / f"{index}-{entry.name}").write_text(f"{beside if beside.is_file() else library}\n")


@functools.cache
def context(handle: cl.Device) -> cl.Context:
    """Return the context that all runs on a device share: a driver of a GPU takes a sixth of a second to make one."""
    import pyopencl

    return pyopencl.Context([handle])


def build(context: cl.Context, source: str, options: Sequence[str]) -> dict[str, Any]:
    """Return new kernels of a program by name, compiled once in a context."""
    return {kernel.function_name: kernel for kernel in _program(context, source, tuple(options)).all_kernels()}


@functools.lru_cache(64)
def _program(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    """Compile a program; if that fails, try once more without the caches of files.

    One thread at a time compiles. The compiler's warnings, which pyopencl would repeat, are not shown.
    """
    import pyopencl

    def built() -> cl.Program:
        anew = [f"-DREPORTED={_reported}"] * bool(_reported)
        program = pyopencl.Program(context, source)
        program.build(["-w", "-cl-std=CL1.2", *anew, *options])
        if not program.all_kernels():  # of a damaged file, PoCL makes an empty program
            raise DeviceError("the program is empty")
        return program

    global _reported
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore", pyopencl.CompilerWarning)
        try:
            with suppress(pyopencl.Error):  # of a signal, at which LLVM removes the files that it is writing
                return built()
            return built()
        except Exception as error:
            before, why = (_reported, pyopencl._PYOPENCL_NO_CACHE), one_line(error)
            _reported, pyopencl._PYOPENCL_NO_CACHE = _reported + 1, True
            try:
                program = built()
            except Exception:
                _reported, pyopencl._PYOPENCL_NO_CACHE = before
                raise error from None
    _compile_anew(f"{why}\n", f"a compiled kernel could not be read ({why})")
    return program


@functools.cache
def failure(handle: cl.Device) -> str:
    """Build and run a tiny program on a device, once in a process; return why that failed, or an empty text."""
    import pyopencl

    try:
        check_fork()
        shared = context(handle)
        kernels = build(shared, _SOURCE, [])
        queue = pyopencl.CommandQueue(shared)
        arrays = np.full((64, 2), _NUMBERS, np.float32), np.full(64, _WHOLE, np.uint64)
        result = np.zeros((64, len(_BITS)), np.uint64)
        flags = pyopencl.mem_flags
        sources = (pyopencl.Buffer(shared, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=array) for array in arrays)
        target = pyopencl.Buffer(shared, flags.WRITE_ONLY, result.nbytes)
        kernels["probe"](queue, (64,), None, *sources, target)
        pyopencl.enqueue_copy(queue, result, target)
    except Exception as error:  # the device is not usable, whatever the reason
        if " " in str(intel_library() or "") and "Intel" in handle.platform.name:
            return (
                "Intel's runtime does not work in a folder with a space in its path; move the environment, or use PoCL"
            )
        return one_line(error)
    wrong = [what for what, column in zip(_BITS, result.T, strict=True) if np.any(column != _BITS[what])]
    return f"a tiny program gave wrong bits: {'; '.join(wrong)}" if wrong else ""


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
        "from simdtex.machine import devices\n"
        f"reason = devices.failure(devices.devices(probe=False)[{index}].handle)\n"
        f"print('\\n{_MARK}' + reason, flush=True)"
    )
    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"a tiny program did not finish within {_SECONDS:.0f} seconds"
    answers = [line for line in done.stdout.decode(errors="replace").splitlines() if line.startswith(_MARK)]
    if answers:
        return answers[-1].removeprefix(_MARK)
    signals = {int(code): code.name for code in signal.Signals}
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


VARIABLE = "SIMDTEX_DEVICE"

# They run programs correctly, but far too slowly for a default.
_SIMULATORS = ("oclgrind", "llvmpipe", "softpipe", "emulat")
# Names of PoCL's single-threaded devices, in old and new versions.
_ONE_THREAD = ("basic", "cpu-minimal")
_KIND_ORDER = {"gpu": 0, "cpu": 1, "accelerator": 2, "other": 3}
_NOT_PROBED = "not probed"


@dataclass(frozen=True, repr=False)
class DeviceInfo:
    """One line of the listing of devices.

    Parameters
    ----------
    index : int
        Place in the listing; `find` accepts it as text or as a number.
    platform, name : str
        Names of the platform and of the device, as the runtime reports them.
    kind : {"gpu", "cpu", "accelerator", "other", "reference"}
        Kind of device; "reference" is the NumPy twin of the kernels.
    version, driver : str
        OpenCL version and driver version, as reported.
    compute_units : int
        Number of compute units, 0 if unknown.
    memory : int
        Global memory in bytes, 0 if unknown.
    largest : int
        Most bytes of one array, 0 if unknown.
    integrated : bool
        Whether it is a GPU that shares the memory of the host.
    usable : bool
        Whether a tiny program built and ran here with the right answer.
    reason : str
        Why it is not usable; empty if it is.
    handle : pyopencl.Device or None
        The device itself; None for the reference and for platforms without a device.
    """

    index: int
    platform: str
    name: str
    kind: str
    version: str = ""
    driver: str = ""
    compute_units: int = 0
    memory: int = 0
    largest: int = 0
    integrated: bool = False
    usable: bool = False
    reason: str = _NOT_PROBED
    handle: cl.Device | None = field(default=None, repr=False)

    @property
    def simulated(self) -> bool:
        """Whether the name is that of a simulator or a software rasteriser."""
        words = f"{self.platform} {self.name}".lower()
        return any(word in words for word in _SIMULATORS)

    def __repr__(self) -> str:
        return f"<{self.index}: {self}, {self.kind}, {'usable' if self.usable else self.reason}>"

    def __str__(self) -> str:
        """Return the name and the platform, as messages give them."""
        if self.kind == "reference":
            return self.name
        return f"{self.name or 'no device'} ({self.platform})"


def devices(probe: bool = True) -> list[DeviceInfo]:
    """Return all OpenCL devices, best first, and the NumPy reference last.

    A platform that reports no device, or raises, has a separate line with the reason. Platforms are queried once in a
    process.

    Parameters
    ----------
    probe : bool
        Build and run a tiny program on each device, in a separate process, so that a runtime that crashes or hangs
        does not affect other devices. Without it every device is marked "not probed".

    Returns
    -------
    list of DeviceInfo
    """
    listing = list(_enumerate())
    if probe:
        real = [info.index for info in listing if info.handle is not None]
        for index, reason in zip(real, failures(real), strict=True):
            listing[index] = replace(listing[index], usable=not reason, reason=reason)
    return [*listing, _reference(len(listing))]


def probe(info: DeviceInfo) -> DeviceInfo:
    """Return the line of a device after a tiny program on it, in this process unless one has crashed in that before."""
    if info.handle is None:
        return info
    reason = failures([info.index])[0] if apart else failure(info.handle)
    return replace(info, usable=not reason, reason=reason)


def find(text: str | int | DeviceInfo | None = None) -> DeviceInfo:
    """Return a usable device, by a part of its name, its index or its line; None takes SIMDTEX_DEVICE, or the first."""
    if isinstance(text, DeviceInfo):
        text = text if text.reason != _NOT_PROBED else probe(text)
        if text.usable:
            return text
        raise DeviceError(f"The device {text} cannot be used: {text.reason}.")
    if isinstance(text, bool) or not isinstance(text, str | int | None):
        raise TypeError(
            "device must be a text, an index, a DeviceInfo, an open machine or None, "
            f"but it is a {type(text).__name__}."
        )
    wanted = str(text) if text is not None else os.environ.get(VARIABLE) or None
    if wanted is not None and wanted.strip().lower() == "reference":
        return _reference(0)  # without any runtime: it must work even if all are broken
    check_fork()
    return choose(wanted, devices(probe=False), probe)


def choose(
    text: str | None,
    listing: Sequence[DeviceInfo],
    check: Callable[[DeviceInfo], DeviceInfo] = lambda info: info,
) -> DeviceInfo:
    """Return a device of a listing, best first; ``check`` probes a line, only until one is usable, and returns it.

    The text is a part of a device's name, platform or version (case does not matter), or an index. If several devices
    match, the result is the one whose whole name, as printed, is the text, else the only usable one, or the only one by
    its platform. None takes the first usable one.
    """
    if text is None:
        tried = []
        for info in listing:
            if info.kind != "reference":
                tried.append(check(info))
                if tried[-1].usable:
                    return tried[-1]
        raise DeviceError(_nothing_usable(tried))
    matches = [check(info) for info in _matching(text, listing)]
    usable = [info for info in matches if info.usable]
    if len(usable) > 1:  # PoCL's devices have the name of the processor, as "Intel"
        usable = [info for info in usable if text.strip().lower() in info.platform.lower()] or usable
    if len(usable) == 1:
        return usable[0]
    if usable:
        raise DeviceError(f'"{text}" matches several devices; give the index of one of: {_indexed(usable)}.')
    if not matches:
        raise DeviceError(f'No device matches "{text}"; choose one of: {_indexed(listing)}.')
    reasons = "; ".join(f"{info}: {info.reason}" for info in matches)
    others = [info for info in listing if info.index not in {match.index for match in matches}]
    raise DeviceError(f'The device "{text}" cannot be used ({reasons}); choose one of: {_indexed(others)}.')


def _matching(text: str, listing: Sequence[DeviceInfo]) -> list[DeviceInfo]:
    word = text.strip().lower()
    if word.isdecimal() and int(word) < len(listing):
        return [listing[int(word)]]
    named = [info for info in listing if word in (info.name.lower(), str(info).lower())]
    return named or [
        info for info in listing if word and word in f"{info.platform}\n{info.name}\n{info.version}".lower()
    ]


def _indexed(listing: Sequence[DeviceInfo]) -> str:
    return ", ".join(f"{info.index} = {info}" for info in listing if info.name and info.reason in ("", _NOT_PROBED))


def _nothing_usable(tried: Sequence[DeviceInfo]) -> str:
    why = "; ".join(f"{info.name or info.platform}: {info.reason}" for info in tried)
    return (
        f"No usable OpenCL device was found{f' ({why})' if why else ''}: install a CPU runtime by "
        "`pip install simdtex[cpu]` (x86-64 Linux and Windows, no root needed) or `apt install pocl-opencl-icd` "
        '(Debian), or the driver of your GPU, or use device="reference", which is slow.'
    )


@functools.cache
def _enumerate() -> tuple[DeviceInfo, ...]:
    """Return the devices of every platform, sorted by preference; platforms are queried once in a process."""
    devices: list[DeviceInfo] = []
    for n, vendor in enumerate(platforms()):
        title = f"platform {n}"
        try:
            title = clean(vendor.name)
            handles = vendor.get_devices()
            devices += [_describe(title, handle) for handle in handles]
            if not handles:
                devices.append(DeviceInfo(0, title, "", "other", reason="the platform reports no device"))
        except Exception as error:  # a broken platform must not stop the others
            devices.append(DeviceInfo(0, title, "", "other", reason=one_line(error)))
    if _report and not faulthandler.is_enabled():  # a crash leaves a report; PoCL has set its own handlers by now
        faulthandler.enable(os.open(_report, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666))
    devices.sort(key=lambda info: info.driver, reverse=True)  # of two versions, the newer first
    devices.sort(key=_preference)
    return tuple(replace(info, index=index) for index, info in enumerate(devices))


def _describe(title: str, handle: cl.Device) -> DeviceInfo:
    """Return the line of a device with its properties."""
    bits = int(handle.type)  # a mask: 2 CPU, 4 GPU, 8 accelerator
    kind = "gpu" if bits & 4 else "cpu" if bits & 2 else "accelerator" if bits & 8 else "other"
    return DeviceInfo(
        index=0,
        platform=title,
        name=clean(handle.name) or "unnamed device",
        kind=kind,
        version=clean(handle.version),
        driver=clean(handle.driver_version),
        compute_units=int(handle.max_compute_units),
        memory=int(handle.global_mem_size),
        largest=int(handle.max_mem_alloc_size),
        integrated=kind == "gpu" and bool(handle.host_unified_memory),
        handle=handle,
    )


def _reference(index: int) -> DeviceInfo:
    units = os.cpu_count() or 0
    return DeviceInfo(
        index, "NumPy", "reference", "reference", driver=np.__version__, compute_units=units, usable=True, reason=""
    )


def _preference(info: DeviceInfo) -> tuple[bool, bool, int, bool, bool, int, str]:
    """Return the sort key of a line; devices that tie keep the order in which their platform gives them."""
    one_thread = info.name.lower().startswith(_ONE_THREAD)
    units = info.compute_units if info.kind == "gpu" else 0  # runtimes of one CPU may count its cores differently
    kind = _KIND_ORDER[info.kind]
    return not info.name, info.simulated, kind, one_thread, info.integrated, -units, info.platform


def main() -> int:
    """Return 0 if there is a default device, else 1; a simulator counts only if SIMDTEX_DEVICE names it."""
    try:
        return int(find().simulated and not os.environ.get(VARIABLE))
    except DeviceError:
        return 1


if __name__ == "__main__":
    sys.exit(main())
