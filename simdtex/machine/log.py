# SPDX-License-Identifier: BSD-3-Clause
"""What a device was asked to do, and how long it took over it."""

from __future__ import annotations

from typing import Any


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
    """

    def __init__(self, profile: bool) -> None:
        self.profile = profile
        self.launches = 0
        self.shapes: dict[int, int] = {}
        self._pending: list[Any] = []
        self._nanoseconds = 0

    def add(self, items: int, event: Any) -> None:
        """Note a launch of so many work-items."""
        self.launches += 1
        self.shapes[items] = self.shapes.get(items, 0) + 1
        if self.profile:
            self._pending.append(event)

    def settle(self) -> None:
        """Add up the times of what is done; call it when the queue is empty."""
        self._nanoseconds += sum(event.profile.end - event.profile.start for event in self._pending)
        self._pending = []

    @property
    def seconds(self) -> float | None:
        """Seconds in kernels so far, None without profiling."""
        return self._nanoseconds * 1e-9 if self.profile else None
