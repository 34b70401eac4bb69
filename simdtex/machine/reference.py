# SPDX-License-Identifier: BSD-3-Clause
"""The machine in plain NumPy: simple, slow, and the authority on every bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from simdtex.ops.operation import Array, Operation, P, R


class Reference:
    """Runs the NumPy twin of every operation.

    Parameters
    ----------
    scratch : int
        Bytes that distances may take at a time.
    """

    name = "reference (NumPy)"

    def __init__(self, scratch: int = 2**24) -> None:
        self.scratch = scratch

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the twin."""
        return operation.reference(*args, **kwargs)

    def put(self, array: Any) -> Array:
        """A copy, so that nobody else's array is changed."""
        return np.array(array)

    def get(self, array: Array) -> Any:
        """A copy."""
        return np.array(array)

    def sync(self, work: int = 0) -> None:
        """Nothing runs behind one's back here."""

    def require(self, size: int) -> None:
        """Nothing is known of the memory here."""

    def chunk(self, candidates: int, neighbours: int, channels: int) -> int:
        """Sites whose distances and neighbourhoods fit the scratch memory."""
        return max(1, self.scratch // (8 * (candidates + neighbours * (1 + channels))))
