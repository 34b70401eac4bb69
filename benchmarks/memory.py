# SPDX-License-Identifier: BSD-3-Clause
"""Bytes for each pixel or voxel that a run takes, beside what the check before a run asks for.

    python benchmarks/memory.py [--device TEXT] [--only mrf,multires] [--quick]

Each job runs at two sizes, each in a process of its own, after a small run that loads and compiles what it needs. The
first figure is the growth of the process's peak; where the device shares the host's memory, as a CPU and the reference
do, the device's arrays are in it. The second is what `simdtex.machine.memory.require` was asked for, and the third,
which the reference does not have, is the most that arrays had on the device at a time.
"""

import json
from itertools import product

import common

JOB = """
import json, sys
import numpy, simdtex
from simdtex.machine import memory

kind, small, side, channels, dtype, device, options = json.loads(sys.argv[1])
values = numpy.random.default_rng(1).integers(0, 256, (64, 64, channels))
sample = (values if dtype == "uint8" else values / 255).astype(dtype)
axes, machine = 3 if kind == "solid" else 2, simdtex.open_machine(device)
make = simdtex.synthesize_solid if kind == "solid" else simdtex.synthesize
if kind == "classify":
    textures = {"one": sample, "another": sample[::-1].copy()}
    make = lambda sample, shape, **given: simdtex.classify(numpy.resize(sample, (*shape, channels)), textures, **given)
given = {"rng": 1, "channel_axis": -1, "device": machine, "full_output": True} | options
given |= {} if kind in ("solid", "classify") else {"method": kind}

def peak():
    with open("/proc/self/status") as file:  # ru_maxrss would count the process that started this one
        return 1024 * int(next(line for line in file if line.startswith("VmHWM")).split()[1])

most, empty = [0], getattr(machine, "empty", None)  # the reference has no pool

def noted(*args):
    made = empty(*args)
    most.append(machine._pool.active_bytes)
    return made

if hasattr(machine, "_pool"):
    machine.empty = noted
make(sample, (small,) * axes, **given)
before = peak()
memory.required.clear()
most.clear()
made = make(sample, (side,) * axes, **given)
print(json.dumps([peak() - before, memory.required["host", id(machine)], max(most, default=0)]))
"""

CASES = {
    "mrf": ("mrf", {}),
    "mrf, schedule block": ("mrf", {"schedule": "block"}),
    "mrf, synchronous": ("mrf", {"schedule": "synchronous"}),
    "multires": ("multires", {}),
    "pyramid": ("pyramid", {"iterations": 2}),
    "pyramid, laplacian": ("pyramid", {"iterations": 2, "pyramid": "laplacian"}),
    "pyramid, 6 orientations": ("pyramid", {"iterations": 1, "orientations": 6}),
    "pyramid, lookup": ("pyramid", {"iterations": 1, "match": "lookup"}),
    "classify": ("classify", {"exemplars": 100}),
    "solid": ("solid", {"iterations": 1}),
    "solid, average": ("solid", {"iterations": 1, "solids": "average"}),
}
"""Name -> the method and its options."""


def run(*job):
    """Bytes that the process grew by, that were asked for, and that arrays had on the device."""
    return json.loads(common.python("-c", JOB, json.dumps(job)))


@common.command
def main(device=None, only="", quick=False):
    for name, (kind, options) in CASES.items():
        if not name.startswith(tuple(only.split(","))):
            continue
        axes = 3 if kind == "solid" else 2
        small, large = ((24, 48) if axes == 3 else (128, 256)) if quick else ((48, 112) if axes == 3 else (512, 1536))
        for dtype, channels in product(("uint8", "float64"), (1, 3)):
            runs = [run(kind, small, side, channels, dtype, device, options) for side in (small, large)]
            grown, asked, held = ((two - one) / (large**axes - small**axes) for one, two in zip(*runs, strict=True))
            told = f"{grown:5.0f} bytes of the process, {asked:5.0f} asked for, {held:5.0f} on the device"
            print(f"{name:24} {channels} x {dtype:8}: {told}", flush=True)


if __name__ == "__main__":
    main()
