# SPDX-License-Identifier: BSD-3-Clause
"""How well holes are filled: parts of textures are cut out, filled, and compared with real texture.

    python benchmarks/fill.py [--samples DIR] [--only brick,wood] [--seeds N] [--options NAME=VALUE,NAME=VALUE ...]
                              [--holes rectangle,blob,scratch,border] [--out DIR] [--csv FILE] [--device TEXT]

Textures are those of scikit-image that every study has, or the pictures of a folder. Each hole is filled by
`simdtex.fill`, with the defaults and with every set of ``--options``, and beside it by
`skimage.restoration.inpaint_biharmonic` and, if OpenCV is installed (``pip install opencv-python-headless``), by its
``inpaint`` after Telea; the original is measured like a filling of its own hole. ``--out`` writes a sheet for each
texture, at 1:1. The figures, of which 1 is that of real texture:

rim     mean squared distance from the 7 x 7 patches that cross the rim to the nearest patch of the known part, over
        the same of patches of the known part; a patch is not compared with those within 8 pixels.
inside  the same of the patches that lie in the hole.
seam    mean absolute step between a pixel of the hole and a known one beside it, over that between known ones.
step    the same between two pixels of the hole: below 1 the filling is blurred.
"""

from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import common
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import gaussian_filter
from skimage import draw
from skimage.restoration import inpaint_biharmonic

import simdtex
from simdtex.experiments.quality import as_planes, in_deviations, nearest

PATCH = 7  # side of the patches, pixels
APART = 8  # patches nearer to one another are not compared
QUERIES = 1024  # patches of the known part that are looked up
FAR = 1e3  # what is unknown, in sample standard deviations: no patch with it is the nearest
FIGURES = ("rim", "inside", "seam", "step")


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
            distance[kind] = np.mean(nearest(made, asked, known, PATCH, APART).distance ** 2)
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


def telea(picture, hole):
    """The hole filled by OpenCV's fast marching after Telea (2004), reaching 3 pixels."""
    import cv2

    return cv2.inpaint(picture, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA)


def cut(picture, hole):
    """The picture with its hole in a colour that it does not have, for the eye."""
    shown = picture if picture.ndim == 3 else np.stack([picture] * 3, -1)
    return np.where(hole[..., None], np.array((255, 0, 255), np.uint8), shown)


def fillings(picture, hole, settings, seeds, machine):
    """What the hole is filled with, in turn: label, seed, picture, seconds."""
    for label, given in settings.items():
        for seed in range(1, seeds + 1):
            options = {"channel_axis": common.axis(picture), "rng": seed, "device": machine} | given
            yield label, seed, *common.timed(simdtex.fill, picture, hole, **options)
    for method in (biharmonic, telea):
        with suppress(ModuleNotFoundError):
            yield method.__name__, 1, *common.timed(method, picture, hole)
    yield "original", 1, picture, 0.0


def report(results, path, figures=FIGURES):
    """Print the means over seeds and holes, and write them as a table; results are picture, shape, label, figures."""
    names, shapes, labels = (list(dict.fromkeys(each)) for each in list(zip(*results, strict=True))[:3])
    groups = [(name, [r for r in results if r[0] == name]) for name in names]
    groups += [(f"all, {shape}", [r for r in results if r[1] == shape]) for shape in shapes if len(shapes) > 1]
    lines = []
    for title, group in [*groups, ("all", results)]:
        for label in labels:
            values = [[r[3][figure] for r in group if r[2] == label and figure in r[3]] for figure in figures]
            lines.append([title, label, *(f"{np.mean(each):.2f}" if each else "" for each in values)])
    header = ["picture", "filling", *figures]
    common.show("Means over seeds and holes", header, lines)
    if path:
        common.write(path, header, lines)


@common.command
def main(samples=Path, only="", holes="", seeds=1, options=list, out=Path, csv=Path, device=None):
    settings = {"fill": {}} | {text: common.parsed(text) for text in options or ()}
    known, results = common.samples(samples, only), []
    machine = common.opened(device)
    for name, picture in known.items():
        cells = []
        for shape, hole in common.chosen(hole_shapes(picture.shape[:2]), holes).items():
            cells.append((f"{name}, {shape}", cut(picture, hole), ""))
            for label, seed, made, seconds in fillings(picture, hole, settings, seeds, machine):
                if not (made[~hole] == picture[~hole]).all():
                    raise AssertionError(f"{label} changed known pixels of {name}")
                figures = score(picture, made, hole)
                results.append((name, shape, label, figures))
                line = f"{name:12} {shape:10} {label:20} seed {seed}  {common.told(figures)}  {seconds:.1f} s"
                print(line, flush=True)
                if seed == 1:
                    cells.append((label, made, common.told(figures)))
        if out:
            common.sheet(out / f"fill-{name}.png", cells, 3 + len(settings))
    report(results, csv)


if __name__ == "__main__":
    main()
