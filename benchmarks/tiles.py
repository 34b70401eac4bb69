"""An output in tiles against one that is made at once: seconds, and the memory of the largest process.

    python benchmarks/tiles.py --size 4096 --tiles 2048 --workers 2
    python benchmarks/tiles.py --size 16384 --tiles 2048 --workers 2 --only workers

Each way runs in processes of its own: ``whole`` is simdtex.synthesize, ``here`` one process that does tile after tile,
``workers`` a cluster on this machine whose workers share its cores out. All have the same cores together. The
efficiency is the time of ``here`` over that of ``workers``. A last line says whether all made the same bytes.

    python benchmarks/tiles.py --size 32768 --sizes > docs/tiles/sizes.csv

prints redundant work and memory by the side of tiles instead.

    python benchmarks/tiles.py --scaling > docs/tiles/scaling.csv

measures what a turn of a tile takes on one core, and a task, its note and a turn for the leader, and computes from them
the time of an output of a million pixels to the side by any number of workers.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from math import ceil
from pathlib import Path

import numpy as np
import psutil
from skimage import data

import simdtex
from simdtex import distributed
from simdtex.distributed.cluster import connected
from simdtex.distributed.layout import planned
from simdtex.distributed.store import Store, Turn
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.plan import plan as planned_run
from simdtex.methods.mrf.tiles import Tally
from simdtex.model.pictures import Pictures

WAYS = ("whole", "here", "workers")


def sample(name: str) -> np.ndarray:
    """A picture of scikit-image: 128 pixels to the side of it."""
    return getattr(data, name)()[:128, :128]


def run(given: argparse.Namespace, folder: str) -> None:
    """One way, in this process; prints what it took and a digest of the picture, made row of tiles by row of tiles."""
    pixels = sample(given.sample)
    shape, options = (given.size, given.size), {"rng": 1, "channel_axis": -1 if pixels.ndim == 3 else None}
    device, turns, flushing = given.device, {}, [0.0]

    def fsync(descriptor: int, real: Callable = os.fsync) -> None:
        since = time.perf_counter()
        real(descriptor)
        flushing[0] += time.perf_counter() - since

    os.fsync = fsync
    began = time.perf_counter()
    if given.way == "whole":
        picture = simdtex.synthesize(pixels, shape, device=device, **options)
    else:

        def callback(progress: simdtex.Progress) -> None:
            if progress.tile == progress.tiles:
                turns[f"level {progress.level} {progress.phase}"] = time.perf_counter() - began

        workers = given.workers if given.way == "workers" else None
        where = Path(folder) / "out.zarr"
        picture = distributed.synthesize(
            pixels, shape, where, tiles=given.tiles, workers=workers, device=device, callback=callback, **options
        )
    seconds, digest = time.perf_counter() - began, hashlib.sha256()
    for top in range(0, given.size, 2048):
        digest.update(np.ascontiguousarray(np.asarray(picture[top : top + 2048])))
    print(json.dumps({"seconds": seconds, "digest": digest.hexdigest(), "until": turns, "flushing": flushing[0]}))


def measured(given: argparse.Namespace, way: str) -> dict:
    """One way in processes of its own, watched."""
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        told = {name: getattr(given, name) for name in ("size", "tiles", "workers", "sample", "device")}
        words = [word for name, value in told.items() if value is not None for word in (f"--{name}", str(value))]
        command = [sys.executable, __file__, *words, "--way", way, "--folder", folder]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            peaks: dict[int, int] = {}
            tree = psutil.Process(process.pid)
            while process.poll() is None:
                try:
                    for one in [tree, *tree.children(recursive=True)]:
                        peaks[one.pid] = max(peaks.get(one.pid, 0), one.memory_info().rss)
                except psutil.NoSuchProcess:
                    pass
                time.sleep(0.05)
            found = json.loads(process.stdout.read().splitlines()[-1])
        return found | {"peak": max(peaks.values())}


def sizes(size: int) -> None:
    """Print redundant work and memory by the side of tiles."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["side of a tile", "tiles", "redundant work, %", "memory, MiB"])
    colour = data.astronaut()[:128, :128]
    for side in (256, 512, 1024, 2048, 4096, 8192):
        plan = distributed.plan(colour, (size, size), tiles=side, channel_axis=-1)
        finest = plan.levels[0]
        writer.writerow([side, finest.count, f"{100 * finest.redundant:.0f}", f"{plan.memory / 2**20:.0f}"])


def nothing(number: int) -> int:
    """A task that takes no time."""
    return number


def scaling(device: str | None) -> None:
    """Print what one core and the leader take, and the time of a large output by the number of workers."""
    side, large, pixels, turns = 1024, 10**6, sample("brick"), {}
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # before a device is opened
    os.environ |= {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1"}

    def callback(progress: simdtex.Progress) -> None:
        if progress.level == 0 and progress.tile == progress.tiles:
            turns[progress.phase, progress.sweep] = time.perf_counter()

    with tempfile.TemporaryDirectory() as folder:
        distributed.synthesize(
            pixels, (2 * side, 2 * side), Path(folder) / "out.zarr", tiles=side, device=device, callback=callback, rng=1
        )
    count, ends = len(turns), list(turns.values())
    tile = (ends[-1] - ends[0]) / (count - 1) / 4  # the first end is that of a turn whose beginning is not known
    with connected(1) as client:
        client.gather([client.submit(nothing, number, pure=False) for number in range(100)])
        began = time.perf_counter()
        client.gather([client.submit(nothing, number, pure=False) for number in range(2000)])
        task = (time.perf_counter() - began) / 2000
    pictures = Pictures((pixels[..., None],))
    with tempfile.TemporaryDirectory() as folder:
        small = planned_run(pictures, (side, side), Options())
        many = planned(small, 1, side // 32)
        store = Store.create(str(Path(folder, "s.zarr")), small, 1, many, channels=False, source=False, maps={})
        turn, rows = Turn(1, "begin", 0), many.levels[0].tasks
        store.prepare(turn, store.work, pixels.size)
        for number in range(rows):
            store.note(turn, number, Tally(np.arange(pixels.size), 1, 1))
        began = time.perf_counter()
        store.total(turn)
        note = (time.perf_counter() - began) / rows
        began = time.perf_counter()
        store.save(turn, np.zeros(pixels.size, np.float32))
        between = time.perf_counter() - began
    print(f"a turn of a tile {tile:.3f} s, a task {1e3 * task:.2f} ms, its note {1e3 * note:.2f} ms, ", file=sys.stderr)
    print(f"a turn of the leader {1e3 * between:.0f} ms; {count} turns of a level", file=sys.stderr)
    levels = planned(planned_run(pictures, (large, large), Options()), 1, side).levels
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["workers", "days", "times as fast as one", "efficiency", "share of the leader"])
    alone = 0.0
    for workers in (1, 10, 100, 1000, 10000):
        seconds = leader = 0.0
        for level in levels:
            handing, after = level.tasks * task, level.tasks * note + between
            seconds += count * (max(ceil(level.tasks / workers) * level.together * tile, handing) + after)
            leader += count * (handing + after)
        alone = alone or seconds
        times = alone / seconds
        writer.writerow(
            [workers, f"{seconds / 86400:.2f}", f"{times:.0f}", f"{times / workers:.2f}", f"{leader / seconds:.2f}"]
        )


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=2048, help="sides of the output, pixels")
    parser.add_argument("--tiles", type=int, default=1024, help="sides of a tile")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--sample", default="brick", help="of skimage.data")
    parser.add_argument("--device")
    parser.add_argument("--only", choices=WAYS, action="append", help="only this way; may be repeated")
    parser.add_argument("--folder", help="where the stores are")
    parser.add_argument("--sizes", action="store_true", help="print a table of sides of tiles instead")
    parser.add_argument("--scaling", action="store_true", help="print a table of numbers of workers instead")
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.way:
        run(given, given.folder)
        return
    if given.sizes or given.scaling:
        sizes(given.size) if given.sizes else scaling(given.device)
        return
    pixels = sample(given.sample)
    axis = -1 if pixels.ndim == 3 else None
    plan = distributed.plan(pixels, (given.size, given.size), tiles=given.tiles, channel_axis=axis)
    print("\n".join(plan.lines()))
    found = {}
    for way in given.only or WAYS:
        found[way] = one = measured(given, way)
        rate = given.size**2 / one["seconds"] / 1e6
        print(f"{way:8} {one['seconds']:8.1f} s  {rate:6.3f} Mpixel/s  largest process {one['peak'] / 2**20:6.0f} MiB")
        for name, until in one["until"].items():
            print(f"           {name} ended after {until:.1f} s")
        if way == "here":
            print(f"           flushing to the disk took {one['flushing'] / one['seconds']:.1%} of the time")
    if {"here", "workers"} <= set(found):
        ratio = found["here"]["seconds"] / found["workers"]["seconds"]
        print(f"efficiency of {given.workers} workers against one process with all their cores: {ratio:.2f}")
    if len(found) > 1:
        print("same bytes:", len({one["digest"] for one in found.values()}) == 1)


if __name__ == "__main__":
    main()
