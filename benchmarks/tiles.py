"""An output in tiles against one that is made at once: seconds, and the memory of the largest process.

    python benchmarks/tiles.py --size 4096 --tiles 2048 --workers 2
    python benchmarks/tiles.py --size 16384 --tiles 2048 --workers 2 --only workers

Each way runs in processes of its own: ``whole`` is simdtex.synthesize, ``here`` one process that does tile after tile,
``workers`` a cluster on this machine whose workers share its cores out. All have the same cores together. The
efficiency is the time of ``here`` over that of ``workers``. A last line says whether all made the same bytes.

    python benchmarks/tiles.py --size 32768 --sizes > docs/tiles/sizes.csv

prints redundant work and memory by the side of tiles instead.
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
from pathlib import Path

import numpy as np
import psutil
from skimage import data

import simdtex
from simdtex import distributed

WAYS = ("whole", "here", "workers")


def sample(name: str) -> np.ndarray:
    """A picture of scikit-image, or of a file: 128 pixels to the side of it."""
    if "." in name:
        from skimage import io

        return io.imread(name)[:128, :128, :3]
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


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=2048, help="sides of the output, pixels")
    parser.add_argument("--tiles", type=int, default=1024, help="sides of a tile")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--sample", default="brick", help="of skimage.data, or a file")
    parser.add_argument("--device")
    parser.add_argument("--only", choices=WAYS, action="append", help="only this way; may be repeated")
    parser.add_argument("--folder", help="where the stores are")
    parser.add_argument("--sizes", action="store_true", help="print a table of sides of tiles instead")
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.way:
        run(given, given.folder)
        return
    if given.sizes:
        sizes(given.size)
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
