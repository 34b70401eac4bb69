# SPDX-License-Identifier: BSD-3-Clause
"""Times whole jobs of ``mrf`` on gravel in one process, to be run in turns with another checkout's (PYTHONPATH=...).

python benchmarks/jobs.py [--size 256] [--side 128] [--search coherent exact] [--runs 9] [--fill] [--device TEXT]

Prints the best and the median of the runs after the first, and the most memory that the process had.
"""

import argparse
import resource
import time
from statistics import median

import numpy as np
from skimage import data

import simdtex


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--side", type=int, default=128, help="of the sample")
    parser.add_argument("--search", nargs="+", default=["coherent", "exact"])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--device")
    parser.add_argument("--fill", action="store_true", help="only fill a hole of 64x64 in a picture of 1024x1024")
    options = parser.parse_args()
    machine, shape = simdtex.open_machine(options.device), (options.size, options.size)
    sample = data.gravel()[: options.side, : options.side]
    if options.fill:
        picture, hole = np.tile(data.gravel(), (2, 2)), np.zeros((1024, 1024), bool)
        hole[480:544, 480:544] = True
        seconds = []
        for _ in range(1 + options.runs):
            began = time.perf_counter()
            simdtex.fill(picture, hole, rng=1, device=machine)
            seconds.append(time.perf_counter() - began)
        print(f"fill 64x64 of 1024x1024: best {min(seconds[1:]):.3f} s, median {median(seconds[1:]):.3f} s")
        return
    for search in options.search:
        seconds = []
        for _ in range(1 + options.runs):
            began = time.perf_counter()
            simdtex.synthesize(sample, shape, rng=1, device=machine, search=search)
            seconds.append(time.perf_counter() - began)
        best, usual = min(seconds[1:]), median(seconds[1:])
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{search:8} {options.side} -> {options.size}: best {best:.3f} s, median {usual:.3f} s, {memory:.0f} MiB")


if __name__ == "__main__":
    main()
