# SPDX-License-Identifier: BSD-3-Clause
"""What a command does if its streams are closed or full, its folder is gone, or names are no text."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from simdtex.cli import COMMANDS, WHAT
from simdtex.io import image

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="these are streams and names of POSIX")
SYNTH = ["synth", "sample.png", "-o", "out.png", "--size", "9x8", "--order", "2", "--device", "reference"]


@pytest.fixture
def folder(tmp_path):
    """A folder with a small sample."""
    image.write(tmp_path / "sample.png", np.random.default_rng(1).integers(0, 256, (12, 14), dtype=np.uint8))
    return tmp_path


def run(folder, words, python=(), **environment):
    """Run a command by a shell, so that its streams can be redirected; buffered, as a terminal's user has it."""
    whole = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"} | environment
    line = b" ".join([os.fsencode(sys.executable), *map(os.fsencode, python), b"-m simdtex", *map(os.fsencode, words)])
    return subprocess.run(line, shell=True, cwd=folder, env=whole, capture_output=True, timeout=120, check=False)


@pytest.mark.parametrize("closed", ["2>&-", ">&-", "<&- >&- 2>&-"])
def test_a_closed_stream_takes_nothing_away(folder, closed):
    done = run(folder, [*SYNTH, closed])
    assert done.returncode == 0, done.stderr
    assert image.read(folder / "out.png").pixels.shape == (8, 9)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
@pytest.mark.parametrize(
    ("words", "unbuffered"),
    [(["--help"], "1"), (["synth", "--help"], ""), (["--version"], ""), (["devices"], ""), (SYNTH, ""), (SYNTH, "1")],
    ids=str,
)
def test_a_full_standard_output_is_one_sentence(folder, words, unbuffered):
    done = run(folder, [*words, ">/dev/full"], PYTHONUNBUFFERED=unbuffered, SIMDTEX_DEVICE="reference")
    assert done.returncode == 2
    said = b"simdtex: standard output could not be written (No space left on device): redirect it\n"
    assert done.stderr == said
    assert (folder / "out.png").exists() == (words is SYNTH)


@pytest.mark.parametrize("words", [["--help"], ["devices"], SYNTH], ids=str)
def test_a_reader_that_has_read_enough_ends_a_command_quietly(folder, words):
    done = run(folder, [*words, "| true"], SIMDTEX_DEVICE="reference")
    assert done.stderr == b""


def test_a_folder_that_is_gone_is_named(folder):
    command = ["synth", "sample.png", *SYNTH[2:]]
    line = " ".join(["mkdir gone && cd gone && rmdir ../gone &&", sys.executable, "-m", "simdtex", *command])
    done = subprocess.run(line, shell=True, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    said = "simdtex: the current folder no longer exists: change to another one\n"
    assert (done.returncode, done.stderr) == (2, said)


def test_helps_need_no_docstrings(folder):
    said = " ".join(run(folder, ["--help"], ["-OO"]).stdout.decode().split())
    assert WHAT in said
    for name in ("synth", "devices"):
        said = " ".join(run(folder, [name, "--help"], ["-OO"]).stdout.decode().split())
        assert COMMANDS[name] in said


def test_names_that_are_no_text_are_written_and_reported(folder):
    """In a locale other than C, in which Python prints no such name."""
    os.rename(folder / "sample.png", os.fsencode(folder / "s") + b"\xff.png")
    words = [b"s\xff.png", b"-o", b"o\xff.png", *map(os.fsencode, SYNTH[4:]), b"--report", b"page\xff"]
    done = run(folder, [b"synth", *words], PYTHONIOENCODING="utf-8:strict")
    assert done.returncode == 0 and done.stderr == b"", done.stderr
    assert done.stdout.startswith(b"o\\udcff.png: 9x8 from 14x12")
    assert os.path.exists(os.fsencode(folder) + b"/o\xff.png")
    page = os.fsencode(folder) + b"/page\xff/"
    with open(page + b"results.json", encoding="utf-8") as file:
        assert json.load(file)["command"].startswith(r"simdtex synth 's\xff.png' -o 'o\xff.png'")
    with open(page + b"index.html", encoding="utf-8") as file:
        assert r"s\xff.png" in file.read()


@pytest.mark.parametrize("words", [["loop.png", "-o", "out.png"], ["sample.png", "-o", "loop.png"]], ids=str)
def test_links_in_a_circle_are_refused(folder, words):
    (folder / "loop.png").symlink_to("loop.png")
    done = run(folder, ["synth", *words, *SYNTH[4:]])
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1 and b"loop.png cannot be" in done.stderr, done.stderr
    assert sorted(os.listdir(folder)) == ["loop.png", "sample.png"]


def test_a_link_to_nothing_is_written_through(folder):
    (folder / "out.png").symlink_to("real.png")
    assert run(folder, SYNTH).returncode == 0
    assert (folder / "out.png").is_symlink() and image.read(folder / "real.png").pixels.shape == (8, 9)


def test_unusual_names(folder):
    for name in ("-dash.png", "new\nline.png", "two words.png", "per%cent.png", "a=b,c.png"):
        (folder / name).write_bytes((folder / "sample.png").read_bytes())
        command = [sys.executable, "-m", "simdtex", "synth", "-o", f"-out{name}", *SYNTH[4:], "--quiet", "--", name]
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=120, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
        assert image.read(folder / f"-out{name}").pixels.shape == (8, 9)
