"""How long a run is expected to last: ``--dry-run``, a sentence, and lines of progress; and random seeds."""

import os
import re

import numpy as np
import pytest
from click.testing import CliRunner

from simdtex.cli import job, main
from simdtex.io import image
from simdtex.machine import memory

WELLS = "x,y,value\n3,4,7\n"
JOBS = {
    "synth": (["a.png", "--size", "2x", "--order", 2], "48x40 from 24x20, 2 levels"),
    "pyramid": (["a.png", "--size", "64", "--method", "pyramid"], "64x64 from 24x20"),
    "tile": (["a.png", "--order", 2], "24x20 from 24x20, 2 levels"),
    "extend": (["a.png", "--size", "150%", "--order", 2], "36x30 from 24x20, 2 levels"),
    "fill": (["a.png", "--mask", "hole.png", "--order", 2], "16 of 480 pixels filled, 2 levels"),
    "mix": (["a.png", "b.png", "--size", "40x30"], "40x30 from 2 samples"),
    "solid": (["a.png", "--size", "16"], "16x16x16 from 24x20"),
    "simulate": (["a.png", "--known", "w.csv", "-n", 2, "--order", 2], "2 realisations of 24x20, 2 levels"),
    "estimate": (["a.png", "--known", "w.csv"], "maps of 24x20"),
    "classify": (["a.png", "--texture", "a=a.png", "--texture", "b=b.png", "--order", 2], "24x20, 2 classes"),
}
OUTPUTS = {"solid": "out.npz", "simulate": "out.npz", "estimate": "out.npz"}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    image.write("a.png", rng.integers(0, 256, (20, 24), dtype=np.uint8))
    image.write("b.png", rng.integers(0, 256, (20, 24), dtype=np.uint8))
    hole = np.zeros((20, 24), np.uint8)
    hole[8:12, 8:12] = 255
    image.write("hole.png", hole)
    (tmp_path / "w.csv").write_text(WELLS)
    return tmp_path


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in (*words, "--device", "reference")])


@pytest.mark.parametrize("name", JOBS)
def test_a_dry_run_tells_size_memory_and_time_and_writes_nothing(name):
    before = sorted(os.listdir())
    words, summary = JOBS[name]
    command = "synth" if name == "pyramid" else name
    done = run(command, *words, "-o", OUTPUTS.get(name, "out.png"), "--dry-run")
    assert done.exit_code == 0, done.output
    out, more = OUTPUTS.get(name, "out.png"), r", \d+ MiB of memory, about \d+\.\d s on reference \(NumPy\)"
    assert re.fullmatch(rf"{out}: {summary}{more}; nothing was written\n", done.output), done.output
    assert sorted(os.listdir()) == before


def test_a_dry_run_needs_the_memory_of_the_run(monkeypatch):
    monkeypatch.setattr(memory, "required", {})
    words = ["synth", "a.png", "-o", "out.png", "--size", 64, "--order", 2]
    told = int(re.search(r"(\d+) MiB", run(*words, "--dry-run").output)[1])
    monkeypatch.setattr(memory, "available", lambda: (told - 1) * 2**20)
    assert f"needs about {told} MiB" in run(*words).output


@pytest.fixture
def clock(monkeypatch):
    """The clock of forecasts: its only element is the time."""
    at = [0.0]
    monkeypatch.setattr(job.time, "perf_counter", lambda: at[0])
    return at


def test_the_rest_of_a_run_takes_as_long_as_its_beginning(clock):
    forecast, found = job.Forecast(), {}
    for clock[0], share in [(2, 0.1), (2.05, 0.11), (9.05, 0.11), (9.25, 0.2)]:
        found[clock[0]] = forecast.seconds(share)
    assert list(found.values())[:3] == [None, None, None]
    assert found[9.25] == pytest.approx(9.25 + 0.25 / 0.1 * 0.8), "in the seven seconds a kernel was compiled"


def test_of_rare_callbacks_all_time_counts(clock):
    forecast, found = job.Forecast(), []
    for clock[0], share in [(2, 0.0), (7, 0.25), (11, 0.4), (12, 0.5)]:
        found.append(forecast.seconds(share))
    assert found == [None, None, None, pytest.approx(12 + 10 / 0.5 * 0.5)]


@pytest.mark.parametrize("whole", [50.0, 90.0])
def test_a_long_run_is_said_once_and_lines_follow_every_ten_seconds(clock, capsys, whole):
    with job.progress_bar(quiet=False) as show:
        for clock[0] in np.arange(0, 25, 0.25):
            show(clock[0] / whole, "level 2")
    said = ["simdtex: this is expected to last about 90.0 s"] * (whole > 60)
    lines = [f"{now / whole:.0%}, level 2; about {whole - now:.1f} s left" for now in (10, 20)]
    assert capsys.readouterr().err.splitlines() == said + lines


def test_a_random_seed_is_short_and_printed():
    said = [run("synth", "a.png", "-o", "out.png", "--size", 9, "--order", 2).output for _ in range(2)]
    seeds = [int(re.search(r"seed (\d+)\n", one)[1]) for one in said]
    assert max(seeds) < 10**6 and seeds[0] != seeds[1]
    made = image.read("out.png").pixels
    assert run("synth", "a.png", "-o", "out.png", "--size", 9, "--order", 2, "--seed", seeds[1]).exit_code == 0
    assert np.array_equal(image.read("out.png").pixels, made)
