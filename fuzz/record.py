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
        seconds = time.monotonic() - self.began
        return {
            "seed": self.seed,
            "seconds": round(seconds, 1),
            "tries": self.tries,
            "rate": round(self.tries / seconds, 1),
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

    def text(self):
        """Return the same as text."""
        found = self.results()
        lines = [
            f"{found['tries']} tries in {found['seconds']:.0f} s, {found['rate']:.0f} a second, seed {self.seed}",
            f"exit codes: {found['codes']}",
            f"slowest {found['slowest']} s, most memory {found['largest'] / 2**20:.0f} MiB",
            f"commands: {found['commands']}",
            f"kinds: {found['kinds']}",
            f"{len(found['faults'])} different faults in {found['faulty']} tries",
        ]
        for fault in found["faults"]:
            lines.append(f"{fault['tries']:6} {fault['kind']}: {fault['text']}")
            lines.append(f"       python -m fuzz --replay {fault['file']}")
        return "\n".join(lines)
