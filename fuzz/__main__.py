# SPDX-License-Identifier: BSD-3-Clause
"""Run `simdtex` with random command lines and damaged files, and check the results.

    python -m fuzz [--kinds lines,stores,checkpoints] [--minutes 10] [--tries N] [--seed 1] [--first 0] [--workers N]
                   [--device TEXT]

The kinds, which share the minutes, are

lines        random command lines with random files. A try passes if it ends with exit code 0, or with 2 and one
             sentence, within 10 s and 1 GiB, changes no input, leaves no temporary file and writes nowhere else.
stores       runs in tiles whose stores are damaged and continued, to the same picture or to a sentence.
checkpoints  checkpoints that are damaged, or given with another option: the files are right, or there is a sentence.

A seed and a number give a try, so that every fault is printed with the command that repeats it. ``--device`` is that of
command lines that name none.
"""

import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import TimeoutError

from pebble import ProcessExpired, ProcessPool

from benchmarks.common import chosen, command
from fuzz import KINDS, begin, one_try

SECONDS = 60.0
"""Seconds until the process of a try is killed, which may wait for another on a busy machine."""

LIFE = 3000
"""Tries of a process: what libraries keep would count as memory of later tries."""


def ended(results, kind):
    """Yield the results of tries, also of those whose process was killed or died."""
    while True:
        try:
            yield next(results)
        except StopIteration:
            return
        except TimeoutError:
            yield kind, "killed", [("time", f"more than {SECONDS:g} s")]
        except ProcessExpired as error:
            yield kind, "died", [("died", f"exit code {error.exitcode}")]


def run(kind, minutes, tries, seed, first, workers, device):
    """Run the tries of a kind; return how often each ended how, and the faults."""
    ends, faults, until, number = Counter(), Counter(), time.monotonic() + 60 * minutes, first
    shared = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-", dir=shared) as root,
        ProcessPool(workers, LIFE, begin, [kind, root, device], multiprocessing.get_context("spawn")) as pool,
    ):
        while time.monotonic() < until and (tries is None or number < first + tries):
            count = 8 * workers if tries is None else min(8 * workers, first + tries - number)
            numbers = range(number, number + count)
            results = pool.map(one_try, [kind] * count, [seed] * count, numbers, timeout=SECONDS).result()
            for number, (what, end, found) in zip(numbers, ended(results, kind), strict=True):
                ends.update([end, *what.split(", ")])
                for fault in dict.fromkeys(map(tuple, found)):
                    faults[fault] += 1
                    if faults[fault] == 1:
                        print(*fault, sep=": ")
                        print(f"    python -m fuzz --kinds {kind} --seed {seed} --first {number} --tries 1", flush=True)
            number += 1
    return number - first, ends, faults


@command
def main(kinds=tuple(KINDS), minutes=10.0, tries=int, seed=1, first=0, workers=int, device="reference"):
    wrong = 0
    for kind in chosen(KINDS, kinds):
        each = minutes / len(kinds), tries, seed, first, workers or os.cpu_count(), device
        count, ends, faults = run(kind, *each)
        print(f"{kind}: {count} tries, {len(faults)} different faults")
        print("\n".join(f"{number:6} {what}" for what, number in ends.most_common()), flush=True)
        wrong += len(faults)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
