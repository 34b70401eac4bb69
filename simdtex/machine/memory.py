# SPDX-License-Identifier: BSD-3-Clause
"""Memory checks before a run: the device's memory and the host's.

The arrays of a CPU and of the NumPy reference are in the host's memory, and are counted there.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import psutil

from simdtex.machine import devices
from simdtex.machine.devices import DeviceError
from simdtex.machine.interface import Machine
from simdtex.options import SMALLER

LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
"""Limit of this process's control group in a container, version 2 and version 1."""

TEMPORARY = 2**26
"""Bytes of the host's memory that a machine takes at any size: scratch memory, sorting, its pool."""


required: dict[tuple[str, int], int] = {}
"""The most bytes that runs of this process required of the ``"device"`` and of the ``"host"``, by machine."""


def shared(machine: Machine) -> bool:
    """Return whether a machine's arrays are in the host's memory."""
    return machine.kind in ("cpu", "reference")


def require(machine: Machine, device: int, host: int = 0, remedy: str = SMALLER) -> None:
    """Raise DeviceError if bytes in arrays of the machine, and in others on the host, do not fit; name the remedy."""
    required["device", id(machine)] = max(device, required.get(("device", id(machine)), 0))
    if device > machine.memory:
        raise DeviceError(
            f"this needs about {device / 2**20:.0f} MiB and {machine.name} has {machine.memory / 2**20:.0f}; "
            "give a smaller size or another --device"
        )
    require_host(host + (device + TEMPORARY) * shared(machine), remedy, id(machine))


def require_host(wanted: int, remedy: str = SMALLER, of: int = 0) -> None:
    """Raise DeviceError if bytes, for the machine with the `id` ``of``, exceed the available memory of the host."""
    required["host", of] = max(wanted, required.get(("host", of), 0))
    there = available()
    if wanted > there:
        raise DeviceError(
            f"this needs about {wanted / 2**20:.0f} MiB of this computer's memory and {there / 2**20:.0f} MiB is "
            f"available; {remedy}"
        )


def available() -> int:
    """Return the bytes that are available to this process, within its limit and that of its control group."""
    taken = psutil.Process().memory_info()
    free: int = min(psutil.virtual_memory().available, devices.address_space() - taken.vms)
    for path in LIMITS:
        with suppress(OSError, ValueError):  # no such version; or "max", which is no limit
            free = min(free, int(path.read_text()) - taken.rss)
    return max(0, free)
