"""The fuzzer: the same seed gives the same tries, faults are found, and a short run finds none."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz import KINDS, seeded, worker
from fuzz.lines import LINES, RUNS, Maker, Try
from simdtex.commands import COMMANDS as KNOWN

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="the fuzzer runs on Linux")]

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("kind", KINDS)
def test_a_short_run_finds_nothing(kind):
    command = [sys.executable, "-m", "fuzz", "--kinds", kind, "--tries", "25", "--seed", "3", "--workers", "1"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{kind}: 25 tries, 0 different faults\n" in done.stdout
    assert any(end in done.stdout for end in ("exit code 0", "the bytes", "went on"))


def test_every_command_is_tried():
    """But demo, which has tests of its own, and live, which serves a page until it is stopped."""
    assert set(KNOWN) <= {*(line.split()[0] for _, line in LINES.values()), "demo", "live"}


def test_a_seed_and_a_number_give_a_try():
    def made(seed):
        return [Maker(seeded(seed, number)).make() for number in range(50)]

    tries = made(1)
    assert tries == made(1) != made(2)
    assert len({one.args[0] for one in tries if one.args}) > 4


def test_what_a_command_says_wrong():
    for code, said, faults in [
        (2, "simdtex: the sample is empty; give another\n", []),
        (2, "Usage: simdtex synth\nTry 'simdtex synth --help'\n\nError: Missing option '--size'.\n", []),
        (2, "oh\n", ["sentence"]),
        (2, "a\nsimdtex: b\n", ["more than a sentence"]),
        (1, "simdtex: [Errno 2] no file\n", ["exit code", "raw error"]),
        (0, "RuntimeWarning: overflow\n", ["warning"]),
        (2, "simdtex: .tmpab12cd34 is damaged\n", ["hidden name"]),
        (1, "Traceback (most recent call last):\nKeyError: 1\n", ["traceback"]),
    ]:
        assert [what for what, _ in worker.said_wrong(Try([*RUNS["synth"], "-q"]), code, said)] == faults
