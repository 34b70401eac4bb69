# SPDX-License-Identifier: BSD-3-Clause
"""Run `simdtex` with random command lines and damaged files, and check the results.

    python -m fuzz [--minutes 10 | --tries N] [--seed 1] [--workers N] [--record]
    python -m fuzz --replay FILE

A try passes if it ends with exit code 0, or with 2 and one sentence, within 10 s and 1 GiB, changes no input, leaves no
temporary file and writes nowhere else. Each different fault is written once to build/fuzz, with its command and files.
"""

import argparse
import itertools
import json
import os
import sys
import time
from pathlib import Path

RECORD = Path(__file__).resolve().parent.parent / "docs" / "fuzzing" / "lines.csv"


def replay(path, device):
    """Run the try of a file, and print what is wrong with it."""
    from fuzz import pool

    kept = json.loads(path.read_text())
    answers = []
    pool.run(iter([kept["try"]]), 1, lambda _, answer: answers.append(answer), device)
    result = answers[0][2]
    print(kept["command"])
    print(result["said"], end="")
    print(f"exit code {result['code']}, {result['seconds']:.2f} s, {result['bytes'] / 2**20:.0f} MiB")
    for what, text in result["faults"]:
        print(f"{what}: {text}")
    return bool(result["faults"])


def main():
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--tries", type=int, help="the number of tries, however long they take")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--device", default="reference", help="the device of tries that name none")
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"), metavar="DIR")
    parser.add_argument("--record", action="store_true", help="write docs/fuzzing/lines.csv")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="run the try of a file, and say what is wrong")
    options = parser.parse_args()
    if options.replay:
        return replay(options.replay, options.device)
    from fuzz import pool
    from fuzz.lines import made
    from fuzz.record import Record, write_counts

    record = Record(options.seed, options.out)
    end = time.monotonic() + 60 * options.minutes

    def questions():
        for number in itertools.count():
            if number == options.tries or (options.tries is None and time.monotonic() > end):
                return
            yield {"seed": options.seed, "number": number}

    def took(question, answer):
        record.add(lambda: made(question["seed"], question["number"]), *answer)
        if sys.stderr.isatty():
            print(f"\r{record.tries} tries, {len(record.first)} faults ", end="", file=sys.stderr, flush=True)

    pool.run(questions(), options.workers, took, options.device)
    found = record.results()
    print("\n".join(f"{what}: {number}" for what, number in found.items() if what != "faults"))
    for fault in found["faults"]:
        print(f"{fault['tries']:6} {fault['kind']}: {fault['text']}")
        print(f"       python -m fuzz --replay {fault['file']}")
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "fuzz.json").write_text(json.dumps(found, indent=1) + "\n")
    if options.record:
        write_counts(RECORD, record.counts())
    return bool(record.faults)


if __name__ == "__main__":
    sys.exit(main())
