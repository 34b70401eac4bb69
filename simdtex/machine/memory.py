# SPDX-License-Identifier: BSD-3-Clause
"""How much memory a run may still take, asked before it begins: the device's, and that of the host.

A CPU and the NumPy reference keep their arrays in the host's memory, so what such a device is to hold counts there.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from simdtex.machine.devices import DeviceError
from simdtex.machine.interface import Machine
from simdtex.options import SMALLER

SHARED = ("cpu", "reference")
"""Kinds of machines whose arrays lie in the host's memory."""


TEMPORARY = 2**26
"""Bytes that a machine takes of the host's memory whatever the size: scratch memory, sorting, rests of its pool."""


def shared(machine: Machine) -> bool:
    """Whether a machine's arrays lie in the host's memory."""
    return machine.kind in SHARED


def require(machine: Machine, device: int, host: int = 0, remedy: str = SMALLER) -> None:
    """Raise where a run would not fit in the memory there is.

    Parameters
    ----------
    machine : Machine
    device, host : int
        Bytes that the run takes at most in arrays of the machine, and of the host beside them.
    remedy : str
        What helps, as the sentence says it.

    Raises
    ------
    simdtex.machine.devices.DeviceError
        The device has less, or the host has less available; the sentence names the remedy.
    """
    machine.require(device)
    require_host(host + (device + TEMPORARY) * shared(machine), remedy)


def require_host(wanted: int, remedy: str = SMALLER) -> None:
    """Raise DeviceError where so many bytes are more than the host has available."""
    there = available()
    if there is not None and wanted > there:
        raise DeviceError(
            f"this needs about {_mebibytes(wanted)} of this computer's memory and {_mebibytes(there)} is available; "
            f"{remedy}"
        )


def available(root: Path = Path("/")) -> int | None:
    """Bytes that this process may still take: what is free, within the limits set to it; None where nobody says.

    Parameters
    ----------
    root : Path
        Where ``proc`` and ``sys`` are looked for, as Linux has them.
    """
    found = [*_free(root), *_of_groups(root), *_of_addresses(root)]
    return max(0, min(found)) if found else None


def _mebibytes(size: int) -> str:
    return f"{size / 2**20:.0f} MiB"


def _free(root: Path) -> Iterator[int]:
    """What the system has for a new process without swapping."""
    named = _table(root / "proc/meminfo")
    if "MemAvailable" in named:
        yield 1024 * named["MemAvailable"]
    elif sys.platform == "win32":
        yield _free_on_windows()
    else:
        names = [name for name in ("SC_AVPHYS_PAGES", "SC_PHYS_PAGES") if name in os.sysconf_names]
        if names and os.sysconf(names[0]) > 0:
            yield os.sysconf(names[0]) * os.sysconf("SC_PAGE_SIZE")


def _free_on_windows() -> int:
    import ctypes

    class Status(ctypes.Structure):
        _fields_ = (
            ("length", ctypes.c_ulong),
            ("load", ctypes.c_ulong),
            *((name, ctypes.c_ulonglong) for name in ("physical", "free", *"abcde")),
        )

    status = Status(length=ctypes.sizeof(Status))
    vars(ctypes)["windll"].kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return int(status.free)


def _of_groups(root: Path) -> Iterator[int]:
    """What control groups leave to this process: its own and those above it, of version 2 and of version 1."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, own = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        two = not controllers
        top = root / "sys/fs/cgroup" if two else root / "sys/fs/cgroup/memory"
        limit, usage = ("memory.max", "memory.current") if two else ("memory.limit_in_bytes", "memory.usage_in_bytes")
        group = Path(own.lstrip("/"))
        for folder in dict.fromkeys((top / group, *(top / above for above in group.parents), top)):
            most, used = _text(folder / limit).strip(), _text(folder / usage).strip()
            if most.isdecimal() and used.isdecimal():
                kept = _table(folder / "memory.stat", " ").get("inactive_file", 0)  # which gives way
                yield int(most) - int(used) + kept


def _of_addresses(root: Path) -> Iterator[int]:
    """What the limit on this process's address space leaves."""
    try:
        import resource
    except ImportError:  # Windows
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = _text(root / "proc/self/statm").split()
    if most != resource.RLIM_INFINITY and pages:
        yield most - int(pages[0]) * os.sysconf("SC_PAGE_SIZE")


def _table(path: Path, after: str = ":") -> dict[str, int]:
    """Numbers by name, a line each."""
    words = (line.partition(after) for line in _text(path).splitlines())
    return {
        name: int(value.split()[0]) for name, _, value in words if value.split()[:1] and value.split()[0].isdecimal()
    }


def _text(path: Path) -> str:
    """What a file holds; nothing where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
