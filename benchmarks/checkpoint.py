# SPDX-License-Identifier: BSD-3-Clause
"""Time runs with and without a checkpoint in turn: medians, and the share of time in writes.

    python benchmarks/checkpoint.py [--size 1024] [--runs 5] [--device TEXT] [--folder DIR] [--jobs NAME ...]

States go to a temporary folder, within --folder if given, which should lie on the disk of interest.
"""

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median

from skimage import data

import simdtex
from simdtex import checkpoint

JOBS = {
    "mrf": {"rng": 1},
    "mrf, exact": {"search": "exact", "rng": 1},
    "multires": {"method": "multires", "rng": 1},
    "pyramid": {"method": "pyramid", "rng": 1},
}


def timed(machine, size, options, path=None):
    """Return seconds of a run, of its writes, their number, and the bytes of the largest state."""
    seconds, sizes = [], [0]
    write = checkpoint.write_checked

    def measured(path, *rest):
        began = time.perf_counter()
        write(path, *rest)
        seconds.append(time.perf_counter() - began)
        sizes.append(Path(path).stat().st_size)

    checkpoint.write_checked = measured
    began = time.perf_counter()
    try:
        simdtex.synthesize(data.brick()[:256, :256], (size, size), device=machine, checkpoint=path, **options)
    finally:
        checkpoint.write_checked = write
    return time.perf_counter() - began, sum(seconds), len(seconds), max(sizes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--device")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--jobs", nargs="*", choices=JOBS, default=[name for name in JOBS if name != "mrf, exact"])
    given = parser.parse_args()
    machine = simdtex.open_machine(given.device)
    print(f"{given.size}x{given.size} from 256x256 on {machine.name}, medians of {given.runs} in turn")
    print(f"{'job':22s} {'without':>9s} {'with':>9s} {'cost':>7s} {'writing':>8s} {'writes':>7s} {'state':>9s}")
    for name in given.jobs:
        timed(machine, 96, JOBS[name])  # builds the kernels
        runs = []
        with tempfile.TemporaryDirectory(dir=given.folder) as folder:
            for _ in range(given.runs):
                without = timed(machine, given.size, JOBS[name])[0]
                runs.append((without, *timed(machine, given.size, JOBS[name], Path(folder, "state"))))
        without, within = (median(run[k] for run in runs) for k in (0, 1))
        share, (*_, writes, size) = median(run[2] / run[1] for run in runs), runs[-1]
        print(
            f"{name:22s} {without:7.2f} s {within:7.2f} s {within / without - 1:7.1%} {share:8.2%} {writes:7d} "
            f"{size / 1e6:6.1f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
