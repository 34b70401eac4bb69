# SPDX-License-Identifier: BSD-3-Clause
"""What an operation is: one name, a kernel launcher and a NumPy twin with the same arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar

if TYPE_CHECKING:
    from simdtex.machine import Machine
    from simdtex.machine.opencl import OpenCL

P = ParamSpec("P")
R = TypeVar("R")

Array = Any
"""An array of the machine: `numpy.ndarray` on the reference, `pyopencl.array.Array` on a device."""


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
