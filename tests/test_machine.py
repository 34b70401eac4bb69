# SPDX-License-Identifier: BSD-3-Clause
"""Machines: memory, caches, threads, forked processes and arguments of `open_machine`."""

import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import uuid
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import simdtex
from simdtex.machine import memory, opencl, runtimes
from simdtex.machine.devices import DeviceError
from simdtex.machine.interface import Operation
from simdtex.machine.opencl import OpenCL


@given(st.integers(1, 200_000), st.integers(1, 300), st.integers(1, 4))
def test_a_chunk_of_sites_fits_the_scratch_memory(candidates, neighbours, channels):
    machine = OpenCL.__new__(OpenCL)
    machine.scratch = 2**24
    for table in (0, 3072):
        sites = machine.chunk(candidates, neighbours, channels, table)
        per_site = table + 8 * neighbours * (1 + channels)
        assert sites == 1 or sites * per_site <= 2**24
        assert sites == 1 or sites * candidates * neighbours * channels <= 2e9


def test_a_run_that_does_not_fit_the_device_is_refused(any_device):
    machine = OpenCL(dataclasses.replace(any_device, memory=10_000))
    with pytest.raises(DeviceError, match=r"needs about \d+ MiB.*smaller size"):
        simdtex.synthesize(np.eye(16), (64, 64), order=1, device=machine)


def test_running_out_of_device_memory_is_a_device_error(any_device):
    machine = OpenCL(any_device)
    greedy = Operation(lambda machine: machine.empty((2**46,), np.uint8))
    with pytest.raises(DeviceError, match="ran out of memory; give a smaller size"):
        greedy(machine)


OPEN = """
import sys
import numpy as np
import simdtex
print(simdtex.synthesize(np.eye(8), (4, 4), order=1, rng=1, levels=1, device=sys.argv[1]).shape)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="caches of Windows are in other folders")
@pytest.mark.parametrize("environment", [{"HOME": "FILE", "XDG_CACHE_HOME": ""}, {"XDG_CACHE_HOME": "/proc/nowhere"}])
def test_a_device_opens_if_no_cache_can_be_written(cl_device, tmp_path, environment):
    (tmp_path / "FILE").touch()
    environment = {key: value.replace("FILE", str(tmp_path / "FILE")) for key, value in environment.items()}
    assert python(OPEN, str(cl_device.index), TMPDIR=str(tmp_path), **environment) == ["(4,", "4)"]
    assert os.listdir(tmp_path) == ["FILE"], "the temporary cache is removed"


def test_a_short_write_means_that_the_disk_of_the_cache_is_full(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(runtimes, "_report", None)
    short = nullcontext(SimpleNamespace(write=lambda data: len(data) // 4))
    monkeypatch.setattr(runtimes.tempfile, "TemporaryFile", lambda **_: short)
    runtimes._prepare_caches()
    assert os.environ["XDG_CACHE_HOME"] != str(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="caches of Windows are in other folders")
@pytest.mark.parametrize("damaged", ["*.so", "*.bc", "binary", "info", "*.sqlite"])
def test_a_damaged_cache_is_passed_over(cl_device, tmp_path, damaged):
    """The first process may crash; the next one warns of the folder, and has the device."""

    def start():
        code = "import sys; from simdtex.machine import devices; assert devices.find(sys.argv[1]).usable"
        environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONFAULTHANDLER", "POCL_CACHE_DIR")}
        return subprocess.run(
            [sys.executable, "-c", code, str(cl_device.index)],
            env=environment | {"XDG_CACHE_HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=200,
        )

    assert (start().returncode, start().stderr) == (0, "")
    files = [path for path in tmp_path.rglob(damaged) if path.is_file()]
    if not files:
        pytest.skip("the runtime keeps no such file")
    for path in files:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    first = start()
    if first.returncode:
        assert -first.returncode in (signal.SIGABRT, signal.SIGBUS, signal.SIGSEGV), first.stderr
        first = start()
    assert first.returncode == 0, first.stderr
    assert first.stderr.count(f"delete the folders pocl, pyopencl, pytools and simdtex in {tmp_path}") == 1
    again = start()
    assert again.returncode == 0, again.stderr
    assert damaged == "*.sqlite" or not again.stderr, "the user was warned once"


def test_kernels_are_compiled_from_a_folder_of_any_name(cl_device, monkeypatch, tmp_path):
    folder = tmp_path / "a space" / "\u00fc"
    shutil.copytree(opencl.kernel_folder(), folder)
    monkeypatch.setattr(opencl, "kernel_folder", lambda: folder)
    assert OpenCL(cl_device).kernel("start").function_name == "start"


@pytest.mark.skipif(sys.platform != "linux", reason="the limit has effect on Linux")
def test_a_limit_on_the_address_space_is_said(any_device):
    """The runtimes would abort, or not be found; a run that does not fit is refused before it begins."""
    code = """
import resource, sys
import numpy as np
import simdtex
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20,) * 2)
try:
    simdtex.synthesize(np.eye(8), (6000, 6000), order=1, device=sys.argv[2])
except ValueError as error:
    print(error)
"""
    words = python(code, "700", str(any_device.index))
    assert " ".join(words).startswith("the address space of this process is limited to 700 MiB, and OpenCL needs")
    assert "is available" in " ".join(python(code, "3000", "reference"))
    assert memory.available() < runtimes.address_space()


# Threads and forks, in processes of their own: a race may crash, and a forked process may hang


def python(code, *words, **environment):
    """Return the words that a process prints within 100 seconds."""
    result = subprocess.run(
        [sys.executable, "-c", code, *words],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert result.returncode == 0, result.stderr[-2000:]
    return result.stdout.split()


THREADS = """
import sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import simdtex

machine = simdtex.open_machine(sys.argv[1], profile=sys.argv[2] == "True")
sample = np.random.default_rng(0).integers(0, 256, (20, 18), dtype=np.uint8)
METHODS = [{"order": 2, "levels": 2}, {"method": "multires"}, {"method": "pyramid", "iterations": 1}]

def run(i):
    return simdtex.synthesize(sample, (16, 17), rng=i, device=machine, **METHODS[i % 3]).tobytes()

alone = [run(i) for i in range(6)]
sys.setswitchinterval(1e-5)  # threads are switched often
with ThreadPoolExecutor(6) as pool:
    together = list(pool.map(run, [*range(6)] * 3))
print([bytes == alone[i % 6] for i, bytes in enumerate(together)].count(False), len(set(alone)))
"""


@pytest.mark.parametrize("profile", [False, True])
def test_threads_that_share_a_machine_get_the_bytes_of_runs_alone(cl_device, profile):
    assert python(THREADS, str(cl_device.index), str(profile)) == ["0", "6"]


DEVICES = """
import itertools, sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import simdtex

devices, repeats = [*sys.argv[2:], "reference"], int(sys.argv[1])
sample = np.random.default_rng(0).integers(0, 256, (20, 18), dtype=np.uint8)
hole = np.indices(sample.shape).sum(0) % 19 == 0
JOBS = [
    lambda **how: simdtex.synthesize(sample, (16, 17), order=2, levels=2, **how),
    lambda **how: simdtex.synthesize(sample, (16, 17), method="multires", **how),
    lambda **how: simdtex.synthesize(sample, (16, 17), method="pyramid", iterations=1, **how),
    lambda **how: simdtex.synthesize_solid(sample, (6, 6, 6), iterations=1, **how),
    lambda **how: simdtex.fill(sample, hole, order=1, levels=1, **how),
]
expected = [job(rng=5, device="reference").tobytes() for job in JOBS]
sys.setswitchinterval(1e-5)

def wrong(which):
    device, number = which
    return JOBS[number](rng=5, device=device).tobytes() != expected[number]

with ThreadPoolExecutor(6) as pool:
    ends = list(pool.map(wrong, [*itertools.product(devices, range(len(JOBS)))] * repeats))
print(len(ends), sum(ends))
"""


@pytest.mark.slow  # kernels are compiled
def test_threads_with_different_devices_get_the_same_bytes(any_device):
    """The reference and every OpenCL device at the same time."""
    devices = [str(one.index) for one in simdtex.devices() if one.usable and one.kind != "reference"]
    assert python(DEVICES, "1", *devices) == [str(5 * (1 + len(devices))), "0"]


FORK = """
import os, sys
import numpy as np
import simdtex

SAMPLE = np.arange(64).reshape(8, 8)

def result(device):
    try:
        return simdtex.synthesize(SAMPLE, (5, 6), order=1, rng=1, levels=1, device=device).tobytes()
    except simdtex.DeviceError as error:
        return "spawn" in str(error) and "OpenCL was in use before this process was forked" in str(error)

def child(work):
    pid = os.fork()
    if not pid:
        os._exit(work())
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])

device = sys.argv[1]
early = child(lambda: len(result(device)) == 5 * 6 * 8)  # before OpenCL is in use a child may use it
machine = simdtex.open_machine(device)
right = result(machine)
waiting = machine.put(np.zeros(10))
lost = [child(lambda: result(which) is True) for which in (machine, device, None)]
listed = child(lambda: [line.usable for line in simdtex.devices()] == [False] * (len(simdtex.devices()) - 1) + [True])
print(early, *lost, listed, child(lambda: result("reference") == right), result(machine) == right)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing is forked here")
def test_a_forked_process_raises_instead_of_hanging(cl_device):
    assert python(FORK, str(cl_device.index)) == [*"111111", "True"]


MULTIPROCESSING = """
import multiprocessing
import numpy as np
import simdtex

def work(device):
    try:
        return simdtex.synthesize(np.eye(8), (4, 4), order=1, rng=1, levels=1, device=device).shape
    except simdtex.DeviceError as error:
        return str(error).count(".") == 1 and "spawn" in str(error)

if __name__ == "__main__":
    work(None)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        print(*pool.map(work, [None, "reference"]), sep=";")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing is forked here")
def test_a_pool_of_forked_processes_may_use_the_reference(any_device):
    assert "".join(python(MULTIPROCESSING)) == "True;(4,4)"


class Other:
    """Neither a text nor a machine."""

    def __repr__(self):
        return "another object"


@pytest.mark.parametrize("wrong", [1.0, b"0", [], (), {}, True, Other()], ids=repr)
def test_another_type_of_device_is_a_type_error(wrong):
    sentence = r"^device must be a text, an index, a DeviceInfo, an open machine or None, but it is a \w+\.$"
    with pytest.raises(TypeError, match=sentence):
        simdtex.open_machine(wrong)
    with pytest.raises(TypeError, match=sentence):
        simdtex.synthesize(np.eye(8), (4, 4), order=1, device=wrong)


def test_the_compilers_warnings_are_not_printed(cl_device, capfd):
    machine = OpenCL(cl_device)
    source = f"__kernel void f(__global int *a) {{ int b; a[0] = b; 7; }} // {uuid.uuid4()}"
    runtimes.build(machine.context, source, [])
    assert capfd.readouterr() == ("", "")
