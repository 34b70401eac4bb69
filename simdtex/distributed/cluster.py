# SPDX-License-Identifier: BSD-3-Clause
"""Where tiles are done: in this process, or by the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from logging import CRITICAL, getLogger
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from simdtex.distributed.store import Store, Turn
from simdtex.distributed.tasks import do
from simdtex.distributed.tiling import Execute
from simdtex.machine import Machine
from simdtex.machine.devices import DeviceError
from simdtex.options import require, whole

if TYPE_CHECKING:
    from distributed import Client

AHEAD = 3
"""Tasks for each worker that the scheduler knows of: one is always ready, and the scheduler's memory is bounded."""

WAIT = 10.0
"""Seconds between two looks at whether there are workers."""


def here(store: Store, device: str | Machine | None) -> Execute:
    """Return what does tasks in this process, one after another."""
    name = store.about["name"]

    def execute(turn: Turn, tasks: int) -> Iterator[int]:
        for number in range(tasks):
            yield do(store.where, name, device, turn, number)

    return execute


def across(client: Client, store: Store, device: str | Machine | None, note: Callable[[str], None]) -> Execute:
    """Return what has the workers of a cluster do tasks; a task that is lost with its worker is done by another.

    ``note`` receives a sentence when there are no workers.
    """
    distributed: Any = import_module("distributed")
    what = store.where, store.about["name"], None if device is None else str(device)

    def execute(turn: Turn, tasks: int) -> Iterator[int]:
        token, todo = os.urandom(8).hex(), iter(range(tasks))

        def begun(count: int) -> list[Any]:
            return [
                client.submit(do, *what, turn, number, key=f"tile-{token}-{turn.number}-{number}", pure=False)
                for number in islice(todo, count)
            ]

        first = begun(AHEAD * max(1, len(client.scheduler_info(n_workers=-1)["workers"])))
        running = distributed.as_completed(first, loop=client.loop)
        try:
            with _waiting(client, note):
                for future in running:
                    for another in begun(1):
                        running.add(another)
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
            cancel: Any = client.cancel
            cancel(list(running.futures))

    return execute


@contextmanager
def _waiting(client: Client, note: Callable[[str], None]) -> Iterator[None]:
    """Note during the block when there are no workers, for which the run then waits."""
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
    """Raise unless workers of a valid number can open the device."""
    if workers is None:
        return
    if isinstance(workers, (int, float)):
        whole("workers", workers, 1, 4 * (os.cpu_count() or 1))
    if not (device is None or isinstance(device, (str, int))):
        raise TypeError("each worker opens its own device; give its name, not an open machine")


@contextmanager
def connected(workers: int | str | Client | None) -> Iterator[Client | None]:
    """Yield a client of so many processes on this machine, of the scheduler at an address, the one given, or None."""
    if workers is None or not isinstance(workers, (int, str)):
        yield workers
        return
    require("distributed", "distributed")
    distributed: Any = import_module("distributed")
    from simdtex.distributed.cores import Cores

    if isinstance(workers, str):
        getLogger("distributed.client").setLevel(CRITICAL)  # what ends a run is said in one sentence
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
            memory_limit=0,  # the plan says what a worker needs; a tile that is stopped at a limit is only begun again
            env={**limits, "OMP_NUM_THREADS": str(each)},
            plugins=(Cores(each),),
            silence_logs=50,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client
