# SPDX-License-Identifier: BSD-3-Clause
"""The picture and the times of the README, made from pictures that scikit-image carries.

    python benchmarks/front.py [--out docs/_static/front.jpg] [--device TEXT]
    python benchmarks/front.py --times [--runs 5] [--methods multires pyramid] [--device TEXT]

The picture has gravel and tissue beside their samples, brick with its normal map carried over, and a hole in grass
before and after; all of it at 1:1, with the default options and seed 1. ``--times`` runs ``simdtex synth`` as a
process of its own for each method, on three colour samples of 128x128, for outputs of 256x256; it prints the user CPU
seconds of the whole process and its wall seconds, least to most of the samples, each the median of the runs after the
first. "start-up" is a process that makes one pixel.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from skimage import data, filters

import simdtex
from simdtex.io.examples import example
from simdtex.io.image import write
from simdtex.model.source_map import apply_source_map

SIDE = 156  # of a sample, pixels
SEED = 1  # of every picture
GAP, TEXT = 12, 15  # between pictures, and the height of letters, pixels
METHODS = {
    "start-up": ["--size", "1x1", "--levels", "1", "--order", "1"],
    "mrf": [],
    "mrf, exact search": ["--search", "exact"],
    "multires": ["--method", "multires"],
    "pyramid": ["--method", "pyramid"],
}


def normals(height, strength=0.06):
    """A tangent-space normal map, 8 bits, of a height map that is the same all around."""
    down, right = np.gradient(filters.gaussian(height.astype(float), 1))
    across = np.stack([-right * strength, down * strength, np.ones(height.shape)], -1)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    return np.rint((across + 1) * 127.5).astype(np.uint8)


def scribble(side):
    """A hole as a thick stroke, in a square of that side."""
    hole = PIL.Image.new("L", (side, side))
    points = [(0.2, 0.3), (0.45, 0.2), (0.3, 0.55), (0.75, 0.4), (0.45, 0.8), (0.8, 0.75)]
    path = [(x * side, y * side) for x, y in points]
    pen = PIL.ImageDraw.Draw(hole)
    pen.line(path, fill=255, width=max(3, side // 11), joint="curve")
    return np.array(hole) > 0


def samples(side):
    """Gravel, tissue and brick, seen from the front."""
    return {
        "gravel": data.gravel()[200 : 200 + side, 200 : 200 + side],
        "tissue": data.immunohistochemistry()[300 : 300 + side, 290 - side + 128 : 418],
        "brick": example("brick")[:side, :side],
    }


def placed(parts, size):
    """Lay out (left, top, picture or text) on white."""
    sheet = PIL.Image.new("RGB", size, "white")
    pen, font = PIL.ImageDraw.Draw(sheet), PIL.ImageFont.load_default(TEXT)
    for left, top, what in parts:
        if isinstance(what, str):
            pen.multiline_text((left, top), what, fill="black", font=font, spacing=6)
        else:
            sheet.paste(PIL.Image.fromarray(what).convert("RGB"), (left, top))
    return sheet


def front(machine, side=SIDE):
    """The picture: three samples above their results, and a row with a filled hole and a carried map."""
    made, options = {}, {"device": machine, "full_output": True}
    for name, sample in samples(side).items():
        axis = -1 if sample.ndim == 3 else None
        made[name] = simdtex.synthesize(sample, (2 * side, 2 * side), rng=SEED, channel_axis=axis, **options)
    given = samples(side)
    relief = normals(-given["brick"].astype(float))
    carried = apply_source_map(made["brick"][1].source, relief)
    grass, hole = data.grass()[100 : 100 + 2 * side, 60 : 60 + 2 * side], scribble(2 * side)
    filled = simdtex.fill(grass, hole, rng=SEED, device=machine)
    wide, line = 2 * side + GAP, TEXT + 8
    results = line + side + GAP
    below = results + 2 * side + GAP
    parts = [
        *((i * wide, line, given[name]) for i, name in enumerate(given)),
        *((i * wide, results, made[name][0]) for i, name in enumerate(given)),
        *((i * wide, 0, f"{name}: the sample") for i, name in enumerate(("gravel", "tissue"))),
        (2 * wide, 0, "brick: the sample and its normal map"),
        (2 * wide + side, line, relief),
        *((i * wide + side + GAP, line + side - 3 * line, "below: more\nof it, without\na seam") for i in (0, 1)),
        (0, below, "grass with a hole"),
        (wide, below, "the hole filled"),
        (2 * wide, below, "the normal map, carried along"),
        (0, below + line, np.where(hole, np.uint8(255), grass)),
        (wide, below + line, filled),
        (2 * wide, below + line, carried),
    ]
    return placed(parts, (3 * wide - GAP, below + line + 2 * side))


def processes(device, runs, methods):
    """Time every method on every sample as a process; print a line for each method."""
    colour = {
        "tissue": data.immunohistochemistry()[300:428, 290:418],
        "wood": data.coffee()[270:398, 472:600],
        "stars": data.hubble_deep_field()[346:474, 166:294],
    }
    print(f"{'':20} user CPU seconds   wall seconds")
    with tempfile.TemporaryDirectory() as folder:
        for method in methods:
            cpu, wall = [], []
            for name, sample in colour.items():
                write(Path(folder) / f"{name}.png", sample)
                words = f"-m simdtex synth {name}.png -o more.png --size 256x256"
                command = [sys.executable, *words.split()]
                command += [*METHODS[method], "--seed", "1", "--quiet", *(["--device", device] if device else [])]
                seconds = []
                for _ in range(1 + runs):
                    before, began = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
                    subprocess.run(command, cwd=folder, check=True)
                    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
                    seconds.append((after - before, time.perf_counter() - began))
                cpu.append(median(each for each, _ in seconds[1:]))
                wall.append(median(each for _, each in seconds[1:]))
            print(f"{method:20} {min(cpu):.2f} to {max(cpu):.2f}       {min(wall):.2f} to {max(wall):.2f}", flush=True)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/_static/front.jpg"))
    parser.add_argument("--side", type=int, default=SIDE, help="of the samples, pixels; results have twice that")
    parser.add_argument("--times", action="store_true", help="print times instead")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS), metavar="METHOD")
    parser.add_argument("--device")
    options = parser.parse_args(argv)
    machine = simdtex.open_machine(options.device)
    print(machine.name)
    if options.times:
        processes(options.device, options.runs, options.methods)
        return
    front(machine, options.side).save(options.out, quality=90)
    print(f"{options.out}: {options.out.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
