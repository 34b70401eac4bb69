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

from pathlib import Path

import common
import fill
import numpy as np

import simdtex


def frame(shape, band):
    """What `extend` makes anew of a picture to tile: a band along its edges."""
    found = np.ones(shape, bool)
    found[band:-band, band:-band] = False
    return found


def seamless(picture, band):
    """The figures of a picture that was made seamless: it is seen with as much of its repetition as was made anew."""
    wrapped = np.pad(picture, ((band, band), (band, band), (0, 0))[: picture.ndim], mode="wrap")
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


@common.command
def main(samples=Path, only="", seeds=1, bands="4,8,16,32", add=64, options="", out=Path, csv=Path, device=None):
    known, results = common.samples(samples, only), []
    given = common.parsed(options) | {"device": common.opened(device)}
    for name, picture in known.items():
        own = {"tiles": simdtex.quality.seam(picture)}
        cells = [(f"{name}, 2 x 2", twice(picture), common.told(own))]
        results.append((name, "", "as it is", own))
        widths = [band for band in map(int, bands.split(",")) if 3 * band < min(picture.shape[:2])]
        jobs = {f"band {band}": {"seamless": True, "band": band} for band in widths}
        if add:
            jobs["continued"] = {"right": add, "bottom": add}
        for label, what in jobs.items():
            for seed in range(1, seeds + 1):
                more = {"rng": seed, "channel_axis": common.axis(picture), **what, **given}
                made, seconds = common.timed(simdtex.extend, picture, **more)
                tiled = "band" in what
                figures = seamless(made, what["band"]) if tiled else continued(made, picture.shape[:2])
                results.append((name, "", label, figures))
                print(f"{name:12} {label:10} seed {seed}  {common.told(figures)}  {seconds:.1f} s", flush=True)
                if seed == 1:
                    cells.append((label, twice(made) if tiled else made, common.told(figures)))
        if out:
            common.sheet(out / f"tile-{name}.png", cells, 3)
    fill.report(results, csv, ("tiles", *fill.FIGURES))


if __name__ == "__main__":
    main()
