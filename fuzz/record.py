# SPDX-License-Identifier: BSD-3-Clause
"""Counts of tries and faults; each different fault is kept once, as a file that replays it."""

import csv
import json
import shlex
import time
from collections import Counter
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs" / "fuzzing"


class Record:
    """Counts tries and faults."""

    def __init__(self, seed, folder):
        self.seed, self.folder, self.began = seed, Path(folder), time.monotonic()
        self.tries, self.slowest, self.largest = 0, 0.0, 0
        self.kinds, self.codes, self.faults, self.files = Counter(), Counter(), Counter(), {}

    def add(self, one, result):
        """Count a try and its result."""
        self.tries += 1
        self.kinds.update(one.kind.split(", "))
        self.codes[result["code"]] += 1
        self.slowest, self.largest = max(self.slowest, result["seconds"]), max(self.largest, result["bytes"])
        for fault in {tuple(fault) for fault in result["faults"]}:
            self.faults[fault] += 1
            if fault not in self.files:
                self.files[fault] = self.keep(one, fault, result["said"])

    def keep(self, one, fault, said):
        """Write a try with a fault, and return the file's name."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{len(self.files):04}.json"
        told = {"fault": fault, "command": shlex.join(["simdtex", *one.args]), "said": said[-2000:]}
        path.write_text(json.dumps(told | {"try": one.as_json()}, indent=1))
        return path

    def counts(self):
        """Return what docs/testing.rst tells of a run."""
        return {
            **{"tries": f"{self.tries:,}", "seconds": f"{time.monotonic() - self.began:,.0f}", "seed": self.seed},
            "ended with exit code 0": f"{self.codes[0]:,}",
            "ended with exit code 2 and a sentence": f"{self.codes[2]:,}",
            "ended by Ctrl-C": f"{self.codes[130]:,}",
            "slowest try, seconds": f"{self.slowest:.2f}",
            "most memory of a try, MiB": f"{self.largest / 2**20:.0f}",
            "different faults": len(self.faults),
            **{f"tries with {kind}": f"{count:,}" for kind, count in self.kinds.most_common() if kind != "plain"},
        }


def write(name, rows):
    """Write a table that docs/testing.rst shows."""
    with open(DOCS / name, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
