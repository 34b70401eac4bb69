# SPDX-License-Identifier: BSD-3-Clause
"""The types of machines, and whole-array operations, which run on either machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeAlias, TypeVar

from simdtex.machine.log import Work, touching

if TYPE_CHECKING:
    from simdtex.machine.opencl import OpenCL
    from simdtex.machine.reference import Reference

__all__ = ["Array", "Launcher", "Machine", "Operation", "Work", "touching"]

P = ParamSpec("P")
R = TypeVar("R")

Machine: TypeAlias = "OpenCL | Reference"
"""A machine as methods see it: what the two classes have in common. Methods know nothing about OpenCL."""

Launcher: TypeAlias = "OpenCL"
"""The machine that launchers of kernels get."""

Array = Any
"""An array of a machine: `simdtex.machine.opencl.DeviceArray`, or `numpy.ndarray` on the reference."""


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
        The launcher: the OpenCL machine first, then the same arguments as device arrays.
    """

    name: str
    reference: Callable[P, R]
    launch: Callable[Concatenate[Any, P], R]

    def __call__(self, machine: Machine, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the operation on a machine."""
        result: R = machine.run(self, *args, **kwargs)
        return result
