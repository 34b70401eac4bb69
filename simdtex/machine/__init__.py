# SPDX-License-Identifier: BSD-3-Clause
"""The machine that executes whole-array steps: the NumPy reference, or an OpenCL device."""

from __future__ import annotations

from typing import Any, Protocol

from simdtex.ops.operation import Array, Operation, P, R


class Machine(Protocol):
    """What a method may ask of a machine. A method says nothing about OpenCL."""

    name: str

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Run one operation on arrays of this machine."""
        ...

    def put(self, array: Any) -> Array:
        """An array of this machine with the contents of a NumPy array."""
        ...

    def get(self, array: Array) -> Any:
        """A NumPy array with the contents of an array of this machine; waits for them."""
        ...

    def sync(self, work: int = 0) -> None:
        """Wait until everything is done, or, given the fma just asked for, as often as keeps launches answering."""
        ...

    def require(self, size: int) -> None:
        """Raise DeviceError where this many bytes are more than there is."""
        ...

    def chunk(self, candidates: int, neighbours: int, channels: int) -> int:
        """How many sites to relax in one go, for a neighbourhood of so many neighbours and channels."""
        ...


def open_machine(device: str | Machine | None = None) -> Machine:
    """The machine for a device text.

    Parameters
    ----------
    device : str, Machine or None
        Part of a name or platform, an index of ``simdtex devices``, or ``"reference"``; None takes
        SIMDTEX_DEVICE, else a GPU, else a CPU. A machine is returned as it is.

    Raises
    ------
    simdtex.device.DeviceError
        No device matches, several do, or none is usable; the sentence names the remedy.
    """
    if device is not None and not isinstance(device, (str, int)):
        return device
    from simdtex.device import find

    info = find(None if device is None else str(device))
    if info.kind == "reference":
        from simdtex.machine.reference import Reference

        return Reference()
    from simdtex.machine.opencl import OpenCL

    return OpenCL(info)
