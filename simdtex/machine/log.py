# SPDX-License-Identifier: BSD-3-Clause
"""Counts and times of the kernels that a device has run."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from typing import Any, NamedTuple

PENDING = 4096
"""Launches whose events may wait for being read."""


class Work(NamedTuple):
    """The amount of work of a launch, for profiles.

    Attributes
    ----------
    fma : float or None
        Multiply-adds of the operation, even if the kernel skips some of them; None if unknown.
    bytes : float or None
        Bytes moved at least: every array read or written once.
    """

    fma: float | None
    bytes: float | None


def touching(*arrays: Any, fma: float | None = None) -> Work:
    """Return the work of a launch that reads or writes each of these arrays once."""
    return Work(fma, float(sum(array.nbytes for array in arrays)))


class Times:
    """Durations in nanoseconds, and the work done in them; 8 bytes for each duration."""

    def __init__(self) -> None:
        self.durations = array("q")
        self.fma: float | None = 0.0
        self.bytes: float | None = 0.0

    def add(self, nanoseconds: int, work: Work | None = None) -> None:
        """Note a duration; the sums of work are None from the first unknown amount on."""
        self.durations.append(nanoseconds)
        fma, moved = work or (None, None)
        self.fma = None if self.fma is None or fma is None else self.fma + fma
        self.bytes = None if self.bytes is None or moved is None else self.bytes + moved

    @property
    def nanoseconds(self) -> int:
        """Sum of all durations."""
        return sum(self.durations)

    def report(self) -> dict[str, Any]:
        """Return ``calls``, and ``min``, ``median``, ``max`` and ``seconds``, their sum, in seconds."""
        found = self.durations or [0]
        figures = {"min": min(found) * 1e-9, "median": median(found) * 1e-9, "max": max(found) * 1e-9}
        return {"calls": len(self.durations), **figures, "seconds": self.nanoseconds * 1e-9}


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

    Notes
    -----
    At most `PENDING` events are kept, and 16 bytes for each launch until `take`.
    """

    def __init__(self, profile: bool) -> None:
        self.profile = profile
        self.launches = 0
        self._pending: list[tuple[str, Work | None, Any]] = []
        self._nanoseconds = 0
        self._reset()

    def _reset(self) -> None:
        self._kernels: dict[str, Times] = defaultdict(Times)
        self._gaps, self._last = Times(), 0

    def add(self, event: Any, kernel: Any, work: Work | None = None) -> None:
        """Note a launch of a kernel and its work."""
        self.launches += 1
        if self.profile:
            self._pending.append((kernel.function_name, work, event))
            if len(self._pending) >= PENDING:
                half = PENDING // 2  # the device goes on with the other half meanwhile
                self._pending[half - 1][2].wait()
                self.settle(half)

    def settle(self, count: int | None = None) -> None:
        """Read the times of the first launches that are pending, which must be complete; of all by default."""
        for name, work, event in self._pending[:count]:
            begin, end = event.profile.start, event.profile.end
            self._nanoseconds += end - begin
            self._kernels[name].add(end - begin, work)
            if self._last:
                self._gaps.add(max(0, begin - self._last))
            self._last = end
        del self._pending[:count]

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Time no launch within this context."""
        profile, self.profile = self.profile, False
        try:
            yield
        finally:
            self.profile = profile

    @property
    def seconds(self) -> float | None:
        """Seconds spent in kernels so far, None without profiling."""
        return self._nanoseconds * 1e-9 if self.profile else None

    def take(self) -> dict[str, Any] | None:
        """Return the times of the launches since the last call, None without profiling; the queue must be empty.

        Returns
        -------
        dict
            ``kernels``, a list sorted by time, the longest first: dicts with ``name``, the entries of `Times.report`,
            ``share`` of the time of all kernels, ``fma`` and ``bytes`` in all (None if unknown), and ``fma_rate`` and
            ``byte_rate``, the same per second. ``gaps``: `Times.report` of the times between one kernel and the next.
        """
        if not self.profile:
            return None
        total = sum(times.nanoseconds for times in self._kernels.values())
        kernels = []
        for name, times in sorted(self._kernels.items(), key=lambda item: -item[1].nanoseconds):
            share = times.nanoseconds / max(1, total)
            work = {"share": share, "fma": times.fma, "bytes": times.bytes}
            rates = {"fma_rate": _rate(times.fma, times), "byte_rate": _rate(times.bytes, times)}
            kernels.append({"name": name, **times.report(), **work, **rates})
        report = {"kernels": kernels, "gaps": self._gaps.report()}
        self._reset()
        return report


def _rate(amount: float | None, times: Times) -> float | None:
    return None if amount is None or not times.nanoseconds else amount / (times.nanoseconds * 1e-9)
