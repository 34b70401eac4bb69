# SPDX-License-Identifier: BSD-3-Clause
"""How well holes are filled and pictures made seamless and continued: what is new is compared with real texture.

    python benchmarks/fill.py [--samples DIR] [--only brick,wood] [--parts fill,tile] [--seeds N]
                              [--options search=exact] [--out DIR] [--device TEXT]

Textures are those of scikit-image that every study has, or the pictures of a folder. ``fill``: four holes of each are
filled by `simdtex.fill`, with the defaults and with every set of ``--options``, and beside it by
`skimage.restoration.inpaint_biharmonic`; the original is measured like a filling of its own hole. ``tile``:
`simdtex.extend` makes each seamless by bands of several widths, and continues it to the right and downwards. ``--out``
takes a table for each part and a sheet for each texture, at 1:1. The figures, of which 1 is that of real texture:

rim     mean squared distance from the 7 x 7 patches that cross the rim to the nearest patch of the known part, over
        the same of patches of the known part; a patch is not compared with those within 8 pixels.
inside  the same of the patches that lie in what is new.
seam    mean absolute step between a new pixel and a known one beside it, over that between known ones.
step    the same between two new pixels: below 1 what is new is blurred.
tiles   `simdtex.quality.seam`: the step across the seam of a seamless picture laid side by side with itself.
"""

from itertools import pairwise, product
from pathlib import Path

import common
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import gaussian_filter
from skimage import draw
from skimage.restoration import inpaint_biharmonic

import simdtex
from simdtex.jobs.studies.quality import as_planes, in_deviations, nearest

PATCH = 7  # side of the patches, pixels
APART = 8  # patches nearer to one another are not compared
QUERIES = 1024  # patches of the known part that are looked up
FAR = 1e3  # what is unknown, in sample standard deviations: no patch with it is the nearest
FIGURES = ("rim", "inside", "seam", "step")
BANDS, ADDED = (4, 8, 16, 32), {"right": 64, "bottom": 64}  # widths of bands, and what is added, pixels


def hole_shapes(shape):
    """Holes of four shapes in a picture of that shape, by name: (rows, cols) bool arrays."""
    rows, cols = shape
    row, col = np.indices(shape)
    noise = gaussian_filter(np.random.default_rng(3).standard_normal(shape), min(shape) / 16)
    away = np.hypot((row / rows - 0.48) / 0.2, (col / cols - 0.52) / 0.2)
    scratch = np.zeros(shape, bool)
    corners = [(round(r * rows), round(c * cols)) for r, c in [(0.2, 0.12), (0.35, 0.4), (0.62, 0.55), (0.8, 0.9)]]
    for first, second in pairwise(corners):
        for down in (-1, 0, 1):
            scratch[draw.line(first[0] + down, first[1], second[0] + down, second[1])] = True
    return {
        "rectangle": (abs(row - rows * 0.5) < rows * 0.13) & (abs(col - cols * 0.5) < cols * 0.16),
        "blob": away + 0.35 * noise / noise.std() < 1,
        "scratch": scratch,
        "border": (abs(row - rows * 0.55) < rows * 0.17) & (col >= cols * 0.78),
    }


def score(original, picture, hole):
    """The figures of a filling: a dictionary with those of `FIGURES` that the hole allows."""
    planes, made = in_deviations(as_planes(original), as_planes(original), as_planes(picture))
    known = planes.copy()
    known[hole] = FAR
    share = sliding_window_view(hole, (PATCH, PATCH)).mean((2, 3)).ravel()
    distance = {}
    for kind, which in {"known": share == 0, "rim": (share > 0) & (share < 1), "inside": share == 1}.items():
        asked = np.flatnonzero(which)
        if kind == "known":
            asked = asked[:: -(-len(asked) // QUERIES)]
        if len(asked):
            distance[kind] = np.mean(nearest(made, asked, known, PATCH, APART) ** 2)
    steps = {kind: [] for kind in ("known", "seam", "step")}
    for axis in (0, 1):
        size = abs(np.diff(made, axis=axis)).mean(-1)
        ends = np.swapaxes(hole, 0, axis)
        ends = np.swapaxes(ends[1:].astype(int) + ends[:-1], 0, axis)  # how many of the two are in the hole
        for number, kind in enumerate(steps):
            steps[kind].append(size[ends == number])
    mean = {kind: np.concatenate(found).mean() for kind, found in steps.items()}
    found = {kind: distance[kind] / distance["known"] for kind in ("rim", "inside") if kind in distance}
    return found | {kind: mean[kind] / mean["known"] for kind in ("seam", "step")}


def biharmonic(picture, hole):
    """The hole filled by the biharmonic equation, in the picture's type."""
    found = inpaint_biharmonic(picture / 255, hole, channel_axis=common.axis(picture))
    return np.rint(found.clip(0, 1) * 255).astype(picture.dtype)


def cut(picture, hole):
    """The picture with its hole in a colour that it does not have, for the eye."""
    shown = picture if picture.ndim == 3 else np.stack([picture] * 3, -1)
    return np.where(hole[..., None], np.array((255, 0, 255), np.uint8), shown)


def fillings(picture, hole, settings, seeds, machine):
    """What the hole is filled with, in turn: label and picture."""
    for label, given in settings.items():
        for seed in range(1, seeds + 1):
            options = {"channel_axis": common.axis(picture), "rng": seed, "device": machine} | given
            yield label, simdtex.fill(picture, hole, **options)
    yield "biharmonic", biharmonic(picture, hole)
    yield "original", picture


def filled(name, picture, settings, seeds, machine):
    """Fill the four holes of a texture; yield the hole, the filling, its figures and its picture."""
    for shape, hole in hole_shapes(picture.shape[:2]).items():
        yield shape, f"{name}, {shape}", None, cut(picture, hole)
        for label, made in fillings(picture, hole, settings, seeds, machine):
            if not (made[~hole] == picture[~hole]).all():
                raise AssertionError(f"{label} changed known pixels of {name}")
            yield shape, label, score(picture, made, hole), made


def frame(shape, band):
    """What `extend` makes anew of a picture to tile: a band along its edges."""
    found = np.ones(shape, bool)
    found[band:-band, band:-band] = False
    return found


def seamless(picture, band):
    """The figures of a picture that was made seamless: it is seen with as much of its repetition as was made anew."""
    wrapped = np.pad(picture, ((band, band), (band, band), (0, 0))[: picture.ndim], mode="wrap")
    found = score(wrapped, wrapped, np.pad(frame(picture.shape[:2], band), band, constant_values=True))
    return {"tiles": simdtex.quality.seam(picture)} | found


def twice(picture):
    """The picture laid out 2 x 2."""
    return np.tile(picture, (2, 2, 1)[: picture.ndim])


def tiled(_name, picture, _settings, seeds, machine):
    """Make a texture seamless and continue it; yield as `filled` does."""
    yield "", "as it is", {"tiles": simdtex.quality.seam(picture)}, twice(picture)
    rows, cols = picture.shape[:2]
    ways = {f"band {band}": {"seamless": True, "band": band} for band in BANDS if 3 * band < min(rows, cols)}
    for (label, what), seed in product((ways | {"continued": ADDED}).items(), range(1, seeds + 1)):
        made = simdtex.extend(picture, channel_axis=common.axis(picture), rng=seed, device=machine, **what)
        if label == "continued":
            new = np.ones(made.shape[:2], bool)
            new[:rows, :cols] = False
            yield "", label, score(made, made, new), made
        else:
            yield "", label, seamless(made, what["band"]), twice(made)


PARTS = {"fill": (filled, FIGURES), "tile": (tiled, ("tiles", *FIGURES))}


def means(results, figures):
    """Rows of means over seeds and holes; results are picture, shape, label, figures."""
    names, shapes, labels = (list(dict.fromkeys(each)) for each in list(zip(*results, strict=True))[:3])
    groups = [(name, [r for r in results if r[0] == name]) for name in names]
    groups += [(f"all, {shape}", [r for r in results if r[1] == shape]) for shape in shapes if len(shapes) > 1]
    for title, group in [*groups, ("all", results)]:
        for label in labels:
            values = [[r[3][figure] for r in group if r[2] == label and figure in r[3]] for figure in figures]
            yield [title, label, *(f"{np.mean(each):.2f}" if each else "" for each in values)]


@common.command
def main(samples=Path, only="", parts="", seeds=1, options=list, out=Path, device=None):
    settings = {"fill": {}} | {text: common.parsed(text) for text in options}
    known, machine = common.samples(samples, only), common.opened(device)
    for part, (run, figures) in common.chosen(PARTS, parts).items():
        results = []
        for name, picture in known.items():
            cells = {}
            for shape, label, found, made in run(name, picture, settings, seeds, machine):
                cells.setdefault((shape, label), (label, made, common.told(found) if found else ""))  # the first seed
                if found:
                    results.append((name, shape, label, found))
            if out:
                columns = 3 if part == "tile" else 3 + len(settings)
                common.sheet(out / f"{part}-{name}.png", cells.values(), columns, scale=1)
        rows = list(means(results, figures))
        common.table("Means over seeds and holes", ["picture", "filling", *figures], rows, out and out / f"{part}.csv")


if __name__ == "__main__":
    main()
