# SPDX-License-Identifier: BSD-3-Clause
"""How well pictures are continued and made seamless: the seam before and after, and how real what is new looks.

    python benchmarks/tile.py [--samples DIR] [--only brick,wood] [--seeds N] [--bands 4,8,16,32] [--add 64]
                              [--options NAME=VALUE,NAME=VALUE] [--out DIR] [--csv FILE] [--device TEXT]

Each texture is made seamless by ``simdtex.extend(..., seamless=True)`` with bands of these widths, and continued to the
right and downwards by so many pixels. ``--out`` writes a sheet for each texture, at 1:1, where what is to tile is laid
out 2 x 2. The figures, of which 1 is that of real texture:

tiles   `simdtex.quality.seam`: the step across the seam of the picture laid side by side with itself.
rim, inside, seam, step    of what is new, as in fill.py.
"""

import argparse
import time
from pathlib import Path

import fill
import numpy as np
import over_folder
import samples

import simdtex

FIGURES = ("tiles", *fill.FIGURES)


def frame(shape, band):
    """What `extend` makes anew of a picture to tile: a band along its edges."""
    found = np.ones(shape, bool)
    found[band:-band, band:-band] = False
    return found


def seamless(picture, band):
    """The figures of a picture that was made seamless: it is seen with as much of its repetition as was made anew."""
    around = ((band, band), (band, band), (0, 0))[: picture.ndim]
    wrapped = np.pad(picture, around, mode="wrap")
    found = fill.score(wrapped, wrapped, np.pad(frame(picture.shape[:2], band), band, constant_values=True))
    return {"tiles": simdtex.quality.seam(picture)} | found


def continued(picture, shape):
    """The figures of a picture of which the part of that shape at the top left was given."""
    new = np.ones(picture.shape[:2], bool)
    new[: shape[0], : shape[1]] = False
    return fill.score(picture, picture, new)


def twice(picture):
    """The picture laid out 2 x 2."""
    return np.tile(picture, (2, 2, 1)[: picture.ndim])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=Path, help="folder of pictures, each a texture")
    parser.add_argument("--only", default="", help="names of textures, brick,wood")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--bands", default="4,8,16,32", help="widths, pixels; none that takes up a picture")
    parser.add_argument("--add", type=int, default=64, help="how much is added to the right and below, pixels")
    parser.add_argument("--options", default="", help="NAME=VALUE,NAME=VALUE")
    parser.add_argument("--out", type=Path, help="folder for the sheets")
    parser.add_argument("--csv", type=Path, help="a file for the table, a line for each texture and band")
    parser.add_argument("--device")
    options = parser.parse_args()
    try:
        given = over_folder.parsed(options.options)
        bands = [int(width) for width in options.bands.split(",")]
        known = samples.chosen(options.samples, options.only)
    except ValueError as error:
        parser.error(str(error))
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}")
    results = []
    for name, picture in known.items():
        channels = {"channel_axis": -1 if picture.ndim == 3 else None}
        cells = [(f"{name}, 2 x 2", twice(picture), f"tiles {simdtex.quality.seam(picture):.2f}")]
        results.append((name, "", "as it is", 1, {"tiles": simdtex.quality.seam(picture)}))
        jobs = [
            (f"band {band}", {"seamless": True, "band": band}) for band in bands if 3 * band < min(picture.shape[:2])
        ]
        jobs += [("continued", {"right": options.add, "bottom": options.add})] if options.add else []
        for label, what in jobs:
            for seed in range(1, options.seeds + 1):
                began = time.perf_counter()
                made = simdtex.extend(picture, rng=seed, device=machine, **what, **channels, **given)
                seconds = time.perf_counter() - began
                tiled = "seamless" in what
                figures = seamless(made, what["band"]) if tiled else continued(made, picture.shape[:2])
                results.append((name, "", label, seed, figures))
                told = "  ".join(f"{figure} {value:.2f}" for figure, value in figures.items())
                print(f"{name:12} {label:10} seed {seed}  {told}  {seconds:.1f} s", flush=True)
                if seed == 1:
                    cells.append((label, twice(made) if tiled else made, told))
        if options.out:
            options.out.mkdir(parents=True, exist_ok=True)
            over_folder.sheet(options.out / f"tile-{name}.png", cells, 3)
    fill.report(results, options.csv, FIGURES)


if __name__ == "__main__":
    main()
