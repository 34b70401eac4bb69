"""Tiles by real workers: processes of this machine, and a scheduler and workers that talk over TCP."""

import os
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest
from cases import assert_same_bits, texture
from skimage import data

import simdtex
from simdtex import TileStore
from simdtex.jobs.synthesis.job import plan_synthesis
from simdtex.machine.devices import DeviceError

dask_distributed = pytest.importorskip("distributed")

SAMPLE = np.stack([texture((40, 41), seed=k) for k in (1, 2, 3)], -1)
OPTIONS = {"order": 2, "xi": -4.0, "rng": 5, "channel_axis": -1}


@pytest.fixture(scope="module")
def whole():
    return simdtex.synthesize(SAMPLE, (90, 101), device="reference", **OPTIONS)


@pytest.mark.slow
def test_workers_of_this_machine_open_their_own_devices(tmp_path, whole, any_device):
    store = TileStore(tmp_path / "out.zarr", 40, workers=2)
    ours = simdtex.synthesize(SAMPLE, (90, 101), store=store, device=any_device.index, **OPTIONS)
    assert_same_bits(ours.compute(), whole)


@pytest.mark.slow
def test_a_worker_that_is_killed_is_replaced_and_a_run_without_any_says_what_it_waits_for(tmp_path, whole, monkeypatch):
    monkeypatch.setattr("simdtex.jobs.tiles.cluster.WAIT", 0.5)
    seen, said, emptied = [], [], []

    def callback(progress):
        seen.append(progress.tile)
        if len(seen) == 12:
            os.kill(first, signal.SIGKILL)  # in the middle of a tile, as likely as not
        if progress.phase == "sweep" and progress.level == 0 and not emptied:
            emptied.append(cluster.scale(0))

    def note(sentence):
        said.append(sentence)
        cluster.scale(1)

    with (
        dask_distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        dask_distributed.Client(cluster) as client,
    ):
        first = min(client.run(os.getpid).values())
        store = TileStore(tmp_path / "out.zarr", 30, workers=client, note=note)
        given = {"device": "reference", "callback": callback}
        ours = simdtex.synthesize(SAMPLE, (90, 101), store=store, **given, **OPTIONS)
        where = cluster.scheduler_address
    assert said == [f"all workers of {where} are gone and the run waits for one; start one with: dask worker {where}"]
    assert_same_bits(ours.compute(), whole)


@pytest.mark.slow
def test_a_scheduler_that_ends_is_said(tmp_path, whole):
    """The scheduler and its worker are processes of their own, as on a cluster."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    program = [sys.executable, "-m"]
    words = [*program, "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard"]
    one = [*program, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    with (
        subprocess.Popen(words, stderr=subprocess.DEVNULL) as scheduler,
        subprocess.Popen(one, stderr=subprocess.DEVNULL) as worker,
    ):

        def callback(progress):
            if progress.phase == "sweep" and progress.level == 0:
                scheduler.kill()

        store = TileStore(tmp_path / "out.zarr", 30, workers=address)
        given = {"device": "reference", "callback": callback}
        try:
            with pytest.raises(DeviceError, match=f"the scheduler {address} is gone; start it and its workers again, "):
                simdtex.synthesize(SAMPLE, (90, 101), store=store, **given, **OPTIONS)
        finally:
            scheduler.kill()
            worker.kill()
    ours = TileStore(store.path, workers=1).resume("reference")
    assert_same_bits(ours.compute(), whole)


def test_a_scheduler_that_does_not_answer_leaves_no_client(tmp_path):
    """A client that failed to connect would else be the default one, on which the next `compute` waits for ever."""
    with pytest.raises(ValueError, match="no scheduler answers at nonsense://a") as caught:
        store = TileStore(tmp_path / "a.zarr", workers="nonsense://a")
        simdtex.synthesize(SAMPLE, (20, 20), store=store, channel_axis=-1)
    assert caught.value.__cause__ is not None  # which holds the client
    with pytest.raises(ValueError, match="No clients found"):
        dask_distributed.default_client()
    with pytest.raises(TypeError, match="each worker opens its own device"):
        store, device = TileStore(tmp_path / "a.zarr", workers=1), simdtex.open_machine("reference")
        simdtex.synthesize(SAMPLE, (20, 20), store=store, device=device, channel_axis=-1)


PEAK = """
import sys
import simdtex
from skimage import data
store = simdtex.TileStore(sys.argv[1], 512)
simdtex.synthesize(data.brick()[:128, :128], (1024, 1024), store=store, rng=1, device=sys.argv[2])
with open("/proc/self/status") as file:  # ru_maxrss would count the process that started this one
    print(1024 * int(next(line for line in file if line.startswith("VmHWM")).split()[1]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc is Linux's")
def test_a_process_takes_no_more_memory_than_the_plan_says(tmp_path, cl_device):
    plan = TileStore("", 512).layout(plan_synthesis(data.brick()[:128, :128], (1024, 1024)))
    command = [sys.executable, "-c", PEAK, str(tmp_path / "o.zarr"), str(cl_device.index)]
    usual = {name: value for name, value in os.environ.items() if name != "MALLOC_TRIM_THRESHOLD_"}  # set by Dask
    done = subprocess.run(command, env=usual, check=True, capture_output=True, text=True)
    assert plan.memory / 4 < int(done.stdout) < plan.memory
