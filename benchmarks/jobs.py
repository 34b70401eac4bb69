# SPDX-License-Identifier: BSD-3-Clause
"""Times whole jobs on gravel in one process, to be run in turns with another checkout's (PYTHONPATH=...).

python benchmarks/jobs.py [--size 256] [--side 128] [--jobs coherent,exact] [--runs 9] [--colour] [--device TEXT]

``--side`` is that of the sample, with ``--colour`` of the Hubble deep field, mirrored beyond its 872 rows. The jobs are
both searches of ``mrf``, ``multires``, ``pyramid``, ``solid`` (a block), and ``fill`` (a hole of 64x64 in a picture of
1024x1024). Prints the best and the median of the runs after the first, and the most memory that the process had.
"""

import resource
from functools import partial
from statistics import median

import common
import numpy as np
from skimage import data

import simdtex


@common.command
def main(size=256, side=128, jobs=("coherent", "exact"), runs=9, colour=False, device=None):
    given = {"rng": 1, "device": simdtex.open_machine(device), "channel_axis": -1 if colour else None}
    sample, shape = data.gravel()[:side, :side], (size, size)
    if colour:
        sample = np.pad(data.hubble_deep_field(), ((0, 600), (0, 600), (0, 0)), "reflect")[:side, :side]
    picture, hole = np.tile(data.gravel(), (2, 2)), np.zeros((1024, 1024), bool)
    hole[480:544, 480:544] = True
    known = {
        **{way: partial(simdtex.synthesize, sample, shape, search=way) for way in ("coherent", "exact")},
        **{method: partial(simdtex.synthesize, sample, shape, method=method) for method in ("multires", "pyramid")},
        "solid": partial(simdtex.synthesize_solid, sample, (size, *shape)),
        "fill": partial(simdtex.fill, picture, hole),
    }
    for name in jobs:
        job = known[name]
        seconds = common.in_turns(runs, {name: lambda job=job: common.timed(job, **given)[1]})[name]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{name} {side} -> {size}: best {min(seconds):.3f} s, median {median(seconds):.3f} s, {memory:.0f} MiB")


if __name__ == "__main__":
    main()
