# SPDX-License-Identifier: BSD-3-Clause
"""Damage the stores of runs in tiles, go on with them, and check the result.

Each try takes a run in tiles as it was at a random moment or when it was finished; flips bits of one of its files,
cuts, empties or removes it, or copies another file over it; or takes each file from one of two moments, as a backup
made during the run has them; and goes on. A try passes if the picture has its bytes, or a sentence says that the run
has to begin anew.
"""

import shutil
import warnings
from pathlib import Path

import numpy as np

import simdtex
from fuzz.corpus import damaged, put
from simdtex.jobs.tiles import layout
from simdtex.jobs.tiles.tasks import context

SHAPE = 20, 21
GREY = np.random.default_rng(2).integers(0, 9, (20, 22)).astype(np.uint8).repeat(2, 1)[:, :22]
COLOUR = np.stack([GREY, GREY[::-1], 9 - GREY], -1)
KNOWN = np.ma.masked_array(np.full(SHAPE, 4, np.uint8), np.indices(SHAPE).sum(0) % 9 > 0)
SMALL = {"order": 1, "levels": 2, "xi": -8.0, "rng": 11, "device": "reference"}

TILED = {
    "known values": (GREY, 12, {"known": KNOWN}),
    "seam": (GREY, 16, {"boundary": "torus", "finish": 1.0}),
    "colour": (COLOUR, 18, {"channel_axis": -1}),
}
"""Runs in tiles: the sample, the side of a tile, and options."""

HOWS = ("bit", "cut", "empty", "remove", "bits", "another", "moments")
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
        store = simdtex.TileStore(place / "o.zarr", tile, source_map=True)
        simdtex.synthesize(sample, SHAPE, store=store, callback=keep, **given)
        keep(None)  # the finished store
        self.expected = simdtex.synthesize(sample, SHAPE, **given)

    def ended(self, folder):
        """Go on with the run in a folder; return how it ended, and what is wrong with that."""
        for _ in range(RESUMES):
            context.cache_clear()
            try:
                made = simdtex.TileStore(folder / "o.zarr").resume("reference").compute()
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


def begin(place, _device):
    """Prepare a process for tries."""
    warnings.simplefilter("ignore")
    layout.CHUNK = 16  # a tile of 18 has four chunks
    _runs.extend(Run(name, Path(place)) for name in TILED)


def one_try(rng):
    """Damage a store and go on with it; return as `fuzz.worker.one_try` does."""
    run = rng.choice(_runs)
    moment = rng.choice(run.moments)
    name, how, folder = rng.choice(files(moment)), rng.choice(HOWS), moment.with_name("try")
    shutil.copytree(moment, folder)
    if how == "moments":
        other = rng.choice(run.moments)
        for one in (one for one in files(other) if rng.random() < 0.5):
            put(folder / one, (other / one).read_bytes())
    elif how == "another":  # most likely of the same array
        others = [one for one in files(folder) if one != name] or [name]
        near = [one for one in others if one.parent.parent == name.parent.parent] or others
        put(folder / name, (folder / rng.choice(near)).read_bytes())
    else:
        put(folder / name, damaged((folder / name).read_bytes(), how, rng))
    end, fault = run.ended(folder)
    shutil.rmtree(folder)
    return f"{run.name}, {how}", end or "fault", [(f"{run.name}, {how} {name}", fault)] if fault else []
