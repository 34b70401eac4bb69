# SPDX-License-Identifier: BSD-3-Clause
"""Bytes for each pixel that a run takes of the whole process, beside what the check before a run asks for.

    python benchmarks/memory.py [--device TEXT] [--only mrf,multires] [--quick]

Each job runs at two sizes, each in a process of its own, after a small run that loads and compiles what it needs. The
first figure is the growth of the process's peak; where the device shares the host's memory, as a CPU and the reference
do, the device's arrays are in it. The second is what `simdtex.machine.memory.require` was asked for.
"""

import argparse
import json
import subprocess
import sys

JOB = """
import json, sys
import numpy, simdtex
from simdtex.machine import memory

kind, small, side, channels, dtype, device, options = json.loads(sys.argv[1])
values = numpy.random.default_rng(1).integers(0, 256, (64, 64, channels))
sample = (values if dtype == "uint8" else values / 255).astype(dtype)
solid = kind == "solid"
make = simdtex.synthesize_solid if solid else simdtex.synthesize
if kind == "classify":
    textures = {"one": sample, "another": sample[::-1].copy()}
    make = lambda sample, shape, **given: simdtex.classify(numpy.resize(sample, (*shape, channels)), textures, **given)
given = {"rng": 1, "channel_axis": -1, "device": simdtex.open_machine(device), "full_output": True} | options
given |= {} if solid or kind == "classify" else {"method": kind}

def peak():
    with open("/proc/self/status") as file:  # ru_maxrss would count the process that started this one
        return 1024 * int(next(line for line in file if line.startswith("VmHWM")).split()[1])

asked, require = [0], memory.require

def noted(machine, device, host=0, remedy=""):
    asked.append((device + memory.TEMPORARY) * memory.shared(machine) + host)
    require(machine, device, host)

memory.require = noted
make(sample, (small,) * (3 if solid else 2), **given)
asked[:], before = [0], peak()
made = make(sample, (side,) * (3 if solid else 2), **given)
print(json.dumps([peak() - before, max(asked)]))
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


def measured(kind, small, side, channels, dtype, device, options):
    """Bytes that the process grew by, and bytes that were asked for."""
    given = json.dumps([kind, small, side, channels, dtype, device, options])
    done = subprocess.run([sys.executable, "-c", JOB, given], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--only", default="", help="beginnings of the names of jobs, separated by commas")
    parser.add_argument("--quick", action="store_true", help="small sizes")
    options = parser.parse_args()
    for name, (kind, chosen) in CASES.items():
        if options.only and not name.startswith(tuple(options.only.split(","))):
            continue
        axes = 3 if kind == "solid" else 2
        sides = (24, 48) if kind == "solid" else (128, 256)
        if not options.quick:
            sides = (48, 112) if kind == "solid" else (512, 1536)
        for dtype in ("uint8", "float64"):
            for channels in (1, 3):
                runs = [measured(kind, sides[0], s, channels, dtype, options.device, chosen) for s in sides]
                more = sides[1] ** axes - sides[0] ** axes
                grown, asked = ((two - one) / more for one, two in zip(*runs, strict=True))
                print(
                    f"{name:24} {channels} x {dtype:8}: {grown:5.0f} bytes of the process, {asked:5.0f} asked for",
                    flush=True,
                )


if __name__ == "__main__":
    main()
