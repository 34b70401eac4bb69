# SPDX-License-Identifier: BSD-3-Clause
"""Damage the checkpoints of every command, go on with other options, and check the result.

    python -m fuzz.checkpoints [--damages 20] [--draws 2] [--seed 1] [--record] [COMMAND...]

Each command runs once, and its checkpoint is kept after every write. A checkpoint is cut, emptied or removed, or a bit
of it is flipped, and `simdtex resume` goes on: it writes the files of a run that was never stopped, or ends with exit
code 2, one sentence and no file. Then the command is given again with one more option, as drawn by `fuzz.lines`: it is
refused in one sentence and the checkpoint is as it was, or it writes the files that it writes without a checkpoint.
"""

import argparse
import json
import random
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from contextlib import chdir
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner

from fuzz.lines import OTHERS, Maker
from simdtex import checkpoint as checkpoints
from simdtex.checkpoint import Checkpoint
from simdtex.cli import load, main
from simdtex.io import image

RECORD = Path(__file__).resolve().parent.parent / "docs" / "fuzzing" / "checkpoints.csv"

SIZED = ("--size", "14x13")
SHORT = ("--order", "1", "--levels", "2", "--xi", "-6")
RUNS = {
    "synth": ("synth", "L.png", "-o", "out.png", *SIZED, *SHORT, "--source-map", "where.npz"),
    "multires": ("synth", "RGB.png", "-o", "out.png", *SIZED, "--method", "multires"),
    "pyramid": ("synth", "RGB.png", "-o", "out.png", *SIZED, "--method", "pyramid", "--iterations", "2"),
    "fill": ("fill", "L.png", "-o", "out.png", "--mask", "hole.png", "--order", "1", "--levels", "1"),
    "extend": ("extend", "L.png", "-o", "out.png", "--right", "3", "--order", "1"),
    "mix": ("mix", "L.png", "M.png", "-o", "out.png", *SIZED, "--iterations", "2"),
    "solid": ("solid", "L.png", "-o", "out.npz", "--size", "6", "--iterations", "2"),
    "simulate": ("simulate", "L.png", "-o", "out.npz", *SIZED, "-n", "3", "--order", "1", "--jobs", "1"),
    "classify": ("classify", "L.png", "-o", "out.png", "--texture", "a=L.png", "--texture", "b=M.png"),
}
ALWAYS = ("--seed", "5", "--device", "reference", "--quiet")
FREE = ("output", "checkpoint", "help", "seed", "device", "quiet")
"""Options that are not changed, as they say where the result is, or are tried otherwise."""


def inputs():
    """Write the inputs of the runs."""
    row, col = np.indices((15, 16))
    grey = np.clip(128 + 60 * np.sin(row / 2) + 50 * np.sin(col / 1.5 + row / 5), 0, 255).astype(np.uint8)
    hole = np.zeros(grey.shape, np.uint8)
    hole[3:5, 4:7] = hole[10:13, 9:12] = 255
    for name, pixels in {"L": grey, "M": grey.T[:15, :], "hole": hole}.items():
        image.write(Path(f"{name}.png"), pixels)
    image.write(Path("RGB.png"), np.stack([grey, grey[::-1], 255 - grey], -1))


def files():
    """Return the files of the present folder; arrays as they are, since an npz has the time in it."""
    found = {}
    for path in sorted(Path().rglob("*")):
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                found[str(path)] = {name: arrays[name].tobytes() for name in arrays.files}
        elif path.is_file() and path.name != "kept":
            found[str(path)] = path.read_bytes()
    return found


def call(*words):
    """Call the command; return its exit code, standard error, and the traceback if there was one."""
    done = CliRunner().invoke(main, [str(word) for word in words])
    error = done.exception if not isinstance(done.exception, (SystemExit, type(None))) else None
    return done.exit_code, done.stderr, error


def moments(words):
    """Run a command, and return its files and its checkpoint after every write."""
    kept, save = [], Checkpoint._write

    def keeping(self, tree):
        save(self, tree)
        kept.append(self.path.read_bytes())

    Checkpoint._write = keeping
    try:
        code, said, _ = call(*words, *ALWAYS, "--checkpoint", "kept")
    finally:
        Checkpoint._write = save
    assert code == 0, said
    return files(), kept


def damages(data, rng, count):
    """Yield how a checkpoint is damaged, and its content; None if it is removed."""
    yield "emptied", b""
    yield "removed", None
    for _ in range(count):
        at = rng.randrange(len(data))
        yield f"cut at {at}", data[:at]
        yield f"bit of {at}", data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


class Place:
    """A folder with the inputs, to which it is brought back."""

    def __init__(self):
        inputs()
        self.given = files()

    def clear(self, more=None):
        for path in Path().iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name not in self.given:
                path.unlink()
        for name, data in (more or {}).items():
            if name not in self.given:
                Path(name).write_bytes(data)


def refused(code, said, error, before):
    """Return what is wrong with a refusal."""
    if error is not None:
        return f"traceback {type(error).__name__}: {error}"
    if code != 2 or len(said.strip().splitlines()) != 1:
        return f"exit code {code}: {said.strip()}"
    return "" if files() == before else "files were written"


def damaged(name, place, given, rng, count):
    """Go on with damaged checkpoints of a command; return how often it was said, and faults."""
    words, ends, faults = RUNS[name], Counter(), []
    place.clear()
    expected, kept = moments(words)
    for data in rng.sample(kept, min(given.moments, len(kept))):
        for what, content in damages(data, rng, count):
            place.clear()
            if content is not None:
                Path("kept").write_bytes(content)
            before, answer = files(), call("resume", "kept")
            if answer[0] == 0:
                wrong = "" if files() == expected else "other files"
            else:
                wrong = refused(*answer, before)
                if not wrong and content is not None and Path("kept").read_bytes() != content:
                    wrong = "the checkpoint was changed"
            ends["fault" if wrong else "went on" if answer[0] == 0 else "said"] += 1
            faults += [f"{name}, {what}: {wrong}"] * bool(wrong)
    return ends, faults


def other_options(name, place, given, rng):
    """Give commands with one more option to checkpoints of others; return how they ended, and faults."""
    words, ends, faults = RUNS[name], Counter(), []
    place.clear()
    _, kept = moments(words)
    samples = [word for word in words[1:3] if word.endswith(".png")][: 2 if name == "mix" else 1]
    for option in load(words[0]).params:
        if not isinstance(option, click.Option) or option.name in (*FREE, *OTHERS):
            continue
        for _ in range(given.draws):
            maker = Maker(rng)
            methods = {"solid": "pyramid", "mix": "pyramid", "classify": "classifier"}
            maker.method = methods.get(name, name if name in ("multires", "pyramid") else "mrf")
            more = maker.option(option, samples, words[0], True)
            line = [*words, *more, *ALWAYS]
            place.clear(maker.files)
            before = files()
            fresh = call(*line)
            expected = files()
            place.clear(maker.files)
            data = kept[rng.randrange(len(kept))]
            Path("kept").write_bytes(data)
            code, said, error = call(*line, "--checkpoint", "kept")
            if code == 0:
                found = files()
                wrong = [path for path in {**found, **expected} if found.get(path) != expected.get(path)]
                if option.name == "stages":  # those from there on
                    wrong = [path for path in wrong if path in found]
                elif option.name == "report":  # which has the time in it
                    wrong = [path for path in wrong if Path(path).name not in ("index.html", "results.json")]
                wrong = "" if fresh[0] == 0 and not wrong else f"other files than without a checkpoint: {wrong}"
                end = "went on" if not wrong else "fault"
            else:
                wrong = refused(code, said, error, before)
                if not wrong and Path("kept").read_bytes() != data:
                    wrong = "the checkpoint was changed"
                if not wrong and fresh[0] == 0 and "another" not in said and "--" not in said:
                    wrong = f"no reason: {said.strip()}"
                end = "fault" if wrong else "refused" if fresh[0] == 0 else "wrong anyway"
            ends[end] += 1
            if given.verbose and end in ("went on", "refused"):
                print(name, *more, end, said.strip())
            faults += [f"{name} {' '.join(more)}: {wrong}"] * bool(wrong)
    return ends, faults


def run():
    parser = argparse.ArgumentParser(prog="python -m fuzz.checkpoints", description=__doc__.splitlines()[0])
    parser.add_argument("--damages", type=int, default=20, help="cuts and bits of each kept state")
    parser.add_argument("--moments", type=int, default=3, help="kept states of each command that are damaged")
    parser.add_argument("--draws", type=int, default=2, help="values of each option")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", action="store_true", help=f"write docs/fuzzing/{RECORD.name}")
    parser.add_argument("--verbose", action="store_true", help="print each option that went on or was refused")
    parser.add_argument("commands", nargs="*", default=list(RUNS))
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    checkpoints.FIRST, checkpoints.SHARE = 0.0, 0
    results = {}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        place = Place()
        for name in given.commands:
            rng = random.Random(f"{given.seed}-{name}")
            damage, wrong = damaged(name, place, given, rng, given.damages)
            options, more = other_options(name, place, given, rng)
            results[name] = {"damage": damage, "options": options}
            print(name, json.dumps(results[name]), flush=True)
            for fault in wrong + more:
                print(fault, flush=True)
    if given.record:
        columns = {
            "states that were damaged": ("damage", ("went on", "said", "fault")),
            "of these refused in a sentence": ("damage", ("said",)),
            "options that were added": ("options", ("went on", "refused", "wrong anyway", "fault")),
            "of these refused by the checkpoint": ("options", ("refused",)),
            "refused without a checkpoint too": ("options", ("wrong anyway",)),
            "accepted: files as without a checkpoint": ("options", ("went on",)),
        }
        lines = [",".join(f'"{one}"' for one in ("run", *columns, "faults"))]
        for name, one in results.items():
            counts = [sum(one[what].get(end, 0) for end in ends) for what, ends in columns.values()]
            lines.append(",".join(map(str, (name, *counts, sum(ends.get("fault", 0) for ends in one.values())))))
        RECORD.write_text("\n".join(lines) + "\n")
    return any("fault" in ends for one in results.values() for ends in one.values())


if __name__ == "__main__":
    sys.exit(run())
