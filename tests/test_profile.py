"""Profiles: the times, the work and the gaps of kernels, and their table."""

from types import SimpleNamespace

import pytest
from cases import opencl, texture
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.io.image import write
from simdtex.machine.interface import Work, touching
from simdtex.machine.log import PENDING, Log, Times
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.ops.noise import noise
from simdtex.report.tables import rate_text, seconds_text
from simdtex.report.terminal import profile_summary, profile_table


class Event:
    """A kernel that ran from one nanosecond to another."""

    def __init__(self, start, end):
        self.profile = SimpleNamespace(start=start, end=end)
        self.waited = False

    def wait(self):
        self.waited = True


def kernel(name):
    return SimpleNamespace(function_name=name)


def test_times_are_summed_up():
    times = Times()
    for value in (5, 1, 2):
        times.add(value)
    assert times.nanoseconds == 8
    assert times.report() == pytest.approx({"calls": 3, "min": 1e-9, "median": 2e-9, "max": 5e-9, "seconds": 8e-9})
    assert Times().report() == {"calls": 0, "min": 0, "median": 0, "max": 0, "seconds": 0}


def test_a_log_reports_kernels_shares_rates_and_gaps():
    log = Log(True)
    log.add(Event(100, 200), kernel("fast"), Work(1000, 50))
    log.add(Event(250, 550), kernel("slow"), Work(None, 600))
    log.add(Event(550, 650), kernel("fast"), Work(500, 50))
    log.settle()
    taken = log.take()
    slow, fast = taken["kernels"]
    assert (slow["name"], slow["calls"], slow["share"]) == ("slow", 1, 0.6)
    assert (slow["fma"], slow["fma_rate"], slow["bytes"]) == (None, None, 600)
    assert slow["byte_rate"] == pytest.approx(600 / 300e-9)
    assert (fast["calls"], fast["fma"], fast["share"]) == (2, 1500, 0.4)
    assert fast["fma_rate"] == pytest.approx(1500 / 200e-9)
    assert taken["gaps"]["calls"] == 2
    assert taken["gaps"]["seconds"] == pytest.approx(50e-9)
    assert log.seconds == pytest.approx(500e-9)
    assert log.take() == {"kernels": [], "gaps": Times().report()}  # begun anew
    assert log.seconds == pytest.approx(500e-9)


def test_a_kernel_with_unknown_work_has_no_rate():
    log = Log(True)
    log.add(Event(0, 10), kernel("a"), Work(1, 1))
    log.add(Event(10, 20), kernel("a"))
    log.settle()
    (only,) = log.take()["kernels"]
    assert only["fma"] is only["bytes"] is only["fma_rate"] is None


def test_events_do_not_pile_up():
    log = Log(True)
    events = [Event(2 * i, 2 * i + 1) for i in range(3 * PENDING)]
    for event in events:
        log.add(event, kernel("a"))
        assert len(log._pending) < PENDING
    assert any(event.waited for event in events)
    log.settle()
    assert log.take()["kernels"][0]["calls"] == len(events)


def test_without_profiling_nothing_is_kept():
    log = Log(False)
    log.add(Event(0, 1), kernel("a"))
    assert (log.launches, log.seconds, log.take(), log._pending) == (1, None, None, [])
    log = Log(True)
    with log.paused():
        log.add(Event(0, 1), kernel("a"))
        assert log.seconds is None
    assert log.take()["kernels"] == []


def test_a_launch_states_its_work(any_device):
    machine = OpenCL(any_device, profile=True)
    values = noise(machine, 4, 100, 1, 0)
    (only,) = machine.profile()["kernels"]
    assert (only["name"], only["calls"], only["bytes"], only["fma"]) == ("noise", 1, None, None)
    assert 0 < only["min"] == only["median"] == only["max"] == only["seconds"]
    assert touching(values, fma=3) == (3, 1600)


def test_a_run_states_the_work_of_its_kernels(any_device, monkeypatch):
    monkeypatch.setattr("simdtex.ops.relax.KEPT", 0)  # in several kernels, as of many candidates
    machine = OpenCL(any_device, profile=True)
    options = {"order": 2, "levels": 1, "xi": -100.0, "free_sweeps": 1, "relaxation": "gibbs"}
    run = simdtex.synthesize(texture((12, 12)), (10, 10), rng=1, device=machine, full_output=True, **options)[1]
    found = {entry["name"]: entry for entry in run.statistics["kernels"]}
    own = found["lcpdf_distance"]
    assert own["fma"] == run.statistics["levels"][0]["fma"] > len(neighbourhood_offsets(2)) * 100
    assert own["bytes"] > 0
    assert sum(entry["seconds"] for entry in found.values()) == pytest.approx(run.statistics["device_seconds"])


def test_statistics_have_kernels_only_where_they_are_measured(any_device):
    sample = texture((16, 16))
    for machine in (opencl(any_device), Reference()):
        run = simdtex.synthesize(sample, (8, 8), order=1, rng=1, device=machine, full_output=True)[1]
        assert "kernels" not in run.statistics
        assert machine.profile() is None


def test_numbers_are_written_with_three_digits():
    assert [seconds_text(s) for s in (1.234, 0.01234, 1.234e-6, 123.4)] == ["1.23 s", "12.3 ms", "1.23 us", "123 s"]
    assert [rate_text(r) for r in (1.5e12, 2.5e9, 99.96e6, 1500, 12, None)] == [
        *("1.50 T", "2.50 G", "100 M", "1.50 k", "12.0", "-")
    ]


def test_the_table_and_the_sentence():
    entry = {"name": "a", "calls": 1234, "min": 1e-6, "median": 2e-6, "max": 3e-3, "seconds": 0.5, "share": 0.25}
    table = profile_table({"device": "d", "kernels": [entry | {"fma_rate": 2e9, "byte_rate": None}]})
    cells = ["a", "1,234", "1.00 us", "2.00 us", "3.00 ms", "500 ms", "25.0%", "2.00 G", "-"]
    assert list(table.rows[0].values()) == cells and all(table.numeric[1:])
    gaps = {"calls": 7, "min": 0, "median": 1e-3, "max": 0.2, "seconds": 0.5}
    text = profile_summary({"seconds": 2.0, "device_seconds": 1.0, "gaps": gaps})
    assert text == (
        "wall time 2.00 s: kernels 1.00 s (50.0%); between them 500 ms (25.0%) in 7 gaps, median 1.00 ms, longest "
        "200 ms; before the first and after the last 500 ms"
    )
    assert profile_summary({"seconds": 2.0, "device_seconds": 1.0, "gaps": gaps | {"calls": 0}}).endswith("(50.0%)")


@pytest.mark.parametrize(
    ("command", "kernels"),
    [
        (("synth", "--order", "1"), "start"),
        (("synth", "--method", "multires"), "candidates"),
        (("solid", "--iterations", "1"), "solid_turn"),
        (("mix", "--iterations", "1"), "sort_scatter"),
    ],
)
def test_profile_prints_a_table(any_device, tmp_path, command, kernels):
    sample, out = tmp_path / "in.png", tmp_path / ("out.npy" if command[0] == "solid" else "out.png")
    write(sample, texture((16, 16)))
    device = ("--device", str(any_device.index), "-q")
    done = CliRunner().invoke(main, [*command, str(sample), "-o", str(out), "--size", "12", *device, "--profile"])
    assert done.exit_code == 0, done.output
    assert kernels in done.output
    assert "wall time" in done.output


def test_the_reference_has_no_profile(tmp_path):
    sample = tmp_path / "in.png"
    write(sample, texture((16, 16)))
    words = ["synth", str(sample), "-o", str(tmp_path / "out.png"), "--device", "reference", "--profile"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 2
    assert done.output.count("\n") == 1
    assert "--profile times the kernels of an OpenCL device" in done.output
    assert not (tmp_path / "out.png").exists()
