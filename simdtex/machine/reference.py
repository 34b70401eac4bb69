# SPDX-License-Identifier: BSD-3-Clause
"""The machine in plain NumPy: simple, slow, and the authority on every bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from simdtex.machine.interface import Array, Operation, P, R


class Reference:
    """Runs the NumPy twin of every operation.

    Parameters
    ----------
    scratch : int
        Bytes that distances may take at a time.
    """

    name, kind = "reference (NumPy)", "reference"

    def __init__(self, scratch: int = 2**24) -> None:
        self.scratch = scratch
        self.launches = 0
        self.seconds = None
        self.spared = 0

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the twin."""
        self.launches += 1
        return operation.reference(*args, **kwargs)

    def put(self, array: Any) -> Array:
        """A copy, so that nobody else's array is changed."""
        return np.array(array)

    def get(self, array: Array) -> Any:
        """A copy."""
        return np.array(array)

    def part(self, array: Array, begin: int, end: int) -> Array:
        """A view."""
        return array[begin:end]

    def sync(self, work: int = 0) -> None:
        """Nothing runs behind one's back here."""

    def profile(self) -> None:
        """Nothing is timed here."""

    def require(self, size: int) -> None:
        """Nothing is known of the memory here."""

    def chunk(self, candidates: int, neighbours: int, channels: int, stored: bool = True) -> int:
        """Sites whose distances and neighbourhoods fit the scratch memory."""
        return max(1, self.scratch // (8 * (candidates + neighbours * (1 + channels))))
