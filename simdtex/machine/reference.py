# SPDX-License-Identifier: BSD-3-Clause
"""The machine in plain NumPy, the authority on every bit; and the log of the kernels of a device."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from typing import Any

import numpy as np

PENDING = 4096
"""The most launches whose events wait to be read."""


class Log:
    """Launches and, with profiling, their times.

    Parameters
    ----------
    profile : bool
        Whether the queue's events have times.

    Attributes
    ----------
    launches : int
        Kernels enqueued so far.
    """

    def __init__(self, profile: bool) -> None:
        self.profile = profile
        self.launches = 0
        self._pending: list[tuple[str, Any]] = []
        self._total = 0
        self._calls: Counter[str] = Counter()
        self._nanoseconds: Counter[str] = Counter()

    def add(self, event: Any, kernel: Any) -> None:
        """Note a launch of a kernel."""
        self.launches += 1
        if self.profile:
            self._pending.append((kernel.function_name, event))
            if len(self._pending) >= PENDING:
                half = PENDING // 2  # meanwhile the device continues with the other half
                self._pending[half - 1][1].wait()
                self.settle(half)

    def settle(self, count: int | None = None) -> None:
        """Read the times of the first ``count`` pending launches, None: all, which must be complete."""
        for name, event in self._pending[:count]:
            took = event.profile.end - event.profile.start
            self._total += took
            self._calls[name] += 1
            self._nanoseconds[name] += took
        del self._pending[:count]

    @property
    def seconds(self) -> float | None:
        """Seconds spent in kernels so far, None without profiling."""
        return self._total * 1e-9 if self.profile else None

    def take(self) -> dict[str, Any] | None:
        """Return the times of the launches since the last call, None without profiling; the queue must be empty.

        ``kernels`` is a list, the longest time first: dicts with ``name``, ``calls``, ``seconds`` and ``share`` of the
        time of all kernels.
        """
        if not self.profile:
            return None
        total = max(1, self._nanoseconds.total())
        kernels = [
            {"name": name, "calls": self._calls[name], "seconds": time * 1e-9, "share": time / total}
            for name, time in self._nanoseconds.most_common()
        ]
        self._calls.clear()
        self._nanoseconds.clear()
        return {"kernels": kernels}


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
