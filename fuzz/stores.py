# SPDX-License-Identifier: BSD-3-Clause
"""Damage what runs keep, go on with it, and check the result.

    python -m fuzz.stores [--tries 200 | --every 1] [--minutes M] [--seed 1] [--first 0] [--workers N] [--record]

Each try takes a run in tiles, or one with a checkpoint, as it was at a random moment or when it was finished; flips
bits of one of its files, cuts, empties or removes it, or copies another file over it; or takes each file from one of
two moments, as a backup made during the run has them; and goes on. It passes if the picture has its bytes, or a
sentence says that the run has to begin anew. Every fault is printed with the try's number.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import simdtex
from fuzz.record import write_counts
from simdtex import Checkpoint, distributed
from simdtex.distributed import layout
from simdtex.distributed.turns import context

RECORD = Path(__file__).resolve().parent.parent / "docs" / "fuzzing" / "stores.csv"

SHAPE = 20, 21
GREY = np.random.default_rng(2).integers(0, 9, (20, 22)).astype(np.uint8).repeat(2, 1)[:, :22]
COLOUR = np.stack([GREY, GREY[::-1], 9 - GREY], -1)
KNOWN = np.ma.masked_array(np.full(SHAPE, 4, np.uint8), np.indices(SHAPE).sum(0) % 9 > 0)
GUIDE = GREY // 4, np.indices(SHAPE).sum(0).astype(np.uint8) // 20
SMALL = {"order": 1, "levels": 2, "xi": -8.0, "rng": 11, "device": "reference"}

TILED = {
    "known values": (GREY, 12, SMALL | {"known": KNOWN}),
    "seam": (GREY, 16, SMALL | {"boundary": "torus", "finish": 1.0}),
    "colour": (COLOUR, 18, SMALL | {"channel_axis": -1}),
    "guide": (GREY, 16, SMALL | {"guide": GUIDE}),
}
"""Runs in tiles: the sample, the side of a tile, and options."""

ALONE = ("bit", "cut", "empty", "remove")
HOWS = (*ALONE, "bits", "another", "moments")
"""Kinds of damage."""

RESUMES = 6
"""Times that a run is gone on with: each level begins again once, and more would be a fault."""


class Run:
    """A run, kept as it was at every moment: ``moments`` are folders, and ``expected`` is the picture."""

    def __init__(self, name, folder):
        self.name, self.folder = name, folder
        folder.mkdir()
        self.moments, self.place = [], folder / "run"
        self.place.mkdir()
        if name == "checkpoint":
            options = SMALL | {"known": KNOWN}
            self._again = lambda kept, **how: simdtex.synthesize(GREY, SHAPE, checkpoint=kept, **how, **options)
            self.expected = self._again(Checkpoint(self.place / "state", every=0), callback=self._keep)
        else:
            sample, tile, options = TILED[name]
            store = self.place / "o.zarr"
            distributed.synthesize(sample, SHAPE, store, tiles=tile, source_map=True, callback=self._keep, **options)
            self._keep(None)  # the finished store
            self.expected = simdtex.synthesize(sample, SHAPE, **options)

    def _keep(self, progress):
        """Keep the present moment; files that a thread of Zarr writes now have hidden names."""
        self.moments.append(self.folder / str(len(self.moments)))
        shutil.copytree(self.place, self.moments[-1], ignore=shutil.ignore_patterns("*.lock", ".simdtex-*"))

    def go_on(self, folder):
        """Return the picture that the run in a folder makes."""
        if self.name == "checkpoint":
            return self._again(Checkpoint(folder / "state"))
        context.cache_clear()
        return distributed.resume(folder / "o.zarr", device="reference").compute()


def files(folder):
    """Return the files of a folder."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def damage(folder, name, how, rng):
    """Damage a file of a folder."""
    path = folder / name
    data = bytearray(path.read_bytes())
    if how in ("bit", "bits"):
        for _ in range(1 if how == "bit" else 20):
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    elif how == "cut":
        data = data[: rng.integers(len(data))]
    elif how == "another":  # most likely of the same array
        others = [one for one in files(folder) if one != name] or [name]
        near = [one for one in others if one.parent.parent == name.parent.parent] or others
        data = (folder / near[rng.integers(len(near))]).read_bytes()
    path.unlink() if how == "remove" else path.write_bytes(b"" if how == "empty" else data)


def mix(folder, moment, rng):
    """Replace half of the files of a folder by those of another moment."""
    for name in files(moment):
        if rng.random() < 0.5:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(moment / name, folder / name)


def tried(run, folder):
    """Go on with a damaged run; return how it ended."""
    for _ in range(RESUMES):
        try:
            return "the bytes" if np.array_equal(run.go_on(folder), run.expected) else "ANOTHER PICTURE"
        except ValueError as error:
            said = any(words in str(error) for words in ("begin anew", "run the command again", "give another"))
            if said and ("damaged" in str(error) or " is no " in str(error)):
                return "begins anew"
            if str(error).startswith("Stored and computed checksum"):  # Zarr's, of the array that was returned
                return "begins anew"
            if "simdtex resume" not in str(error):
                return f"NO REMEDY: {error}"
        except Exception as error:
            return f"TRACEBACK: {type(error).__name__}: {error}"
    return "NO END"


def in_one_thread():
    """Have Zarr and Dask do all in this thread: handing a small file over takes longer than reading it."""
    import asyncio
    from concurrent.futures import Future

    import dask

    loop = asyncio.new_event_loop()

    async def at_once(function, *args, **named):
        return function(*args, **named)

    def run(coroutine, _):
        future = Future()
        future.set_result(loop.run_until_complete(coroutine))
        return future

    asyncio.to_thread, asyncio.run_coroutine_threadsafe = at_once, run
    dask.config.set(scheduler="synchronous")


_place, _runs = [], []


def begin(place):
    """Prepare a process for tries."""
    in_one_thread()
    warnings.simplefilter("ignore")
    layout.CHUNK = 16  # a tile of 18 has four chunks
    _place.append(tempfile.mkdtemp(dir=place))
    _runs.extend(Run(name, Path(_place[0], name)) for name in (*TILED, "checkpoint"))


@cache
def each(moments):
    """Return every file of every run at so many moments with every kind of damage of `ALONE`."""
    found = []
    for number, run in enumerate(_runs):
        for n in range(moments):
            moment = run.moments[(2 * n + 1) * len(run.moments) // (2 * moments)]
            found += [(number, moment, name, how) for name in files(moment) for how in ALONE]
    return found


def one_try(seed, number, moments):
    """Return the run of a try, what was damaged, and how it ended."""
    rng = np.random.default_rng((seed, number))
    if moments:
        which, moment, name, how = each(moments)[number]
        run = _runs[which]
    else:
        run = _runs[rng.integers(len(_runs))]
        moment = run.moments[rng.integers(len(run.moments))]
        names = files(moment)
        name, how = names[rng.integers(len(names))], str(rng.choice(HOWS))
    folder = Path(_place[0], "try")
    shutil.copytree(moment, folder)
    if how == "moments":
        mix(folder, run.moments[rng.integers(len(run.moments))], rng)
    else:
        damage(folder, name, how, rng)
    end = tried(run, folder)
    shutil.rmtree(folder)
    return run.name, f"{how} {name}", end


def main():
    parser = argparse.ArgumentParser(prog="python -m fuzz.stores", description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=np.inf, help="stop after so long, whatever is left to try")
    parser.add_argument("--every", type=int, default=0, metavar="N", help="damage every file at N moments of each run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="the number of the first try")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--record", action="store_true", help=f"write docs/fuzzing/{RECORD.name}")
    given = parser.parse_args()
    ends, hows, began = Counter(), Counter(), time.monotonic()
    with (
        tempfile.TemporaryDirectory() as place,
        ProcessPoolExecutor(given.workers, get_context("spawn"), begin, (place,)) as pool,
    ):
        tries = len(pool.submit(each, given.every).result()) - given.first if given.every else given.tries
        numbers = range(given.first, given.first + tries)
        found = pool.map(one_try, repeat(given.seed), numbers, repeat(given.every), chunksize=10)
        for number, (name, what, end) in zip(numbers, found, strict=True):
            hows[what.split()[0]] += 1
            ends[end if end.islower() else "fault"] += 1
            if not end.islower():
                print(f"try {number}: {name}, {what}: {end}", flush=True)
            if time.monotonic() - began > 60 * given.minutes:
                pool.shutdown(cancel_futures=True)
                break
            if sys.stderr.isatty() and not number % 10:
                print(f"\r{number} ", end="", file=sys.stderr, flush=True)
    tries = ends.total()
    print(f"{tries} tries, seed {given.seed}: " + ", ".join(f"{ends[end]} {end}" for end in sorted(ends)))
    if given.record:
        counts = {
            **{"tries": tries, "seed": given.seed, "seconds": f"{time.monotonic() - began:.0f}"},
            "ended with the bytes of an undisturbed run": ends["the bytes"],
            "ended with a sentence that the run has to begin anew": ends["begins anew"],
            "ended otherwise, which is a fault": ends["fault"],
            **{f"tries with the damage *{how}*": hows[how] for how in sorted(hows)},
        }
        write_counts(RECORD, counts)
    return bool(ends["fault"])


if __name__ == "__main__":
    sys.exit(main())
