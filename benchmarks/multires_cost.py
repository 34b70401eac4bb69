# SPDX-License-Identifier: BSD-3-Clause
"""What a run of `multires` costs, all measured in one run.

    python benchmarks/multires_cost.py [--device TEXT] [--repeats 3]

Prints seconds (the best of a few runs, kernels compiled before) of whole syntheses, their growth with the output, the
sample and alpha, the nodes of the sample that a pixel of the finest level is compared with as a share of all, the time
by kernel, the NumPy reference's time next to the device's, and memory. A warm picture is one whose kernels have been
compiled by a run before.
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
import json, resource, time
began = time.time()
from skimage import data
import simdtex
first = []
def callback(progress):
    first or first.append(time.time() - began)
start = time.time()
simdtex.synthesize(data.gravel()[:256, :256], (1024, 1024), method="multires", rng=1, device=sys.argv[1] or None,
                   callback=callback)
print(json.dumps([time.time() - start, first[0], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""

MEMORY = """
import resource, sys
import numpy, simdtex
sample, output, channels = (int(n) for n in sys.argv[1:4])
sample = numpy.random.default_rng(1).integers(0, 256, (sample, sample, channels), dtype=numpy.uint8)
simdtex.synthesize(sample, (output, output), method="multires", alpha=0.0, rng=1, channel_axis=-1,
                   device=sys.argv[4] or None)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
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


def scan(finest):
    """What the scan of the finest level did."""
    share = finest["compared"] / finest["nodes"]
    return f"{finest['candidates']:7.1f} candidates, {finest['compared']:7.1f} of {finest['nodes']} nodes: {share:.2%}"


def jobs(machine, repeats):
    for side, output in ((128, 256), (256, 1024)):
        for name in NAMES:
            for alpha in (0.2, 0.3):
                seconds, finest = best_of(repeats, machine, picture(name, side), output, alpha=alpha)
                print(f"{name:8} {side}x{side} -> {output}x{output}, alpha {alpha}: {seconds:6.2f} s {scan(finest)}")


def growth(machine, repeats):
    for output in (128, 256, 512, 1024, 2048):
        seconds, _ = best_of(repeats, machine, picture("gravel", 128), output)
        print(f"output {output:4}: {seconds:6.2f} s, {1e6 * seconds / output**2:5.2f} us a pixel")
    for side in (32, 64, 128, 256, 512):
        seconds, finest = best_of(repeats, machine, picture("gravel", side), 512)
        print(f"sample {side:4}: {seconds:6.2f} s {scan(finest)}")
    for name in NAMES:
        for alpha in (0.0, 0.1, 0.2, 0.4, 0.8, np.inf):
            few = 1 if alpha == np.inf else repeats
            seconds, finest = best_of(few, machine, picture(name, 128), 256, alpha=alpha)
            print(f"{name:8} alpha {alpha:3}: {seconds:6.2f} s {scan(finest)}")


def by_kernel(device):
    """Device seconds of each kernel, told apart by waiting for every launch."""
    machine = simdtex.open_machine(device, profile=True)
    launch, spent = machine.launch, {}

    def timed(kernel, *args, **kwargs):
        before = machine.seconds
        launch(kernel, *args, **kwargs)
        spent[kernel.function_name] = spent.get(kernel.function_name, 0.0) + machine.seconds - before

    machine.launch = timed
    run(machine, picture("gravel", 256), 1024)
    spent.clear()
    seconds = run(machine, picture("gravel", 256), 1024)["seconds"]
    for name, busy in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"{name:18} {busy:8.4f} s {busy / seconds:6.1%} of the run's {seconds:.2f} s")


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
        for what, small, large in (("output", (8, 1024), (8, 3072)), ("sample", (256, 64), (768, 64))):
            process, arrays = [], []
            for side, output in (small, large):
                process.append(int(output_of(MEMORY, str(side), str(output), str(channels), device or "")))
                sample = rng.integers(0, 256, (side, side, channels), dtype=np.uint8)
                arrays.append(held(machine, sample, output))
            more = max(large) ** 2 - max(small) ** 2
            each = [(two - one) / more for one, two in (process, arrays)]
            kind = f"{channels} channel{'s' * (channels > 1)}"
            print(f"bytes per {what} pixel, {kind}: {each[0]:4.0f} of the process, {each[1]:4.0f} in arrays")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}, {machine.info.compute_units} compute units")
    jobs(machine, options.repeats)
    growth(machine, options.repeats)
    by_kernel(options.device)
    device, _ = best_of(options.repeats, machine, picture("gravel", 64), 128)
    reference, _ = best_of(options.repeats, simdtex.open_machine("reference"), picture("gravel", 64), 128)
    print(f"64x64 -> 128x128: {reference:.2f} s in NumPy, {device:.3f} s on the device: {reference / device:.0f} times")
    seconds, first, peak = json.loads(output_of(JOB, options.device or ""))
    print(f"a process of its own: {seconds:.1f} s, first progress after {first:.1f} s, peak memory {peak:.0f} MiB")
    memory(machine, options.device)


if __name__ == "__main__":
    main()
