# SPDX-License-Identifier: BSD-3-Clause
"""Damage the checkpoints of every command, go on with other options, and check the result.

    python -m fuzz.checkpoints [--damages 20] [--draws 2] [--moments 3] [--seed 1] [--record] [--commands NAME ...]

Each command runs once, and its checkpoint is kept after every write. As many states as ``--moments`` are emptied,
removed, cut ``--damages`` times, and a bit of them is flipped as often, and `simdtex resume` goes on: it writes the
files of a run that was never stopped, or ends with exit code 2, one sentence and no file. Then the command is given
again with one more option, as drawn by `fuzz.lines` ``--draws`` times: it is refused in one sentence and the checkpoint
is as it was, or it writes the files that it writes without a checkpoint.
"""

import random
import shutil
import sys
import tempfile
import warnings
from contextlib import chdir
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner

from benchmarks.common import command
from fuzz.damage import Ends, damaged, put
from fuzz.lines import METHOD_OF, OTHERS, Maker
from fuzz.record import write
from simdtex import checkpoint as checkpoints
from simdtex.checkpoint import Checkpoint
from simdtex.cli import load
from simdtex.cli import main as simdtex
from simdtex.io import image

SHORT = "--order 1 --levels 2 --xi -6 --source-map where.npz"
RUNS = {
    "synth": f"synth L.png -o out.png --size 14x13 {SHORT}",
    "multires": "synth RGB.png -o out.png --size 14x13 --method multires",
    "pyramid": "synth RGB.png -o out.png --size 14x13 --method pyramid --iterations 2",
    "fill": "fill L.png -o out.png --mask hole.png --order 1 --levels 1",
    "extend": "extend L.png -o out.png --right 3 --order 1",
    "mix": "mix L.png M.png -o out.png --size 14x13 --iterations 2",
    "solid": "solid L.png -o out.npz --size 6 --iterations 2",
    "simulate": "simulate L.png -o out.npz --size 14x13 -n 3 --order 1 --jobs 1",
    "classify": "classify L.png -o out.png --texture a=L.png --texture b=M.png",
}
ALWAYS = ("--seed", "5", "--device", "reference", "--quiet")
FREE = ("output", "checkpoint", "help", "seed", "device", "quiet", *OTHERS)
"""Options that are not changed, as they say where the result is, or are tried otherwise."""

KEPT, KEEP = Path("kept"), ("--checkpoint", "kept")


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
    """Return the files here without the checkpoint; of an npz, which has the time in it, its arrays."""
    found = {}
    for path in sorted(Path().rglob("*")):
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                found[str(path)] = {name: arrays[name].tobytes() for name in arrays.files}
        elif path.is_file() and path != KEPT:
            found[str(path)] = path.read_bytes()
    return found


def clear(given, more=()):
    """Bring the present folder back to the files that it had, and some more."""
    for path in Path().iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name not in given:
            path.unlink()
    for name in set(more) - set(given):
        Path(name).write_bytes(more[name])


def call(*words):
    """Call the command; return its exit code, standard error, and the traceback if there was one."""
    done = CliRunner().invoke(simdtex, [str(word) for word in words])
    return done.exit_code, done.stderr, None if isinstance(done.exception, SystemExit) else done.exception


def states(words):
    """Run a command, and return its files and its checkpoint after every write."""
    kept, save = [], Checkpoint._write

    def keeping(self, tree):
        save(self, tree)
        kept.append(self.path.read_bytes())

    Checkpoint._write = keeping
    try:
        code, said, _ = call(*words, *ALWAYS, *KEEP)
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


def damage(name, given, expected, chosen, rng, count, ends):
    """Go on with damaged checkpoints of a command."""
    for data in chosen:
        for how in ("empty", "remove", *("cut", "bit") * count):
            clear(given)
            content = damaged(data, how, rng)
            put(KEPT, content)
            answer = call("resume", KEPT)
            done = answer[0] == 0
            fault = ("" if files() == expected else "other files") if done else refused(answer, given, content)
            ends.add("damage", "went on" if done else "said", fault and f"{name}, {how}: {fault}")


def other_options(name, words, given, kept, rng, draws, ends):
    """Give a command with one more option to checkpoints of the one without."""
    samples = [word for word in words[1:3] if word.endswith(".png")]
    options = [one for one in load(words[0]).params if isinstance(one, click.Option) and one.name not in FREE]
    for option in (option for option in options for _ in range(draws)):
        maker = Maker(rng)
        maker.method = METHOD_OF.get(name, name if name in ("multires", "pyramid") else "mrf")
        line = [*words, *maker.option(option, samples[: 1 + (name == "mix")], words[0], True), *ALWAYS]
        clear(given, maker.files)
        before = files()
        valid = call(*line)[0] == 0
        expected, data = files(), rng.choice(kept)
        clear(given, maker.files)
        put(KEPT, data)
        answer = call(*line, *KEEP)
        if answer[0] == 0:
            found = files()
            wrong = [path for path in {**found, **expected} if found.get(path) != expected.get(path)]
            if option.name == "stages":  # those from there on
                wrong = [path for path in wrong if path in found]
            elif option.name == "report":  # which has the time in it
                wrong = [path for path in wrong if Path(path).name not in ("index.html", "results.json")]
            end, fault = "went on", "" if valid and not wrong else f"other files than without a checkpoint: {wrong}"
        else:
            end, fault = "refused" if valid else "wrong anyway", refused(answer, before, data)
            if not fault and valid and "another" not in answer[1] and "--" not in answer[1]:
                fault = f"no reason: {answer[1].strip()}"
        ends.add("options", end, fault and f"{' '.join(line)}: {fault}")


COLUMNS = {
    "states that were damaged": ("damage", None),
    "of these refused in a sentence": ("damage", "said"),
    "options that were added": ("options", None),
    "of these refused by the checkpoint": ("options", "refused"),
    "refused without a checkpoint too": ("options", "wrong anyway"),
    "accepted: files as without a checkpoint": ("options", "went on"),
}


@command
def main(damages=20, moments=3, draws=2, seed=1, record=False, commands=tuple(RUNS)):
    warnings.simplefilter("ignore")
    checkpoints.FIRST, checkpoints.SHARE = 0.0, 0
    rows, faults = [["run", *COLUMNS, "faults"]], 0
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        inputs()
        given = files()
        for name in commands:
            rng, ends, words = random.Random(f"{seed}-{name}"), Ends(), RUNS[name].split()
            clear(given)
            expected, kept = states(words)
            damage(name, given, expected, rng.sample(kept, min(moments, len(kept))), rng, damages, ends)
            other_options(name, words, given, kept, rng, draws, ends)
            rows.append([name, *(ends.total(*column) for column in COLUMNS.values()), ends.faults])
            print(*rows[-1], flush=True)
            faults += ends.faults
    if record:
        write("checkpoints.csv", rows)
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
