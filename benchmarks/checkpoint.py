# SPDX-License-Identifier: BSD-3-Clause
"""Time runs with and without a checkpoint in turn: medians, and the share of time in writes.

    python benchmarks/checkpoint.py [--size 1024] [--runs 5] [--device TEXT] [--folder DIR] [--jobs NAME ...]

States go to a temporary folder, within --folder if given, which should lie on the disk of interest.
"""

import tempfile
from functools import partial
from pathlib import Path
from statistics import median

import common
from skimage import data

import simdtex
from simdtex import checkpoint

JOBS = {
    "mrf": {},
    "multires": {"method": "multires"},
    "pyramid": {"method": "pyramid"},
    "mrf, exact": {"search": "exact"},
}


def run(machine, size, options, path=None):
    """Return seconds of a run, of its writes, their number, and the bytes of the largest state."""
    seconds, sizes, write = [], [0], checkpoint.write_checked

    def measured(path, *rest):
        seconds.append(common.timed(write, path, *rest)[1])
        sizes.append(Path(path).stat().st_size)

    checkpoint.write_checked = measured
    try:
        given = {"rng": 1, "device": machine, "checkpoint": path, **options}
        whole = common.timed(simdtex.synthesize, data.brick()[:256, :256], (size, size), **given)[1]
    finally:
        checkpoint.write_checked = write
    return whole, sum(seconds), len(seconds), max(sizes)


@common.command
def main(size=1024, runs=5, device=None, folder=None, jobs=("mrf", "multires", "pyramid")):
    machine = simdtex.open_machine(device)
    print(f"{size}x{size} from 256x256 on {machine.name}, medians of {runs} in turn")
    print(f"{'job':22s} {'without':>9s} {'with':>9s} {'cost':>7s} {'writing':>8s} {'writes':>7s} {'state':>9s}")
    for name in jobs:
        with tempfile.TemporaryDirectory(dir=folder) as where:
            both = {"without": None, "with": Path(where, "state")}
            ways = {how: partial(run, machine, size, JOBS[name], path) for how, path in both.items()}
            found = common.in_turns(runs, ways)
        without, within = (median(one[0] for one in those) for those in found.values())
        share, (*_, writes, most) = median(one[1] / one[0] for one in found["with"]), found["with"][-1]
        seconds = f"{without:7.2f} s {within:7.2f} s {within / without - 1:7.1%}"
        print(f"{name:22s} {seconds} {share:8.2%} {writes:7d} {most / 1e6:6.1f} MB", flush=True)


if __name__ == "__main__":
    main()
