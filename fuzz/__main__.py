# SPDX-License-Identifier: BSD-3-Clause
"""Give `simdtex` command lines and files that nobody would, and say what it makes of them.

    python -m fuzz [--minutes 10 | --tries N] [--seed 1] [--workers N] [--record]
    python -m fuzz --replay FILE

A try passes that ends with exit code 0, or 2 and one sentence, within 10 s and 1 GiB, changes no input, leaves no
temporary file and writes nowhere else. Each fault is written once to build/fuzz, with all that it takes to see it
again.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
RECORD = HERE.parent / "docs" / "fuzzing.json"


def main():
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--tries", type=int, help="so many, however long they take")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--part", choices=("both", "lines", "faults"), default="both")
    parser.add_argument("--device", default="reference", help="that tries run on")
    parser.add_argument("--out", default="build/fuzz", metavar="DIR")
    parser.add_argument("--record", action="store_true", help="write docs/fuzzing.json")
    parser.add_argument("--replay", metavar="FILE", help="run the try of a file, and say what is wrong with it")
    parser.add_argument("--work", metavar="DIR", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        from fuzz.worker import serve

        serve(options.work)
        return 0
    from fuzz import pool
    from fuzz.lines import made
    from fuzz.record import Record
    from fuzz.writes import write_faults

    if options.replay:
        told = json.loads(Path(options.replay).read_text())
        print(told["command"])
        answers = []
        pool.run(iter([told["try"]]), 1, lambda _, answer: answers.append(answer), options.device)
        result = answers[0][2]
        print(result["said"], end="")
        print(f"exit code {result['code']}, {result['seconds']:.2f} s, {result['bytes'] / 2**20:.0f} MiB")
        for what, text in result["faults"]:
            print(f"{what}: {text}")
        return bool(result["faults"])
    record = Record(options.seed, options.out)
    last = [time.monotonic()]

    def tell():
        if sys.stderr.isatty() and time.monotonic() - last[0] > 1:
            last[0] = time.monotonic()
            print(f"\r{record.tries} tries, {len(record.first)} faults ", end="", file=sys.stderr, flush=True)

    if options.part != "lines":
        share = 0.4 if options.part == "both" else 1.0
        write_faults(record, options.workers, tell, record.began + 60 * share * options.minutes)
    if options.part != "faults":
        end = record.began + 60 * options.minutes

        def questions():
            for number in itertools.count():
                if number == options.tries or (options.tries is None and time.monotonic() > end):
                    return
                yield {"seed": options.seed, "number": number}

        def took(question, answer):
            record.add(lambda: made(question["seed"], question["number"]), *answer)
            tell()

        pool.run(questions(), options.workers, took, options.device)
    text = record.text()
    print(text)
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "fuzz.txt").write_text(text + "\n")
    found = record.results()
    (out / "fuzz.json").write_text(json.dumps(found, indent=1) + "\n")
    if options.record:
        found["version"] = subprocess.run(
            ["git", "-C", str(HERE), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
        ).stdout.strip()
        RECORD.write_text(json.dumps(found, indent=1) + "\n")
    return bool(record.faults)


if __name__ == "__main__":
    sys.exit(main())
