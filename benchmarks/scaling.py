"""What more workers would do for an output in tiles, computed from what is measured here; as CSV.

    python benchmarks/scaling.py --tiles 1024 > docs/tiles/scaling.csv

Measured on this machine, with one core: what a tile takes a worker in every turn of an output of twice the tile's
side, for each site that it relaxes; and what the one process that leads the run takes for a turn, and for each of its
tiles: handing a task out through Dask's scheduler, and adding up what was noted. Computed: the time of an output of
10^6 x 10^6, with the redundant work of its tiles, in turns of which none begins before the one before has ended.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
from skimage import data

from simdtex import distributed
from simdtex.distributed.cluster import connected
from simdtex.distributed.drive import go_on
from simdtex.distributed.plan import laid
from simdtex.distributed.store import Store, Turn
from simdtex.distributed.tasks import do, forget
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.outline import outlined
from simdtex.methods.mrf.tiles import Tally

SIDE = 10**6
WORKERS = (1, 10, 100, 1000, 10_000)


def turns(sample: np.ndarray, tiles: int, device: str | None, folder: str) -> tuple[dict, float]:
    """Seconds a site, tile by tile, by level, kind and number of a turn; and the leader's of a turn."""
    side, options = 2 * tiles, Options()
    outline = outlined(sample, (side, side), options, 1)
    plan = laid(outline, [max(1, tiles >> number) for number in range(outline.levels)], 1)  # four tiles to each level
    store = Store.create(str(Path(folder) / "s.zarr"), outline, plan, None, sample.ndim == 3, False, "benchmark")
    took: dict[tuple[int, str], list[float]] = {}
    inside = 0.0

    def execute(turn, left):
        nonlocal inside
        for number in left:
            began = time.perf_counter()
            do(store.where, store.name, device, turn, number)
            seconds = time.perf_counter() - began
            level = plan.levels[turn.level]
            tile = level.tile(number)
            sites = level.relaxed(tile) if turn.phase == "sweep" else tile.rows * tile.cols
            took.setdefault((turn.level, turn.phase, turn.number), []).append(seconds / sites)
            inside += seconds
            yield number

    began = time.perf_counter()
    go_on(store, execute)
    leading = time.perf_counter() - began - inside
    forget()
    return took, leading / len(took)


def adding_up(candidates: int, folder: str, tiles: int = 500) -> float:
    """Seconds of the leader for what is noted of a tile."""
    outline = outlined(data.brick()[:64, :64, None], (tiles, 64), Options(order=1, levels=1), 1)
    plan = laid(outline, [1], 1)
    store, turn = (
        Store.create(str(Path(folder) / "t.zarr"), outline, plan, None, True, False, "benchmark"),
        Turn(9, "show", 0),
    )
    store.prepare(turn, replace(plan.levels[0], side=64, rows=64 * tiles, cols=64), 1, candidates)
    counts = np.random.default_rng(0).integers(0, 500, candidates).astype(np.int32)
    for number in range(tiles):
        store.told(turn, number, Tally(counts, 1, 1))
    began = time.perf_counter()
    store.total(turn, tiles)
    return (time.perf_counter() - began) / tiles


def handing_out(tasks: int = 2000) -> float:
    """Seconds of Dask's scheduler and client for a task that does nothing."""
    from distributed import as_completed

    with connected(1, None) as client:
        client.submit(int, 1, pure=False).result()
        began = time.perf_counter()
        for _ in as_completed(client.map(int, [1] * tasks, pure=False)):
            pass
        return (time.perf_counter() - began) / tasks


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiles", type=int, default=2048)
    parser.add_argument("--device")
    given = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        os.environ["POCL_MAX_PTHREAD_COUNT"] = "1"
    sample = data.brick()[:128, :128, None]
    with tempfile.TemporaryDirectory() as folder:
        took, turn = turns(sample, given.tiles, given.device, folder)
        adding = adding_up(sample.size, folder)
    task = handing_out()
    lead = adding + task
    print(f"leader: {turn * 1e3:.0f} ms a turn, {adding * 1e3:.2f} + {task * 1e3:.2f} ms a tile", file=sys.stderr)
    levels = 1 + max(level for level, *_ in took)
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["workers", "days", "times as fast as one", "efficiency", "share of the leader"])
    first = None
    for workers in WORKERS:
        options = {"tiles": given.tiles, "workers": workers, "levels": levels, "channel_axis": -1}
        plan = distributed.plan(sample, (SIDE, SIDE), **options)
        total = leader = 0.0
        for (level, kind, _), seconds in sorted(took.items()):
            here = plan.levels[level]
            tile = here.tile(0)
            sites = here.relaxed(tile) if kind == "sweep" else tile.rows * tile.cols
            tile_seconds = sites * float(np.mean(seconds))
            total += turn + max(ceil(here.count / workers) * tile_seconds, here.count * lead)
            leader += turn + here.count * lead
        first = first or total
        faster = first / total
        writer.writerow(
            [workers, f"{total / 86400:.1f}", f"{faster:.0f}", f"{faster / workers:.2f}", f"{leader / total:.2f}"]
        )


if __name__ == "__main__":
    main()
