# SPDX-License-Identifier: BSD-3-Clause
"""Damage what runs keep, go on with it, and check the result.

    python -m fuzz.stores [--tries 200] [--seed 1]

Each try takes a run in tiles, or one with a checkpoint, that was stopped at a random moment; flips bits of one of its
files, cuts, empties or removes it; and goes on. It passes if the picture has its bytes, or a sentence says that
the run has to begin anew. Every fault is printed with the try's number.
"""

import argparse
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

import simdtex
from simdtex import Checkpoint, distributed
from simdtex.distributed.tasks import forget

SHAPE = 26, 31
SAMPLE = np.random.default_rng(2).integers(0, 9, (20, 22)).astype(np.uint8).repeat(2, 1)[:, :22]
KNOWN = np.ma.masked_array(np.full(SHAPE, 4, np.uint8), np.indices(SHAPE).sum(0) % 9 > 0)
OPTIONS = {"order": 1, "levels": 2, "xi": -6.0, "rng": 11, "known": KNOWN, "device": "reference"}
RESUMES = 6
"""Times that a run is gone on with: each level begins again once, and more would be a fault."""


class Stop(Exception):
    """Stops a run."""


def stop_after(count):
    """Return a callback that raises after so many calls."""
    left = [count]

    def callback(progress):
        left[0] -= 1
        if not left[0]:
            raise Stop

    return callback


def tiles(folder, count):
    """Begin a run in tiles, which is stopped."""
    distributed.synthesize(
        SAMPLE, SHAPE, folder / "o.zarr", tiles=12, source_map=True, callback=stop_after(count), **OPTIONS
    )


def go_on_with_tiles(folder):
    """Return the picture of a run in tiles."""
    forget()
    return distributed.resume(folder / "o.zarr", device="reference").compute()


def checkpoint(folder, count):
    """Begin a run with a checkpoint, which is stopped."""
    kept = Checkpoint(folder / "state", every=0)
    simdtex.synthesize(SAMPLE, SHAPE, checkpoint=kept, callback=stop_after(count), **OPTIONS)


def go_on_with_a_checkpoint(folder):
    """Return the picture of a run with a checkpoint."""
    return simdtex.synthesize(SAMPLE, SHAPE, checkpoint=Checkpoint(folder / "state"), **OPTIONS)


RUNS = (tiles, go_on_with_tiles, 60), (checkpoint, go_on_with_a_checkpoint, 12)
"""What begins a run, what goes on with it, and after how many calls it is over."""


def damaged(folder, rng):
    """Damage a file of a folder, and return how and which."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(".lock"))
    path = files[rng.integers(len(files))]
    how, data = str(rng.choice(["bit", "bits", "cut", "empty", "remove"])), bytearray(path.read_bytes())
    if how in ("bit", "bits"):
        for _ in range(1 if how == "bit" else 20):
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    elif how == "cut":
        data = data[: rng.integers(len(data))]
    path.unlink() if how == "remove" else path.write_bytes(b"" if how == "empty" else data)
    return f"{how} {path.relative_to(folder)}"


def tried(go_on, folder, expected):
    """Go on with a damaged run; return how it ended."""
    for _ in range(RESUMES):
        try:
            return "the bytes" if np.array_equal(go_on(folder), expected) else "ANOTHER PICTURE"
        except ValueError as error:
            if any(words in str(error) for words in ("begin anew", "run the command again", "give another")):
                return "begins anew"
            if "simdtex resume" not in str(error):
                return f"NO REMEDY: {error}"
        except Exception as error:
            return f"TRACEBACK: {type(error).__name__}: {error}"
    return "NO END"


def main():
    parser = argparse.ArgumentParser(prog="python -m fuzz.stores", description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    expected, ends = simdtex.synthesize(SAMPLE, SHAPE, **OPTIONS), Counter()
    for number in range(given.tries):
        rng = np.random.default_rng((given.seed, number))
        begin, go_on, most = RUNS[int(rng.random() < 0.2)]
        with tempfile.TemporaryDirectory() as place:
            folder, kept = Path(place, "kept"), Path(place, "run")
            kept.mkdir()
            try:
                begin(kept, int(rng.integers(1, most)))
            except Stop:
                shutil.copytree(kept, folder)
                what = damaged(folder, rng)
                end = tried(go_on, folder, expected)
            else:
                what, end = "", "over before"
        ends[end if end.islower() else "fault"] += 1
        if not end.islower():
            print(f"try {number}: {begin.__name__}, {what}: {end}", flush=True)
    print(f"{given.tries} tries, seed {given.seed}: " + ", ".join(f"{ends[end]} {end}" for end in sorted(ends)))
    return bool(ends["fault"])


if __name__ == "__main__":
    sys.exit(main())
