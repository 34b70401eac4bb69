"""What `simdtex.checkpoint` costs: runs with and without one in turn, their medians, and the share of time in writes.

    python benchmarks/checkpoint.py [--size 1024] [--runs 5] [--device TEXT] [--folder DIR]

The medians differ by what the machine does beside, too; the share of a run that it spends in writing does not. States
go to a temporary folder, or one within --folder, which should lie on the disk that is asked about.
"""

import argparse
import shutil
import tempfile
import time
from pathlib import Path
from statistics import median

from skimage import data

import simdtex
from simdtex.checkpoints import keep
from simdtex.machine import open_machine

JOBS = {
    "mrf": {"rng": 1},
    "mrf, exact": {"search": "exact", "rng": 1},
    "multires": {"method": "multires", "rng": 1},
    "multires, alpha auto": {"method": "multires", "alpha": "auto", "rng": 1},
    "pyramid": {"method": "pyramid", "rng": 1},
}


def timed(machine, size, options, place):
    """Seconds of a run, of its writes, how many there were, and the bytes of the largest state."""
    writes, largest = [], 0
    plain = keep.Kept._write

    def measured(self, *args, **kwargs):
        nonlocal largest
        began = time.perf_counter()
        wrote = plain(self, *args, **kwargs)
        writes.append((wrote, time.perf_counter() - began))
        largest = max([largest, *(path.stat().st_size for path in place.glob("*.npz"))])
        return wrote

    keep.Kept._write = measured
    began = time.perf_counter()
    try:
        if place:
            with simdtex.checkpoint(place):
                simdtex.synthesize(data.brick()[:256, :256], (size, size), device=machine, **options)
        else:
            simdtex.synthesize(data.brick()[:256, :256], (size, size), device=machine, **options)
    finally:
        keep.Kept._write = plain
    seconds = time.perf_counter() - began
    return seconds, sum(took for _, took in writes), sum(wrote for wrote, _ in writes), largest


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--device", help="as of the command line")
    parser.add_argument("--folder", type=Path)
    parser.add_argument(
        "--jobs", nargs="*", choices=list(JOBS), default=[name for name in JOBS if name != "mrf, exact"]
    )
    arguments = parser.parse_args()
    machine = open_machine(arguments.device)
    print(f"{arguments.size}x{arguments.size} from 256x256 on {machine.name}, medians of {arguments.runs} in turn")
    print(f"{'job':22s} {'without':>9s} {'with':>9s} {'cost':>7s} {'writing':>8s} {'writes':>7s} {'state':>9s}")
    for name in arguments.jobs:
        simdtex.synthesize(data.brick()[:64, :64], (96, 96), device=machine, **JOBS[name])  # builds the kernels
        without, within, shares, last = [], [], [], (0.0, 0.0, 0, 0)
        for _ in range(arguments.runs):
            without.append(timed(machine, arguments.size, JOBS[name], None)[0])
            place = Path(tempfile.mkdtemp(dir=arguments.folder))
            last = timed(machine, arguments.size, JOBS[name], place)
            shutil.rmtree(place)
            within.append(last[0])
            shares.append(last[1] / last[0])
        cost = median(within) / median(without) - 1
        print(
            f"{name:22s} {median(without):7.2f} s {median(within):7.2f} s {cost:7.1%} {median(shares):8.2%} "
            f"{last[2]:7d} {last[3] / 1e6:6.1f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
