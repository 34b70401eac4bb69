# SPDX-License-Identifier: BSD-3-Clause
"""Counts of tries and faults; each different fault is kept once, as a file that replays it."""

import json
import shlex
import time
from collections import Counter
from pathlib import Path

from fuzz.lines import COMMANDS


class Record:
    """Counts tries and faults."""

    def __init__(self, seed, folder):
        self.seed, self.folder, self.began = seed, Path(folder), time.monotonic()
        self.tries, self.slowest, self.largest = 0, 0.0, 0
        self.kinds, self.commands, self.codes = Counter(), Counter(), Counter()
        self.faults, self.first = Counter(), {}

    def add(self, one, kind, args, result):
        """Count a try; ``one()`` makes it if it has to be kept."""
        self.tries += 1
        self.kinds.update(kind.split(", "))
        self.commands[args[0] if args and args[0] in COMMANDS else "no command"] += 1
        self.codes[str(result["code"])] += 1
        self.slowest = max(self.slowest, result["seconds"])
        self.largest = max(self.largest, result["bytes"])
        for what, text in {(what, text) for what, text in result["faults"]}:
            self.faults[what, text] += 1
            if (what, text) not in self.first:
                self.first[what, text] = self.keep(one(), len(self.first), what, text, result["said"])

    def keep(self, one, number, what, text, said):
        """Write a try with a fault, and return the file's name."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{number:04}.json"
        told = {"fault": [what, text], "command": shlex.join(["simdtex", *one.args]), "said": said[-2000:]}
        path.write_text(json.dumps(told | {"try": one.as_json()}, indent=1))
        return path

    def results(self):
        """Return all counts and faults for JSON."""
        return {
            "seed": self.seed,
            "seconds": round(time.monotonic() - self.began, 1),
            "tries": self.tries,
            "slowest": round(self.slowest, 2),
            "largest": self.largest,
            "codes": dict(sorted(self.codes.items())),
            "commands": dict(self.commands.most_common()),
            "kinds": dict(self.kinds.most_common()),
            "faulty": sum(self.faults.values()),
            "faults": [
                {"kind": what, "text": text, "tries": count, "file": str(self.first[what, text])}
                for (what, text), count in self.faults.most_common()
            ],
        }

    def counts(self):
        """Return what docs/testing.rst tells of a run."""
        return {
            **{"tries": f"{self.tries:,}", "seconds": f"{time.monotonic() - self.began:,.0f}", "seed": self.seed},
            "ended with exit code 0": f"{self.codes['0']:,}",
            "ended with exit code 2 and a sentence": f"{self.codes['2']:,}",
            "ended by Ctrl-C": f"{self.codes['130']:,}",
            "slowest try, seconds": f"{self.slowest:.2f}",
            "most memory of a try, MiB": f"{self.largest / 2**20:.0f}",
            "different faults": len(self.faults),
            **{f"tries with {kind}": f"{count:,}" for kind, count in self.kinds.most_common() if kind != "plain"},
        }


def write_counts(path, counts):
    """Write a record that docs/testing.rst shows: what was counted, and how many."""
    path.write_text("what,how many\n" + "".join(f'"{what}","{number}"\n' for what, number in counts.items()))
