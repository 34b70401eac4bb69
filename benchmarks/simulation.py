# SPDX-License-Identifier: BSD-3-Clause
"""How like the training image realisations are, with and without hard and soft data.

    python benchmarks/simulation.py [--parts maps,border,volumes,soft,continuous,joint]
                                    [--images channels,network,lenses,meanders] [--walker FILE]
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
continuous  values that are no categories, realisations of 128 x 128: the mean and the standard deviation over those of
         the training image, by how much P1 to P99 are off in shares, the variograms at lags 1 to 16 over the image's,
         and the copied windows. ``--walker`` names a CSV table of Walker Lake: columns U, V, X and Y.
joint    two variables in three kinds of relation, both simulated, or one known everywhere: the correlation and the
         correlation ratio of a realisation and of the image, the distance of their joint histograms (of four windows of
         the image in the last column), and the variogram of the second variable over the image's.
"""

from functools import partial
from itertools import pairwise
from pathlib import Path

import common
import numpy as np
from channels import Scene, channels
from matplotlib import cbook
from scipy import ndimage
from scipy.spatial import KDTree
from skimage import data as bundled

import simdtex
from simdtex.io import image as files
from simdtex.jobs.simulation.ensemble import channels as of_the_pages
from simdtex.jobs.simulation.ensemble import connectivity, copied, copies, summary, variogram
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


LAGS = [1, 2, 4, 8, 16]
PERCENTS = np.arange(0.01, 1, 0.01)


def smooth(seed, width, side=256):
    """A Gaussian random field that wraps around, with mean 0 and variance 1."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), width, mode="wrap")
    return (field - field.mean()) / field.std()


def lognormal():
    """Make a smooth skewed field with a tenth of zeros."""
    field = np.exp(smooth(1, 5))
    return np.where(field < np.quantile(field, 0.1), 0, field).astype(np.float32)


def walker_lake(path, name):
    """One of the variables of the table of Walker Lake."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    rows, cols = (table[axis].astype(int) - 1 for axis in "YX")
    field = np.zeros((rows.max() + 1, cols.max() + 1), np.float32)
    field[rows, cols] = table[name]
    return field


def relief(name, key):
    """A relief of matplotlib."""
    return cbook.get_sample_data(name)[key].astype(np.float32)


VALUES = {
    "lognormal": lognormal,
    "gravel": lambda: bundled.gravel()[:200, :200],
    "grass": lambda: bundled.grass()[:200, :200],
    "topobathy": partial(relief, "topobathy.npz", "topo"),
    "jacksboro": partial(relief, "jacksboro_fault_dem.npz", "elevation"),
}


def along(field):
    """The variogram at some lags, the mean over the axes."""
    return np.mean([variogram(field.astype(float), axis, LAGS[-1])[LAGS] for axis in (0, 1)], 0)


def ratios(made, image):
    """The mean variogram of realisations over that of the image, as text."""
    return [f"{ratio:.2f}" for ratio in np.mean([along(field) for field in made], 0) / along(image)]


def continuous(walker, images, _data, number, side, options, out):
    """Rows of the figures of continuous variables."""
    fields = {name: partial(walker_lake, walker, name) for name in "UV"} if walker else {}
    options = {name: value for name, value in options.items() if name != "categorical"}
    for name, draw in common.chosen(fields | VALUES, images).items():
        image = draw()
        made = simdtex.simulate(image, number, shape=(side or 128,) * 2, **options).values
        ranks, cuts = np.sort(image, axis=None), np.quantile(made, PERCENTS)
        low, high = (np.searchsorted(ranks, cuts, way) / ranks.size for way in ("left", "right"))
        deviation = np.mean([field.std(dtype=float) for field in made]) / image.std(dtype=float)
        yield [
            *(name, f"{made.mean(dtype=float) / image.mean(dtype=float):.3f}", f"{deviation:.3f}"),
            f"{np.maximum(low - PERCENTS, PERCENTS - high).max():.3f}",
            *(*ratios(made, image), f"{copied(copies(made, image)).mean():.3f}"),
        ]
        if out:
            parts = [
                np.clip((one - ranks[0]) / (np.quantile(image, 0.99) - ranks[0]), 0, 1) for one in (image, *made[:3])
            ]
            high = max(map(len, parts))
            parts = [np.pad(one, ((0, high - len(one)), (0, 0))) for one in parts]
            files.write(out / f"values-{name}.png", beside(parts))


def related(kind, seed, side):
    """Two variables (rows, cols, 2) in a relation: linear, parabola, or a category and a value."""
    first, other = smooth(seed, 4, side), smooth(seed + 1, 3, side)
    second = {"linear": 0.8 * first + 0.6 * other, "parabola": 0.6 * first**2 + 0.5 * other}
    if kind == "category":
        first = (first > 0.4) * 1.0
        return np.stack([first, 1.5 * first + other * (0.6 + 0.4 * first)], -1).astype(np.float32)
    return np.stack([first, second[kind]], -1).astype(np.float32)


def correlations(pair, cuts):
    """The correlation of two variables, and the correlation ratio of the second by classes of the first."""
    of, values = np.digitize(pair[..., 0], cuts[0]).ravel(), pair[..., 1].ravel().astype(float)
    means = np.bincount(of, values) / np.maximum(np.bincount(of), 1)
    return np.corrcoef(pair.reshape(-1, 2).T)[0, 1], means[of].std() / values.std()


def histogram(pair, cuts):
    """The joint histogram."""
    at = [np.digitize(pair[..., k], cuts[k]) for k in (0, 1)]
    counts = np.bincount((at[0] * 8 + at[1]).ravel(), minlength=64)
    return counts / counts.sum()


def joint(_images, _data, number, side, options, _out):
    """Rows of the relation of two variables."""
    side = side or 128
    for kind in ("linear", "parabola", "category"):
        image, truth = related(kind, 3, 2 * side), related(kind, 99, side)
        cuts = [np.unique(np.quantile(image[..., k], np.arange(1, 8) / 8)) for k in (0, 1)]
        cuts[0] = cuts[0] if kind != "category" else [0.5]
        windows = [image[i : i + side, j : j + side] for i in (0, side) for j in (0, side)]
        off = [abs(histogram(one, cuts) - histogram(image, cuts)).sum() / 2 for one in windows]
        known = np.stack([np.clip(truth[..., 0], image[..., 0].min(), image[..., 0].max()), np.nan * truth[..., 1]], -1)
        for name, given in (("both simulated", None), ("one known", known)):
            how = options | {"channel_axis": -1, "categorical": (0,) if kind == "category" else False}
            made = simdtex.simulate(image, number, shape=(side, side), known=given, **how).values
            found = np.mean([correlations(one, cuts) for one in made], 0)
            apart = np.mean([abs(histogram(one, cuts) - histogram(image, cuts)).sum() / 2 for one in made])
            pairs = zip(found, correlations(image, cuts), strict=True)
            texts = [f"{value:.3f}" for both in pairs for value in both]
            yield [kind, name, *texts, f"{apart:.3f}", *ratios(made[..., 1], image[..., 1]), f"{np.mean(off):.3f}"]


OF_MAPS = "share|dead ends|in the image|bodies|specks|misses|right|js 4x4|copied|variety|likeness|ratio"
OF_LAGS = [f"lag {lag}" for lag in LAGS]
OF_PAIRS = "correlation|correlation, image|ratio|ratio, image|joint distance"
BANDS = [f"band {p}" for p in (0.125, 0.375, 0.625, 0.875)]
PARTS = {
    "maps": (maps, ["image", "data", *OF_MAPS.split("|")]),
    "border": (border, ["image", "side", *(f"from {least}" for least in DISTANCES[:-1])]),
    "volumes": (volumes, ["data", "share", "wanted", "misses", "variograms", "connectivity"]),
    "soft": (soft, ["channels", *map(str, FLAT), *BANDS, "blocks off by", "at most", "dead ends", "js 4x4"]),
    "continuous": (continuous, ["variable", "mean", "deviation", "quantiles off", *OF_LAGS, "copied"]),
    "joint": (joint, ["relation", "second", *OF_PAIRS.split("|"), *OF_LAGS, "of windows"]),
}


@common.command
def main(
    parts="", images="", data=(0, 50, 200, 500), number=50, side=int, options="", out=Path, device=None, walker=Path
):
    given = {"categorical": True, "rng": 1, "device": common.opened(device)} | common.parsed(options)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    for part, (rows, header) in common.chosen(PARTS, parts).items():
        rows = partial(rows, walker) if rows is continuous else rows
        found = list(rows(images, data, number, side, given, out))
        common.table(part, header, found, out and out / f"simulation-{part}.csv")


if __name__ == "__main__":
    main()
