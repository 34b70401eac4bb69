# SPDX-License-Identifier: BSD-3-Clause
"""Damage the stores of runs in tiles, go on with them, and check the result.

    python -m fuzz.stores [--tries 200 | --every 1] [--minutes M] [--seed 1] [--first 0] [--workers N] [--record]

Each try takes a run in tiles as it was at a random moment or when it was finished; flips bits of one of its files,
cuts, empties or removes it, or copies another file over it; or takes each file from one of two moments, as a backup
made during the run has them; and goes on. With ``--every`` each file has all damage of its own at so many moments of
each run. A try passes if the picture has its bytes, or a sentence says that the run has to begin anew. Every fault is
printed with the try's number; ``--first`` is that of the first try, and ``--minutes`` stop after so long.
"""

import random
import shutil
import sys
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import simdtex
from benchmarks.common import command
from fuzz.damage import ALONE, Ends, damaged, put
from fuzz.record import write
from simdtex import distributed
from simdtex.distributed import layout
from simdtex.distributed.turns import context

SHAPE = 20, 21
GREY = np.random.default_rng(2).integers(0, 9, (20, 22)).astype(np.uint8).repeat(2, 1)[:, :22]
COLOUR = np.stack([GREY, GREY[::-1], 9 - GREY], -1)
KNOWN = np.ma.masked_array(np.full(SHAPE, 4, np.uint8), np.indices(SHAPE).sum(0) % 9 > 0)
GUIDE = GREY // 4, np.indices(SHAPE).sum(0).astype(np.uint8) // 20
SMALL = {"order": 1, "levels": 2, "xi": -8.0, "rng": 11, "device": "reference"}

TILED = {
    "known values": (GREY, 12, {"known": KNOWN}),
    "seam": (GREY, 16, {"boundary": "torus", "finish": 1.0}),
    "colour": (COLOUR, 18, {"channel_axis": -1}),
    "guide": (GREY, 16, {"guide": GUIDE}),
}
"""Runs in tiles: the sample, the side of a tile, and options."""

HOWS = (*ALONE, "bits", "another", "moments")
"""Kinds of damage."""

RESUMES = 6
"""Times that a run is gone on with: each level begins again once, and more would be a fault."""

ANEW = ("begin anew", "run the command again", "give another")


class Run:
    """A run, kept as it was at every moment: ``moments`` are folders, and ``expected`` is the picture."""

    def __init__(self, name, folder):
        self.name, self.moments, place = name, [], folder / name / "run"
        place.mkdir(parents=True)
        sample, tile, options = TILED[name]

        def keep(progress):  # files that a thread of Zarr writes now have hidden names
            self.moments.append(place.with_name(str(len(self.moments))))
            shutil.copytree(place, self.moments[-1], ignore=shutil.ignore_patterns("*.lock", ".simdtex-*"))

        given = SMALL | options
        distributed.synthesize(sample, SHAPE, place / "o.zarr", tiles=tile, source_map=True, callback=keep, **given)
        keep(None)  # the finished store
        self.expected = simdtex.synthesize(sample, SHAPE, **given)

    def ended(self, folder):
        """Go on with the run in a folder; return how it ended, and what is wrong with that."""
        for _ in range(RESUMES):
            context.cache_clear()
            try:
                made = distributed.resume(folder / "o.zarr", device="reference").compute()
                return "the bytes", "" if np.array_equal(made, self.expected) else "another picture"
            except ValueError as error:
                said = str(error)
                if any(words in said for words in ANEW) and ("damaged" in said or " is no " in said):
                    return "begins anew", ""
                if said.startswith("Stored and computed checksum"):  # Zarr's, of the array that was returned
                    return "begins anew", ""
                if "simdtex resume" not in said:
                    return "", f"no remedy: {said}"
            except Exception as error:
                return "", f"traceback: {type(error).__name__}: {error}"
        return "", "no end"


def files(folder):
    """Return the files of a folder."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


_runs = []


def begin(place):
    """Prepare a process for tries."""
    warnings.simplefilter("ignore")
    layout.CHUNK = 16  # a tile of 18 has four chunks
    own = Path(tempfile.mkdtemp(dir=place))
    _runs.extend(Run(name, own) for name in TILED)


@cache
def each(moments):
    """Return every file of every run at so many moments with every kind of damage of `ALONE`."""
    parts = [(2 * n + 1) / (2 * moments) for n in range(moments)]
    chosen = [(run, run.moments[int(part * len(run.moments))]) for run in _runs for part in parts]
    return [(run, moment, name, how) for run, moment in chosen for name in files(moment) for how in ALONE]


def number_of_tries(moments):
    return len(each(moments))


def one_try(seed, number, moments):
    """Return the run of a try, how it was damaged, how it ended, and what is wrong with that."""
    rng = random.Random(f"{seed}-{number}")
    if moments:
        run, moment, name, how = each(moments)[number]
    else:
        run = rng.choice(_runs)
        moment = rng.choice(run.moments)
        name, how = rng.choice(files(moment)), rng.choice(HOWS)
    folder = moment.with_name("try")
    shutil.copytree(moment, folder)
    if how == "moments":
        other = rng.choice(run.moments)
        for one in files(other):
            if rng.random() < 0.5:
                put(folder / one, (other / one).read_bytes())
    elif how == "another":  # most likely of the same array
        others = [one for one in files(folder) if one != name] or [name]
        near = [one for one in others if one.parent.parent == name.parent.parent] or others
        put(folder / name, (folder / rng.choice(near)).read_bytes())
    else:
        put(folder / name, damaged((folder / name).read_bytes(), how, rng))
    end = run.ended(folder)
    shutil.rmtree(folder)
    return run.name, f"{how} {name}", *end


@command
def main(tries=200, minutes=float, every=0, seed=1, first=0, workers=int, record=False):
    ends, began, fork = Ends(), time.monotonic(), get_context("spawn")
    with tempfile.TemporaryDirectory() as place, ProcessPoolExecutor(workers, fork, begin, (place,)) as pool:
        if every:
            tries = pool.submit(number_of_tries, every).result() - first
        numbers = range(first, first + tries)
        found = pool.map(one_try, repeat(seed), numbers, repeat(every), chunksize=10)
        for number, (name, what, end, fault) in zip(numbers, found, strict=True):
            ends.add(what.split()[0], end, f"try {number}, {name}, {what}: {fault}" if fault else "")
            if minutes and time.monotonic() - began > 60 * minutes:
                pool.shutdown(cancel_futures=True)
                break
    counts = {
        **{"tries": ends.total(), "seed": seed, "seconds": f"{time.monotonic() - began:.0f}"},
        "ended with the bytes of an undisturbed run": ends.total(end="the bytes"),
        "ended with a sentence that the run has to begin anew": ends.total(end="begins anew"),
        "ended otherwise, which is a fault": ends.faults,
        **{f"tries with the damage *{how}*": ends.total(how) for how in sorted(HOWS)},
    }
    print("\n".join(f"{what}: {number}" for what, number in counts.items()))
    if record:
        write("stores.csv", [("what", "how many"), *counts.items()])
    return bool(ends.faults)


if __name__ == "__main__":
    sys.exit(main())
