"""``simdtex synth --tiles`` and ``simdtex resume`` of a store, end to end."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from cases import assert_same_bits, texture
from commands import run

import simdtex
from simdtex import TileStore
from simdtex.figures import sheet
from simdtex.io import image
from simdtex.jobs.synthesis import report as synthesis
from simdtex.jobs.tiles.store import CheckedArray, Sources
from simdtex.model.source_map import load_source_map

zarr = pytest.importorskip("zarr")

OPTIONS = ["--size", "21x18", "--seed", "3", "--order", "1", "--levels", "2", "--xi", "-8", "--device", "reference"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    image.write(tmp_path / "grey.png", texture((30, 33), seed=2))
    image.write(tmp_path / "colour.png", np.stack([texture((30, 33), seed=k) for k in (1, 2, 3)], -1))
    alpha = np.where(np.arange(21) < np.full((18, 1), 10), 255, 0)
    image.write(tmp_path / "known.png", np.dstack([texture((18, 21), seed=4), alpha]).astype("u1"))
    image.write(tmp_path / "from.png", (texture((30, 33), seed=2) > 128).astype(np.uint8))
    image.write(tmp_path / "to.png", (np.indices((18, 21)).sum(0) // 10 % 2).astype(np.uint8))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pixels(store):
    return zarr.open_group(store, mode="r")["image"][...]


def test_tiles_have_the_bytes_of_a_picture(folder):
    args = ("grey.png", "--known", "known.png", "--guide", "from.png=to.png")
    whole = run("synth", *args, "-o", "whole.png", *OPTIONS)
    tiles = run("synth", *args, "-o", "o.zarr", "--tiles", 12, *OPTIONS)
    assert (whole.exit_code, tiles.exit_code) == (0, 0), whole.output + tiles.output
    assert_same_bits(pixels("o.zarr"), image.read("whole.png").pixels)
    assert tiles.stderr.count("level 0: 21x18 sites in 4 tiles of 12x12, halo") == 1
    assert "o.zarr: 21x18 in" in tiles.stdout
    assert "seed 3; the array is called image" in tiles.stdout


def test_the_source_map_and_other_maps_are_arrays_of_the_store(folder):
    more = ("--source-map", "whole.npz", "--also", "colour.png=whole-colour.png")
    whole = run("synth", "grey.png", "-o", "whole.png", *more, *OPTIONS)
    more = ("--source-map", "o.zarr/source", "--also", "colour.png=o.zarr/colour")
    tiles = run("synth", "grey.png", "-o", "o.zarr", "--tiles", 12, "-q", *more, *OPTIONS)
    assert (whole.exit_code, tiles.exit_code) == (0, 0), whole.output + tiles.output
    store = zarr.open_group("o.zarr", mode="r")
    assert tiles.output == ""
    assert_same_bits(store["source"][...], load_source_map("whole.npz"))
    assert_same_bits(store["colour"][...], image.read("whole-colour.png").pixels)


@pytest.fixture
def small_sheets(monkeypatch):
    """Reports whose pictures are reduced and read in several parts; return the pixels of each part that is read."""
    read = []
    for module, name, value in ((sheet, "MOST_SIDE", 20), (sheet, "PART", 16), (synthesis, "CORNER", 12)):
        monkeypatch.setattr(module, name, value)
    for kind in (CheckedArray, Sources):
        get = kind.__getitem__

        def recorded(self, where, get=get):
            part = get(self, where)
            if isinstance(self, Sources) or self._name == "image":
                read.append(part.shape[0] * part.shape[1])
            return part

        monkeypatch.setattr(kind, "__getitem__", recorded)
    return read


@pytest.mark.slow
def test_the_report_is_that_of_a_whole_run(folder, small_sheets):
    sample, more, options = "colour.png", ["--source-map", "o.zarr/source"], [*OPTIONS, "--size", "61x50"]
    whole = run("synth", sample, "-o", "whole.png", "--report", "w", *options)
    tiles = run("synth", sample, "-o", "o.zarr", "--tiles", 16, "--report", "t", *more, *options)
    assert (whole.exit_code, tiles.exit_code) == (0, 0), whole.output + tiles.output
    names = ["arrangement.png", "index.html", "picture.png", "results.json", "use.png"]
    assert sorted(os.listdir("t")) == names
    for name in names:
        if name.endswith(".png"):
            assert (folder / "t" / name).read_bytes() == (folder / "w" / name).read_bytes(), name
    ours, theirs = (json.loads((folder / one / "results.json").read_text()) for one in ("t", "w"))
    for name in ("taken", "copied", "shape", "sample_shape"):
        assert ours[name] == theirs[name], name
    for name in ("use", "lattice", "options", "seed"):
        assert ours["statistics"][name] == theirs["statistics"][name], name
    assert "device" not in ours["statistics"]
    page = (folder / "t" / "index.html").read_text(encoding="utf-8")
    assert "in 16 tiles of at most 16 x 16" in page and "one pixel is the mean of 4 x 4" in page
    assert ours["command"].startswith(f"simdtex synth {sample} ") and "--tiles 16" in ours["command"]
    assert len(small_sheets) > 20 and max(small_sheets) <= (16 + 15) ** 2 < 50 * 61 / 3


def test_resume_writes_the_report(folder):
    """Of a run that is stopped, ends where it cannot write its report, and then finds a damaged picture."""

    def stop(progress):
        if progress.phase == "show":
            raise KeyboardInterrupt

    sample, options = (
        image.read("grey.png").pixels,
        {"order": 1, "levels": 2, "xi": -8.0, "device": "reference", "rng": 3},
    )
    store = TileStore("o.zarr", 12, command={"report": "page", "line": "as given"})
    with pytest.raises(KeyboardInterrupt):
        simdtex.synthesize(sample, (18, 21), store=store, callback=stop, **options)
    (folder / "page").mkdir()
    (folder / "page" / "mine.txt").write_text("mine")
    result = run("resume", "o.zarr", "--device", "reference")
    assert result.exit_code == 2
    assert "page holds other files (mine.txt): give an empty or a new one; then go on with: simdtex" in result.stderr
    assert os.listdir("page") == ["mine.txt"] and not store.finished
    (folder / "page" / "mine.txt").unlink()
    (folder / "o.zarr" / "image" / "c" / "0" / "1").write_bytes(b"")
    result = run("resume", "o.zarr", "--device", "reference")
    assert result.exit_code == 0, result.output
    whole = run("synth", "grey.png", "-o", "whole.png", "--report", "w", *OPTIONS)
    assert whole.exit_code == 0, whole.output
    assert_same_bits(pixels("o.zarr"), image.read("whole.png").pixels)
    assert (folder / "page" / "picture.png").read_bytes() == (folder / "w" / "picture.png").read_bytes()
    assert json.loads((folder / "page" / "results.json").read_text())["command"] == "as given"
    assert store.finished and not (folder / "o.zarr" / "work").exists()
    assert "o.zarr is finished already" in run("resume", "o.zarr").stdout


def test_a_dry_run_prints_the_plan_and_makes_nothing(folder):
    before = sorted(os.listdir())
    result = run("synth", "grey.png", "-o", "o.zarr", "--tiles", 16, "--dry-run", "--workers", 2, *OPTIONS)
    assert result.exit_code == 0, result.output
    *_, memory, duration = result.stdout.splitlines()
    assert memory.startswith("a worker needs at most ")
    assert re.fullmatch(r"one process needs about \d+\.\d (s|min|h|d); nothing was written", duration)
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ("--report o.zarr/page", "into o.zarr, the folder of another output"),
        ("--report page --known known.png", "--report requires one sample without unknown pixels, and no --known;"),
        ("--output o.png", "o.png is not a .zarr store, which --tiles requires; end its name in .zarr"),
        ("--workers x", "--workers x must be a number or an address"),
        ("--method pyramid", "the method pyramid needs the whole output at once"),
        ("--stages s", "--stages cannot be used with --tiles; leave out one of them"),
        ("--source-map s.npz", "of the store; give --source-map o.zarr/source"),
        ("--also grey.png=x.png", "x.png is not an array of the store; end --also in =o.zarr/x"),
        ("--output no/o.zarr", "does not exist; make it first"),
        ("--output there.zarr", "is there already; give another name, or continue with"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_made(folder, args, words):
    (folder / "there.zarr").mkdir()
    (folder / "there.zarr" / "mine").touch()
    before = sorted(os.listdir())
    result = run("synth", "grey.png", "-o", "o.zarr", "--tiles", 16, *OPTIONS, *args.split())
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.strip().splitlines()[-1].startswith("simdtex: ")
    assert sorted(os.listdir()) == before
    assert "--workers requires --tiles" in run("synth", "grey.png", "-o", "o.png", "--workers", 2).stderr


@pytest.mark.slow
@pytest.mark.parametrize("how", ["interrupt", "kill"])
def test_a_run_that_is_stopped_goes_on(folder, how):
    """The command and its workers get the signal, as from a terminal; or the command alone is killed."""
    options = [*OPTIONS, "--size", "41x34"]
    whole = run("synth", "colour.png", "-o", "whole.png", *options)
    assert whole.exit_code == 0
    command = [sys.executable, "-m", "simdtex", "synth", "colour.png", "-o", "o.zarr", "--tiles", "16", *options]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        began = time.monotonic()
        while not any((folder / "o.zarr").glob("*/level0/*/values/c")) and time.monotonic() - began < 120:
            time.sleep(0.01)  # until the finest level's first sweep writes
        os.killpg(process.pid, signal.SIGINT if how == "interrupt" else signal.SIGKILL)
        said = process.stderr.read()
    assert process.returncode == (130 if how == "interrupt" else -signal.SIGKILL), said
    if how == "interrupt":
        assert said.strip().splitlines()[-1] == "simdtex: stopped; continue with: simdtex resume o.zarr"
    result = run("resume", "o.zarr", "--device", "reference")
    assert result.exit_code == 0, result.output
    assert_same_bits(pixels("o.zarr"), image.read("whole.png").pixels)


STOPPED = """
import os, signal, sys
from pathlib import Path
from simdtex import TileStore
from simdtex.commands import main

async def begun_by_zarr():
    pass

def make(store, *_):
    Path(store.path).mkdir()
    waiting = begun_by_zarr()
    os.kill(os.getpid(), getattr(signal, sys.argv[1]))
    signal.pause()

TileStore.make = make
main(["synth", "colour.png", "-o", "o.zarr", "--tiles", "16", "--size", "40x40", "--order", "1", "-q"])
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_how_to_go_on_is_the_last_thing_said(folder, name, code):
    """Whatever Zarr had begun when the signal came."""
    done = subprocess.run([sys.executable, "-c", STOPPED, name], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (code, "simdtex: stopped; continue with: simdtex resume o.zarr\n")
