# SPDX-License-Identifier: BSD-3-Clause
"""The cores of each worker on one machine."""

from __future__ import annotations

import os
import signal
import threading

from distributed import Worker, WorkerPlugin


class Cores(WorkerPlugin):
    """Gives each worker of a local cluster ``each`` cores of its own, before it opens a device."""

    name = "simdtex-cores"

    def __init__(self, each: int) -> None:
        self.each = each

    def setup(self, worker: Worker) -> None:
        """Set the cores of the worker, which its threads and those of its device inherit."""
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that starts the workers
        if not hasattr(os, "sched_setaffinity"):
            return  # workers compete for cores on this system
        free = sorted(os.sched_getaffinity(0))
        first = int(worker.name) * self.each % len(free)
        os.sched_setaffinity(0, {free[(first + k) % len(free)] for k in range(min(self.each, len(free)))})
