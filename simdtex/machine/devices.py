# SPDX-License-Identifier: BSD-3-Clause
"""Find, probe, rank and name OpenCL devices.

The listing is sorted by preference (GPUs, then CPUs, then
other accelerators, then simulators; the NumPy reference is last), so the device
taken by default is the first usable one in it, and an index into it is stable.
A device is usable only once a tiny program has built and run on it and given the
right bits: runtimes that enumerate, but cannot build, are common.
"""

from __future__ import annotations

import functools
import os
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simdtex.machine import cache, runtimes
from simdtex.machine.runtimes import DeviceError

if TYPE_CHECKING:
    import pyopencl as cl
    from rich.console import Console

__all__ = ["DeviceError", "DeviceInfo", "devices", "find", "probe", "render", "table"]

VARIABLE = "SIMDTEX_DEVICE"
COLUMNS = ("", "index", "platform", "device", "kind", "OpenCL", "units", "memory", "usable")

# These run programs correctly, but far too slowly to be anyone's first choice.
_SIMULATORS = ("oclgrind", "llvmpipe", "softpipe", "emulat")
# PoCL's single-threaded devices, by the names of old and new versions.
_ONE_THREAD = ("basic", "cpu-minimal")
_KIND_ORDER = {"gpu": 0, "cpu": 1, "accelerator": 2, "other": 3}
_NOT_PROBED = "not probed"


@dataclass(frozen=True)
class DeviceInfo:
    """One line of the listing of devices.

    Parameters
    ----------
    index : int
        Place in the listing; `find` takes it as text or as a number.
    platform, name : str
        What the runtime calls its platform and the device.
    kind : {"gpu", "cpu", "accelerator", "other", "reference"}
        What the device is; "reference" is the NumPy twin of the kernels.
    version, driver : str
        OpenCL version and driver version, as reported.
    compute_units : int
        Number of compute units, 0 where there is none to report.
    memory : int
        Global memory in bytes, 0 where there is none to report.
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
    usable: bool = False
    reason: str = _NOT_PROBED
    handle: cl.Device | None = field(default=None, repr=False)

    @property
    def simulated(self) -> bool:
        """Whether this is, by its name, a simulator or a software rasteriser."""
        words = f"{self.platform} {self.name}".lower()
        return any(word in words for word in _SIMULATORS)

    def __str__(self) -> str:
        """Return the name with its platform, as messages give it."""
        if self.kind == "reference":
            return self.name
        return f"{self.name or 'no device'} ({self.platform})"


def devices(probe: bool = True) -> list[DeviceInfo]:
    """List every OpenCL device, best first, and the NumPy reference last.

    A platform that reports no device, or fails to answer, has a line of its own
    that says so. The platforms are asked once in a process.

    Parameters
    ----------
    probe : bool
        Build and run a tiny program on each device. Each runs in a process of its
        own, so that a runtime that crashes or hangs costs its own line and nothing
        else. Without it every device is marked "not probed".

    Returns
    -------
    list of DeviceInfo
    """
    listing = list(_enumerate())
    if probe:
        real = [info.index for info in listing if info.handle is not None]
        for index, reason in zip(real, runtimes.failures(real), strict=True):
            listing[index] = replace(listing[index], usable=not reason, reason=reason)
    return [*listing, _reference(len(listing))]


def probe(info: DeviceInfo) -> DeviceInfo:
    """Build and run a tiny program on one device, in this process.

    Parameters
    ----------
    info : DeviceInfo
        A line of the listing.

    Returns
    -------
    DeviceInfo
        The same line with `usable` and `reason` filled in.
    """
    if info.handle is None:
        return info
    reason = runtimes.failure(info.handle)
    return replace(info, usable=not reason, reason=reason)


def find(text: str | int | DeviceInfo | None = None) -> DeviceInfo:
    """Choose a usable device.

    Devices are probed in order of preference, in this process, and only until one
    is usable; devices that `text` does not name are never touched.

    Parameters
    ----------
    text : str, int, DeviceInfo or None
        Part of a device's name, platform or version (case does not matter), an index
        into the listing, or "reference" for the NumPy twin. None reads the environment
        variable SIMDTEX_DEVICE; where that is unset or empty, the first usable device
        of the listing is taken. Where several devices match, the one whose whole name
        is the text is taken, else the only usable one of them. A `DeviceInfo` is
        returned as it is if it was found usable.

    Returns
    -------
    DeviceInfo

    Raises
    ------
    DeviceError
        If nothing matches, several usable devices match, or nothing usable is left.
    TypeError
        If `text` is of another type.
    """
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
        return _reference(0)  # no runtime is asked, so that it works where all are broken
    runtimes.alive()
    return choose(wanted, devices(probe=False), probe)


def choose(
    text: str | None,
    listing: Sequence[DeviceInfo],
    check: Callable[[DeviceInfo], DeviceInfo] = lambda info: info,
) -> DeviceInfo:
    """Choose from a listing by the rules of `find`.

    Parameters
    ----------
    text : str or None
        What was asked for; None asks for the first usable OpenCL device.
    listing : sequence of DeviceInfo
        The devices, best first.
    check : callable
        Gives the probed line for a line; by default the lines are taken as probed.

    Returns
    -------
    DeviceInfo
    """
    if text is None:
        found = []
        for info in listing:
            if info.kind != "reference":
                found.append(check(info))
                if found[-1].usable:
                    return found[-1]
        raise DeviceError(_nothing_usable(found))
    matches = [check(info) for info in _matching(text, listing)]
    usable = [info for info in matches if info.usable]
    if len(usable) == 1:
        return usable[0]
    choices = ", ".join(f"{info.index} = {info}" for info in listing if info.name)
    if not matches:
        trouble = runtimes.cache_trouble()
        why = f" ({trouble})" if trouble else ""
        raise DeviceError(f'No device matches "{text}"{why}; choose one of: {choices}.')
    if not usable:
        reasons = "; ".join(f"{info}: {info.reason}" for info in matches)
        raise DeviceError(f'The device "{text}" cannot be used ({reasons}); choose one of: {choices}.')
    several = ", ".join(f"{info.index} = {info}" for info in usable)
    raise DeviceError(f'"{text}" matches several devices; give the index of one of: {several}.')


def table(listing: Sequence[DeviceInfo]) -> list[tuple[str, ...]]:
    """Set out a listing in rows of text under `COLUMNS`.

    Parameters
    ----------
    listing : sequence of DeviceInfo
        Probed devices; the one `find` would take by default is marked with "*".
    """
    chosen, _ = _default(listing)
    return [
        (
            "*" if info is chosen else "",
            str(info.index),
            info.platform,
            info.name or "-",
            info.kind if info.name else "-",
            info.version.removeprefix("OpenCL ").partition(" ")[0] or "-",
            str(info.compute_units or "-"),
            f"{info.memory / 2**30:.1f} GiB" if info.memory else "-",
            ("yes (simulator)" if info.simulated else "yes") if info.usable else f"no: {info.reason}",
        )
        for info in listing
    ]


def render(console: Console, listing: Sequence[DeviceInfo] | None = None) -> None:
    """Print the listing as a table, and which device would be chosen.

    Parameters
    ----------
    console : rich.console.Console
        Where to print.
    listing : sequence of DeviceInfo, optional
        Probed devices; by default every device is listed and probed.
    """
    from rich.table import Table
    from rich.text import Text

    listing = devices() if listing is None else listing
    sheet = Table(box=None, pad_edge=False)
    for name in COLUMNS:
        sheet.add_column(name, justify="right" if name in ("units", "memory") else "left")
    for row in table(listing):
        sheet.add_row(*(Text(cell) for cell in row))  # Text: names may hold [brackets]
    console.print(sheet)
    console.print(Text(_default(listing)[1]))


def _default(listing: Sequence[DeviceInfo]) -> tuple[DeviceInfo | None, str]:
    """Return the device taken when none is asked for, and a sentence about it."""
    wanted = os.environ.get(VARIABLE) or None
    try:
        chosen = choose(wanted, listing)
    except DeviceError as error:
        return None, str(error)
    return chosen, f"Chosen by {VARIABLE if wanted else 'default'}: {chosen}"


@functools.cache
def _enumerate() -> tuple[DeviceInfo, ...]:
    """Ask every platform for its devices, once, and sort them by preference."""
    found: list[DeviceInfo] = []
    for number, vendor in enumerate(runtimes.platforms()):
        title = f"platform {number}"
        try:
            title = runtimes.clean(vendor.name)
            handles = vendor.get_devices()
            found += [_describe(title, handle) for handle in handles]
            if not handles:
                trouble = runtimes.cache_trouble() if title == cache.POCL else ""
                reason = trouble or "the platform reports no device"
                found.append(DeviceInfo(0, title, "", "other", reason=reason))
        except Exception as error:  # a broken platform must never stop the working ones
            found.append(DeviceInfo(0, title, "", "other", reason=runtimes.one_line(error)))
    found.sort(key=lambda info: info.driver, reverse=True)  # of two versions, the newer first
    found.sort(key=_preference)
    return tuple(replace(info, index=index) for index, info in enumerate(found))


def _describe(title: str, handle: Any) -> DeviceInfo:
    """Read a device's properties; those that a runtime cannot tell stay empty."""

    def read(name: str, default: Any) -> Any:
        try:
            return getattr(handle, name)
        except Exception:  # what a device cannot tell of itself is not needed to use it
            return default

    # The kinds are bits of a mask: 2 CPU, 4 GPU, 8 accelerator.
    bits = int(read("type", 0))
    kind = "gpu" if bits & 4 else "cpu" if bits & 2 else "accelerator" if bits & 8 else "other"
    return DeviceInfo(
        index=0,
        platform=title,
        name=runtimes.clean(read("name", "")) or "unnamed device",
        kind=kind,
        version=runtimes.clean(read("version", "")),
        driver=runtimes.clean(read("driver_version", "")),
        compute_units=int(read("max_compute_units", 0)),
        memory=int(read("global_mem_size", 0)),
        handle=handle,
    )


def _reference(index: int) -> DeviceInfo:
    return DeviceInfo(
        index=index,
        platform="NumPy",
        name="reference",
        kind="reference",
        driver=np.__version__,
        compute_units=os.cpu_count() or 0,
        usable=True,
        reason="",
    )


def _preference(info: DeviceInfo) -> tuple[bool, bool, int, bool, str]:
    """Sort key; devices that tie keep the order in which their platform gives them."""
    one_thread = info.name.lower().startswith(_ONE_THREAD)
    return not info.name, info.simulated, _KIND_ORDER[info.kind], one_thread, info.platform


def _matching(text: str, listing: Sequence[DeviceInfo]) -> list[DeviceInfo]:
    word = text.strip().lower()
    if word.isdecimal() and int(word) < len(listing):
        return [listing[int(word)]]
    named = [info for info in listing if info.name.lower() == word]
    return named or [
        info for info in listing if word and word in f"{info.platform}\n{info.name}\n{info.version}".lower()
    ]


def _nothing_usable(found: Sequence[DeviceInfo]) -> str:
    intel = platform.machine() in ("x86_64", "AMD64") and sys.platform in ("linux", "win32")
    remedies = [
        "`pip install simdtex[cpu]` (a CPU runtime, no root needed)" if intel else "",
        "`apt install pocl-opencl-icd` on Debian" if sys.platform == "linux" else "",
        "the driver of your GPU",
    ]
    install = ", ".join(remedy for remedy in remedies if remedy)
    why = "; ".join(f"{info.name or info.platform}: {info.reason}" for info in found)
    return (
        f"No usable OpenCL device was found{f' ({why})' if why else ''}: install {install}, "
        'or use device="reference", which is slow.'
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Print the listing (nothing with ``--ensure``); return 0 if a device would be chosen.

    A simulator counts only where SIMDTEX_DEVICE names it.
    """
    import argparse

    parser = argparse.ArgumentParser(prog="python -m simdtex.machine.devices", description="List devices.")
    parser.add_argument("--ensure", action="store_true", help="print nothing, only exit 0 or 1")
    if not parser.parse_args(argv).ensure:
        from rich.console import Console

        render(Console(width=None if sys.stdout.isatty() else 200))
    try:
        return int(find().simulated and not os.environ.get(VARIABLE))
    except DeviceError:
        return 1


if __name__ == "__main__":
    sys.exit(main())
