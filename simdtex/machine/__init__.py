# SPDX-License-Identifier: BSD-3-Clause
"""The machine that executes whole-array steps: the NumPy reference, or an OpenCL device."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from simdtex.lattice import Grid
from simdtex.machine.array import ProcessorArray
from simdtex.ops.operation import Array, Operation, P, R


class Machine(Protocol):
    """What a method may ask of a machine. A method says nothing about OpenCL."""

    name: str

    @property
    def launches(self) -> int:
        """Kernels enqueued so far; on the reference, operations."""
        ...

    @property
    def seconds(self) -> float | None:
        """Seconds the device has worked so far; None where that is not measured."""
        ...

    @property
    def spared(self) -> int:
        """Fma of equation (12) that a bound has spared so far, where the machine skips what it proves to lose."""
        ...

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Run one operation on arrays of this machine."""
        ...

    def put(self, array: Any) -> Array:
        """An array of this machine with the contents of a NumPy array."""
        ...

    def get(self, array: Array) -> Any:
        """A NumPy array with the contents of an array of this machine; waits for them."""
        ...

    def emulate(self, array: ProcessorArray) -> Machine:
        """The same machine as a processor array."""
        ...

    def pieces(self, sites: NDArray[np.int32], grid: Grid, most: int) -> Iterator[tuple[Machine, NDArray[np.int32]]]:
        """The sites of a step in pieces of `most` or fewer, each with the machine that is to relax it."""
        ...

    def sync(self, work: int = 0) -> None:
        """Wait until everything is done, or, given the fma just asked for, as often as keeps launches answering."""
        ...

    def profile(self) -> dict[str, Any] | None:
        """The kernels launched since this was called last and their times; None where that is not measured."""
        ...

    def require(self, size: int) -> None:
        """Raise DeviceError where this many bytes are more than there is."""
        ...

    def chunk(self, candidates: int, neighbours: int, channels: int, stored: bool = True) -> int:
        """How many sites to relax in one go, for a neighbourhood of so many neighbours and channels.

        `stored` says whether their distances are kept.
        """
        ...


def open_machine(device: str | Machine | None = None, *, profile: bool = False, skip: bool = True) -> Machine:
    """The machine for a device text.

    Parameters
    ----------
    device : str, Machine or None
        Part of a name or platform, an index of ``simdtex devices``, or ``"reference"``; None takes
        SIMDTEX_DEVICE, else a GPU, else a CPU. A machine is returned as it is.
    profile : bool
        Whether an OpenCL machine measures how long its device works.
    skip : bool
        Whether an OpenCL machine skips candidates that it proves to lose. It changes no bit of any result.

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
    from simdtex.machine.tuner import tune

    machine = OpenCL(info, profile=profile, skip=skip)
    tune(machine)
    return machine
