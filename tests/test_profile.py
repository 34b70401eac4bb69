"""Profiles: the times of kernels, and their table."""

from types import SimpleNamespace

import pytest
from cases import opencl, texture
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.io.image import write
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import PENDING, Log, Reference
from simdtex.report.tables import profile_summary, profile_table, seconds_text


class Event:
    """A kernel that ran from one nanosecond to another."""

    def __init__(self, start, end):
        self.profile = SimpleNamespace(start=start, end=end)
        self.waited = False

    def wait(self):
        self.waited = True


def kernel(name):
    return SimpleNamespace(function_name=name)


def test_a_log_reports_kernels_and_shares():
    log = Log(True)
    log.add(Event(100, 200), kernel("fast"))
    log.add(Event(250, 550), kernel("slow"))
    log.add(Event(550, 650), kernel("fast"))
    log.settle()
    slow, fast = log.take()["kernels"]
    assert slow == {"name": "slow", "calls": 1, "seconds": pytest.approx(300e-9), "share": 0.6}
    assert fast == {"name": "fast", "calls": 2, "seconds": pytest.approx(200e-9), "share": 0.4}
    assert log.take() == {"kernels": []}, "begun anew"
    assert log.seconds == pytest.approx(500e-9)


def test_without_profiling_nothing_is_kept():
    log = Log(False)
    log.add(Event(0, 1), kernel("a"))
    assert (log.launches, log.seconds, log.take(), log._pending) == (1, None, None, [])


def test_events_do_not_pile_up():
    log = Log(True)
    events = [Event(2 * i, 2 * i + 1) for i in range(3 * PENDING)]
    for event in events:
        log.add(event, kernel("a"))
        assert len(log._pending) < PENDING
    assert any(event.waited for event in events)
    log.settle()
    assert log.take()["kernels"][0]["calls"] == len(events)


def test_the_kernels_of_a_run_take_its_seconds_on_the_device(any_device):
    machine = OpenCL(any_device, profile=True)
    run = simdtex.synthesize(texture((12, 12)), (10, 10), rng=1, order=2, device=machine, full_output=True)[1]
    total = sum(entry["seconds"] for entry in run.statistics["kernels"])
    assert total == pytest.approx(run.statistics["device_seconds"])


def test_statistics_have_kernels_only_where_they_are_measured(any_device):
    sample = texture((16, 16))
    for machine in (opencl(any_device), Reference()):
        run = simdtex.synthesize(sample, (8, 8), order=1, rng=1, device=machine, full_output=True)[1]
        assert "kernels" not in run.statistics
        assert machine.profile() is None


def test_the_table_and_the_sentence():
    entry = {"name": "a", "calls": 1000, "seconds": 0.5, "share": 0.25}
    table = profile_table({"device": "d", "kernels": [entry]})
    assert list(table.rows[0].values()) == ["a", "1,000", "500 us", "500 ms", "25.0%"] and all(table.numeric[1:])
    text = profile_summary({"seconds": 2.0, "device_seconds": 1.0})
    assert text == "wall time 2 s: kernels 1 s (50.0%)"
    assert [seconds_text(s) for s in (1.234, 0.01234, 1.234e-6, 123.4)] == ["1.23 s", "12.3 ms", "1.23 us", "123 s"]


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
