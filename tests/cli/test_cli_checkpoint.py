"""``--checkpoint`` and ``simdtex resume``: the files of a run that was never stopped."""

import os
import shlex
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from cases import slow_but, texture
from commands import refused, run

from simdtex import checkpoint as checkpoints
from simdtex.checkpoint import Checkpoint, read, write_state
from simdtex.io import image

SYNTH = ("synth", "sample.png", "-o", "out.png", "--size", "14x13", "--seed", "5")
MRF = (*SYNTH, "--order", "2", "--xi", "-2", "--no-labels", "--array", "4x4", "--source-map", "where.npz")
RUNS = {
    "synth-mrf": (*MRF, "--stages", "stages", "--also", "height.png=more.png"),
    "synth-multires": (*SYNTH, "--method", "multires", "--stages", "stages"),
    "synth-pyramid": (*SYNTH, "--method", "pyramid", "--stages", "stages"),
    "fill": tuple(shlex.split("fill holed.png --mask mask.png -o out.png --order 1 --levels 1 --seed 5")),
    "extend": ("extend", "sample.png", "-o", "out.png", "--right", "3", "--order", "2", "--seed", "5"),
    "tileset": ("tileset", "sample.png", "-o", "out", "--size", "16", "--order", "1", "--seed", "5"),
    "mix": ("mix", "sample.png", "holed.png", "-o", "out.png", "--size", "16x16", "--seed", "5"),
    "solid": ("solid", "sample.png", "-o", "out.npz", "--size", "8", "--iterations", "2", "--seed", "5"),
    "classify": shlex.split(
        "classify sample.png --texture a=sample.png --texture b=holed.png -o out.png --exemplars 20 --seed 5"
    ),
    "simulate": shlex.split("simulate sample.png -o out.npz -n 2 --size 9x8 --order 2 --jobs 1 --seed 5"),
}


@pytest.fixture(autouse=True)
def often(monkeypatch):
    monkeypatch.setattr(checkpoints, "FIRST", 0.0)
    monkeypatch.setattr(checkpoints, "SHARE", 0)


@pytest.fixture
def place(tmp_path, monkeypatch):
    folder = tmp_path / "begun"
    folder.mkdir()
    image.write(folder / "sample.png", texture((14, 15)))
    image.write(folder / "height.png", texture((14, 15), dtype=np.uint16, seed=3))
    image.write(folder / "holed.png", texture((14, 15), seed=2))
    mask = np.zeros((14, 15), np.uint8)
    mask[2:4, 3:6] = mask[10:12, 9:12] = 255
    image.write(folder / "mask.png", mask)
    monkeypatch.chdir(folder)
    return folder


def given(*words, device="reference"):
    return run(*words, "--device", device)


def made(folder):
    """What a command has written: files as they are, arrays as they are, since an npz tells the time."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                found[path.name] = {name: arrays[name].tobytes() for name in arrays.files}
        elif path.is_file() and "kept" not in path.parts:
            found[str(path.relative_to(folder))] = path.read_bytes()
    return found


def stopping(monkeypatch, after, kind=signal.SIGTERM):
    """Send the process a signal after so many writes, which stops it at the next state."""
    count, write = [0], Checkpoint._save

    def counted(self, tree):
        wrote = write(self, tree)
        count[0] += 1
        if count[0] % after == 0:
            os.kill(os.getpid(), kind)
            for _ in range(1000):  # a handler runs in the main thread, whose turn may come late
                if self.stopping:
                    break
                time.sleep(0.001)
        return wrote

    monkeypatch.setattr(Checkpoint, "_save", counted)


def clear(folder, inputs):
    for path in folder.rglob("*"):
        if path.is_file() and path.name not in inputs:
            path.unlink()


@pytest.mark.parametrize("name", slow_but(("synth-mrf", "fill", "simulate"), RUNS))
def test_resume_writes_the_files_of_a_run_that_was_never_stopped(name, place, tmp_path, monkeypatch):
    inputs = set(made(place))
    result = given(*RUNS[name])
    assert result.exit_code == 0, result.output
    expected = made(place)
    assert len(expected) > len(inputs)
    clear(place, inputs)

    with monkeypatch.context() as patch:
        stopping(patch, 2)
        result = given(*RUNS[name], "--checkpoint", "kept")
        assert result.exit_code == 128 + signal.SIGTERM, result.output
        assert "stopped; continue with: simdtex resume kept" in result.output
        assert not {"out.png", "out.npz"} & set(os.listdir(place))
        monkeypatch.chdir(tmp_path)  # paths mean what they meant where the command was given
        for _ in range(40):
            result = run("resume", "begun/kept")
            assert result.exit_code in (0, 128 + signal.SIGTERM), result.output
            if result.exit_code == 0:
                break
    assert result.exit_code == 0
    assert made(place) == expected
    assert Path.cwd() == tmp_path

    again = run("resume", "begun/kept")
    assert again.exit_code == 2
    assert "begun/kept does not exist: check the path (a finished run has no checkpoint)" in again.output
    assert made(place) == expected


def stopped(place, monkeypatch, *more, after=3):
    with monkeypatch.context() as patch:
        stopping(patch, after)
        assert given(*MRF, "--checkpoint", "kept", *more).exit_code == 128 + signal.SIGTERM


def test_the_same_command_goes_on_too(place, monkeypatch):
    given(*MRF)
    expected = image.read("out.png").pixels
    Path("out.png").unlink()
    stopped(place, monkeypatch, "-q")
    kept = read(place / "kept")[0]["command"]
    assert (kept["name"], kept["folder"]) == ("synth", str(place))
    assert ["synth", *kept["words"]] == [*MRF, "--checkpoint", "kept", "-q", "--device", "reference"]
    assert given(*MRF, "--checkpoint", "kept").exit_code == 0
    assert np.array_equal(image.read("out.png").pixels, expected)


def test_a_file_whose_name_looks_like_an_option(place, monkeypatch):
    os.rename("sample.png", "--size.png")
    words = ("synth", "-o", "out.png", "--seed", "5", "--order", "2", "--device", "reference", "--checkpoint", "kept")
    with monkeypatch.context() as patch:
        stopping(patch, 3)
        assert run(*words, "--", "--size.png").exit_code == 128 + signal.SIGTERM
    assert run("resume", "kept").exit_code == 0
    assert Path("out.png").is_file()


def test_what_is_no_checkpoint(place):
    refused("nothing does not exist: check the path (a finished run has no checkpoint)", "resume", "nothing")
    (place / "other").mkdir()
    refused("other is a folder; give the file of --checkpoint, or the store of --tiles", "resume", "other")
    refused("--workers requires the .zarr store of --tiles; leave it out", "resume", "sample.png", "--workers", 2)
    refused("sample.png is no checkpoint, or is damaged; give another file", "resume", "sample.png")
    refused("sample.png is an input and would be overwritten", *SYNTH, "--checkpoint", "sample.png")
    refused("out.png would be written twice", *SYNTH, "--checkpoint", "out.png")


def test_what_was_begun_elsewhere(place, monkeypatch):
    stopped(place, monkeypatch, after=1)
    about, tree = read(place / "kept")
    for command, words in (
        ({"folder": "/nowhere"}, "/nowhere, the folder of the run in kept, does not exist; restore it"),
        ({"name": "bench"}, "is of a command that cannot be resumed; run that"),
        (None, "was started in Python; make the same call with checkpoint='kept'"),
    ):
        write_state(place / "kept", about | {"command": command and about["command"] | command}, tree)
        refused(words, "resume", "kept")


def test_an_output_that_cannot_be_written_leaves_the_checkpoint(place, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(28, "No space left on device", "out.png")

    with monkeypatch.context() as patch:
        patch.setattr(image, "write", full)
        assert given(*MRF, "--checkpoint", "kept").exit_code == 2
    assert read(place / "kept")[1] is not None
    assert run("resume", "kept").exit_code == 0
    assert Path("out.png").is_file() and not Path("kept").exists()


def test_another_device_is_told_on_stderr(place, monkeypatch, any_device):
    stopped(place, monkeypatch)
    result = run("resume", "kept", "--device", any_device.index, "-q")
    assert result.exit_code == 0, result.output
    assert "was begun on reference (NumPy) and goes on on " in result.stderr
    assert len(result.output.splitlines()) == 1


def test_ctrl_c_stops_at_the_next_state_and_a_second_one_at_once(place, monkeypatch):
    before, stops = signal.getsignal(signal.SIGINT), []

    def impatient(self):
        stops.append(self)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.001)

    for stop in (Checkpoint.stop, impatient):
        with monkeypatch.context() as patch:
            stopping(patch, 1, signal.SIGINT)
            patch.setattr(Checkpoint, "stop", stop)
            assert given(*MRF, "--checkpoint", "kept").exit_code == 130
        assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == (signal.SIG_DFL, before)
    assert len(stops) == 1
