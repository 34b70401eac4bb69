# SPDX-License-Identifier: BSD-3-Clause
"""How much of the distances a device was spared."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher


class Tally:
    """Counts on the device the terms of equation (12) that were weighed, against those there are.

    Parameters
    ----------
    machine : Launcher
    """

    def __init__(self, machine: Launcher) -> None:
        self._machine = machine
        self._slots: Array | None = None
        self._spared = 0

    def slots(self, count: int) -> Array:
        """An array of `count` or more uint64 on the device, to which kernels add the fma that they do."""
        if self._slots is None or self._slots.size < count:
            self._settle()
            self._slots = self._machine.put(np.zeros(count, np.uint64))
        return self._slots

    def expect(self, fma: int) -> None:
        """Note the fma that a launch would do without any bound."""
        self._spared += fma

    def _settle(self) -> None:
        if self._slots is not None:
            self._spared -= int(self._machine.get(self._slots).sum())
            self._slots = None

    @property
    def spared(self) -> int:
        """Fma that were not done, so far; waits for the device."""
        self._settle()
        return self._spared
