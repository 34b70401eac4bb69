# SPDX-License-Identifier: BSD-3-Clause
"""How like the training image realisations of values are that are no categories.

    python benchmarks/values.py [--parts continuous,joint] [--walker CSV] [--number 20] [--side 128]
                                [--options NAME=VALUE,...] [--out DIR] [--device TEXT]

``--walker`` is a table of Walker Lake with the columns U, V, X and Y; all others are as in ``simulation.py``. All
realisations aim at the histogram of the training image (``share_spread=0``).

continuous  realisations of 128 x 128: the mean and the standard deviation over those of the training image, by how much
         P1 to P99 are off in shares, the variograms at lags 1 to 16 over the image's, and the copied windows.
joint    two variables in three kinds of relation, both simulated, or one known everywhere: the correlation and the
         correlation ratio of a realisation and of the image, the distance of their joint histograms (of four windows of
         the image in the last column), and the variogram of the second variable over the image's.
"""

from functools import partial
from pathlib import Path

import common
import numpy as np
from matplotlib import cbook
from scipy import ndimage
from simulation import beside
from skimage import data as bundled

import simdtex
from simdtex.io import image as files
from simdtex.jobs.simulation.ensemble import copied, copies, variogram

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


def continuous(images, walker, number, side, options, out):
    """Rows of the figures of continuous variables."""
    fields = {name: partial(walker_lake, walker, name) for name in "UV"} if walker else {}
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


def joint(_images, _walker, number, side, options, _out):
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


OF_LAGS = [f"lag {lag}" for lag in LAGS]
OF_PAIRS = "correlation|correlation, image|ratio|ratio, image|joint distance"
PARTS = {
    "continuous": (continuous, ["variable", "mean", "deviation", "quantiles off", *OF_LAGS, "copied"]),
    "joint": (joint, ["relation", "second", *OF_PAIRS.split("|"), *OF_LAGS, "of windows"]),
}


@common.command
def main(parts="", images="", number=20, side=int, options="", walker=Path, out=Path, device=None):
    given = {"rng": 1, "share_spread": 0.0, "device": common.opened(device)} | common.parsed(options)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    for part, (rows, header) in common.chosen(PARTS, parts).items():
        found = list(rows(images, walker, number, side, given, out))
        common.table(part, header, found, out and out / f"values-{part}.csv")


if __name__ == "__main__":
    main()
