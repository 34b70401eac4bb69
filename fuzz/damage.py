# SPDX-License-Identifier: BSD-3-Clause
"""Damage to the files that a run keeps, and what comes of it: what `fuzz.stores` and `fuzz.checkpoints` share."""

from collections import Counter

ALONE = ("bit", "cut", "empty", "remove")
"""Kinds of damage to one file: a flipped bit, an end that is missing, no content, no file."""


def damaged(data, how, rng):
    """Return the content of a file after damage of a kind, ``bits`` for twenty flipped ones; None for no file."""
    data = bytearray(data)
    if how in ("bit", "bits"):
        for _ in range(1 if how == "bit" else 20):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif how == "cut":
        del data[rng.randrange(len(data)) :]
    return None if how == "remove" else b"" if how == "empty" else bytes(data)


def put(path, data):
    """Give a file this content, or remove it."""
    if data is None:
        path.unlink(missing_ok=True)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


class Ends:
    """Counts how tries ended; those with a fault are printed."""

    def __init__(self):
        self.counts = Counter()

    def add(self, what, end, fault=""):
        """Count a try of a kind."""
        self.counts[what, "fault" if fault else end] += 1
        if fault:
            print(fault, flush=True)

    def total(self, what=None, end=None):
        """Return the number of tries, of a kind, and with an end."""
        return sum(n for (one, other), n in self.counts.items() if what in (None, one) and end in (None, other))

    @property
    def faults(self):
        """The number of tries with a fault."""
        return self.total(end="fault")
