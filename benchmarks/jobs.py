# SPDX-License-Identifier: BSD-3-Clause
"""Times whole jobs of ``mrf`` on gravel in one process, to be run in turns with another checkout's (PYTHONPATH=...).

python benchmarks/jobs.py [--size 256] [--side 128] [--search coherent exact] [--runs 9] [--fill] [--device TEXT]

Prints the best and the median of the runs after the first, and the most memory that the process had.
"""

import argparse
import resource
import timeit
from functools import partial
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
    given = {"rng": 1, "device": simdtex.open_machine(options.device)}
    if options.fill:
        picture, hole = np.tile(data.gravel(), (2, 2)), np.zeros((1024, 1024), bool)
        hole[480:544, 480:544] = True
        jobs = {"fill 64x64 of 1024x1024": partial(simdtex.fill, picture, hole, **given)}
    else:
        sample, shape = data.gravel()[: options.side, : options.side], (options.size, options.size)
        jobs = {
            f"{search:8} {options.side} -> {options.size}": partial(
                simdtex.synthesize, sample, shape, search=search, **given
            )
            for search in options.search
        }
    for name, job in jobs.items():
        seconds = timeit.repeat(job, number=1, repeat=1 + options.runs)[1:]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{name}: best {min(seconds):.3f} s, median {median(seconds):.3f} s, {memory:.0f} MiB")


if __name__ == "__main__":
    main()
