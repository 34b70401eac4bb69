# SPDX-License-Identifier: BSD-3-Clause
"""What a run of `pyramid` costs, all measured in one run.

    python benchmarks/pyramid_cost.py [--device TEXT] [--repeats 3] [--only jobs,goal] [--quick]

Prints seconds (the best of a few runs, kernels compiled before) of whole syntheses, the time by kernel, the NumPy
reference's time next to the device's, solid textures in processes of their own, memory for each pixel and voxel, the
steerable pyramid beside the same one by FFT, and sorted values a second. ``--quick`` runs all of it on small sizes.
"""

import argparse
import json
import os
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import scipy.fft
import scipy.ndimage
from cost import output_of
from skimage import data

import simdtex
from simdtex.methods.pyramid import MEMORY, TIES
from simdtex.methods.pyramid.pyramids import Transform
from simdtex.methods.pyramid.solid import MEMORY as MEMORY_OF_BLOCKS
from simdtex.ops.noise import noise
from simdtex.ops.sort import sort
from simdtex.ops.steerable_filters import filters

POOL = ThreadPoolExecutor(os.cpu_count())

JOB = """
import json, sys, time
import numpy, simdtex
side, output, channels, solid, iterations = (int(n) for n in sys.argv[1:6])
sample = numpy.random.default_rng(1).integers(0, 256, (side, side, channels), dtype=numpy.uint8)
make, axes = (simdtex.synthesize_solid, 3) if solid else (simdtex.synthesize, 2)
given = {"iterations": iterations, "rng": 1, "channel_axis": -1, "device": sys.argv[6] or None}
given |= {} if solid else {"method": "pyramid"}
began = time.time()
make(sample, (output,) * axes, **given)
print(json.dumps(time.time() - began))
"""

HIGH_WATER = """
with open("/proc/self/status") as file:  # ru_maxrss would count the process that started this one
    print(next(line for line in file if line.startswith("VmHWM")).split()[1])
"""


def shown(seconds):
    return f"{seconds:7.3f} s" if seconds < 60 else f"{seconds:7.1f} s"


def run(machine, sample, shape, **options):
    """Statistics of one synthesis, of a picture or of a block."""
    make = simdtex.synthesize_solid if len(shape) == 3 else partial(simdtex.synthesize, method="pyramid")
    axis = -1 if sample.ndim == 3 else None
    return make(sample, shape, channel_axis=axis, rng=1, device=machine, full_output=True, **options)[1].statistics


def best_of(repeats, machine, function):
    """Seconds of the fastest of a few calls, the first of which does not count."""
    function()
    seconds = []
    for _ in range(repeats):
        machine.sync()
        began = time.perf_counter()
        function()
        machine.sync()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def sample_of(side, channels=1):
    picture = data.gravel()[:side, :side]
    return picture if channels == 1 else data.immunohistochemistry()[:side, :side]


# ---------------------------------------------------------------- whole syntheses


def jobs(machine, repeats, part):
    """What one synthesis takes: 5 iterations, 4 levels at 128 pixels."""
    fine, side = 128 // part, 256 // part
    cases = {
        "steerable, 4 orientations": (1, fine, side, {}),
        "1 orientation": (1, fine, side, {"orientations": 1}),
        "2 orientations": (1, fine, side, {"orientations": 2}),
        "6 orientations": (1, fine, side, {"orientations": 6}),
        "laplacian": (1, fine, side, {"pyramid": "laplacian"}),
        "match=lookup": (1, fine, side, {"match": "lookup"}),
        "laplacian, match=lookup": (1, fine, side, {"pyramid": "laplacian", "match": "lookup"}),
        "20 iterations": (1, fine, side, {"iterations": 20}),
        "colour": (3, fine, side, {}),
        "odd sides": (1, fine, side - 1, {}),
        "odd sides, laplacian": (1, fine, side - 1, {"pyramid": "laplacian"}),
        "larger": (1, 2 * fine, 4 * side, {}),
        "larger, laplacian": (1, 2 * fine, 4 * side, {"pyramid": "laplacian"}),
        "larger, colour": (3, 2 * fine, 4 * side, {}),
    }
    for name, (channels, own, output, options) in cases.items():
        call = partial(run, machine, sample_of(own, channels), (output, output), **options)
        seconds = best_of(repeats, machine, call)
        pixels = 1e6 * seconds / output**2
        print(f"{name:26} {own:3} -> {output:4}: {shown(seconds)}, {pixels:6.2f} us a pixel", flush=True)


def by_kernel(device, part):
    """Device seconds of each kernel."""
    machine = simdtex.open_machine(device, profile=True)
    for name, shape, options in (
        ("128 -> 256", (256 // part,) * 2, {}),
        ("256 -> 1024", (1024 // part,) * 2, {}),
        ("solid 64^3", (64 // part,) * 3, {}),
    ):
        sample = sample_of((256 if shape[0] > 256 else 128) // part)
        run(machine, sample, shape, **options)
        statistics = run(machine, sample, shape, **options)
        seconds, kernels = statistics["seconds"], statistics["kernels"]
        print(f"by kernel, grey {name}, {seconds:.3f} s")
        for kernel in kernels:
            busy = kernel["seconds"]
            print(f"  {kernel['name']:20} {busy:7.4f} s, {busy / seconds:6.1%}, {kernel['calls']} launches")
        total = sum(kernel["seconds"] for kernel in kernels)
        print(f"  all of them          {total:7.4f} s, {total / seconds:6.1%}", flush=True)


def reference(machine, repeats, part):
    """The device beside the NumPy reference."""
    plain = simdtex.open_machine("reference")
    for name, shape, options in (
        ("128 -> 256", (256 // part,) * 2, {}),
        ("128 -> 256, laplacian", (256 // part,) * 2, {"pyramid": "laplacian"}),
        ("solid 64 -> 32^3", (32 // part,) * 3, {}),
    ):
        sample = sample_of((64 if len(shape) == 3 else 128) // part)
        fast = best_of(repeats, machine, partial(run, machine, sample, shape, **options))
        slow = run(plain, sample, shape, **options)["seconds"]
        print(f"{name:22}: {slow:.2f} s in NumPy, {fast:.3f} s on the device: {slow / fast:.1f} times", flush=True)


def solids(device, part):
    """Blocks, each in a process of its own."""
    for channels in (1, 3):
        for side in (64 // part, 128 // part):
            given = [str(n) for n in (128 // part, side, channels, 1, 5)]
            seconds, kib = output_of(JOB + HIGH_WATER, *given, device or "").splitlines()
            what = f"solid {side}^3, {channels} channel{'s' * (channels > 1)}"
            took = shown(json.loads(seconds))
            print(f"{what:22}: {took}, peak memory of the process {int(kib) / 1024:.0f} MiB", flush=True)


# ---------------------------------------------------------------- memory


def held(device, sample, shape):
    """Most bytes that a run's arrays have on the device: those put there, and those that its pool asked for."""
    machine = simdtex.open_machine(device)
    put, now, most = machine.put, 0, [0, 0]

    def release(size):
        nonlocal now
        now -= size

    def counted(array):
        nonlocal now
        made = put(array)
        now += made.nbytes
        weakref.finalize(made, release, made.nbytes)
        note()
        return made

    def note():
        most[0] = max(most[0], now + machine._pool.active_bytes)
        most[1] = max(most[1], now + machine._pool.managed_bytes)

    empty = machine.empty

    def emptied(*args):
        made = empty(*args)
        note()
        return made

    machine.put, machine.empty = counted, emptied
    run(machine, sample, shape, iterations=2)
    return most


def memory(device, part):
    """Bytes per pixel and voxel from two sizes each."""
    if not hasattr(simdtex.open_machine(device), "_pool"):
        print("memory: only of an OpenCL device")
        return
    rng = np.random.default_rng(1)
    for solid, sizes in ((0, (512 // part, 1536 // part)), (1, (48 // part, 112 // part))):
        axes = 3 if solid else 2
        for channels in (1, 3):
            process, arrays = [], []
            for output in sizes:
                given = [str(n) for n in (64, output, channels, solid, 2)]
                process.append(1024 * int(output_of(JOB + HIGH_WATER, *given, device or "").splitlines()[1]))
                sample = rng.integers(0, 256, (64, 64, channels), dtype=np.uint8)
                arrays.append(held(device, sample, (output,) * axes))
            more = sizes[1] ** axes - sizes[0] ** axes
            each = (process[1] - process[0]) / more
            used, pool = ((two - one) / more for one, two in zip(*arrays, strict=True))
            what = f"{'voxel' if solid else 'pixel'}, {channels} channel{'s' * (channels > 1)}"
            figures = f"{each:5.0f} of the process, {used:5.0f} in arrays at a time, {pool:5.0f} taken by the pool"
            print(f"bytes per {what:17}: {figures}", flush=True)
    print(f"limits asked of a device: {MEMORY} per pixel, {MEMORY_OF_BLOCKS} per voxel")


# ---------------------------------------------------------------- beside other ways


class ByFFT:
    """The steerable pyramid on a torus by FFT in float32 on the host, with the very same filters."""

    def __init__(self, levels, orientations):
        self.levels, self.taps, self.known = levels, filters(orientations), {}

    def response(self, name, taps, shape):
        """What a correlation with each of the taps multiplies a spectrum by."""
        if (name, shape) not in self.known:
            reach = taps.shape[-1] // 2
            spread = np.zeros((len(taps), *shape))
            for (f, a, b), tap in np.ndenumerate(taps):
                spread[f, (a - reach) % shape[0], (b - reach) % shape[1]] += tap
            self.known[name, shape] = np.conj(np.fft.rfft2(spread)).astype(np.complex64)
        return self.known[name, shape]

    def spectrum(self, picture):
        return scipy.fft.rfft2(picture, workers=-1)

    def back(self, spectrum, shape):
        return scipy.fft.irfft2(spectrum, s=shape, workers=-1)

    def whole(self, values):
        return np.rint(values).astype(np.int32)

    def make(self, picture):
        shape = picture.shape[1:]
        spectrum = self.spectrum(picture.astype(np.float32))
        bands = [self.whole(self.back(spectrum * self.response("high", self.taps.high[None], shape)[0], shape))[None]]
        low = spectrum * self.response("low", self.taps.low[None], shape)[0]
        for _ in range(self.levels):
            own = self.response("bands", self.taps.bands, shape)
            bands.append(np.array([self.whole(self.back(low * one, shape)) for one in own]))
            down = self.back(low * self.response("down", self.taps.down[None], shape)[0], shape)[:, ::2, ::2]
            shape = down.shape[1:]
            low = self.spectrum(np.ascontiguousarray(down))
        return [*bands, self.whole(self.back(low, shape))[None]]

    def collapse(self, subbands):
        high, *bands, low = subbands
        low = low[0].astype(np.float32)
        for own in reversed(bands):
            shape = own.shape[2:]
            spread = np.zeros((own.shape[1], *shape), np.float32)
            spread[:, ::2, ::2] = low
            total = self.spectrum(spread) * np.conj(self.response("up", 4 * self.taps.down[None], shape)[0])
            for band, response in zip(own, self.response("bands", self.taps.bands, shape), strict=True):
                total += self.spectrum(band.astype(np.float32)) * np.conj(response)
            low = self.back(total, shape)
        shape = high.shape[2:]
        total = self.spectrum(low) * np.conj(self.response("low", self.taps.low[None], shape)[0])
        total += self.spectrum(high[0].astype(np.float32)) * np.conj(
            self.response("high", self.taps.high[None], shape)[0]
        )
        return self.whole(self.back(total, shape))


def by_fft(machine, repeats, part):
    """Make-Pyramid and Collapse-Pyramid with spatial filters on the device, and by FFT on the host."""
    rng = np.random.default_rng(1)
    for planes, side in ((1, 256 // part), (1, 1024 // part), (128 // part, 128 // part)):
        picture = rng.integers(-(2**20), 2**20, (planes, side, side), dtype=np.int32)
        there = machine.put(picture)
        for orientations in (4, 6):
            levels = 4 if part == 1 else 1
            pyramid, other = Transform(machine, "steerable", levels, orientations, True), ByFFT(levels, orientations)
            ours, theirs = pyramid.make(there), other.make(picture)
            apart = max(np.abs(machine.get(a) - b).max() for a, b in zip(ours, theirs, strict=True))
            back = np.abs(machine.get(pyramid.collapse(ours)) - other.collapse(theirs)).max()
            seconds = [
                best_of(repeats, machine, call)
                for call in (
                    partial(pyramid.make, there),
                    partial(other.make, picture),
                    partial(pyramid.collapse, ours),
                    partial(other.collapse, theirs),
                )
            ]
            make, make_fft, collapse, collapse_fft = (f"{1000 * s:6.1f} ms" for s in seconds)
            what = f"{planes:3} x {side:4}^2, {orientations} orientations"
            took = f"make {make} (FFT {make_fft}), collapse {collapse} (FFT {collapse_fft})"
            print(f"{what}: {took}; apart by {max(apart, back) / 2**20:.0e} of the range", flush=True)


class InSpace(ByFFT):
    """The same by SciPy's correlation with the filters themselves, a thread for each core."""

    def correlated(self, picture, taps):
        bands = POOL.map(partial(scipy.ndimage.correlate, picture, mode="wrap"), taps)
        return np.array(list(bands))

    def make(self, picture):
        low = picture[0].astype(np.float32)
        high, low = self.correlated(low, np.stack([self.taps.high, padded_to(self.taps.low, self.taps.high)]))
        bands = [high[None, None]]
        for _ in range(self.levels):
            own = self.correlated(low, [*self.taps.bands, self.taps.down])
            bands.append(own[:-1, None])
            low = np.ascontiguousarray(own[-1][::2, ::2])
        return [*bands, low[None, None]]

    def collapse(self, subbands):
        high, *bands, low = subbands
        low = low[0, 0]
        for own in reversed(bands):
            spread = np.zeros(own.shape[2:], np.float32)
            spread[::2, ::2] = low
            pairs = [*zip(own[:, 0], self.taps.bands, strict=True), (spread, 4 * self.taps.down)]
            low = sum(POOL.map(self.turned, *zip(*pairs, strict=True)))
        return sum(POOL.map(self.turned, (high[0, 0], low), (self.taps.high, self.taps.low)))[None]

    def turned(self, band, taps):
        return scipy.ndimage.correlate(band, taps[::-1, ::-1], mode="wrap")


def padded_to(small, large):
    return np.pad(small, (len(large) - len(small)) // 2) if len(large) > len(small) else small


def matched(values, target):
    """One band with the histogram of a sorted target, by rank; ties as they come, which is quicker."""
    found = np.empty_like(values)
    found.reshape(-1)[np.argsort(values, axis=None)] = target
    return found


def by_rank(bands, targets):
    """Bands (bands, ...), a thread for each core."""
    return np.stack(list(POOL.map(matched, bands, targets)))


def texture_in_numpy(pyramid, sample, shape, seed):
    """Heeger and Bergen's match-texture of a grey sample with SciPy's filters, or FFT, and NumPy's sort, in float32."""
    around = np.pad(sample, sample.shape[0] // 2, mode="reflect")  # of which the middle half is the sample

    def expanded(values, n):
        values = np.sort(values, axis=None)
        return values[(2 * np.arange(n) + 1) * values.size // (2 * n)]

    made = pyramid.make(around[None].astype(np.float32))
    picture = np.random.default_rng(seed).standard_normal(shape, np.float32)
    targets = []
    for level, own in enumerate(made):
        inner = slice(own.shape[2] // 4, own.shape[2] * 3 // 4)
        n = (shape[0] >> max(0, level - 1)) * (shape[1] >> max(0, level - 1))
        targets.append([expanded(band[0, inner, inner], n) for band in own])
    pixels = expanded(sample.astype(np.float32), shape[0] * shape[1])
    picture = matched(picture, pixels)
    for _ in range(5):
        subbands = pyramid.make(picture[None])
        subbands = [by_rank(own, wanted) for own, wanted in zip(subbands, targets, strict=True)]
        picture = matched(np.asarray(pyramid.collapse(subbands)[0], np.float32), pixels)
    return picture


def goal(machine, repeats, part):
    """Whole syntheses beside the same in NumPy and SciPy, on the same cores."""
    for side, output in ((128 // part, 256 // part), (256 // part, 1024 // part)):
        sample, levels = sample_of(side), (side // 8).bit_length() - 1
        ours = best_of(repeats, machine, partial(run, machine, sample, (output, output)))
        figures = []
        for name, kind in (("SciPy's filters", InSpace), ("SciPy's FFT", ByFFT)):
            pyramid = kind(levels, 4)  # whose responses are known from the first call on, as kernels are compiled
            theirs = best_of(1, machine, partial(texture_in_numpy, pyramid, sample, (output, output), 1))
            figures.append(f"{name} and np.argsort {theirs:.3f} s, {theirs / ours:.1f} times as long")
        print(f"{side} -> {output}: {ours:.3f} s; {'; '.join(figures)}", flush=True)


def sorting(machine, repeats, part):
    """Million values a second."""
    for segments, n in ((1, 2**16), (1, 2**20), (4, 2**20), (128, 2**14), (1, 2**22), (1, 2**24)):
        n = n // part**2
        values = np.concatenate([np.random.default_rng(s).integers(-(2**20), 2**20, (1, n)) for s in range(segments)])
        values = values.astype(np.int32)
        there = machine.put(values)
        first = sort(machine, noise(machine, 1, n, 1, TIES), machine.put(np.arange(n, dtype=np.int32)))
        first = machine.put(machine.get(first).reshape(n))
        calls = {
            "device": partial(sort, machine, there, first),
            "np.sort": partial(np.sort, values, axis=1),
            "np.argsort, stable": partial(np.argsort, values, axis=1, kind="stable"),
        }
        rates = {name: values.size / best_of(repeats, machine, call) / 1e6 for name, call in calls.items()}
        figures = ", ".join(f"{name} {rate:6.1f}" for name, rate in rates.items())
        print(f"sort, {segments:3} x {n:8} values, million a second: {figures}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="parts to run, by name, separated by commas")
    parser.add_argument("--quick", action="store_true", help="small sizes")
    options = parser.parse_args()
    device, repeats, part = options.device, 1 if options.quick else options.repeats, 4 if options.quick else 1
    machine = simdtex.open_machine(device)
    units = f", {machine.info.compute_units} compute units" if hasattr(machine, "info") else ""
    print(f"device: {machine.name}{units}")
    parts = {
        "jobs": partial(jobs, machine, repeats, part),
        "goal": partial(goal, machine, repeats, part),
        "kernels": partial(by_kernel, device, part),
        "reference": partial(reference, machine, repeats, part),
        "sort": partial(sorting, machine, repeats, part),
        "fft": partial(by_fft, machine, repeats, part),
        "memory": partial(memory, device, part),
        "solids": partial(solids, device, part),
    }
    chosen = options.only.split(",") if options.only else list(parts)
    for name in chosen:
        parts[name]()


if __name__ == "__main__":
    main()
