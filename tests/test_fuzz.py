"""The fuzzer: the same seed gives the same tries, faults are found, and a short run finds none."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz import corpus
from fuzz.lines import COMMANDS, Try, made
from fuzz.record import Record
from simdtex.cli import COMMANDS as KNOWN
from simdtex.io import image

pytestmark = pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="the fuzzer runs on Linux")

ROOT = Path(__file__).resolve().parent.parent


def fuzz(*args, module="fuzz", timeout=200):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", module, *map(str, args)]
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=timeout, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("stores", "--tries", 30), ("checkpoints", "--damages", 4, "--draws", 1, "--commands", "fill")]
)
def test_damaged_stores_and_checkpoints(words):
    done = fuzz(*words[1:], module=f"fuzz.{words[0]}", timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_command_is_tried():
    assert set(KNOWN) <= {*COMMANDS, "live"}, "which serves a page until it is stopped"


def test_a_seed_and_a_number_give_a_try():
    tries = [made(1, number) for number in range(50)]
    assert tries == [made(1, number) for number in range(50)] != [made(2, number) for number in range(50)]
    assert tries == [Try.from_json(json.loads(json.dumps(one.as_json()))) for one in tries]
    assert len({one.args[0] for one in tries if one.args}) > 4


def test_valid_files_are_valid(tmp_path):
    read = 0
    for name, data in corpus.pictures().items():
        path = tmp_path / name
        path.write_bytes(data)
        try:
            image.read(path)
            read += 1
        except (ValueError, TypeError) as error:
            assert name.partition(".")[0].partition("-")[0] in (
                *("complex", "object", "empty", "inf", "pages", "animated", "bool", "huge", "tiny"),
            ), error
    assert read > 40


def test_a_fault_is_counted_and_kept_once(tmp_path):
    record, one = Record(1, tmp_path), Try(["synth", "a.png"], {"a.png": b"\0"})
    result = {"code": 1, "seconds": 0.5, "bytes": 9, "said": "oh", "faults": [("traceback", "KeyError"), ("time", "x")]}
    for _ in range(3):
        record.add(one, result)
    assert record.counts()["tries"] == "3" and record.counts()["different faults"] == 2
    assert set(record.faults.values()) == {3} and {*record.files.values()} == {*tmp_path.iterdir()}
    kept = json.loads(record.files["traceback", "KeyError"].read_text())
    assert Try.from_json(kept["try"]) == one and kept["command"] == "simdtex synth a.png"


@pytest.mark.slow
def test_a_replay_says_what_is_wrong(tmp_path):
    one = Try(["synth", "L.png", "-o", "out.png", "--size", "4x4", "-q", "--method", "multires"], corpus.pictures())
    path = tmp_path / "try.json"
    path.write_text(json.dumps({"command": "simdtex synth", "try": one.as_json()}))
    done = fuzz("--replay", path)
    assert done.returncode == 0 and "exit code 0" in done.stdout, done.stdout + done.stderr


@pytest.mark.slow
def test_a_short_run_finds_nothing(tmp_path):
    done = fuzz("--tries", 25, "--seed", 3, "--workers", 1, "--out", tmp_path / "found")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tries: 25\n" in done.stdout and int(re.search("exit code 0: (.+)", done.stdout)[1]) > 2
