# SPDX-License-Identifier: BSD-3-Clause
"""What a device was asked to do, and how long it took over it, kernel by kernel."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from typing import Any

from simdtex.machine.interface import Work

PENDING = 4096
"""Launches whose events may wait for being read."""

KEPT = 2**14
"""Times of a kernel that are kept, for their median."""


class Times:
    """Durations: their number, sum, extremes and a median, in bounded memory.

    Attributes
    ----------
    count : int
    nanoseconds, least, most : int
        Exact, of all durations.
    """

    def __init__(self) -> None:
        self.count = self.nanoseconds = self.most = 0
        self.least = 0
        self._kept, self._every = array("d"), 1

    def add(self, nanoseconds: int) -> None:
        """Note one; of many, every second, fourth, ... is kept for the median."""
        self.least = min(self.least, nanoseconds) if self.count else nanoseconds
        self.most = max(self.most, nanoseconds)
        if self.count % self._every == 0:
            self._kept.append(nanoseconds)
            if len(self._kept) > KEPT:
                self._kept, self._every = self._kept[::2], 2 * self._every
        self.count += 1
        self.nanoseconds += nanoseconds

    def report(self) -> dict[str, Any]:
        """``calls``, and ``min``, ``median``, ``max`` and ``seconds``, their sum, in seconds."""
        return {
            "calls": self.count,
            "min": self.least * 1e-9,
            "median": median(self._kept) * 1e-9 if self._kept else 0.0,
            "max": self.most * 1e-9,
            "seconds": self.nanoseconds * 1e-9,
        }


class _Kernel(Times):
    """The times of a kernel, and what its launches said they do; None as soon as one did not say it."""

    def __init__(self) -> None:
        super().__init__()
        self.fma: float | None = 0.0
        self.bytes: float | None = 0.0

    def say(self, work: Work | None) -> None:
        fma, moved = (work.fma, work.bytes) if work else (None, None)
        self.fma = None if self.fma is None or fma is None else self.fma + fma
        self.bytes = None if self.bytes is None or moved is None else self.bytes + moved


class Log:
    """Launches, and with profiling their times.

    Parameters
    ----------
    profile : bool
        Whether the queue's events have times.

    Attributes
    ----------
    launches : int
        Kernels enqueued so far.
    shapes : dict
        (work-items) of a launch -> how often.

    Notes
    -----
    Memory is bounded: at most `PENDING` events, and `KEPT` times for each kernel.
    """

    def __init__(self, profile: bool) -> None:
        self.profile = profile
        self.launches = 0
        self.shapes: dict[int, int] = {}
        self._pending: list[tuple[str, Work | None, Any]] = []
        self._nanoseconds = 0
        self._begin()

    def _begin(self) -> None:
        self._kernels: dict[str, _Kernel] = {}
        self._gaps, self._last = Times(), 0

    def add(self, items: int, event: Any, kernel: Any = None, work: Work | None = None) -> None:
        """Note a launch of so many work-items, of a kernel, that does so much."""
        self.launches += 1
        self.shapes[items] = self.shapes.get(items, 0) + 1
        if self.profile:
            self._pending.append((kernel.function_name if kernel else "", work, event))
            if len(self._pending) >= PENDING:
                half = PENDING // 2  # the device has the others yet to do, so it does not idle
                self._pending[half - 1][2].wait()
                self._settle(half)

    def settle(self) -> None:
        """Read the times of what is done; call it when the queue is empty."""
        self._settle(len(self._pending))

    def _settle(self, count: int) -> None:
        for name, work, event in self._pending[:count]:
            begin, end = event.profile.start, event.profile.end
            self._nanoseconds += end - begin
            kernel = self._kernels.setdefault(name, _Kernel())
            kernel.add(end - begin)
            kernel.say(work)
            if self._last:
                self._gaps.add(max(0, begin - self._last))
            self._last = end
        del self._pending[:count]

    @contextmanager
    def paused(self) -> Iterator[None]:
        """No launch is timed in here, so that timing costs none of them anything."""
        profile, self.profile = self.profile, False
        try:
            yield
        finally:
            self.profile = profile

    @property
    def seconds(self) -> float | None:
        """Seconds in kernels so far, None without profiling."""
        return self._nanoseconds * 1e-9 if self.profile else None

    def take(self) -> dict[str, Any] | None:
        """What was launched since this was called last, None without profiling; call it when the queue is empty.

        Returns
        -------
        dict
            ``kernels``, a list, the one that took longest first: dicts with ``name``, the entries of `Times.report`,
            ``share`` of the time of all kernels, ``fma`` and ``bytes`` in all (None where not stated), and ``fma_rate``
            and ``byte_rate``, those per second. ``gaps``: `Times.report` of the times between one kernel and the next.
        """
        if not self.profile:
            return None
        total = sum(kernel.nanoseconds for kernel in self._kernels.values())
        kernels = [
            {"name": name, **kernel.report(), "share": kernel.nanoseconds / max(1, total)}
            | {"fma": kernel.fma, "bytes": kernel.bytes}
            | {"fma_rate": _rate(kernel.fma, kernel), "byte_rate": _rate(kernel.bytes, kernel)}
            for name, kernel in sorted(self._kernels.items(), key=lambda item: -item[1].nanoseconds)
        ]
        report = {"kernels": kernels, "gaps": self._gaps.report()}
        self._begin()
        return report


def _rate(amount: float | None, times: Times) -> float | None:
    return None if amount is None or not times.nanoseconds else amount / (times.nanoseconds * 1e-9)
