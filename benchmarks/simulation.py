# SPDX-License-Identifier: BSD-3-Clause
"""How like the training image realisations are, with and without hard and soft data.

    python benchmarks/simulation.py [--parts maps,border,volumes,soft] [--images channels,network,lenses,meanders]
                                    [--data 0,50,200,500] [--number 50] [--side N] [--options NAME=VALUE,...]
                                    [--out DIR] [--device TEXT]

``--options`` are those of `simdtex.simulate` that differ from its defaults, ``--number`` is that of realisations, and
``--side`` makes other sizes. ``--out`` takes a table for each part.

maps     training images of channels, of a network of thin lines without ends, of lenses, and of thin meanders without
         ends; data are read off another one of the same kind, at random places. The row *others* is of five more of the
         same kind. ``--out`` also takes pictures: the training image, two realisations, and the share of category 1.
border   the share of category 1 by the distance from the border of the map, in pixels: 16 *others* of each kind of
         *maps*, and 16 realisations, also of a quarter of the side from a quarter of the training image.
volumes  channels of elliptic cross section along x in 100 x 100 x 30 voxels, at random depths: the share of channels,
         the data missed, and the mean absolute differences, from the training image, of the indicator variograms and
         of the connectivity functions along z, y and x, lags up to a third of a side; *another* is one more draw.
soft     the shares of channels in 128 x 128 pixels, means of 8 realisations, by the weight of the soft data: where the
         same probability is asked everywhere, in four bands of a gradient from 0 to 1, and in 16 blocks of 32 x 32, by
         how much they differ from 0.1, 0.15 ... 0.85; and the dead ends and the js 4x4 of the second map. Weight 0 is a
         run without, and *proportions* are asked instead of the first four maps.
"""

from itertools import pairwise
from pathlib import Path

import common
import numpy as np
from channels import Scene, channels
from scipy import ndimage
from scipy.spatial import KDTree

import simdtex
from simdtex.io import image as files
from simdtex.jobs.simulation.ensemble import channels as of_the_pages
from simdtex.jobs.simulation.ensemble import connectivity, summary, variogram
from simdtex.random import as_seed

SPECK = 16  # pixels of a body that is one, at most
OTHERS = 5
CELL = 1600  # pixels of a cell of the network, on average
LINE = 4  # width of its lines, pixels
STRETCH = 2  # cells are so many times as wide as high
SIZES = ((56, 10), (22, 7))  # lengths and heights of lenses, pixels
SHARE = 0.3  # of lenses, and of channels in a volume; half of it of meanders
FLAT, WEIGHTS = (0.1, 0.27, 0.5, 0.8), (0, 0.25, 1, 4)  # probabilities, and weights, of soft data
BLOCK, TOGETHER = 32, 8  # pixels of a side, and realisations
DISTANCES, EACH = (0, 3, 8, 16, 32, 1000), 16  # from the border, pixels, and realisations


def network(shape, rng=None):
    """Make a network (rows, cols) uint8 of lines about 4 pixels wide, 1, of cells that are twice as wide as high."""
    draw = np.random.default_rng(rng)
    high = np.array([shape[0] * STRETCH, shape[1]])  # where cells are as high as wide
    least = np.sqrt(CELL * STRETCH) / 2  # between the middles of two cells, so that none is tiny
    middles = np.empty((0, 2))
    for one in draw.uniform(-60, high + 60, (20 * high.prod() // CELL, 2)):
        if not len(middles) or ((middles - one) ** 2).sum(1).min() > least**2:
            middles = np.vstack([middles, one])
    near, which = KDTree(middles).query(np.stack(np.indices(shape), -1) * (STRETCH, 1), 2)
    apart = middles[which[..., 1]] - middles[which[..., 0]]
    # the distance from the line between two middles, across it; the stretch makes it longer down
    across = (near[..., 1] ** 2 - near[..., 0] ** 2) / 2 / np.hypot(apart[..., 0] * STRETCH, apart[..., 1])
    return (across < LINE / 2).astype(np.uint8)


def lenses(shape, rng=None):
    """Make lenses (rows, cols) uint8 of two sizes, 1, that lie apart or run together, tilted by 20 degrees at most."""
    draw = np.random.default_rng(rng)
    image, (row, col) = np.zeros(shape, np.uint8), np.indices(shape)
    while image.mean() < SHARE:
        length, height = SIZES[draw.integers(2)]
        i, j, turn = *draw.uniform(-20, np.add(shape, 20)), np.radians(draw.uniform(-20, 20))
        along = (col - j) * np.cos(turn) + (row - i) * np.sin(turn)
        across = (row - i) * np.cos(turn) - (col - j) * np.sin(turn)
        image[(2 * along / length) ** 2 + (2 * across / height) ** 2 <= 1] = 1
    return image


def meanders(shape, rng=None):
    """Make thin sinuous lines (rows, cols) uint8, 1, about 4 pixels wide, that cross the image and never end."""
    scene = Scene(shape, as_seed(rng), LINE)
    while scene.pixels.mean() < SHARE / 2:
        scene.add_main()
    return scene.pixels


IMAGES = {"channels": channels, "network": network, "lenses": lenses, "meanders": meanders}


def hard_data(truth, number, seed):
    """So many values of the hidden map, the rest masked; None for 0."""
    hidden = np.ones(truth.size, bool)
    hidden[np.random.default_rng(seed).choice(truth.size, number, replace=False)] = False
    return np.ma.array(truth, mask=hidden.reshape(truth.shape)) if number else None


def specks(image):
    """Bodies of 16 pixels or less in 10,000 pixels."""
    sizes = np.bincount(ndimage.label(image)[0].ravel())[1:]
    return 1e4 * (sizes <= SPECK).sum() / image.size


def figures(made, image, truth, known):
    """The figures of realisations in a row."""
    row, col = ([], []) if known is None else np.nonzero(~known.mask)
    data = np.stack([col, row, truth[row, col]], -1) if known is not None else None
    found = summary(made, image, data=data)
    ends, anodi = found.dead_ends[1], found.anodi  # the training image comes last
    return [
        *(f"{found.shares[1, :-1].mean():.3f}", f"{ends[:-1].mean():.2f}", f"{ends[-1]:.2f}"),
        *(f"{found.components[1, :-1].mean():.2f}", f"{np.mean([specks(one) for one in made]):.2f}"),
        *(int(found.misses.sum()), f"{(made == truth).mean():.3f}", f"{anodi.by_level[0, 1]:.3f}"),
        *(f"{found.copied.mean():.2f}", f"{anodi.variety:.3f}", f"{anodi.likeness:.3f}", f"{anodi.ratio:.2f}"),
    ]


def sheet(image, made):
    """The training image, two realisations, and the share of category 1."""
    return beside((image, *made[:2], (made == 1).mean(0)))


def beside(pictures):
    """Pictures of values from 0 to 1 side by side."""
    shown = [np.rint(255 * one).astype(np.uint8) for one in pictures]
    gap = np.full((len(shown[0]), 6), 128, np.uint8)
    return np.hstack([part for one in shown for part in (one, gap)][:-1])


def maps(images, data, number, side, options, out):
    """Rows of the figures of maps."""
    shape = (side or 250,) * 2
    for name, draw in common.chosen(IMAGES, images).items():
        image, truth, *others = (draw(shape, seed) for seed in (1, 1001, *range(1002, 1002 + OTHERS)))
        yield [name, "others", *figures(np.stack(others), image, truth, None)]
        for count in data:
            known = hard_data(truth, count, 1)
            made = simdtex.simulate(image, number, shape=shape, known=known, **options).values
            yield [name, count, *figures(made, image, truth, known)]
            if out:
                files.write(out / f"{name}-{count}.png", sheet(image, made))


def border(images, _data, number, side, options, _out):
    """Rows of the share of category 1 by the distance from the border."""
    whole, number = side or 250, min(number, EACH)
    for name, draw in common.chosen(IMAGES, images).items():
        image = draw((whole, whole), 1)
        yield [name, "others", *_by_distance(np.stack([draw(image.shape, 1001 + k) for k in range(number)]))]
        for size, training in ((whole, image), (whole // 4, image[: whole // 2, : whole // 2])):
            made = simdtex.simulate(training, number, shape=(size, size), **options).values
            yield [name, size, *_by_distance(made)]


def _by_distance(made):
    row, col = np.indices(made.shape[1:])
    rows, cols = made.shape[1:]
    apart = np.minimum(np.minimum(row, rows - 1 - row), np.minimum(col, cols - 1 - col))
    bands = [made[:, (apart >= least) & (apart < most)] for least, most in pairwise(DISTANCES)]
    return [f"{one.mean():.3f}" if one.size else "" for one in bands]


def model(shape, seed):
    """Sinuous channels in a volume (layers, rows, cols): 1 in channels, 0 elsewhere, uint8."""
    rng = np.random.default_rng(seed)
    layers, rows, cols = shape
    z, y, x = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij", sparse=True)
    found = np.zeros(shape, bool)
    while found.mean() < SHARE:
        half, thick = rng.uniform(4, 7), rng.uniform(2, 3.5)
        wave, swing = rng.uniform(40, 80), rng.uniform(4, 10)
        middle = rng.uniform(0, rows) + swing * np.sin(2 * np.pi * (x / wave + rng.uniform()))
        middle = middle + (x - cols / 2) * rng.normal(0, 0.1)
        depth = rng.uniform(0, layers)
        found |= ((y - middle) / half) ** 2 + ((z - depth) / thick) ** 2 < 1
    return found.astype(np.uint8)


def apart(volume, training):
    """Mean absolute differences of variograms and of connectivity functions, over the axes, as text."""
    most = [min(n, 90) // 3 for n in training.shape]
    curves = [abs(variogram(volume, a, m) - variogram(training, a, m))[1:].mean() for a, m in enumerate(most)]
    found, wanted = (connectivity(one, 1, min(most)).function for one in (volume, training))
    return f"{np.mean(curves):.4f}", f"{np.nanmean(abs(found - wanted)):.4f}"


def volumes(_images, _data, number, side, options, _out):
    """Rows of the figures of volumes, two realisations each."""
    shape = (3 * (side or 100) // 10, side or 100, side or 100)
    training, truth = model(shape, 1), model(shape, 2)
    for count in (0, 200):
        known = hard_data(truth, count, 3)
        for first in range(min(number, 2)):
            made = simdtex.simulate(training, 1, first=first, shape=shape, known=known, **options).values[0]
            missed = 0 if known is None else int((made != known).sum())
            yield [count, f"{made.mean():.3f}", f"{training.mean():.3f}", missed, *apart(made, training)]
    yield ["another", f"{truth.mean():.3f}", f"{training.mean():.3f}", "", *apart(truth, training)]


def soft(_images, _data, number, side, options, out):
    """Rows of the shares of channels, and of their patterns."""
    side, image = (side or 128) // BLOCK * BLOCK, of_the_pages()[0]
    many = (side // BLOCK) ** 2
    blocks = np.random.default_rng(3).permutation(np.linspace(0.1, 0.85, many)).reshape(side // BLOCK, -1)
    slope = np.repeat((np.arange(side) + 0.5)[:, None] / side, side, 1)
    pictures = []

    def made(p, **given):
        given |= {} if p is None else {"probabilities": np.stack([1 - p, p])}
        found = simdtex.simulate(image, min(number, TOGETHER), shape=(side, side), **given, **options).values
        pictures.append(found[0])
        return found

    for weight in WEIGHTS:
        given = {"soft_weight": weight}
        flat = [made(np.full((side, side), p) if weight else None, **given) for p in (FLAT if weight else FLAT[:1])]
        bands, off = [""] * 4, []
        if weight:
            bands = [f"{part.mean():.2f}" for part in np.split(made(slope, **given).mean(0), 4)]
            found = made(np.kron(blocks, np.ones((BLOCK, BLOCK))), **given).mean(0)
            off = abs(found.reshape(len(blocks), BLOCK, -1, BLOCK).mean((1, 3)) - blocks)
        yield [
            f"weight {weight:g}",
            *_shares(flat),
            *bands,
            *_offs(off),
            *_patterns(flat[min(1, len(flat) - 1)], image),
        ]
    flat = [made(None, proportions=(1 - p, p)) for p in FLAT]
    yield ["proportions", *_shares(flat), *[""] * 4, *_offs([]), *_patterns(flat[1], image)]
    if out:
        files.write(out / "soft.png", beside(pictures[7:13]))


def _shares(flat):
    return [f"{one.mean():.2f}" for one in flat] + [""] * (len(FLAT) - len(flat))


def _offs(off):
    return (f"{np.mean(off):.3f}", f"{np.max(off):.3f}") if len(off) else ("", "")


def _patterns(made, image):
    found = summary(made, image)
    return f"{found.dead_ends[1][:-1].mean():.2f}", f"{found.anodi.by_level[0, 1]:.3f}"


OF_MAPS = "share|dead ends|in the image|bodies|specks|misses|right|js 4x4|copied|variety|likeness|ratio"
BANDS = [f"band {p}" for p in (0.125, 0.375, 0.625, 0.875)]
PARTS = {
    "maps": (maps, ["image", "data", *OF_MAPS.split("|")]),
    "border": (border, ["image", "side", *(f"from {least}" for least in DISTANCES[:-1])]),
    "volumes": (volumes, ["data", "share", "wanted", "misses", "variograms", "connectivity"]),
    "soft": (soft, ["channels", *map(str, FLAT), *BANDS, "blocks off by", "at most", "dead ends", "js 4x4"]),
}


@common.command
def main(parts="", images="", data=(0, 50, 200, 500), number=50, side=int, options="", out=Path, device=None):
    given = {"categorical": True, "rng": 1, "device": common.opened(device)} | common.parsed(options)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    for part, (rows, header) in common.chosen(PARTS, parts).items():
        found = list(rows(images, data, number, side, given, out))
        common.table(part, header, found, out and out / f"simulation-{part}.csv")


if __name__ == "__main__":
    main()
