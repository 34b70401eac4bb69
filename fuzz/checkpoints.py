# SPDX-License-Identifier: BSD-3-Clause
"""Damage the checkpoints of every command, go on with other options, and check the result.

Each command runs once, and its checkpoint is kept after every write. A try empties, removes or cuts one of them or
flips a bit, and `simdtex resume` goes on: it writes the files of a run that was never stopped, or ends with exit code
2, one sentence and no file. Or the command is given again with one more option, as drawn by `fuzz.lines`: it is refused
in one sentence and the checkpoint is as it was, or it writes the files that it writes without a checkpoint.
"""

import os
import shutil
import warnings
from functools import cache
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner

from fuzz import corpus
from fuzz.corpus import damaged, put
from fuzz.lines import OTHERS, PLAIN, RUNS, Maker
from simdtex import checkpoint as checkpoints
from simdtex.checkpoint import Checkpoint
from simdtex.commands import load
from simdtex.commands import main as simdtex

KEEPING = ("synth", "multires", "pyramid", "fill", "extend", "mix", "solid", "simulate", "classify")
"""The jobs that keep a checkpoint."""

ALWAYS = ("--seed", "5", "--device", "reference", "--quiet")
FREE = ("output", "checkpoint", "help", "seed", "device", "quiet", *OTHERS)
"""Options that are not changed, as they say where the result is, or are tried otherwise."""

KEPT, KEEP = Path("kept"), ("--checkpoint", "kept")


def files():
    """Return the files here without the checkpoint; of an npz, which has the time in it, its arrays."""
    found = {}
    for path in sorted(Path().rglob("*")):
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                found[str(path)] = {name: arrays[name].tobytes() for name in arrays.files}
        elif path.is_file() and path != KEPT:
            found[str(path)] = path.read_bytes()
    return found


def clear(more=()):
    """Bring the present folder back to the inputs, and some more files."""
    for path in Path().iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name not in GIVEN:
            path.unlink()
    for name in set(more) - set(GIVEN):
        Path(name).write_bytes(more[name])


def call(*words):
    """Call the command; return its exit code, standard error, and the traceback if there was one."""
    done = CliRunner().invoke(simdtex, [str(word) for word in words])
    return done.exit_code, done.stderr, None if isinstance(done.exception, SystemExit) else done.exception


@cache
def states(name):
    """Run a command; return its files, and its checkpoint after every write."""
    kept, save = [], Checkpoint._write

    def keeping(self, tree):
        save(self, tree)
        kept.append(self.path.read_bytes())

    Checkpoint._write = keeping
    try:
        clear()
        code, said, _ = call(*RUNS[name], *ALWAYS, *KEEP)
    finally:
        Checkpoint._write = save
    assert code == 0, said
    return files(), kept


def refused(answer, before, data):
    """Return what is wrong with a refusal."""
    code, said, error = answer
    if error is not None:
        return f"traceback {type(error).__name__}: {error}"
    if code != 2 or len(said.strip().splitlines()) != 1:
        return f"exit code {code}: {said.strip()}"
    if files() != before:
        return "files were written"
    return "the checkpoint was changed" if data is not None and KEPT.read_bytes() != data else ""


def damage(name, rng):
    """Go on with a damaged checkpoint of a command; return how that ended, and what is wrong."""
    expected, kept = states(name)
    content = damaged(rng.choice(kept), rng.choice(("empty", "remove", *("cut", "bit") * 9)), rng)
    clear()
    put(KEPT, content)
    answer = call("resume", KEPT)
    if answer[0] == 0:
        return "went on", "" if files() == expected else "other files"
    return "said", refused(answer, GIVEN, content)


def other_option(name, rng):
    """Give a command one more option and a checkpoint without it; return how that ended, and what is wrong."""
    words, data = RUNS[name], rng.choice(states(name)[1])
    samples = [word for word in words[1:3] if word.endswith(".png")]
    options = [one for one in load(words[0]).params if isinstance(one, click.Option) and one.name not in FREE]
    option, maker = rng.choice(options), Maker(rng)
    maker.job = name
    line = [*words, *maker.option(option, samples[: 1 + (name == "mix")], True), *ALWAYS]
    clear(maker.files)
    before = files()
    valid = call(*line)[0] == 0
    expected = files()
    clear(maker.files)
    put(KEPT, data)
    answer = call(*line, *KEEP)
    if answer[0] == 0:
        found = files()
        wrong = [path for path in {**found, **expected} if found.get(path) != expected.get(path)]
        if option.name == "stages":  # those from there on
            wrong = [path for path in wrong if path in found]
        elif option.name == "report":  # which has the time in it
            wrong = [path for path in wrong if Path(path).name not in ("index.html", "results.json")]
        fault = "" if valid and not wrong else f"other files than without a checkpoint: {wrong}"
        return "went on", fault and f"{' '.join(line)}: {fault}"
    fault = refused(answer, before, data)
    if not fault and valid and "another" not in answer[1] and "--" not in answer[1]:
        fault = f"no reason: {answer[1].strip()}"
    return "refused" if valid else "wrong anyway", fault and f"{' '.join(line)}: {fault}"


GIVEN = {}
"""The inputs of the runs."""


def begin(place, _device):
    """Prepare a process for tries."""
    warnings.simplefilter("ignore")
    checkpoints.FIRST, checkpoints.SHARE = 0.0, 0
    os.chdir(place)
    for name, data in corpus.named(PLAIN.values()).items():
        Path(name).write_bytes(data)
    GIVEN.update(files())


def one_try(rng):
    """Damage a checkpoint, or give it with another option; return as `fuzz.worker.one_try` does."""
    name, (what, job) = rng.choice(KEEPING), rng.choice((("damage", damage), ("another option", other_option)))
    end, fault = job(name, rng)
    return f"{name}, {what}", f"{what}: {end}", [(name, fault)] if fault else []
