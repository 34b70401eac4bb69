"""The memory that is available, the checks before a run, and that a run takes no more than checked."""

import importlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from cases import ising

import simdtex
from simdtex.machine import memory
from simdtex.machine.reference import Reference

ROOT = Path(__file__).resolve().parent.parent
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
            if text is not None:
                path.write_text(text)

    return set_to


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        ((), 5000),
        (("max\n",), 5000),
        (("4000\n",), 3000),
        ((None, "4500\n"), 3500),
        ((None, "9223372036854771712\n"), 5000),
        (("900\n",), 0),
    ],
)
def test_the_available_memory_is_what_is_free_within_the_limit_of_the_control_group(limits, texts, expected):
    limits(5000, 1000, *texts)
    assert memory.available() == expected


def test_the_available_memory_of_this_computer():
    assert 2**20 < memory.available() <= psutil.virtual_memory().total


class Gpu(Reference):
    """A machine with its own memory."""

    kind = "gpu"


class Cpu(Reference):
    """A device that shares the host's memory."""

    kind = "cpu"


@pytest.mark.parametrize(
    ("machine", "wanted"), [(Reference(), 30 + memory.TEMPORARY), (Cpu(), 30 + memory.TEMPORARY), (Gpu(), 10)]
)
def test_arrays_of_a_cpu_count_for_the_host(machine, wanted, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: wanted)
    memory.require(machine, 20, 10)
    monkeypatch.setattr(memory, "available", lambda: wanted - 1)
    with pytest.raises(
        simdtex.DeviceError, match=r"of this computer's memory and \d+ MiB is available; give a smaller"
    ):
        memory.require(machine, 20, 10)


def test_the_limits_are_exact_and_named(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 3 * MEBIBYTE)
    memory.require_host(3 * MEBIBYTE)
    with pytest.raises(simdtex.DeviceError) as caught:
        memory.require_host(3 * MEBIBYTE + 1, "do less")
    assert str(caught.value) == "this needs about 3 MiB of this computer's memory and 3 MiB is available; do less"
    machine = Gpu()
    machine.memory = 2 * MEBIBYTE
    memory.require(machine, 2 * MEBIBYTE)
    with pytest.raises(simdtex.DeviceError) as caught:
        memory.require(machine, 2 * MEBIBYTE + 1)
    sentence = "this needs about 2 MiB and reference (NumPy) has 2; give a smaller size or another --device"
    assert str(caught.value) == sentence


JOBS = {
    "mrf": lambda: simdtex.synthesize(SAMPLE, (9000, 9000), device="reference", rng=1),
    "multires": lambda: simdtex.synthesize(SAMPLE, (9000, 9000), method="multires", device="reference", rng=1),
    "pyramid": lambda: simdtex.synthesize(SAMPLE, (9000, 9000), method="pyramid", device="reference", rng=1),
    "solid": lambda: simdtex.synthesize_solid(SAMPLE, (400, 400, 400), device="reference", rng=1),
    "mix": lambda: simdtex.mix([SAMPLE, SAMPLE], (9000, 9000), device="reference", rng=1),
    "extend": lambda: simdtex.extend(SAMPLE, right=9000, bottom=9000, order=1, device="reference", rng=1),
    "simulate": lambda: simdtex.simulate(SAMPLE, 10**6, shape=(99, 99), device="reference", rng=1),
    "classify": lambda: simdtex.classify(np.zeros((6000, 6000), np.uint8), {"a": SAMPLE}, device="reference", rng=1),
    "ising": lambda: ising(Reference(), (64, 64), [2.0], "coloring", sweeps=2**27),
}


ASKED = {
    "mrf": 9952,
    "multires": 5485,
    "pyramid": 15745,
    "solid": 14712,
    "mix": 15745,
    "extend": 7907,
    "simulate": 18755,
    "classify": 5023,
    "ising": 81986,
}
"""MiB that are asked for, by the bytes for each pixel that benchmarks/memory.py measures."""


@pytest.mark.parametrize("job", JOBS)
def test_a_run_that_does_not_fit_is_refused_before_it_begins(job, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 2**30)
    with pytest.raises(simdtex.DeviceError, match=rf"needs about {ASKED[job]} MiB .* and 1024 MiB is available"):
        JOBS[job]()


def test_tiles_are_offered_where_there_are_tiles(monkeypatch):
    hole = np.zeros(SAMPLE.shape, bool)
    hole[7, 7] = True
    monkeypatch.setattr(memory, "available", lambda: memory.TEMPORARY)
    for job, tiles in (
        (lambda: simdtex.synthesize(SAMPLE, (9, 9), order=1, device="reference", rng=1), True),
        (lambda: simdtex.fill(SAMPLE, hole, order=1, device="reference", rng=1), False),
        (lambda: simdtex.extend(SAMPLE, right=9, order=1, device="reference", rng=1), False),
        (lambda: simdtex.simulate(SAMPLE, 1, order=1, device="reference", rng=1), False),
    ):
        with pytest.raises(simdtex.DeviceError, match="is available; give a smaller size") as said:
            job()
        assert ("--tiles" in str(said.value)) == tiles


@pytest.mark.parametrize("shape, values", [((20000, 20000), 8), ((40000, 40000), 4)])
def test_a_limit_of_counting_says_what_is_counted(shape, values):
    method = "pyramid" if values == 8 else "multires"
    with pytest.raises(ValueError, match=f"columns is beyond 2..31 values, {values} for each pixel; give"):
        simdtex.synthesize(SAMPLE, shape, method=method, device="reference", rng=1)


def benchmark():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "benchmarks")
        return importlib.import_module("memory")


@pytest.mark.slow
@pytest.mark.parametrize("channels, dtype", [(1, "uint8"), (3, "float64")])
@pytest.mark.parametrize("name", benchmark().CASES)
def test_no_run_takes_more_than_was_asked_for(name, channels, dtype, any_device):
    kind, options = benchmark().CASES[name]
    small, side = (24, 80) if kind == "solid" else (128, 1024)
    grown, asked = benchmark().measured(kind, small, side, channels, dtype, str(any_device.index), options)
    assert 0.3 * (asked - memory.TEMPORARY) < grown <= asked, "and not far less, but for what is asked for at any size"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["multires", "pyramid"])
def test_no_run_of_the_reference_takes_more_than_was_asked_for(name):
    kind, options = benchmark().CASES[name]
    grown, asked = benchmark().measured(kind, 64, 256, 3, "uint8", "reference", options)
    assert 0 < grown <= asked
