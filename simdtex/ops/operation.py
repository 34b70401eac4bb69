# SPDX-License-Identifier: BSD-3-Clause
"""What an operation is: one name, a kernel launcher and a NumPy twin with the same arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Concatenate, Generic, NamedTuple, ParamSpec, TypeVar

if TYPE_CHECKING:
    from simdtex.machine import Machine
    from simdtex.machine.opencl import OpenCL

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
    launch: Callable[Concatenate[OpenCL, P], R]

    def __call__(self, machine: Machine, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the operation on a machine."""
        return machine.run(self, *args, **kwargs)
