# SPDX-License-Identifier: BSD-3-Clause
"""The picture and the times of the README, made from pictures that scikit-image carries.

    python benchmarks/front.py [--out docs/_static/front.jpg] [--device TEXT]
    python benchmarks/front.py --times [--runs 5] [--methods multires pyramid] [--device TEXT]

The picture has wood, tissue and stars below their samples, a photograph before and after a mast is removed, and a
normal map of the wood, arranged like its texture; all of it at 1:1, with the default options and seed 1. ``--times``
runs ``simdtex synth`` as a process of its own for each method, on three colour samples of 128x128, for outputs of
256x256; it prints the user CPU seconds of the whole process and its wall seconds, least to most of the samples, each
the median of the runs after the first. "start-up" is a process that makes one pixel.
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
from simdtex.io.image import write
from simdtex.model.source_map import apply_source_map

SIDE = 162  # of a sample, pixels
SEED = 1  # of every picture
GAP, TEXT = 14, 15  # between pictures, and the height of letters, pixels
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


def mast(side):
    """A photograph of that side, and the place of a mast in it."""
    photo, hole = data.rocket()[60 : 60 + side, 190 : 190 + side], PIL.Image.new("L", (side, side))
    outline = [(250, 52), (260, 52), (288, 322), (240, 322)]
    PIL.ImageDraw.Draw(hole).polygon([(x * side // 324, y * side // 324) for x, y in outline], fill=255)
    return photo, np.array(hole) > 0


def samples(side):
    """Wood, tissue and stars."""
    return {
        "wood": data.coffee()[400 - side * 4 // 5 :, 600 - side * 4 // 5 :],  # the rest is the saucer
        "tissue": data.immunohistochemistry()[300 : 300 + side, 290 - side + 128 : 418],
        "stars": data.hubble_deep_field()[346 : 346 + side, 166 : 166 + side],
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
    """The picture: three samples above their results, and a row with a removed mast and a map arranged alike."""
    made, options = {}, {"device": machine, "full_output": True, "channel_axis": -1}
    given = samples(side)
    for name, sample in given.items():
        made[name] = simdtex.synthesize(sample, (2 * side, 2 * side), rng=SEED, **options)
    relief = normals(given["wood"].mean(axis=2))
    photo, hole = mast(2 * side)
    filled = simdtex.fill(photo, hole, channel_axis=-1, rng=SEED, device=machine)
    wide, line = 2 * side + GAP, TEXT + 8
    results = line + side + GAP
    below = results + 2 * side + GAP
    parts = [
        *((i * wide, line + side - len(given[name]), given[name]) for i, name in enumerate(given)),
        *((i * wide, results, made[name][0]) for i, name in enumerate(given)),
        *((i * wide, 0, f"{name}: the sample") for i, name in enumerate(given)),
        *((i * wide + side + GAP, line + side - 3 * line, "below: more\nof it, without\na seam") for i in range(3)),
        (0, below, "a photograph"),
        (wide, below, "the right mast removed"),
        (2 * wide, below, "a normal map, arranged like the wood"),
        (0, below + line, photo),
        (wide, below + line, filled),
        (2 * wide, below + line, apply_source_map(made["wood"][1].source, relief)),
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
