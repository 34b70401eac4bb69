# SPDX-License-Identifier: BSD-3-Clause
"""The machine in plain NumPy: simple, slow, and the authority on every bit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from typing import Any

import numpy as np


class Reference:
    """The machine that runs the NumPy twin of every operation, with the interface of `simdtex.machine.opencl.OpenCL`.

    Parameters
    ----------
    scratch : int
        Bytes available for distances at a time.
    """

    name, kind = "reference (NumPy)", "reference"
    memory, seconds, spared = inf, None, 0

    def __init__(self, scratch: int = 2**24) -> None:
        self.scratch = scratch
        self.launches = 0

    def __repr__(self) -> str:
        return "<NumPy reference>"

    @contextmanager
    def running(self) -> Iterator[None]:
        """Let an operation compute in NumPy."""
        self.launches += 1
        yield None

    def put(self, array: Any) -> Any:
        """Return a copy, so that the caller's array is never changed."""
        return np.array(array)

    def get(self, array: Any) -> Any:
        """Return a copy."""
        return np.array(array)

    def part(self, array: Any, begin: int, end: int) -> Any:
        """Return a view of elements ``begin`` to ``end`` - 1 of the first axis."""
        return array[begin:end]

    def sync(self, work: int = 0) -> None:
        """Do nothing, since every operation is complete when it returns."""

    def profile(self) -> None:
        """Return None: nothing is timed."""

    def chunk(self, candidates: int, neighbours: int, channels: int, table: int = 0) -> int:
        """Return the number of sites whose distances and neighbourhoods fit the scratch memory."""
        return max(1, self.scratch // (8 * (candidates + neighbours * (1 + channels))))
