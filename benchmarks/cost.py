# SPDX-License-Identifier: BSD-3-Clause
"""What a run costs, against what the device can do, all measured in one run.

    python benchmarks/cost.py [--device TEXT] [--order 18] [--sample NAME]

Prints, each from a process of its own, the whole job 128x128 -> 256x256 by exact search, with skipping and without:
seconds, its fma over these and over the device's fma peak (independent chains of vector fma), seconds to the first
piece of progress from the start of the process (kernels compiled before), and peak memory. Then, for states from the
middle of runs, a warm sweep and a free one, the rates of the distances alone and of the whole LCPDF step over the peak.
Last, the growth of memory with the output, from two outputs of a tiny sample.
"""

import argparse
import json
import subprocess
import sys
import time

import numpy as np
import pyopencl as cl
import samples

import simdtex
from simdtex.methods import mrf
from simdtex.methods.mrf.algorithm import anneal, rule
from simdtex.methods.mrf.synthesis import laid_out
from simdtex.ops import lcpdf
from simdtex.ops.commit import commit
from simdtex.ops.neighbourhood import Field, neighbourhood
from simdtex.ops.relax import relax_apart

PEAK = """
__kernel void peak(__global float16 *out)
{
    float16 a[10];
    for (int i = 0; i < 10; ++i)
        a[i] = out[get_global_id(0)] + i;
    for (int n = 0; n < 20000; ++n)
#pragma unroll
        for (int i = 0; i < 10; ++i)
            a[i] = fma(a[i], (float16)(0.5f), (float16)(0.1f));
    float16 sum = 0;
    for (int i = 0; i < 10; ++i)
        sum += a[i];
    out[get_global_id(0)] = sum;
}
"""

JOB = """
import json, resource, time
began = time.time()
import sys
sys.path.insert(0, sys.argv[1])
import samples, simdtex
first = []
def callback(progress):
    first or first.append(time.time() - began)
start = time.time()
machine = simdtex.open_machine(sys.argv[4] or None, skip=sys.argv[5] == "True")
_, output = simdtex.synthesize(samples.grey()[sys.argv[2]], (256, 256), rng=1, order=int(sys.argv[3]), search="exact",
                               device=machine, callback=callback, full_output=True)
fma = sum(level["fma"] for level in output.statistics["levels"])
print(json.dumps([time.time() - start, fma, first[0], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""

MEMORY = """
import resource, sys
import numpy, simdtex
sample = numpy.arange(64, dtype=numpy.uint8).reshape(8, 8)
side = int(sys.argv[1])
simdtex.synthesize(sample, (side, side), order=1, levels=1, xi=-100.0, free_sweeps=0, rng=1, device=sys.argv[2] or None)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


def output_of(*arguments):
    """What a Python process of its own prints."""
    return subprocess.run([sys.executable, "-c", *arguments], capture_output=True, text=True, check=True).stdout


def seconds_of(functions, machine, repeats=7):
    """The median seconds of each, taken in turn: a shared CPU's speed comes and goes."""
    seconds = []
    for _ in range(repeats + 1):
        seconds.append([])
        for function in functions:
            machine.sync()
            began = time.perf_counter()
            function()
            machine.sync()
            seconds[-1].append(time.perf_counter() - began)
    return np.median(seconds[1:], 0)


def peak(machine):
    """A function that does independent chains of fma, and how many it does."""
    items = 64 * machine.info.compute_units
    buffer = cl.Buffer(machine.context, cl.mem_flags.READ_WRITE, 64 * items)
    cl.enqueue_fill_buffer(machine.queue, buffer, np.float32(0), 0, 64 * items)
    kernel = cl.Kernel(cl.Program(machine.context, PEAK).build(), "peak")
    return lambda: kernel(machine.queue, (items,), (8,), buffer), items * 20000 * 10 * 16


def states(machine, pixels, order):
    """Level and field at the finest level: before its third sweep, which is warm, and before its first free one."""
    sample = pixels if pixels.ndim == 3 else pixels[..., None]
    run = laid_out(machine, sample, (256, 256), mrf.Options(order=order, search="exact"), 1)
    found = {}
    for level, state, _ in anneal(run):
        if level.number == 0 and (state.cooling == 2 or not state.warm):
            phase = "relax" if state.warm else "free"
            found.setdefault(phase, (level, state.off(machine).on(machine).field))
        if len(found) == 2:
            return found


def steps(machine, phase, level, field):
    """Fma per second at the peak, in the distances alone, in the step without skipping and with it; the share skipped.

    A step that skips is given the fma of one that does not.
    """
    rng, temperature = np.random.default_rng(1), machine.get(field.temperature).ravel()
    sites = np.flatnonzero(temperature > 0) if phase == "relax" else np.arange(temperature.size)
    sites = np.sort(rng.choice(sites, min(len(sites), 3264), replace=False)).astype(np.int32)
    candidates, offsets, relaxation = level.proposal.candidates, level.setting.offsets, rule(level)
    channels = len(field.values)
    fma = 2 * len(sites) * candidates.size * len(offsets) * channels

    def pieces(stored):
        size = machine.chunk(candidates.size, len(offsets), channels, stored)
        return [machine.put(sites[i : i + size]) for i in range(0, len(sites), size)]

    near = [neighbourhood(machine, some, field, level.offsets, level.grid) for some in pieces(True)]
    parts = pieces(False)

    def distances():
        for some in near:
            lcpdf.distance(machine, some, candidates)

    def whole(skip):  # what it commits goes into copies, so that every repeat finds the same state
        machine.skip = skip
        for some in parts:
            commit(machine, after, some, *relax_apart(machine, some, field, level.weighed, relaxation, 1))

    after = Field(*(machine.put(machine.get(array)) for array in field))
    chains, in_chains = peak(machine)
    spared = machine.spared
    seconds = seconds_of([chains, distances, lambda: whole(False), lambda: whole(True)], machine)
    return np.array([in_chains, fma, fma, fma]) / seconds, (machine.spared - spared) / (8 * fma)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--order", type=int, default=18)
    parser.add_argument("--sample", help="only this one")
    options = parser.parse_args()
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}, {machine.info.compute_units} compute units")
    every = samples.grey() | samples.colour()
    every = {name: pixels for name, pixels in every.items() if options.sample in (None, name)}
    for name in sorted(every.keys() & samples.grey()):
        for skip in (True, False):
            printed = output_of(JOB, sys.path[0], name, str(options.order), options.device or "", str(skip))
            seconds, fma, first, memory = json.loads(printed)
            chains, in_chains = peak(machine)
            most = in_chains / seconds_of([chains], machine)[0]
            job = f"{name:8} 128x128 -> 256x256, order {options.order}, {'skipping' if skip else 'plain   '}"
            rate = f"{fma / seconds / most:.2f} of the peak of {most / 1e9:.0f} GFMA/s"
            print(f"{job}: {seconds:5.1f} s, {rate}, first progress after {first:.1f} s, peak memory {memory:.0f} MiB")
    for name, pixels in every.items():
        for phase, found in states(machine, pixels, options.order).items():
            (most, *rates), skipped = steps(machine, phase, *found)
            shares = ", ".join(
                f"{what} {rate / most:.2f}"
                for what, rate in zip(("distances", "plain", "skipping"), rates, strict=True)
            )
            print(f"{name:8} {phase:5} of the peak of {most / 1e9:3.0f} GFMA/s: {shares}; skipped {skipped:.3f}")
    if options.sample:
        return
    small, large = (int(output_of(MEMORY, str(side), options.device or "")) for side in (1024, 3072))
    print(f"memory of the process per output pixel: {(large - small) / (3072**2 - 1024**2):.0f} bytes")


if __name__ == "__main__":
    main()
