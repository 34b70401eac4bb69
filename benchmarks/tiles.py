# SPDX-License-Identifier: BSD-3-Clause
"""An output in tiles against one that is made at once: seconds, and the memory of the largest process.

    python benchmarks/tiles.py [--size 4096] [--tiles 2048] [--workers 2] [--ways whole,here,workers] [--device TEXT]

Each way runs in processes of its own: ``whole`` is simdtex.synthesize, ``here`` one process that does tile after tile,
``workers`` a cluster on this machine whose workers share its cores out. All have the same cores together. The last
column has the same digest in every row, since all make the same bytes.
"""

import hashlib
import json
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import common
import numpy as np
import psutil
from skimage import data

import simdtex
from simdtex.jobs.synthesis.job import plan_synthesis

SAMPLE = data.brick()[:128, :128]


def run(way, size, tiles, workers, folder, device):
    """One way, in this process; prints its seconds and a digest of the picture, made row of tiles by row of tiles."""
    given, shape = {"rng": 1, "device": device}, (size, size)

    def job():
        if way == "whole":
            return simdtex.synthesize(SAMPLE, shape, **given)
        store = simdtex.TileStore(Path(folder) / "out.zarr", tiles, workers if way == "workers" else None)
        return simdtex.synthesize(SAMPLE, shape, store=store, **given)

    (picture, seconds), digest = common.timed(job), hashlib.sha256()
    for top in range(0, size, 2048):
        digest.update(np.ascontiguousarray(np.asarray(picture[top : top + 2048])))
    print(json.dumps({"seconds": seconds, "digest": digest.hexdigest()[:12]}))


def watched(words):
    """What one way in processes of its own prints, and the memory of the largest of them."""
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, __file__, *words, "--folder", place]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            peaks, tree = {}, psutil.Process(process.pid)
            while process.poll() is None:
                with suppress(psutil.NoSuchProcess):
                    for one in [tree, *tree.children(recursive=True)]:
                        peaks[one.pid] = max(peaks.get(one.pid, 0), one.memory_info().rss)
                time.sleep(0.05)
            return json.loads(process.stdout.read().splitlines()[-1]) | {"peak": max(peaks.values())}


@common.command
def main(size=2048, tiles=1024, workers=2, ways="whole,here,workers", folder="", device=None):
    if folder:  # the process of one way
        run(ways, size, tiles, workers, folder, device)
        return
    print("\n".join(simdtex.TileStore("", tiles).layout(plan_synthesis(SAMPLE, (size, size))).lines()))
    words, rows = [f"--size={size}", f"--tiles={tiles}", f"--workers={workers}"], []
    for way in ways.split(","):
        found = watched([*words, *([f"--device={device}"] if device else []), "--ways", way])
        figures = f"{found['seconds']:.1f}", f"{size**2 / found['seconds'] / 1e6:.3f}", f"{found['peak'] / 2**20:.0f}"
        rows.append([way, *figures, found["digest"]])
    common.table("", ["way", "seconds", "Mpixel/s", "MiB of the largest process", "digest"], rows)


if __name__ == "__main__":
    main()
