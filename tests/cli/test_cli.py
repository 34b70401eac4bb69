"""The command line as its user meets it: what it writes and says, how long it expects to take, and its streams."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import names, pixels, refused, run

from simdtex.cli import job
from simdtex.commands import COMMANDS
from simdtex.io import image
from simdtex.machine import memory
from simdtex.model.source_map import load_source_map
from simdtex.run import Progress

# -- The command line, end to end, as its user meets it.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a small sample, a colour map of the same material, and nothing else."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    image.write(tmp_path / "sample.png", rng.integers(0, 256, (24, 20), dtype=np.uint8))
    image.write(tmp_path / "normal.png", rng.integers(0, 65536, (24, 20, 3), dtype=np.uint16))
    return tmp_path


def synth(*args):
    return run("synth", "sample.png", "-o", "out.png", "--order", 2, "--seed", 5, "--device", "reference", *args)


def test_everything_at_once(folder):
    args = ["--size", "15x13", "--stages", "st", "--source-map", "s.npz", "--finish", "0"]
    result = synth(*args, "--also", "normal.png=normal-out.png")
    assert result.exit_code == 0, result.output
    source = load_source_map("s.npz")
    sample, made, normal, carried = map(pixels, ("sample.png", "out.png", "normal.png", "normal-out.png"))
    assert np.array_equal(made, sample[source[..., 0], source[..., 1]])
    assert np.array_equal(carried, normal[source[..., 0], source[..., 1]]) and carried.dtype == np.uint16
    assert {"level0-sweep01.png", "temperature-level0-sweep01.png"} <= set(names("st"))


BAD = {
    "size": ["--size", "large"],
    "smaller size": ["--size", "60000x60000"],
    "choose one of: mrf": ["--method", "mfr"],
    "choose one of: coloring": ["--schedule", "luby?"],
    "rows x columns such as 128x128": ["--array", "128"],
    "no such device": ["--device", "no such device"],
    "nothing.png": ["--also", "nothing.png=there.png"],
    ".npz": ["--source-map", "map.jpg"],
}


def test_bad_options_get_one_sentence_and_write_nothing(folder):
    for words, args in BAD.items():
        refused(words, "synth", "sample.png", "-o", "out.png", "--device", "reference", *args)


STOPPED = {
    "nothing was written": ("jobs.studies.benchmark.run", ["bench", "-q", "--json", "old.json"], []),
    "written so far: o.png": ("jobs.filling.job.extend", ["extend", "a.png", "-o", "o.png", "--right", "3"], ["o.png"]),
    "written so far: old.png, st": (
        "jobs.synthesis.job.synthesize",
        ["synth", "a.png", "-o", "old.png", "--stages", "st"],
        ["old.png", "st/level0.png"],
    ),
}


@pytest.mark.parametrize("said", STOPPED)
def test_a_stopped_command_says_what_was_written(tmp_path, monkeypatch, said):
    monkeypatch.chdir(tmp_path)
    image.write("a.png", np.indices((9, 9)).sum(0).astype(np.uint8))
    for name in ("old.json", "old.png"):
        (tmp_path / name).touch()
    function, args, writes = STOPPED[said]

    def stopped(*_, **__):
        for name in writes:
            (tmp_path / name).parent.mkdir(exist_ok=True)
            image.write(name, np.ones((2, 2), np.uint8))
        raise KeyboardInterrupt

    monkeypatch.setattr(f"simdtex.{function}", stopped)
    result = run(*args)
    assert (result.exit_code, result.stderr) == (130, f"simdtex: stopped; {said}\n")


@pytest.mark.slow
def test_the_demo(tmp_path):
    result = run("demo", "-o", tmp_path / "demo", "--size", "16x12")
    assert result.exit_code == 0, result.output
    assert names(tmp_path / "demo") == ["brick.png", "grass.png", "gravel.png", "sheet.png"]
    assert image.read(tmp_path / "demo" / "brick.png").pixels.shape == (12, 16)
    assert run("demo", "-o", tmp_path / "demo", "--size", "9x8").exit_code == 0, "its own files are replaced"
    assert image.read(tmp_path / "demo" / "brick.png").pixels.shape == (8, 9)


def test_the_demo_replaces_no_file_of_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, write in (("brick.png", Path.touch), ("sheet.png", Path.mkdir)):
        (tmp_path / name[:-4]).mkdir()
        write(tmp_path / name[:-4] / name)
        words = f"holds other files ({name}): give an empty or a new one"
        refused(words, "demo", "-o", name[:-4], "--size", "16x12", "--device", "reference")


# -- How long a run is expected to last: ``--dry-run``, a sentence, and lines of progress; and random seeds.

WELLS = "x,y,value\n3,4,7\n"
JOBS = {
    "synth": ("a.png --size 2x --order 2", "48x40 from 24x20, 2 levels"),
    "tile": ("a.png --order 2", "24x20 from 24x20, 2 levels"),
    "extend": ("a.png --size 150% --order 2", "36x30 from 24x20, 2 levels"),
    "fill": ("a.png --mask hole.png --order 2", "16 of 480 pixels filled, 2 levels"),
    "mix": ("a.png b.png --size 16", "16x16 from 2 samples"),
    "solid": ("a.png --size 8", "8x8x8 from 24x20"),
    "simulate": ("a.png --known w.csv -n 2 --order 2", "2 realisations of 24x20, 2 levels"),
    "estimate": ("a.png --known w.csv", "maps of 24x20"),
    "schedules": (
        "a.png --schedule coloring,raster --seeds 2 --size 16 --order 2",
        "2 schedules, 2 seeds, 2 levels",
    ),
    "classify": ("a.png --texture a=a.png --texture b=b.png --order 2", "24x20, 2 classes"),
}
OUTPUTS = {"schedules": "out", "solid": "out.npz", "simulate": "out.npz", "estimate": "out.npz"}


@pytest.fixture
def inputs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    image.write("a.png", rng.integers(0, 256, (20, 24), dtype=np.uint8))
    image.write("b.png", rng.integers(0, 256, (20, 24), dtype=np.uint8))
    hole = np.zeros((20, 24), np.uint8)
    hole[8:12, 8:12] = 255
    image.write("hole.png", hole)
    (tmp_path / "w.csv").write_text(WELLS)
    return tmp_path


@pytest.mark.parametrize("name", JOBS)
def test_a_dry_run_tells_size_memory_and_time_and_writes_nothing(inputs, name, monkeypatch):
    monkeypatch.setattr(job, "OBSERVED", 0.05)
    before = sorted(os.listdir())
    words, summary = JOBS[name]
    done = run(name, *words.split(), "-o", OUTPUTS.get(name, "out.png"), "--dry-run", "--device", "reference")
    assert done.exit_code == 0, done.output
    out, more = OUTPUTS.get(name, "out.png"), r", \d+ MiB of memory, about \d+\.\d (s|min) on reference \(NumPy\)"
    assert re.fullmatch(rf"{out}: {summary}{more}; nothing was written\n", done.stdout), done.output
    assert sorted(os.listdir()) == before


def test_a_dry_run_needs_the_memory_of_the_run(inputs, monkeypatch):
    monkeypatch.setattr(memory, "required", {})
    words = ["synth", "a.png", "-o", "out.png", "--size", 64, "--order", 2]
    told = int(re.search(r"(\d+) MiB", run(*words, "--dry-run", "--device", "reference").output)[1])
    monkeypatch.setattr(memory, "available", lambda: (told - 1) * 2**20)
    assert f"needs about {told} MiB" in run(*words, "--device", "reference").output


@pytest.fixture
def clock(monkeypatch):
    """The clock of forecasts: its only element is the time."""
    at = [0.0]
    monkeypatch.setattr(job.time, "perf_counter", lambda: at[0])
    return at


def test_the_rest_of_a_run_takes_as_long_as_its_beginning(clock):
    forecast, found = job.Forecast(), []
    for clock[0], share in [(2, 0.1), (2.5, 0.11), (9.5, 0.11), (10, 0.2)]:
        found.append(forecast.seconds(share))
    assert found == [None, None, None, pytest.approx(10 + 1 / 0.1 * 0.8)], "in the seven seconds a kernel was compiled"
    clock[0], found = 0, []
    forecast = job.Forecast()
    for clock[0], share in [(2, 0.0), (7, 0.25), (11, 0.4), (12, 0.5)]:
        found.append(forecast.seconds(share))
    assert found == [None, None, None, pytest.approx(12 + 10 / 0.5 * 0.5)], "of rare callbacks all time counts"


@pytest.mark.parametrize(("whole", "at"), [(50.0, range(2, 25, 2)), (400.0, (2.25, 6, 10.25, 14, 18.25, 22))])
def test_a_long_run_is_said_once_and_lines_follow_for_each_per_cent(clock, capsys, whole, at):
    with job.progress_bar(quiet=False) as show:
        for clock[0] in np.arange(0, 25, 0.25):
            show(Progress(fraction=clock[0] / whole, doing="level 2", image=print))
    said = [f"simdtex: this is expected to last about {whole / 60:.1f} min"] * (whole > 60)
    lines = [f"{now / whole:.0%}, level 2; after {now:.0f} s about" for now in at]
    found = capsys.readouterr().err.splitlines()
    assert found[: len(said)] == said and [line.split(" about")[0] + " about" for line in found[len(said) :]] == lines


def test_a_random_seed_is_short_and_printed(inputs):
    said = [
        run("synth", "a.png", "-o", "out.png", "--size", 9, "--order", 1, "--device", "reference").output
        for _ in range(2)
    ]
    seeds = [int(re.search(r"seed (\d+)\n", one)[1]) for one in said]
    assert max(seeds) < 10**6 and seeds[0] != seeds[1]
    made = image.read("out.png").pixels
    words = ["--size", 9, "--order", 1, "--seed", seeds[1], "--device", "reference"]
    assert run("synth", "a.png", "-o", "out.png", *words).exit_code == 0
    assert np.array_equal(image.read("out.png").pixels, made)


# -- What a command does if its streams are closed or full, its folder is gone, or names are no text.

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="these are streams and names of POSIX")
SYNTH = ["synth", "sample.png", "-o", "out.png", "--size", "9x8", "--order", "2", "--device", "reference"]


def shell(folder, words, python=(), **environment):
    """Run a command by a shell, so that its streams can be redirected; buffered, as a terminal's user has it."""
    whole = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"} | environment
    line = b" ".join([os.fsencode(sys.executable), *map(os.fsencode, python), b"-m simdtex", *map(os.fsencode, words)])
    return subprocess.run(line, shell=True, cwd=folder, env=whole, capture_output=True, timeout=120, check=False)


@POSIX
def test_a_closed_stream_takes_nothing_away_and_a_reader_that_has_enough_ends_quietly(folder):
    done = shell(folder, [*SYNTH, "<&- >&- 2>&-"])
    assert done.returncode == 0 and image.read(folder / "out.png").pixels.shape == (8, 9)
    assert shell(folder, [*SYNTH, "| true"]).stderr == b""


@POSIX
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
def test_a_full_standard_output_is_one_sentence(folder):
    for words, unbuffered in ((["--help"], "1"), (SYNTH, "")):
        done = shell(folder, [*words, ">/dev/full"], PYTHONUNBUFFERED=unbuffered)
        said = b"simdtex: standard output could not be written (No space left on device): redirect it\n"
        assert (done.returncode, done.stderr) == (2, said)
    assert (folder / "out.png").exists()


@POSIX
def test_a_folder_that_is_gone_is_named(folder):
    command = ["synth", "sample.png", *SYNTH[2:]]
    line = " ".join(["mkdir gone && cd gone && rmdir ../gone &&", sys.executable, "-m", "simdtex", *command])
    done = subprocess.run(line, shell=True, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    said = "simdtex: the current folder no longer exists: change to another one\n"
    assert (done.returncode, done.stderr) == (2, said)


@POSIX
def test_helps_need_no_docstrings(folder):
    assert COMMANDS["synth"] in " ".join(shell(folder, ["synth", "--help"], ["-OO"]).stdout.decode().split())


@pytest.mark.slow
@POSIX
def test_names_that_are_no_text_are_written_and_reported(folder):
    """In a locale other than C, in which Python prints no such name."""
    os.rename(folder / "sample.png", os.fsencode(folder / "s") + b"\xff.png")
    words = [b"s\xff.png", b"-o", b"o\xff.png", *map(os.fsencode, SYNTH[4:]), b"--report", b"page\xff"]
    done = shell(folder, [b"synth", *words], PYTHONIOENCODING="utf-8:strict")
    assert done.returncode == 0 and done.stderr == b"", done.stderr
    assert done.stdout.startswith(b"o\\udcff.png: 9x8 from 20x24")
    assert os.path.exists(os.fsencode(folder) + b"/o\xff.png")
    page = os.fsencode(folder) + b"/page\xff/"
    with open(page + b"results.json", encoding="utf-8") as file:
        assert json.load(file)["command"].startswith(r"simdtex synth 's\xff.png' -o 'o\xff.png'")
    with open(page + b"index.html", encoding="utf-8") as file:
        assert r"s\xff.png" in file.read()


@POSIX
def test_links_in_a_circle_are_refused(folder):
    (folder / "loop.png").symlink_to("loop.png")
    for words in (["loop.png", "-o", "out.png"], ["sample.png", "-o", "loop.png"]):
        refused("loop.png cannot be", "synth", *words, *SYNTH[4:])


@POSIX
def test_unusual_names(folder):
    for name in ("-dash.png", "new\nline.png", "per%cent.png"):
        (folder / name).write_bytes((folder / "sample.png").read_bytes())
        done = run("synth", "-o", f"-out{name}", *SYNTH[4:], "--quiet", "--", name)
        assert (done.exit_code, done.output) == (0, "")
        assert image.read(folder / f"-out{name}").pixels.shape == (8, 9)
