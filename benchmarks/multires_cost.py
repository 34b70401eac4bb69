# SPDX-License-Identifier: BSD-3-Clause
"""What a run of `multires` costs, all measured in one run.

    python benchmarks/multires_cost.py [--device TEXT] [--repeats 3] [--only jobs,goal]

Prints seconds (the best of a few runs, kernels compiled before) of whole syntheses, their growth with the output, the
sample and alpha, the nodes of the sample that a pixel of the finest level is compared with as a share of all, the time
by kernel, the NumPy reference's time next to the device's, and memory.
"""

import argparse
import json
import weakref
from functools import partial

import numpy as np
from cost import output_of
from skimage import data

import simdtex

NAMES = ("brick", "grass", "gravel")

JOB = """
import json, sys, time
began = time.time()
from skimage import data
import simdtex
first = []
def callback(progress):
    first or first.append(time.time() - began)
start = time.time()
simdtex.synthesize(data.gravel()[:256, :256], (1024, 1024), method="multires", rng=1, device=sys.argv[1] or None,
                   callback=callback)
print(json.dumps([time.time() - start, first[0]]))
"""

MEMORY = """
import sys
import numpy, simdtex
sample, output, channels = (int(n) for n in sys.argv[1:4])
sample = numpy.random.default_rng(1).integers(0, 256, (sample, sample, channels), dtype=numpy.uint8)
simdtex.synthesize(sample, (output, output), method="multires", alpha=0.0, rng=1, channel_axis=-1,
                   device=sys.argv[4] or None)
"""

HIGH_WATER = """
with open("/proc/self/status") as file:  # ru_maxrss would count the process that started this one
    print(next(line for line in file if line.startswith("VmHWM")).split()[1])
"""


def picture(name, side):
    """A crop of one of scikit-image's pictures of 512 x 512 pixels."""
    return getattr(data, name)()[:side, :side]


def run(machine, sample, side, **options):
    return simdtex.synthesize(
        sample,
        (side, side),
        method="multires",
        rng=1,
        channel_axis=-1 if sample.ndim == 3 else None,
        device=machine,
        full_output=True,
        **options,
    )[1].statistics


def best_of(repeats, machine, sample, side, **options):
    """Seconds of the fastest of a few runs, and its finest level's statistics."""
    run(machine, sample, side, **options)
    statistics = min((run(machine, sample, side, **options) for _ in range(repeats)), key=lambda s: s["seconds"])
    return statistics["seconds"], statistics["levels"][-1]


def job(repeats, machine, name, side, output, alpha=0.3):
    """Print what one synthesis takes, and what the scan of its finest level did."""
    seconds, finest = best_of(repeats, machine, picture(name, side), output, alpha=alpha)
    what = f"{name:6} {side:3} -> {output:4}, alpha {alpha:4}"
    took = f"{seconds:7.3f} s, {1e6 * seconds / output**2:6.2f} us a pixel"
    compared = f"{finest['compared']:6.1f} of {finest['nodes']} nodes ({finest['compared'] / finest['nodes']:.2%})"
    print(f"{what}: {took}, {finest['candidates']:6.1f} candidates, {compared}")


def jobs(machine, repeats):
    for side, output in ((128, 256), (256, 1024)):
        for name in NAMES:
            for alpha in (0.2, 0.3, "auto"):
                job(repeats, machine, name, side, output, alpha)
    print("the output grows")
    for output in (128, 256, 512, 1024, 2048):
        job(repeats, machine, "gravel", 128, output)
    print("the sample grows")
    for side in (32, 64, 128, 256, 512):
        job(repeats, machine, "gravel", side, 512)
    print("alpha grows")
    for name in NAMES:
        for alpha in (0.0, 0.1, 0.2, 0.4, 0.8, np.inf):
            job(1 if alpha == np.inf else repeats, machine, name, 128, 256, alpha)


def of_options(machine, repeats):
    """What mending and blending add."""
    for side, output in ((128, 256), (256, 1024), (512, 1024)):
        for options in ({"edges": "keep", "seams": "cut"}, {"edges": "keep"}, {}):
            seconds, _ = best_of(repeats, machine, picture("gravel", side), output, **options)
            named = ", ".join(f"{name}={value}" for name, value in options.items()) or "defaults"
            print(f"gravel {side:3} -> {output:4}, {named:21}: {seconds:7.3f} s", flush=True)


def by_kernel(device):
    """Device seconds of each kernel."""
    machine = simdtex.open_machine(device, profile=True)
    run(machine, picture("gravel", 256), 1024, alpha=0.3)
    statistics = run(machine, picture("gravel", 256), 1024, alpha=0.3)
    print(f"by kernel, gravel 256 -> 1024, {statistics['seconds']:.3f} s")
    for kernel in statistics["kernels"]:
        busy = kernel["seconds"]
        print(f"{kernel['name']:18} {busy:7.3f} s, {busy / statistics['seconds']:.1%}")


def goal(machine, repeats):
    """The NumPy reference beside the device."""
    plain = simdtex.open_machine("reference")
    for side, output in ((64, 128), (128, 256)):
        fast, _ = best_of(repeats, machine, picture("gravel", side), output, alpha=0.3)
        slow = run(plain, picture("gravel", side), output, alpha=0.3)["seconds"]
        took = f"{slow:.2f} s in NumPy, {fast:.4f} s on the device: {slow / fast:.0f} times"
        print(f"gravel {side} -> {output}: {took}", flush=True)


def held(machine, sample, side):
    """Most bytes in arrays of the machine at a time, during one run."""
    now, most = 0, 0
    made = {name: getattr(machine, name) for name in ("put", "empty")}

    def release(size):
        nonlocal now
        now -= size

    def counted(name, *args):
        nonlocal now, most
        array = made[name](*args)
        now += array.nbytes
        most = max(most, now)
        weakref.finalize(array, release, array.nbytes)
        return array

    for name in made:
        setattr(machine, name, partial(counted, name))
    run(machine, sample, side, alpha=0.0)
    for name in made:
        delattr(machine, name)
    return most


def memory(machine, device):
    """Bytes per pixel, of the process and of the machine's arrays, from two sizes each."""
    rng = np.random.default_rng(1)
    for channels in (1, 3):
        for what, small, large in (("output", (8, 1024), (8, 3072)), ("sample", (1024, 64), (3072, 64))):
            process, arrays = [], []
            for side, output in (small, large):
                kib = output_of(MEMORY + HIGH_WATER, str(side), str(output), str(channels), device or "")
                process.append(1024 * int(kib))
                sample = rng.integers(0, 256, (side, side, channels), dtype=np.uint8)
                arrays.append(held(machine, sample, output))
            more = max(large) ** 2 - max(small) ** 2
            each = [(two - one) / more for one, two in (process, arrays)]
            kind = f"{channels} channel{'s' * (channels > 1)}"
            print(f"bytes per {what} pixel, {kind}: {each[0]:4.0f} of the process, {each[1]:4.0f} in arrays")


def alone(device):
    """A process of its own, with its imports and compilations."""
    printed, kib = output_of(JOB + HIGH_WATER, device or "").splitlines()
    seconds, first = json.loads(printed)
    print(f"gravel 256 -> 1024 in a process of its own: {seconds:.1f} s, first progress after {first:.1f} s, ", end="")
    print(f"peak memory {int(kib) / 1024:.0f} MiB", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="parts to run, by name, separated by commas")
    options = parser.parse_args()
    device, repeats = options.device, options.repeats
    machine = simdtex.open_machine(device)
    print(f"device: {machine.name}, {machine.info.compute_units} compute units")
    parts = {
        "jobs": partial(jobs, machine, repeats),
        "options": partial(of_options, machine, repeats),
        "kernels": partial(by_kernel, device),
        "goal": partial(goal, machine, repeats),
        "alone": partial(alone, device),
        "memory": partial(memory, machine, device),
    }
    for name in options.only.split(",") if options.only else parts:
        parts[name]()


if __name__ == "__main__":
    main()
