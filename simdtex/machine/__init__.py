# SPDX-License-Identifier: BSD-3-Clause
"""The machine that executes whole-array steps: the NumPy reference, or an OpenCL device."""

from __future__ import annotations

from simdtex.machine.interface import Machine

__all__ = ["Machine", "open_machine"]


def open_machine(device: str | Machine | None = None, *, profile: bool = False) -> Machine:
    """Return the machine of a device.

    Parameters
    ----------
    device : str, int, DeviceInfo, Machine or None
        Part of a name or platform, an index of ``simdtex devices``, or ``"reference"``; None takes the device that
        SIMDTEX_DEVICE names, else a GPU, else a CPU. A machine is returned unchanged.
    profile : bool
        Whether an OpenCL device measures the time of every kernel.

    Raises
    ------
    simdtex.machine.devices.DeviceError
        No device matches, several do, or none is usable; or OpenCL was in use before this process was forked. The
        message names the remedy.
    TypeError
        `device` has another type.
    """
    if callable(getattr(device, "running", None)):
        return device  # type: ignore[return-value]
    from simdtex.machine.devices import find

    info = find(device)  # type: ignore[arg-type]
    if info.kind == "reference":
        from simdtex.machine.reference import Reference

        return Reference()
    from simdtex.machine.opencl import OpenCL

    return OpenCL(info, profile=profile)
