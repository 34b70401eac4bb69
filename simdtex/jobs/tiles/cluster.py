# SPDX-License-Identifier: BSD-3-Clause
"""The execution of tasks: in this process, or by the workers of a Dask cluster."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from logging import CRITICAL, getLogger
from threading import Event, Thread, current_thread, main_thread
from typing import Any

import distributed
from distributed import Client, Worker, WorkerPlugin

from simdtex.jobs.tiles.store import Store, Turn
from simdtex.jobs.tiles.tasks import do
from simdtex.jobs.tiles.turns import Execute
from simdtex.machine import Machine
from simdtex.machine.devices import DeviceError
from simdtex.options import whole

WAIT = 10.0
"""Seconds between two checks for workers."""


def here(store: Store, device: str | Machine | None) -> Execute:
    """Return a function that executes tasks in this process, one after another."""
    name = store.about["name"]

    def execute(turn: Turn, tasks: int) -> Iterator[int]:
        for task in range(tasks):
            yield do(store.where, name, device, turn, task)

    return execute


def across(client: Client, store: Store, device: str | Machine | None, note: Callable[[str], None]) -> Execute:
    """Return a function that executes tasks on workers, repeats those of a lost one, and notes if none is left."""
    what = store.where, store.about["name"], None if device is None else str(device)

    def execute(turn: Turn, tasks: int) -> Iterator[int]:
        futures = client.map(partial(do, *what, turn), range(tasks), key="tile", pure=False)
        try:
            with _waiting(client, note):
                for future in distributed.as_completed(futures, loop=client.loop):
                    yield future.result()
        except distributed.KilledWorker:
            raise DeviceError(
                "the workers that took a tile ended one after another; give smaller tiles, or workers more "
                f"memory, and continue with: simdtex resume {store.where}"
            ) from None
        except distributed.CancelledError:
            raise DeviceError(
                f"the scheduler {_address(client)} is gone; start it and its workers again, and go on with: "
                f"simdtex resume {store.where}"
            ) from None
        finally:
            client.cancel(futures)

    return execute


@contextmanager
def _waiting(client: Client, note: Callable[[str], None]) -> Iterator[None]:
    """Call ``note`` if there are no workers during the block, since the run then waits for them."""
    over = Event()

    def watch() -> None:
        told = False
        while not over.wait(WAIT):
            try:
                gone = not client.scheduler_info(n_workers=1)["workers"]
            except OSError:  # the scheduler is gone too
                return
            if gone and not told:
                where = _address(client)
                note(f"all workers of {where} are gone and the run waits for one; start one with: dask worker {where}")
            told = gone

    Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()


def _address(client: Client) -> str:
    scheduler: Any = client.scheduler
    return str(scheduler.address) if scheduler else ""


def check_workers(workers: Any, device: Any) -> None:
    """Raise unless the number of workers is valid and each can open the device."""
    if workers is None:
        return
    if isinstance(workers, (int, float)):
        whole("workers", workers, 1, 4 * (os.cpu_count() or 1))
    if not (device is None or isinstance(device, (str, int))):
        raise TypeError("each worker opens its own device; give its name, not an open machine")


class Cores(WorkerPlugin):
    """Gives each worker of a local cluster ``each`` cores of its own, before it opens a device."""

    name = "simdtex-cores"

    def __init__(self, each: int) -> None:
        self.each = each

    def setup(self, worker: Worker) -> None:
        """Set the cores of the worker, which its threads and those of its device inherit."""
        if current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that starts the workers
        if not hasattr(os, "sched_setaffinity"):
            return  # workers compete for cores on this system
        free = sorted(os.sched_getaffinity(0))
        first = int(worker.name) * self.each % len(free)
        os.sched_setaffinity(0, {free[(first + k) % len(free)] for k in range(min(self.each, len(free)))})


@contextmanager
def connected(workers: int | str | Client | None) -> Iterator[Client | None]:
    """Yield a client: of processes on this machine, of the scheduler at an address, or the given one or None."""
    if workers is None or not isinstance(workers, (int, str)):
        yield workers
        return
    if isinstance(workers, str):
        getLogger("distributed.client").setLevel(CRITICAL)  # one sentence reports the end of a run
        try:
            client = distributed.Client(workers, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ValueError(f"no scheduler answers at {workers}; start one with: dask scheduler") from error
        with client:
            yield client
        return
    each = max(1, (os.cpu_count() or 1) // workers)
    limits = {name: str(each) for name in ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT")}
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            memory_limit=0,  # `TileStore.layout` gives the need; a tile stopped at a limit would only restart
            env={**limits, "OMP_NUM_THREADS": str(each)},
            plugins=(Cores(each),),
            silence_logs=50,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client
