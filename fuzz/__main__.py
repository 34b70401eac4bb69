# SPDX-License-Identifier: BSD-3-Clause
"""Run `simdtex` with random command lines and damaged files, and check the results.

    python -m fuzz [--minutes 10 | --tries N] [--seed 1] [--workers N] [--device TEXT] [--out build/fuzz] [--record]
    python -m fuzz --replay FILE

A try passes if it ends with exit code 0, or with 2 and one sentence, within 10 s and 1 GiB, changes no input, leaves no
temporary file and writes nowhere else. Each different fault is written once to build/fuzz, with its command and files.
``--device`` is that of tries that name none; ``--record`` writes docs/fuzzing/lines.csv.
"""

import itertools
import json
import os
import sys
import time
from pathlib import Path

from benchmarks.common import command
from fuzz import pool
from fuzz.record import Record, write

OUT = Path("build") / "fuzz"


def show(path, result):
    """Print the command of a try and what is wrong with it."""
    print(json.loads(path.read_text())["command"])
    print(result["said"], end="")
    print(f"exit code {result['code']}, {result['seconds']:.2f} s, {result['bytes'] / 2**20:.0f} MiB")
    for what, text in result["faults"]:
        print(f"{what}: {text}")


def questions(seed, tries, end):
    """Yield the seed and the number of each try."""
    for number in itertools.count() if tries is None else range(tries):
        if tries is None and time.monotonic() > end:
            return
        yield {"seed": seed, "number": number}


@command
def main(minutes=10.0, tries=int, seed=1, workers=int, device="reference", out=OUT, record=False, replay=Path):
    kept = Record(seed, out)

    def took(question, result):
        kept.add(pool.asked(question), result)
        if sys.stderr.isatty():
            print(f"\r{kept.tries} tries, {len(kept.files)} faults ", end="", file=sys.stderr, flush=True)

    if replay:
        results = []
        pool.run(iter([json.loads(replay.read_text())["try"]]), 1, lambda _, result: results.append(result), device)
        show(replay, results[0])
        return bool(results[0]["faults"])
    pool.run(questions(seed, tries, time.monotonic() + 60 * minutes), workers or os.cpu_count(), took, device)
    print("\n".join(f"{what}: {number}" for what, number in kept.counts().items()))
    for (what, text), count in kept.faults.most_common():
        print(f"{count:6} {what}: {text}\n       python -m fuzz --replay {kept.files[what, text]}")
    if record:
        write("lines.csv", [("what", "how many"), *kept.counts().items()])
    return bool(kept.faults)


if __name__ == "__main__":
    sys.exit(main())
