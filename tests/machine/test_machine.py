"""Machines: memory and its checks, caches, threads, forked processes, the pace of launches, and profiles."""

import dataclasses
import functools
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import uuid
from contextlib import nullcontext
from copy import copy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pyopencl as cl
import pytest
from cases import ising, opencl, texture
from commands import refused, run
from hypothesis import given
from hypothesis import strategies as st

import simdtex
import simdtex.run
from simdtex.figures.tables import print_profile, seconds_text
from simdtex.io.image import write
from simdtex.machine import devices, memory
from simdtex.machine import opencl as opencl_machine
from simdtex.machine.devices import DeviceError
from simdtex.machine.interface import Operation
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import PENDING, Log, Reference
from simdtex.run import Progress, paced

# -- The memory that is available, the checks before a run, and that a run takes no more than checked.

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = np.random.default_rng(1).integers(0, 256, (16, 16), dtype=np.uint8)
MEBIBYTE = 2**20


@pytest.fixture
def limits(monkeypatch, tmp_path):
    """Set the free memory, the memory of this process and the texts of the limits of its control group, in files."""
    files = (tmp_path / "memory.max", tmp_path / "memory.limit_in_bytes")
    monkeypatch.setattr(memory, "LIMITS", files)

    def set_to(free, used, *texts):
        monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=free))
        process = SimpleNamespace(memory_info=lambda: SimpleNamespace(rss=used, vms=used))
        monkeypatch.setattr(psutil, "Process", lambda: process)
        for path, text in zip(files, texts, strict=False):
            path.write_text(text)

    return set_to


def test_the_available_memory_is_what_is_free_within_the_limit_of_the_control_group(limits):
    for texts, expected in (
        ((), 5000),
        (("max\n",), 5000),
        (("4000\n",), 3000),
        (("max\n", "4500\n"), 3500),
        (("max\n", "9223372036854771712\n"), 5000),
        (("900\n",), 0),
    ):
        limits(5000, 1000, *texts)
        assert memory.available() == expected


class Gpu(Reference):
    """A machine with its own memory."""

    kind = "gpu"


class Cpu(Reference):
    """A device that shares the host's memory."""

    kind = "cpu"


def test_the_limits_of_memory_are_exact_and_named(monkeypatch):
    host = 30 + memory.TEMPORARY
    for machine, wanted in ((Reference(), host), (Cpu(), host), (Gpu(), 10)):  # arrays of a CPU count for the host
        monkeypatch.setattr(memory, "available", lambda wanted=wanted: wanted)
        memory.require(machine, 20, 10)
        monkeypatch.setattr(memory, "available", lambda wanted=wanted: wanted - 1)
        with pytest.raises(DeviceError, match=r"of this computer's memory and \d+ MiB is available; give a smaller"):
            memory.require(machine, 20, 10)
    monkeypatch.setattr(memory, "available", lambda: 3 * MEBIBYTE)
    memory.require_host(3 * MEBIBYTE)
    with pytest.raises(DeviceError) as said:
        memory.require_host(3 * MEBIBYTE + 1, "do less")
    assert str(said.value) == "this needs about 3 MiB of this computer's memory and 3 MiB is available; do less"
    machine = Gpu()
    machine.memory = 2 * MEBIBYTE
    memory.require(machine, 2 * MEBIBYTE)
    with pytest.raises(DeviceError) as said:
        memory.require(machine, 2 * MEBIBYTE + 1)
    sentence = "this needs about 2 MiB and reference (NumPy) has 2; give a smaller size or another --device"
    assert str(said.value) == sentence


ON = {"device": "reference", "rng": 1}
JOBS = {
    9952: lambda: simdtex.synthesize(SAMPLE, (9000, 9000), **ON),
    5485: lambda: simdtex.synthesize(SAMPLE, (9000, 9000), method="multires", **ON),
    15745: lambda: simdtex.synthesize(SAMPLE, (9000, 9000), method="pyramid", **ON),
    14712: lambda: simdtex.synthesize_solid(SAMPLE, (400, 400, 400), **ON),
    7907: lambda: simdtex.extend(SAMPLE, right=9000, bottom=9000, order=1, **ON),
    18755: lambda: simdtex.simulate(SAMPLE, 10**6, shape=(99, 99), **ON),
    6133: lambda: simdtex.classify(np.zeros((6000, 6000), np.uint8), {"a": SAMPLE}, **ON),
    81986: lambda: ising(Reference(), (64, 64), [2.0], "coloring", sweeps=2**27),
}
"""Runs by the MiB that are asked for, from the bytes for each pixel that benchmarks/memory.py measures."""


def test_a_run_that_does_not_fit_is_refused_before_it_begins(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 2**30)
    for asked, job in JOBS.items():
        words = rf"needs about {asked} MiB .* and 1024 MiB is available; give a smaller size"
        with pytest.raises(DeviceError, match=words) as said:
            job()
        assert ("--tiles" in str(said.value)) == (asked == 9952), "they are offered where there are tiles"


def test_a_limit_of_counting_says_what_is_counted():
    for method, shape, values in (("pyramid", (20000, 20000), 8), ("multires", (40000, 40000), 4)):
        with pytest.raises(ValueError, match=f"columns is beyond 2..31 values, {values} for each pixel; give"):
            simdtex.synthesize(SAMPLE, shape, method=method, device="reference", rng=1)


@functools.cache
def benchmark():
    spec = importlib.util.spec_from_file_location("memory_benchmark", ROOT / "benchmarks" / "memory.py")
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("channels, dtype", [(1, "uint8"), (3, "float64")])
@pytest.mark.parametrize("name", benchmark().CASES)
def test_no_run_takes_more_than_was_asked_for(name, channels, dtype, any_device):
    kind, options = benchmark().CASES[name]
    small, side = (24, 80) if kind == "solid" else (128, 1024)
    grown, asked, _ = benchmark().run(kind, small, side, channels, dtype, str(any_device.index), options)
    assert 0.3 * (asked - memory.TEMPORARY) < grown <= asked, "and not far less, but for what is asked for at any size"


# -- Progress, and the pace of launches.


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is moved on."""
    now = [0.0]
    monkeypatch.setattr(simdtex.run.time, "perf_counter", lambda: now[0])
    return now


@given(count=st.integers(0, 500), least=st.integers(1, 60))
def test_ranges_make_up_the_whole(count, least):
    ranges = list(paced(count, least))
    assert [first for first, _ in ranges] == [0, *(end for _, end in ranges)][: len(ranges)]
    assert (ranges[-1][1] if ranges else 0) == count
    assert all(end - first >= least for first, end in ranges[:-1])


def test_ranges_grow_to_a_tenth_of_a_second_and_shrink_again(clock):
    sizes = []
    for first, end in paced(100_000, 10):
        sizes.append(end - first)
        clock[0] += (end - first) * (1e-4 if first < 10_000 else 1e-3)
    assert sizes[:6] == [10, 40, 160, 640, 1000, 1000], "at most four times the last"
    assert sizes[-2] == 100
    sizes = []
    for first, end in paced(60, 20):
        sizes.append(end - first)
        clock[0] += 10
    assert sizes == [20, 20, 20], "a first range that takes long is not undercut"


def test_progress_has_its_details_and_maps_as_attributes():
    here = Progress(fraction=0.25, doing="", image=print, details={"sweep": 7}, maps={"temperature": lambda: 1})
    assert (here.sweep, here.temperature(), copy(here)) == (7, 1, here)
    with pytest.raises(AttributeError, match=r"no 'tile'; choose from its details and maps: sweep, temperature$"):
        here.tile  # noqa: B018


# -- Profiles: the times of kernels, and their table.


class Event:
    """A kernel that ran from one nanosecond to another."""

    def __init__(self, start, end):
        self.profile = SimpleNamespace(start=start, end=end)
        self.waited = False

    def wait(self):
        self.waited = True


def test_a_log_reports_kernels_and_shares_and_does_not_pile_up():
    fast, slow = SimpleNamespace(function_name="fast"), SimpleNamespace(function_name="slow")
    log = Log(True)
    for begin, end, kernel in ((100, 200, fast), (250, 550, slow), (550, 650, fast)):
        log.add(Event(begin, end), kernel)
    log.settle()
    assert log.take()["kernels"] == [
        {"name": "slow", "calls": 1, "seconds": pytest.approx(300e-9), "share": 0.6},
        {"name": "fast", "calls": 2, "seconds": pytest.approx(200e-9), "share": 0.4},
    ]
    assert log.take() == {"kernels": []}, "begun anew"
    assert log.seconds == pytest.approx(500e-9)
    events = [Event(2 * i, 2 * i + 1) for i in range(3 * PENDING)]
    for event in events:
        log.add(event, fast)
        assert len(log._pending) < PENDING
    assert any(event.waited for event in events)
    log.settle()
    assert log.take()["kernels"][0]["calls"] == len(events)
    log = Log(False)
    log.add(Event(0, 1), fast)
    assert (log.launches, log.seconds, log.take(), log._pending) == (1, None, None, [])


def test_statistics_have_kernels_only_where_they_are_measured(any_device):
    for machine in (OpenCL(any_device, profile=True), opencl(any_device), Reference()):
        output = simdtex.synthesize(texture((12, 12)), (8, 8), order=1, rng=1, device=machine, full_output=True)[1]
        timed = machine.seconds is not None
        assert ("kernels" in output.statistics) == timed and (timed or machine.profile() is None)
        if timed:
            total = sum(entry["seconds"] for entry in output.statistics["kernels"])
            assert total == pytest.approx(output.statistics["device_seconds"])


def test_the_table_and_the_sentence(capsys):
    entry = {"name": "a", "calls": 1000, "seconds": 0.5, "share": 0.25}
    print_profile({"device": "d", "kernels": [entry], "seconds": 2.0, "device_seconds": 1.0})
    title, _, row, *_, text = capsys.readouterr().out.splitlines()
    assert title.strip() == "Kernels on d" and text == "wall time 2 s: kernels 1 s (50.0%)"
    assert row.split() == ["a", "1,000", "500", "us", "500", "ms", "25.0%"]
    assert [seconds_text(s) for s in (1.234, 0.01234, 1.234e-6, 123.4)] == ["1.23 s", "12.3 ms", "1.23 us", "123 s"]


def test_profile_prints_a_table_and_the_reference_has_none(any_device, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("in.png", texture((16, 16)))
    words = ["synth", "in.png", "-o", "out.png", "--size", "9", "--order", "1", "-q", "--profile", "--device"]
    refused("--profile times the kernels of an OpenCL device", *words, "reference")
    done = run(*words, any_device.index)
    assert done.exit_code == 0 and "start" in done.output and "wall time" in done.output, done.output


# -- Machines: memory, caches, threads, forked processes and arguments of `open_machine`.


@given(st.integers(1, 200_000), st.integers(1, 300), st.integers(1, 4))
def test_a_chunk_of_sites_fits_the_scratch_memory(candidates, neighbours, channels):
    machine = OpenCL.__new__(OpenCL)
    machine.scratch = 2**24
    for table in (0, 3072):
        sites = machine.chunk(candidates, neighbours, channels, table)
        per_site = table + 8 * neighbours * (1 + channels)
        fits = [n * per_site <= 2**24 and n * candidates * neighbours * channels <= 2e9 for n in (sites, sites + 1)]
        assert fits == [True, False] or (sites == 1 and fits == [False, False])


def test_what_does_not_fit_the_device_is_refused(any_device):
    machine = OpenCL(dataclasses.replace(any_device, memory=10_000))
    with pytest.raises(DeviceError, match=r"needs about \d+ MiB.*smaller size"):
        simdtex.synthesize(np.eye(16), (64, 64), order=1, device=machine)
    machine = OpenCL(dataclasses.replace(any_device, largest=0))  # as if it had told no limit
    greedy = Operation(lambda machine: machine.empty((2**46,), np.uint8))
    with pytest.raises(DeviceError, match="ran out of memory; give a smaller size"):
        greedy(machine)
    machine = OpenCL(dataclasses.replace(any_device, largest=2**20))
    for make in (lambda n: machine.empty((n,), np.uint8), lambda n: machine.put(np.zeros(n, np.uint8))):
        make(2**20)
        with pytest.raises(DeviceError, match=r"^one array needs 2 MiB and .* allows 1 MiB in each; give a smaller"):
            make(2**21)
    for how in ({"step": 3}, {"items": 3}, {"items": 16, "vector": 4}):
        with pytest.raises(ValueError, match=r"is \d+; give 1"):
            OpenCL(any_device, **how)


def test_after_a_launch_that_a_device_gives_up_there_is_another_context(any_device):
    machine = OpenCL(any_device)
    assert OpenCL(any_device).context == machine.context
    error = cl.RuntimeError(SimpleNamespace(code=lambda: cl.status_code.OUT_OF_RESOURCES))
    words = r"^\S.* gave up \(CL_OUT_OF_RESOURCES\), .* watchdog .*, and report it$"
    with pytest.raises(DeviceError, match=words), machine.running():
        raise error
    assert OpenCL(any_device).context != machine.context


def test_a_work_group_is_no_larger_than_a_kernel_allows(any_device):
    """Some GPUs allow a kernel with many registers only 64 work-items, and fail if it is launched with more."""
    machine, groups = OpenCL(any_device), []

    class Kernel:
        def get_work_group_info(self, what, device):
            return 8

        def __call__(self, queue, size, local, *args):
            groups.append((size, local))

    machine.log = SimpleNamespace(add=lambda event, kernel: None)
    machine.enqueue(Kernel(), (17, 3), local=(64, 1))
    machine.enqueue(Kernel(), (17, 3), local=(4, 1))
    assert groups == [((24, 3), (8, 1)), ((20, 3), (4, 1))]


CACHES = pytest.mark.skipif(sys.platform == "win32", reason="caches of Windows are in other folders")
OPEN = """
import sys
import numpy as np
import simdtex
print(simdtex.synthesize(np.eye(8), (4, 4), order=1, rng=1, levels=1, device=sys.argv[1]).shape)
"""


@pytest.mark.slow
@CACHES
def test_a_device_opens_if_no_cache_can_be_written(cl_device, tmp_path):
    file = tmp_path / "file"
    file.touch()
    for environment in ({"HOME": str(file), "XDG_CACHE_HOME": ""}, {"XDG_CACHE_HOME": "/proc/nowhere"}):
        assert python(OPEN, str(cl_device.index), TMPDIR=str(tmp_path), **environment) == ["(4,", "4)"]
        assert os.listdir(tmp_path) == ["file"], "the temporary cache is removed"


def test_a_short_write_means_that_the_disk_of_the_cache_is_full(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(devices, "_report", None)
    short = nullcontext(SimpleNamespace(write=lambda data: len(data) // 4))
    monkeypatch.setattr(devices.tempfile, "TemporaryFile", lambda **_: short)
    devices._prepare_caches()
    assert os.environ["XDG_CACHE_HOME"] != str(tmp_path)


@pytest.mark.parametrize("name", ["pocl", "pytools", "own"])
def test_each_cache_that_cannot_be_written_is_replaced(monkeypatch, tmp_path, name):
    """The folder refuses temporary files, also if root runs the test."""
    (tmp_path / name).mkdir(parents=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "own") if name == "own" else "")
    monkeypatch.setattr(devices, "_report", None)
    real, tried = devices.tempfile.TemporaryFile, []

    def made(dir, **how):
        tried.append(dir)
        return real(dir="/proc/nowhere" if dir == tmp_path / name else dir, **how)

    monkeypatch.setattr(devices.tempfile, "TemporaryFile", made)
    devices._prepare_caches()
    assert tmp_path / name in tried and os.environ["XDG_CACHE_HOME"] != str(tmp_path)
    assert "POCL_CACHE_DIR" not in os.environ


@CACHES
@pytest.mark.parametrize(("frame", "words"), [("built", "perhaps a cache is damaged"), ("sync", "run a.py again")])
def test_a_crash_is_laid_to_a_cache_only_if_a_compilation_was_under_way(monkeypatch, tmp_path, frame, words):
    report = tmp_path / "simdtex" / "crashes.txt"
    report.parent.mkdir()
    report.write_text(f'Fatal Python error\n  File "b.py", line 9 in {frame}\n  File "a.py", line 1 in <module>\n')
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for name, value in (("_report", None), ("_reported", 0), ("apart", False)):
        monkeypatch.setattr(devices, name, value)
    with pytest.warns(UserWarning, match=words):
        devices._prepare_caches()


@pytest.mark.slow
@CACHES
@pytest.mark.parametrize("damaged", ["info", "*.so", "*.bc", "binary", "*.sqlite"])
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
    shutil.copytree(opencl_machine.kernel_folder(), folder)
    monkeypatch.setattr(opencl_machine, "kernel_folder", lambda: folder)
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
    assert memory.available() < devices.address_space()


# Threads and forks, in processes of their own: a race may crash, and a forked process may hang
def python(code, *words, **environment):
    """Return the words that a process prints within 100 seconds."""
    result = subprocess.run(
        [sys.executable, "-c", code, *words], env=os.environ | environment, capture_output=True, text=True, timeout=200
    )
    assert result.returncode == 0, result.stderr[-2000:]
    return result.stdout.split()


def test_a_buffer_is_taken_again_when_no_array_has_it(cl_device, monkeypatch):
    machine = OpenCL(cl_device)
    one = machine.empty((3, 5), np.int32)
    view, buffer = one.reshape(15), one.data
    assert machine._pool.active_bytes >= one.nbytes
    del one
    assert machine.empty(15, np.int32).data is not buffer, "the view has it"
    del view
    assert machine.empty(14, np.int32).data is buffer
    assert machine._pool.active_bytes == 0

    new, sizes = machine._pool._new, []

    def full(size):
        sizes.append(size)
        if len(sizes) == 1:
            raise cl.MemoryError
        return new(size)

    monkeypatch.setattr(machine._pool, "_new", full)
    monkeypatch.setattr(machine._pool, "_largest", 4001)
    kept = machine.empty(1000, np.int32)  # the free ones go, and it is tried again
    assert sizes == [4001, 4001], "no more than the device allows"
    assert machine._pool.active_bytes >= kept.nbytes
    assert not any(machine._pool._free.values())


THREADS = """
import sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import simdtex

machine = simdtex.open_machine(sys.argv[1], profile=True)
sample = np.random.default_rng(0).integers(0, 256, (20, 18), dtype=np.uint8)
METHODS = [{"order": 2, "levels": 2}, {"method": "multires"}, {"method": "pyramid", "iterations": 1}]

def run(i):
    return simdtex.synthesize(sample, (16, 17), rng=i, device=machine, **METHODS[i % 3]).tobytes()

alone = [run(i) for i in range(6)]
sys.setswitchinterval(1e-5)  # threads are switched often
with ThreadPoolExecutor(6) as pool:
    together = list(pool.map(run, [*range(6)] * 2))
print([bytes == alone[i % 6] for i, bytes in enumerate(together)].count(False), len(set(alone)))
"""


def test_threads_that_share_a_machine_get_the_bytes_of_runs_alone(cl_device):
    assert python(THREADS, str(cl_device.index)) == ["0", "6"]


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


def test_another_type_of_device_is_a_type_error():
    sentence = r"^device must be a text, an index, a DeviceInfo, an open machine or None, but it is a \w+\.$"
    for wrong in (1.0, b"0", [], True, object()):
        with pytest.raises(TypeError, match=sentence):
            simdtex.open_machine(wrong)


def test_the_compilers_warnings_are_not_printed(cl_device, capfd):
    machine = OpenCL(cl_device)
    source = f"__kernel void f(__global int *a) {{ int b; a[0] = b; 7; }} // {uuid.uuid4()}"
    devices.build(machine.context, source, [])
    assert capfd.readouterr() == ("", "")
