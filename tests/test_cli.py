# SPDX-License-Identifier: BSD-3-Clause
"""The command line, end to end, as its user meets it."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner

from simdtex.cli import main
from simdtex.io import image
from simdtex.model.source_map import load_source_map


@pytest.fixture
def folder(tmp_path):
    """A folder with a small sample, a colour map of the same material, and nothing else."""
    rng = np.random.default_rng(1)
    image.write(tmp_path / "sample.png", rng.integers(0, 256, (24, 20), dtype=np.uint8))
    image.write(tmp_path / "normal.png", rng.integers(0, 65536, (24, 20, 3), dtype=np.uint16))
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, [str(arg) for arg in args])


def synth(folder, *args):
    arguments = ["synth", folder / "sample.png", "-o", folder / "out.png", "--order", 2, "--seed", 5]
    return run(*arguments, "--device", "reference", *args)


def listing(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_stranger_gets_more_texture(folder):
    command = [
        sys.executable,
        "-m",
        "simdtex",
        "synth",
        "sample.png",
        "-o",
        "out.png",
        "--size",
        "31x27",
        "--order",
        "2",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert image.read(folder / "out.png").pixels.shape == (27, 31)
    assert "31x27 from 20x24" in done.stdout and "seed" in done.stdout


def test_everything_at_once(folder):
    args = ["--size", "30x26", "--stages", folder / "st", "--source-map", folder / "s.npz", "--finish", "0"]
    result = synth(folder, *args, "--also", f"{folder}/normal.png={folder}/normal-out.png")
    assert result.exit_code == 0, result.output
    source = load_source_map(folder / "s.npz")
    sample, made = image.read(folder / "sample.png").pixels, image.read(folder / "out.png").pixels
    normal, carried = image.read(folder / "normal.png").pixels, image.read(folder / "normal-out.png").pixels
    assert np.array_equal(made, sample[source[..., 0], source[..., 1]])
    assert np.array_equal(carried, normal[source[..., 0], source[..., 1]])
    assert carried.dtype == np.uint16
    stages = listing(folder / "st")
    assert {"level0-sweep01.png", "temperature-level0-sweep01.png"} <= set(stages)


def test_the_same_seed_gives_the_same_file(folder):
    synth(folder, "-q")
    first = (folder / "out.png").read_bytes()
    synth(folder, "-q")
    assert (folder / "out.png").read_bytes() == first


def test_an_array_makes_the_same_file_and_an_account(folder):
    plain = synth(folder, "--size", "9x8", "--seed", 3, "--schedule", "luby")
    assert plain.exit_code == 0 and "PEs" not in plain.output
    made = (folder / "out.png").read_bytes()
    for array in ("4x4", "4x4:hierarchical"):
        result = synth(folder, "--size", "9x8", "--seed", 3, "--schedule", "luby", "--array", array)
        assert result.exit_code == 0, result.output
        assert "4x4 PEs" in result.output and "utilisation" in result.output and "X-Net" in result.output
        assert (folder / "out.png").read_bytes() == made


def test_quiet_says_nothing(folder):
    assert synth(folder, "-q").output == ""


def test_default_size_is_twice_the_sample(folder):
    synth(folder, "-q")
    assert image.read(folder / "out.png").pixels.shape == (48, 40)


BAD = {
    "size 0": (["--size", "0x20"], "size"),
    "size in words": (["--size", "large"], "size"),
    "beyond any device": (["--size", "60000x60000"], "smaller size"),
    "method": (["--method", "mfr"], "choose one of: mrf"),
    "schedule": (["--schedule", "luby?"], "choose one of: coloring"),
    "array": (["--array", "128"], "rows x columns such as 128x128"),
    "device": (["--device", "no such device"], "no such device"),
    "also without a file": (["--also", "normal.png"], "MAP=OUT"),
    "also a missing map": (["--also", "nothing.png=there.png"], "nothing.png"),
    "source map suffix": (["--source-map", "map.jpg"], ".npz"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_options_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD[case]
    before = listing(folder)
    result = synth(folder, *args)
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert listing(folder) == before


def write_not_an_image(path):
    path.write_text("this is a text")


def write_nothing(path):
    path.write_bytes(b"")


def write_nan(path):
    np.save(path, np.full((20, 20), np.nan))


def write_infinite(path):
    np.save(path, np.where(np.eye(20) > 0, np.inf, 1.0))


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("missing.png", lambda path: None),
        ("text.png", write_not_an_image),
        ("empty.png", write_nothing),
        ("nan.npy", write_nan),
        ("infinite.npy", write_infinite),
        ("folder.png", lambda path: path.mkdir()),
    ],
)
def test_bad_samples(folder, name, make):
    make(folder / name)
    before = listing(folder)
    result = run("synth", folder / name, "-o", folder / "out.npy", "--order", 2, "--device", "reference")
    assert result.exit_code == 2, result.output
    assert len(result.output.strip().splitlines()) == 1
    assert listing(folder) == before


@pytest.mark.parametrize("output", ["nowhere/out.png", "sample.png/out.png", "out.xyz", "."])
def test_bad_outputs(folder, output):
    before = listing(folder)
    result = run("synth", folder / "sample.png", "-o", folder / output, "--order", 2)
    assert result.exit_code == 2, result.output
    assert len(result.output.strip().splitlines()) == 1
    assert listing(folder) == before


def test_a_map_of_another_size_is_refused_before_the_work(folder):
    image.write(folder / "small.png", np.zeros((5, 5), np.uint8))
    result = synth(folder, "--also", f"{folder}/small.png={folder}/small-out.png")
    assert result.exit_code == 2 and "sample's size" in result.output


def test_devices_lists_the_reference():
    result = run("devices")
    assert result.exit_code == 0 and "reference" in result.output


def test_ctrl_c_leaves_no_file(folder):
    image.write(folder / "big.png", np.random.default_rng(2).integers(0, 256, (96, 96), dtype=np.uint8))
    command = [sys.executable, "-m", "simdtex", "synth", "big.png", "-o", "out.png", "--size", "1500x1500"]
    running = subprocess.Popen(
        [*command, "--stages", "st"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 120
    while not (folder / "st" / "level0-sweep01.png").exists() and not any((folder / "st").glob("level*")):
        assert running.poll() is None and time.monotonic() < deadline, running.communicate()
        time.sleep(0.1)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 130, errors
    assert "Traceback" not in errors and "stopped" in errors
    assert not (folder / "out.png").exists()
    assert not [path for path in folder.rglob("*") if path.name.startswith((".", "tmp"))]


@pytest.mark.parametrize(
    ("function", "args", "writes", "said"),
    [
        ("simdtex.bench.run.run", ["bench", "-q", "--json", "old.json"], [], "nothing was written"),
        ("simdtex.extend", ["extend", "a.png", "-o", "o.png", "--right", "3"], [], "nothing was written"),
        ("simdtex.extend", ["extend", "a.png", "-o", "o.png", "--right", "3"], ["o.png"], "o.png"),
        (
            "simdtex.jobs.synthesis.synthesize",
            ["synth", "a.png", "-o", "o.png", "--stages", "st"],
            ["st/level0.png"],
            "st",
        ),
        (
            "simdtex.jobs.synthesis.synthesize",
            ["synth", "a.png", "-o", "o.png", "--stages", "st"],
            [],
            "nothing was written",
        ),
        (
            "simdtex.jobs.synthesis.synthesize",
            ["synth", "a.png", "-o", "old.png", "--stages", "st"],
            ["old.png", "st/level0.png"],
            "old.png, st",
        ),
    ],
)
def test_a_stopped_command_says_what_was_written(tmp_path, monkeypatch, function, args, writes, said):
    monkeypatch.chdir(tmp_path)
    image.write("a.png", np.indices((9, 9)).sum(0).astype(np.uint8))
    for name in ("old.json", "old.png"):
        (tmp_path / name).touch()

    def stopped(*_, **__):
        for name in writes:
            (tmp_path / name).parent.mkdir(exist_ok=True)
            image.write(name, np.ones((2, 2), np.uint8))
        raise KeyboardInterrupt

    monkeypatch.setattr(function, stopped)
    result = run(*args)
    assert result.exit_code == 130
    assert result.stderr == f"simdtex: stopped; {said if 'nothing' in said else f'written so far: {said}'}\n"


def test_the_demo(tmp_path, monkeypatch):
    result = run("demo", "-o", tmp_path / "demo", "--size", "16x12")
    assert result.exit_code == 0, result.output
    assert listing(tmp_path / "demo") == ["brick.png", "grass.png", "gravel.png", "sheet.png"]
    assert image.read(tmp_path / "demo" / "brick.png").pixels.shape == (12, 16)
    assert run("demo", "-o", tmp_path / "demo", "--size", "9x8").exit_code == 0, "its own files are replaced"
    assert image.read(tmp_path / "demo" / "brick.png").pixels.shape == (8, 9)


@pytest.mark.parametrize("name", ["brick.png", "sheet.png"])
@pytest.mark.parametrize("content", ["a picture", "no picture", "a folder"])
def test_the_demo_replaces_no_file_of_others(tmp_path, name, content):
    path = tmp_path / name
    if content == "a picture":
        image.write(path, np.zeros((3, 4), np.uint8))
    elif content == "no picture":
        path.write_bytes(b"my notes")
    else:
        path.mkdir()
    before = path.read_bytes() if path.is_file() else None
    result = run("demo", "-o", tmp_path, "--size", "16x12", "--device", "reference")
    assert result.exit_code == 2 and len(result.output.splitlines()) == 1
    assert f"holds other files ({name}): give an empty or a new one" in result.output
    assert listing(tmp_path) == [name] and (before is None or path.read_bytes() == before)
