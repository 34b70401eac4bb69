# SPDX-License-Identifier: BSD-3-Clause
"""An output in tiles against one that is made at once: seconds, and the memory of the largest process.

    python benchmarks/tiles.py [--size 4096] [--tiles 2048] [--workers 2] [--only here --only workers] [--sample brick]
                               [--folder DIR] [--device TEXT]

Each way runs in processes of its own: ``whole`` is simdtex.synthesize, ``here`` one process that does tile after tile,
``workers`` a cluster on this machine whose workers share its cores out. All have the same cores together. The
efficiency is the time of ``here`` over that of ``workers``. A last line says whether all made the same bytes.
``--folder`` is where the stores are.

    python benchmarks/tiles.py --size 32768 --sizes > docs/tiles/sizes.csv

prints redundant work and memory by the side of tiles instead.

    python benchmarks/tiles.py --scaling > docs/tiles/scaling.csv

measures what a turn of a tile takes on one core, and a task, its note and a turn for the leader, and computes from them
the time of an output of a million pixels to the side by any number of workers.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from math import ceil
from pathlib import Path

import common
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


def run(way, pixels, size, tiles, workers, folder, device):
    """One way, in this process; prints what it took and a digest of the picture, made row of tiles by row of tiles."""
    turns, flushing, real, shape = {}, [], os.fsync, (size, size)
    os.fsync = lambda descriptor: flushing.append(common.timed(real, descriptor)[1])
    given = {"rng": 1, "channel_axis": common.axis(pixels), "device": device}
    began = time.perf_counter()

    def callback(progress):
        if progress.tile == progress.tiles:
            turns[f"level {progress.level} {progress.phase}"] = time.perf_counter() - began

    if way == "whole":
        picture = simdtex.synthesize(pixels, shape, **given)
    else:
        given |= {"tiles": tiles, "workers": workers if way == "workers" else None, "callback": callback}
        picture = distributed.synthesize(pixels, shape, Path(folder) / "out.zarr", **given)
    seconds, digest = time.perf_counter() - began, hashlib.sha256()
    for top in range(0, size, 2048):
        digest.update(np.ascontiguousarray(np.asarray(picture[top : top + 2048])))
    print(json.dumps({"seconds": seconds, "digest": digest.hexdigest(), "until": turns, "flushing": sum(flushing)}))


def measured(words, folder):
    """One way in processes of its own, watched."""
    with tempfile.TemporaryDirectory(dir=folder) as place:
        command = [sys.executable, __file__, *words, "--folder", place]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            peaks, tree = {}, psutil.Process(process.pid)
            while process.poll() is None:
                with common.suppress(psutil.NoSuchProcess):
                    for one in [tree, *tree.children(recursive=True)]:
                        peaks[one.pid] = max(peaks.get(one.pid, 0), one.memory_info().rss)
                time.sleep(0.05)
            found = json.loads(process.stdout.read().splitlines()[-1])
        return found | {"peak": max(peaks.values())}


def compare(pixels, size, tiles, workers, ways, words, folder):
    """Print the plan, and a line for each way."""
    plan = distributed.plan(pixels, (size, size), tiles=tiles, channel_axis=common.axis(pixels))
    print("\n".join(plan.lines()))
    found = {}
    for way in ways:
        found[way] = one = measured([*words, "--way", way], folder)
        rate = size**2 / one["seconds"] / 1e6
        print(f"{way:8} {one['seconds']:8.1f} s  {rate:6.3f} Mpixel/s  largest process {one['peak'] / 2**20:6.0f} MiB")
        for name, until in one["until"].items():
            print(f"           {name} ended after {until:.1f} s")
        if way == "here":
            print(f"           flushing to the disk took {one['flushing'] / one['seconds']:.1%} of the time")
    if {"here", "workers"} <= set(found):
        ratio = found["here"]["seconds"] / found["workers"]["seconds"]
        print(f"efficiency of {workers} workers against one process with all their cores: {ratio:.2f}")
    if len(found) > 1:
        print("same bytes:", len({one["digest"] for one in found.values()}) == 1)


def print_sizes(size):
    """Print redundant work and memory by the side of tiles."""
    rows, colour = [], data.astronaut()[:128, :128]
    for side in (256, 512, 1024, 2048, 4096, 8192):
        plan = distributed.plan(colour, (size, size), tiles=side, channel_axis=-1)
        finest = plan.levels[0]
        rows.append([side, finest.count, f"{100 * finest.redundant:.0f}", f"{plan.memory / 2**20:.0f}"])
    common.write(None, ["side of a tile", "tiles", "redundant work, %", "memory, MiB"], rows)


def nothing(number):
    """A task that takes no time."""
    return number


def turn_of_a_tile(pixels, side, device):
    """Seconds of a turn of a tile on one core, and the turns of a level."""
    turns = {}

    def callback(progress):
        if progress.level == 0 and progress.tile == progress.tiles:
            turns[progress.phase, progress.sweep] = time.perf_counter()

    with tempfile.TemporaryDirectory() as folder:
        given = {"tiles": side, "device": device, "callback": callback, "rng": 1}
        distributed.synthesize(pixels, (2 * side, 2 * side), Path(folder) / "out.zarr", **given)
    ends = list(turns.values())  # the first end is that of a turn whose beginning is not known
    return (ends[-1] - ends[0]) / (len(turns) - 1) / 4, len(turns)


def task_of_the_leader():
    """Seconds that the leader takes for a task."""
    with connected(1) as client:

        def done(count):
            client.gather([client.submit(nothing, number, pure=False) for number in range(count)])

        done(100)
        return common.timed(done, 2000)[1] / 2000


def note_and_turn_of_the_leader(pixels, side):
    """Seconds that the leader takes for the note of a task, and for a turn."""
    small = planned_run(Pictures((pixels[..., None],)), (side, side), Options())
    many = planned(small, 1, side // 32)
    with tempfile.TemporaryDirectory() as folder:
        store = Store.create(str(Path(folder, "s.zarr")), small, 1, many, channels=False, source=False, maps={})
        turn, rows = Turn(1, "begin", 0), many.levels[0].tasks
        store.prepare(turn, store.work, pixels.size)
        for number in range(rows):
            store.note(turn, number, Tally(np.arange(pixels.size), 1, 1))
        note = common.timed(store.total, turn)[1] / rows
        return note, common.timed(store.save, turn, np.zeros(pixels.size, np.float32))[1]


def print_scaling(pixels, device):
    """Print what one core and the leader take, and the time of a large output by the number of workers."""
    side, large = 1024, 10**6
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # before a device is opened
    os.environ |= {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1"}
    (tile, count), task = turn_of_a_tile(pixels, side, device), task_of_the_leader()
    note, between = note_and_turn_of_the_leader(pixels, side)
    print(f"a turn of a tile {tile:.3f} s, a task {1e3 * task:.2f} ms, its note {1e3 * note:.2f} ms, ", file=sys.stderr)
    print(f"a turn of the leader {1e3 * between:.0f} ms; {count} turns of a level", file=sys.stderr)
    run = planned_run(Pictures((pixels[..., None],)), (large, large), Options())
    rows, alone = [], 0.0
    for workers in (1, 10, 100, 1000, 10000):
        seconds = leader = 0.0
        for level in planned(run, 1, side).levels:
            handing, after = level.tasks * task, level.tasks * note + between
            seconds += count * (max(ceil(level.tasks / workers) * level.together * tile, handing) + after)
            leader += count * (handing + after)
        alone = alone or seconds
        figures = (alone / seconds / workers, leader / seconds)
        rows.append([workers, f"{seconds / 86400:.2f}", f"{alone / seconds:.0f}", *(f"{one:.2f}" for one in figures)])
    common.write(None, ["workers", "days", "times as fast as one", "efficiency", "share of the leader"], rows)


@common.command
def main(
    size=2048,
    tiles=1024,
    workers=2,
    sample="brick",
    device=str,
    only=list,
    folder=str,
    sizes=False,
    scaling=False,
    way=str,
):
    pixels = getattr(data, sample)()[:128, :128]
    if way:
        run(way, pixels, size, tiles, workers, folder, device)
    elif sizes:
        print_sizes(size)
    elif scaling:
        print_scaling(pixels, device)
    else:
        words = [f"--size={size}", f"--tiles={tiles}", f"--workers={workers}", f"--sample={sample}"]
        words += [f"--device={device}"] if device else []
        compare(pixels, size, tiles, workers, only or ("whole", "here", "workers"), words, folder)


if __name__ == "__main__":
    main()
