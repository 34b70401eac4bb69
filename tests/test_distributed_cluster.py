"""Tiles by real workers: processes of this machine, and a scheduler and workers that talk over TCP."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from cases import assert_same_bits, texture
from skimage import data

import simdtex
from simdtex import distributed

dask_distributed = pytest.importorskip("distributed")

SAMPLE = np.stack([texture((40, 41), seed=k) for k in (1, 2, 3)], -1)
OPTIONS = {"order": 2, "xi": -4.0, "rng": 5, "channel_axis": -1}


@pytest.fixture(scope="module")
def whole():
    return simdtex.synthesize(SAMPLE, (90, 101), device="reference", **OPTIONS)


def test_workers_of_this_machine_open_their_own_devices(tmp_path, whole, any_device):
    path = tmp_path / "out.zarr"
    ours = distributed.synthesize(SAMPLE, (90, 101), path, tiles=40, workers=2, device=any_device.index, **OPTIONS)
    assert_same_bits(ours.compute(), whole)


class Cluster:
    """A scheduler and workers, each a command of its own."""

    def __init__(self, folder):
        self.file, self._log = folder / "scheduler.json", (folder / "log").open("wb")
        self._started = []
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")

    def _start(self, kind, *words):
        command = [sys.executable, "-m", "dask", kind, "--scheduler-file", str(self.file), *words]
        self._started.append(subprocess.Popen(command, stdout=self._log, stderr=self._log))
        return self._started[-1]

    def worker(self):
        words = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        return self._start("worker", *words, "--local-directory", str(self.file.parent))

    def client(self):
        for _ in range(300):
            if self.file.exists():
                return dask_distributed.Client(scheduler_file=str(self.file), timeout=30)
            time.sleep(0.1)
        raise TimeoutError("the scheduler did not begin")

    def end(self):
        for process in self._started:
            process.kill()
            process.wait()
        self._log.close()


@pytest.fixture
def cluster(tmp_path):
    found = Cluster(tmp_path)
    yield found
    found.end()


@pytest.mark.slow
def test_a_worker_is_killed_and_another_joins_late(tmp_path, cluster, whole):
    first, _ = cluster.worker(), cluster.worker()
    seen = {"tiles": 0}

    def callback(progress):
        seen["tiles"] += 1
        if seen["tiles"] == 12:
            os.kill(first.pid, signal.SIGKILL)  # in the middle of a tile, as likely as not
        if seen["tiles"] == 16:
            cluster.worker()

    with cluster.client() as client:
        client.wait_for_workers(2, timeout=60)
        path = tmp_path / "out.zarr"
        ours = distributed.synthesize(
            SAMPLE, (90, 101), path, tiles=30, workers=client, device="reference", callback=callback, **OPTIONS
        )
    assert seen["tiles"] > 40
    assert first.wait(10) == -signal.SIGKILL
    assert_same_bits(ours.compute(), whole)


def test_a_client_that_ends_leaves_a_store_to_go_on_with(tmp_path, whole):
    class Stop(Exception):
        pass

    def stop(progress):
        if progress.phase == "sweep" and progress.level == 0 and progress.tile == 2:
            raise Stop

    path = tmp_path / "out.zarr"
    with pytest.raises(Stop):
        distributed.synthesize(SAMPLE, (90, 101), path, tiles=40, device="reference", callback=stop, **OPTIONS)
    ours = distributed.resume(path, workers=1, device="reference")
    assert_same_bits(ours.compute(), whole)


def test_one_sentence_for_what_is_wrong(tmp_path):
    with dask_distributed.Client(processes=False, n_workers=1, dashboard_address=None) as client:
        given = {"workers": client, "device": simdtex.open_machine("reference"), "channel_axis": -1}
        with pytest.raises(TypeError, match="each worker opens its own device"):
            distributed.synthesize(SAMPLE, (20, 20), tmp_path / "a.zarr", **given)


PEAK = """
import resource, sys
from simdtex import distributed
from skimage import data
distributed.synthesize(data.brick()[:128, :128], (1024, 1024), sys.argv[1], tiles=512, rng=1, device=sys.argv[2])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in other units elsewhere")
def test_a_process_takes_no_more_memory_than_the_plan_says(tmp_path, cl_device):
    plan = distributed.plan(data.brick()[:128, :128], (1024, 1024), tiles=512)
    command = [sys.executable, "-c", PEAK, str(tmp_path / "o.zarr"), str(cl_device.index)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert plan.memory / 4 < int(done.stdout) < plan.memory
