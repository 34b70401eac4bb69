# SPDX-License-Identifier: BSD-3-Clause
"""What a machine is to those who use it: arrays, operations, and what they may ask of it.

A method sees a `Machine` and runs an `Operation` on it: one name, a kernel launcher and a NumPy twin with the same
arguments. A launcher sees a `Launcher`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Concatenate, Generic, NamedTuple, ParamSpec, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.devices import DeviceInfo

P = ParamSpec("P")
R = TypeVar("R")

Array = Any
"""An array of the machine: `numpy.ndarray` on the reference, `simdtex.machine.buffers.DeviceArray` on a device."""


class Work(NamedTuple):
    """What a launch says that it does, for profiles.

    Attributes
    ----------
    fma : float or None
        Multiply-adds that the operation asks for, however the kernel saves some of them; None where it is not known.
    bytes : float or None
        The least that has to be moved: every array read or written once.
    """

    fma: float | None
    bytes: float | None


def touching(*arrays: Array, fma: float | None = None) -> Work:
    """The work of a launch that reads or writes each of these device arrays once."""
    return Work(fma, float(sum(array.nbytes for array in arrays)))


@dataclass(frozen=True)
class Operation(Generic[P, R]):
    """A whole-array step, written twice.

    Parameters
    ----------
    name : str
        Its name; also the stem of the module, of the kernel file and of the test.
    reference : callable
        The twin: NumPy arrays in, NumPy arrays out.
    launch : callable
        The launcher: the machine first, then the same arguments as device arrays.
    """

    name: str
    reference: Callable[P, R]
    launch: Callable[Concatenate[Any, P], R]

    def __call__(self, machine: Machine, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the operation on a machine."""
        return machine.run(self, *args, **kwargs)


class Machine(Protocol):
    """What a method may ask of a machine. A method says nothing about OpenCL."""

    name: str

    @property
    def kind(self) -> str:
        """What the device is: ``"gpu"``, ``"cpu"`` or another, as `simdtex.devices` has it."""
        ...

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

    def part(self, array: Array, begin: int, end: int) -> Array:
        """A copy of some elements of an array of this machine that has one axis."""
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


class Tally(Protocol):
    """Counts the terms of equation (12) that were weighed, against those there are."""

    def slots(self, count: int) -> Array:
        """An array of `count` or more uint64 on the device, to which kernels add the fma that they do."""
        ...

    def expect(self, fma: int) -> None:
        """Note the fma that a launch would do without any bound."""
        ...


class Launcher(Machine, Protocol):
    """What a launcher of kernels may ask of a device.

    Attributes
    ----------
    vector : int
        Sites or candidates side by side in a work-item: 1, 4, 8 or 16.
    step : int
        Vectors that are kept in registers together.
    tile : (int, int)
        Work-items to a group of a launch in two dimensions.
    skip : bool
        Whether candidates that are proved to lose are skipped.
    info : DeviceInfo
    scratch : int
        Bytes that distances may take at a time.
    """

    vector: int
    step: int
    tile: tuple[int, int]
    skip: bool
    info: DeviceInfo
    scratch: int

    @property
    def tally(self) -> Tally:
        """Counts what was skipped."""
        ...

    def empty(self, shape: Any, dtype: Any) -> Array:
        """An array whose contents do not matter yet."""
        ...

    def constant(self, array: Any) -> Array:
        """A small table on the device, uploaded once."""
        ...

    def split(self, items: int, most: int) -> int:
        """How many work-items are to share each of so many, up to `most`."""
        ...

    def kernel(self, file: str, function: str, /, **defines: int | str) -> Any:
        """A kernel of ``kernels/FILE.cl``, compiled once for these -D constants."""
        ...

    def launch(
        self,
        kernel: Any,
        size: tuple[int, ...],
        *args: Any,
        local: tuple[int, ...] | None = None,
        work: Work | None = None,
    ) -> None:
        """Enqueue a kernel over a range of work-items, rounded up to whole groups: kernels guard."""
        ...

    def launch_groups(self, kernel: Any, groups: NDArray[np.int64], *args: Any) -> None:
        """Enqueue a kernel over one group of work-items after another; (groups, 2), each its begin and end."""
        ...
