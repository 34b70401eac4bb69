# SPDX-License-Identifier: BSD-3-Clause
"""The types of machines, and whole-array operations, which run on either machine."""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeAlias, TypeVar

if TYPE_CHECKING:
    from simdtex.machine.opencl import OpenCL
    from simdtex.machine.reference import Reference

P = ParamSpec("P")
R = TypeVar("R")

Machine: TypeAlias = "OpenCL | Reference"
"""The machine of methods: the common interface of both classes. Methods do not depend on OpenCL."""

Launcher: TypeAlias = "OpenCL"
"""The machine argument of functions that launch kernels."""

Array = Any
"""An array of a machine: `simdtex.machine.opencl.DeviceArray`, or `numpy.ndarray` on the reference."""


class Operation(Generic[P, R]):
    """A whole-array step, written as one function that launches kernels or, as their twin, computes in NumPy.

    Parameters
    ----------
    function : callable
        Its first argument is an OpenCL machine, or None for the twin; all others are arrays of that machine, or of
        NumPy, and numbers. Its module, its kernel file and its test have the same name.
    """

    def __init__(self, function: Callable[Concatenate[Any, P], R]) -> None:
        update_wrapper(self, function)
        self._function = function

    def __call__(self, machine: Machine, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the operation on a machine."""
        with machine.running() as launcher:
            return self._function(launcher, *args, **kwargs)

    def reference(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Return the result of the twin in NumPy."""
        return self._function(None, *args, **kwargs)
