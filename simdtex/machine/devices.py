# SPDX-License-Identifier: BSD-3-Clause
"""List, check and choose OpenCL devices.

The listing is sorted by preference: GPUs, CPUs, other accelerators, simulators, and last the NumPy reference. The
default is its first usable device. A device is usable only if a tiny program has built and run on it and has given the
right bits: runtimes that list a device, but cannot build for it, are common.
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from simdtex.machine import runtimes
from simdtex.machine.runtimes import DeviceError

if TYPE_CHECKING:
    import pyopencl as cl

__all__ = ["DeviceError", "DeviceInfo", "choose", "devices", "find", "probe"]

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
        for index, reason in zip(real, runtimes.failures(real), strict=True):
            listing[index] = replace(listing[index], usable=not reason, reason=reason)
    return [*listing, _reference(len(listing))]


def probe(info: DeviceInfo) -> DeviceInfo:
    """Build and run a tiny program on a device, and return its line with `usable` and `reason`.

    It runs in this process, unless a process crashed at this point before.
    """
    if info.handle is None:
        return info
    reason = runtimes.failures([info.index])[0] if runtimes.apart else runtimes.failure(info.handle)
    return replace(info, usable=not reason, reason=reason)


def find(text: str | int | DeviceInfo | None = None) -> DeviceInfo:
    """Return a usable device.

    Devices are probed in order of preference, in this process, and only until one is usable; devices that `text` does
    not match are never probed.

    Parameters
    ----------
    text : str, int, DeviceInfo or None
        Part of a device's name, platform or version (case does not matter), an index of the listing, or "reference" for
        the NumPy twin. None means the value of the environment variable SIMDTEX_DEVICE or, if that is unset or empty,
        the first usable device of the listing. If several devices match, the result is the one whose whole name is the
        text, else the only usable one of them. A usable `DeviceInfo` is returned unchanged.

    Returns
    -------
    DeviceInfo

    Raises
    ------
    DeviceError
        Nothing matches, several usable devices match, or no device is usable.
    TypeError
        `text` is of another type.
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
        return _reference(0)  # without any runtime: it must work even if all are broken
    runtimes.check_fork()
    return choose(wanted, devices(probe=False), probe)


def choose(
    text: str | None,
    listing: Sequence[DeviceInfo],
    check: Callable[[DeviceInfo], DeviceInfo] = lambda info: info,
) -> DeviceInfo:
    """Return a device of a listing, best first, by the rules of `find`; ``check`` probes a line and returns it."""
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
    named = [info for info in listing if info.name.lower() == word]
    return named or [
        info for info in listing if word and word in f"{info.platform}\n{info.name}\n{info.version}".lower()
    ]


def _indexed(listing: Sequence[DeviceInfo]) -> str:
    return ", ".join(f"{info.index} = {info}" for info in listing if info.name and info.reason in ("", _NOT_PROBED))


def _nothing_usable(found: Sequence[DeviceInfo]) -> str:
    why = "; ".join(f"{info.name or info.platform}: {info.reason}" for info in found)
    return (
        f"No usable OpenCL device was found{f' ({why})' if why else ''}: install a CPU runtime by "
        "`pip install simdtex[cpu]` (x86-64 Linux and Windows, no root needed) or `apt install pocl-opencl-icd` "
        '(Debian), or the driver of your GPU, or use device="reference", which is slow.'
    )


@functools.cache
def _enumerate() -> tuple[DeviceInfo, ...]:
    """Return the devices of every platform, sorted by preference; platforms are queried once in a process."""
    found: list[DeviceInfo] = []
    for number, vendor in enumerate(runtimes.platforms()):
        title = f"platform {number}"
        try:
            title = runtimes.clean(vendor.name)
            handles = vendor.get_devices()
            found += [_describe(title, handle) for handle in handles]
            if not handles:
                found.append(DeviceInfo(0, title, "", "other", reason="the platform reports no device"))
        except Exception as error:  # a broken platform must not stop the others
            found.append(DeviceInfo(0, title, "", "other", reason=runtimes.one_line(error)))
    runtimes.report_crashes()
    found.sort(key=lambda info: info.driver, reverse=True)  # of two versions, the newer first
    found.sort(key=_preference)
    return tuple(replace(info, index=index) for index, info in enumerate(found))


def _describe(title: str, handle: cl.Device) -> DeviceInfo:
    """Return the line of a device with its properties."""
    bits = int(handle.type)  # a mask: 2 CPU, 4 GPU, 8 accelerator
    return DeviceInfo(
        index=0,
        platform=title,
        name=runtimes.clean(handle.name) or "unnamed device",
        kind="gpu" if bits & 4 else "cpu" if bits & 2 else "accelerator" if bits & 8 else "other",
        version=runtimes.clean(handle.version),
        driver=runtimes.clean(handle.driver_version),
        compute_units=int(handle.max_compute_units),
        memory=int(handle.global_mem_size),
        handle=handle,
    )


def _reference(index: int) -> DeviceInfo:
    units = os.cpu_count() or 0
    return DeviceInfo(
        index, "NumPy", "reference", "reference", driver=np.__version__, compute_units=units, usable=True, reason=""
    )


def _preference(info: DeviceInfo) -> tuple[bool, bool, int, bool, str]:
    """Return the sort key of a line; devices that tie keep the order in which their platform gives them."""
    one_thread = info.name.lower().startswith(_ONE_THREAD)
    return not info.name, info.simulated, _KIND_ORDER[info.kind], one_thread, info.platform


def main() -> int:
    """Return 0 if there is a default device, else 1; a simulator counts only if SIMDTEX_DEVICE names it."""
    try:
        return int(find().simulated and not os.environ.get(VARIABLE))
    except DeviceError:
        return 1


if __name__ == "__main__":
    sys.exit(main())
