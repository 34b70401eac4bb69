# SPDX-License-Identifier: BSD-3-Clause
"""The picture and the times of the README, made from pictures that scikit-image carries.

    python benchmarks/front.py [--out docs/_static/front.jpg] [--side 162] [--device TEXT]
    python benchmarks/front.py --large docs/_static/large.jpg [--device TEXT]
    python benchmarks/front.py --times [--runs 5] [--device TEXT]

The picture has wood, tissue and stars below their samples, a photograph before and after a mast is removed, and a
normal map of the wood, arranged like its texture; all of it at 1:1, with the default options and seed 1. ``--large``
writes 1024x1024 pixels of tissue from 512x512, with the default options and seed 2. ``--times``
runs ``simdtex synth`` as a process of its own for each method, on three colour samples of 128x128, for outputs of
256x256; it prints the user CPU seconds of the whole process and its wall seconds, least to most of the samples, each
the median of the runs after the first. "start-up" is a process that makes one pixel.
"""

import resource
import tempfile
from functools import partial
from pathlib import Path

import common
import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from skimage import data, filters

import simdtex
from simdtex.io.image import write
from simdtex.model.source_map import apply_source_map

FRONT = common.DOCS / "_static" / "front.jpg"
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
    options, given = {"device": machine, "channel_axis": -1, "rng": SEED}, samples(side)
    made = [simdtex.synthesize(one, (2 * side, 2 * side), full_output=True, **options) for one in given.values()]
    photo, hole = mast(2 * side)
    wide, line = 2 * side + GAP, TEXT + 8
    results = line + side + GAP
    below = results + 2 * side + GAP
    parts = []
    for left, (name, sample), (picture, _) in zip(range(0, 3 * wide, wide), given.items(), made, strict=True):
        parts += [(left, line + side - len(sample), sample), (left, results, picture), (left, 0, f"{name}: the sample")]
        parts.append((left + side + GAP, line + side - 3 * line, "below: more\nof it, without\na seam"))
    relief = normals(given["wood"].mean(axis=2))
    lower = {
        "a photograph": photo,
        "the right mast removed": simdtex.fill(photo, hole, **options),
        "a normal map, arranged like the wood": apply_source_map(made[0][1].source, relief),
    }
    for number, (label, picture) in enumerate(lower.items()):
        parts += [(number * wide, below, label), (number * wide, below + line, picture)]
    return placed(parts, (3 * wide - GAP, below + line + 2 * side))


def process(words, folder):
    """User CPU seconds and wall seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    wall = common.timed(common.python, *words, cwd=folder)[1]
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before, wall


def measured(device, runs):
    """Rows of the times of every method, least to most of the samples, each a process of its own."""
    colour = {
        "tissue": data.immunohistochemistry()[300:428, 290:418],
        "wood": data.coffee()[270:398, 472:600],
        "stars": data.hubble_deep_field()[346:474, 166:294],
    }
    with tempfile.TemporaryDirectory() as folder:
        for name, sample in colour.items():
            write(Path(folder) / f"{name}.png", sample)
        for method, options in METHODS.items():
            more = [*options, "--seed", "1", "--quiet", *(["--device", device] if device else [])]
            words = "-m simdtex synth {}.png -o more.png --size 256x256"
            jobs = {name: partial(process, [*words.format(name).split(), *more], folder) for name in colour}
            found = np.array([np.median(those, 0) for those in common.in_turns(runs, jobs).values()])
            (least, low), (most, high) = found.min(0), found.max(0)
            yield [method, f"{least:.2f} to {most:.2f}", f"{low:.2f} to {high:.2f}"]


@common.command
def main(out=FRONT, side=SIDE, large=None, times=False, runs=5, device=None):
    machine = common.opened(device)
    if large:
        tissue, given = data.immunohistochemistry(), {"channel_axis": -1, "rng": 2, "device": machine}
        PIL.Image.fromarray(simdtex.synthesize(tissue, (1024, 1024), **given)).save(large, quality=85)
        print(f"{large}: {Path(large).stat().st_size // 1024} KiB")
        return
    if times:
        common.table("", ["method", "user CPU seconds", "wall seconds"], list(measured(device, runs)))
        return
    front(machine, side).save(out, quality=90)
    print(f"{out}: {out.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
