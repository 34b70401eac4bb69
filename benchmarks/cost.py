# SPDX-License-Identifier: BSD-3-Clause
"""What a run costs, against what the device can do, all measured in one run.

    python benchmarks/cost.py [--device TEXT] [--order 18]

Prints the device's fma peak (independent chains of vector fma), the rate of the LCPDF step on a state from the middle
of a run, and, from a process of its own, the whole job 128x128 -> 256x256: seconds, seconds to the first piece of
progress from the start of the process (kernels compiled before), and peak memory. Last, the growth of memory with the
output, from two outputs of a tiny sample.
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
from simdtex.lattice import Grid, neighbourhood_offsets
from simdtex.ops import lcpdf
from simdtex.ops.coherence import coherence
from simdtex.ops.commit import commit
from simdtex.ops.neighbourhood import Field, neighbourhood
from simdtex.ops.temperature import temperature
from simdtex.sample import Sample

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
simdtex.synthesize(samples.grey()[sys.argv[2]], (256, 256), rng=1, order=int(sys.argv[3]), device=sys.argv[4] or None,
                   callback=callback)
print(json.dumps([time.time() - start, first[0], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
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


def best_of(function, machine, repeats=7):
    function()
    machine.sync()
    seconds = []
    for _ in range(repeats):
        began = time.perf_counter()
        function()
        machine.sync()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def peak(machine):
    """Fma per second, the best of a few runs."""
    items = 64 * machine.info.compute_units
    buffer = cl.Buffer(machine.context, cl.mem_flags.READ_WRITE, 64 * items)
    cl.enqueue_fill_buffer(machine.queue, buffer, np.float32(0), 0, 64 * items)
    kernel = cl.Kernel(cl.Program(machine.context, PEAK).build(), "peak")
    return items * 20000 * 10 * 16 / best_of(lambda: kernel(machine.queue, (items,), (8,), buffer), machine)


def step(machine, order):
    """Fma per second of equation (12) in the distance kernel alone, and in the whole LCPDF step."""
    pixels = samples.grey()["brick"][..., None]
    offsets = neighbourhood_offsets(order)
    sample, grid = Sample(pixels, len(offsets)), Grid(256, 256)
    candidates = sample.candidates(machine, offsets, 1)
    rng = np.random.default_rng(1)
    source = rng.integers(0, sample.rows * sample.cols, (256, 256), dtype=np.int32)
    warm = rng.choice(np.array([0, 100, 300, 1024], np.uint16), (256, 256))
    field = Field(*(machine.put(a) for a in (sample.working[:, source], source, warm)))
    device_offsets = machine.put(offsets)
    sites = np.arange(0, 256 * 256, 20, dtype=np.int32)  # 3277, as many as a colour of order 18 has
    size = machine.chunk(candidates.size, len(offsets), 1)
    pieces = [machine.put(sites[i : i + size]) for i in range(0, len(sites), size)]
    near = [neighbourhood(machine, piece, field, device_offsets, grid) for piece in pieces]

    def distances():
        for some in near:
            lcpdf.distance(machine, some, candidates)

    def whole():
        for piece in pieces:
            some = neighbourhood(machine, piece, field, device_offsets, grid)
            d = lcpdf.distance(machine, some, candidates)
            d = coherence(machine, d, candidates, piece, field, device_offsets, grid, np.float32(0.5))
            relaxed = lcpdf.best(machine, d, candidates)
            cooled = temperature(machine, piece, field, device_offsets, grid, -1024)
            commit(machine, field, piece, relaxed, cooled)

    fma = 2 * len(sites) * candidates.size * len(offsets)
    return fma / best_of(distances, machine), fma / best_of(whole, machine)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--order", type=int, default=18)
    options = parser.parse_args()
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}, {machine.info.compute_units} compute units")
    before = peak(machine)
    alone, whole = step(machine, options.order)
    most = max(before, peak(machine))
    print(f"peak          {most / 1e9:8.0f} GFMA/s")
    print(f"distances     {alone / 1e9:8.0f} GFMA/s  {alone / most:.2f} of the peak")
    print(f"LCPDF step    {whole / 1e9:8.0f} GFMA/s  {whole / most:.2f} of the peak")
    for name in samples.grey():
        printed = output_of(JOB, sys.path[0], name, str(options.order), options.device or "")
        seconds, first, memory = json.loads(printed)
        job = f"{name:8} 128x128 -> 256x256, order {options.order}"
        print(f"{job}: {seconds:5.1f} s, first progress after {first:.1f} s, peak memory {memory:.0f} MiB")
    small, large = (int(output_of(MEMORY, str(side), options.device or "")) for side in (1024, 3072))
    print(f"memory of the process per output pixel: {(large - small) / (3072**2 - 1024**2):.0f} bytes")


if __name__ == "__main__":
    main()
