# SPDX-License-Identifier: BSD-3-Clause
"""Every write of a command fails once: what is then on the disk, and what the command says."""

import time
from itertools import count, cycle

from fuzz import pool
from fuzz.corpus import build
from fuzz.faults import CALLS, ERRORS, SIZES
from fuzz.lines import Try

OLD = b"what was there before"

COMMANDS = {
    "png": "synth L.png -o out.png --size 40x40 --method multires",
    "png of 16 bits": "synth uint16-3.npy -o out.png --size 24x24 --method multires",
    "npy": "synth uint8.npy -o out.npy --size 40x40 --method multires",
    "tif": "synth float32.npy -o out.tif --size 20x20 --method multires",
    "webp": "synth RGB.png -o out.webp --size 40x40 --method multires",
    "jpg": "synth L.png -o out.jpg --size 40x40 --method multires",
    "bmp": "synth L.png -o out.bmp --size 40x40 --method multires",
    "several": "synth L.png -o out.png --source-map map.npz --also RGB.png=other.png --size 20x20 --method multires",
    "source map png": "synth L.png -o out.npy --source-map map.png --size 20x20 --method multires",
    "stages": "synth L.png -o out.png --size 8x8 --method multires --levels 2 --stages pages",
    "report": "synth L.png -o out.png --size 8x8 --method multires --levels 2 --report pages",
    "fill": "fill L.png --mask hole.png -o out.png --order 1 --source-map map.npy",
    "extend": "extend L.png --left 2 -o out.png --order 1",
    "zarr": "simulate L.png -o out.zarr --size 8x8 --order 1 --number 1",
    "nc": "simulate L.png -o out.nc --size 8x8 --order 1 --number 1",
    "npz": "simulate L.png -o out.npz --size 8x8 --order 1 --number 1",
    "block npz": "solid L.png -o out.npz --size 12 --iterations 0",
    "block nrrd": "solid L.png -o out.nrrd --size 12 --iterations 0",
    "block tif": "solid L.png -o out.tif --size 12 --iterations 0",
    "slices": "solid L.png -o out --size 4 --iterations 0",
    "view": "solid L.png -o out.npy --size 6 --iterations 0 --view view.png",
    "mix": "mix L.png uint8.npy -o out.png --size 24x24 --iterations 0",
    "ising": "ising --size 4x4 --sweeps 2 --burn-in 0 --seeds 2 --temperature 2 --schedules coloring -o pages",
}
"""Name -> a command that writes; each kind of file once."""

NEWLY = ("pages", "out", "out.zarr")
"""Folders: nothing stands there before."""

MOST = 6
"""Calls of a kind that fail in turn, where a folder takes hundreds."""


def _try(line, fault=None):
    files = {name: data for files in build().values() for name, data in files.items()}
    words = [*line.split(), "-q"] if line.startswith("ising") else [*line.split(), "--seed", "1", "-q"]
    used = {name: files[name] for word in words for name in word.replace("=", " ").split() if name in files}
    outputs = [word for word in words if word.startswith(("out.", "map.", "view."))]
    outputs += [word.partition("=")[2] for word in words if "=" in word]
    old = [name for name in outputs if name not in NEWLY]
    return Try(words, used | dict.fromkeys(old, OLD), "failing writes", old, None, fault)


def write_faults(record, workers, tell, end):
    """Run every command with each of its calls failing, one at a time.

    Parameters
    ----------
    record : fuzz.record.Record
    workers : int
    tell : callable
        Called after every try.
    end : float
        When to stop in any case, by `time.monotonic`.
    """
    jobs = [(name, call) for name in COMMANDS for call in (*CALLS, "size")]
    state = {}

    def questions():
        """The next failing call of some job, until one has no more; jobs take turns so that workers do not wait."""
        todo = {job: iter(SIZES) if job[1] == "size" else count(1) for job in jobs}
        errors = cycle(ERRORS)
        while todo and time.monotonic() < end:
            for job in list(todo):
                if state.get(job) == "over":
                    del todo[job]
                    continue
                number = next(todo[job], None)
                if number is None or (number > MOST and job[1] != "size"):
                    del todo[job]
                    continue
                error = "EFBIG" if job[1] == "size" else next(errors)
                one = _try(COMMANDS[job[0]], (job[1], number, error))
                yield one.as_json() | {"job": job}

    def took(question, answer):
        kind, args, result = answer
        job = tuple(question["job"])
        if not result["fired"] and job[1] != "size":
            state[job] = "over"
        record.add(
            lambda: Try.from_json({k: v for k, v in question.items() if k != "job"}), kind, args, result, "writes"
        )
        tell()

    pool.run(questions(), workers, took)
