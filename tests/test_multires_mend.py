"""A sample is made to wrap around, pieces that meet fade into each other, and pictures show neither edges nor lines."""

import itertools

import numpy as np
import pytest
from cases import assert_same_bits, texture
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from skimage import data

import simdtex
from simdtex.experiments.quality import seam
from simdtex.methods.multires.mend import SHARE, _least, _path, mend
from simdtex.model.stretched import Stretched


def mended(pixels):
    """A sample (rows, cols) or (rows, cols, channels) that wraps around."""
    planes = Stretched(pixels.reshape(*pixels.shape[:2], -1)).planes
    return pixels.reshape(-1, *pixels.shape[2:])[mend(planes)]


GRASS = data.grass()[:128, :128]
PHOTOGRAPHS = {
    "gravel": data.gravel()[:128, :128],
    "grass": GRASS,
    "brick": data.brick()[:128, :128],
    "coffee": data.coffee()[266:362, 486:582],
}


def run(sample, side, **options):
    axis = -1 if sample.ndim == 3 else None
    return simdtex.synthesize(sample, (side, side), method="multires", channel_axis=axis, rng=1, **options)


def lines(picture, period):
    """The mean absolute difference across the lines at multiples of a period, over that across all others."""
    ratios = []
    for axis in (0, 1):
        across = abs(np.diff(np.moveaxis(picture.astype(float), axis, 0), axis=0))
        across = across.reshape(len(across), -1).mean(1)
        at = np.arange(1, len(across) + 1) % period == 0
        ratios.append(across[at].mean() / across[~at].mean())
    return np.mean(ratios)


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_a_mended_photograph_wraps_around(name):
    pixels = PHOTOGRAPHS[name]
    assert seam(pixels) > 1.3
    assert seam(mended(pixels)) < 1.2


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_only_a_strip_along_the_edges_is_covered(name):
    rows, cols = PHOTOGRAPHS[name].shape[:2]
    place = mend(Stretched(PHOTOGRAPHS[name].reshape(rows, cols, -1)).planes)
    down, across = rows // SHARE, cols // SHARE
    inside = np.s_[down : rows - down, across : cols - across]
    assert np.array_equal(place[inside], np.arange(rows * cols).reshape(rows, cols)[inside])
    assert (place != np.arange(rows * cols).reshape(rows, cols)).any()


@pytest.mark.parametrize("shape", [(16, 15), (15, 16), (15, 15), (16, 16), (1, 40), (33, 50)], ids=str)
def test_an_axis_of_fewer_than_16_pixels_is_left_as_it_is(shape):
    slope = np.indices(shape).sum(0) * 5 + texture(shape) % 7
    place = np.divmod(mend(Stretched(slope[..., None]).planes), shape[1])
    changed = [bool((there != own).any()) for there, own in zip(place, np.indices(shape), strict=True)]
    assert changed == [n >= 16 for n in shape]


def test_a_sample_that_wraps_around_is_left_as_it_is():
    row, col = np.indices((48, 40))
    wave = np.cos((row + 0.5) * np.pi / 12) + np.cos((col + 0.5) * np.pi / 10)
    for pixels in (wave, np.ones((40, 40)), np.random.default_rng(1).normal(size=(64, 80)), mended(GRASS)):
        assert_same_bits(mended(pixels), pixels)


def test_an_axis_that_wraps_around_is_left_as_it_is():
    row, col = np.indices((40, 48))
    place = mend(Stretched((row + 8 * np.cos((col + 0.5) * np.pi / 12))[..., None]).planes)
    assert (place % 48 == col).all()
    assert (place // 48 != row).any()


def least(cost, closed):
    """What the least path costs, over all paths."""
    rows, cols = cost.shape
    totals = []
    for start in range(cols):
        for steps in itertools.product((-1, 0, 1), repeat=rows - 1):
            path = start + np.cumsum([0, *steps])
            if (path >= 0).all() and (path < cols).all() and (not closed or abs(path[-1] - start) <= 1):
                totals.append(cost[range(rows), path].sum())
    return min(totals)


costs = arrays.arrays(np.int64, st.tuples(st.integers(1, 5), st.integers(1, 4)), elements=st.integers(0, 9))


@given(costs)
def test_a_path_is_the_least(cost):
    path = _path(cost, closed=False)
    assert (abs(np.diff(path)) <= 1).all()
    assert cost[range(len(cost)), path].sum() == least(cost, closed=False)


@given(costs)
def test_a_closed_path_ends_beside_its_beginning(cost):
    path = _path(cost, closed=True)
    assert (abs(np.diff(path, append=path[0])) <= 1).all()
    found = [_least(cost, begin) for begin in range(cost.shape[1])]
    totals = [cost[range(len(cost)), p].sum() for p in found]
    assert min(totals) == least(cost, closed=True)
    assert cost[range(len(cost)), path].sum() in totals


def test_the_strip_is_the_one_that_fits_best_and_ends_where_it_differs_least():
    """Of 12 rows and 64 columns: only columns are mended, and the strip reaches 8 pixels to either side."""
    planes = Stretched(GRASS[:12, 40:104, None]).planes
    values, col = planes[0].astype(np.int64) >> 8, np.arange(16)
    turned = np.roll(mend(planes) % 64, 32, 1)
    there = np.roll(values, 32, 1)[:, 24:40]
    [start] = {int(k) for k in (turned[:, 24:40] - col).ravel()} & set(range(49))
    costs = []
    for x in range(49):
        square = (there - values[:, x : x + 16]) ** 2
        costs.append(square[:, :-1] + square[:, 1:])
    assert start == np.argmin([(cost[:, :7].min(1) + cost[:, 8:].min(1)).sum() for cost in costs])
    inside = turned[:, 24:40] == start + col
    rows, cost = range(12), costs[start]
    first, last = inside.argmax(1), 15 - inside[:, ::-1].argmax(1)
    assert (inside == (col >= first[:, None]) & (col <= last[:, None])).all(), (
        "the seam is covered, and no hole is left"
    )
    for cut, half in ((first - 1, cost[:, :7]), (last - 8, cost[:, 8:])):
        assert half[rows, cut].sum() == half[rows, _path(half, closed=False)].sum()


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_the_source_map_is_of_the_sample_as_given(boundary):
    """At alpha = 0, where each pixel is that of its source; a mirror fits its bands to no other tile."""
    pixels = PHOTOGRAPHS["coffee"]
    side = 192 if boundary == "torus" else 96
    image, output = run(pixels, side, alpha=0, boundary=boundary, full_output=True)
    assert_same_bits(image, pixels[output.source[..., 0], output.source[..., 1]])
    assert_same_bits(image, np.tile(mended(pixels), (side // 96, side // 96, 1)))
    assert_same_bits(output.stages[-1].source, output.source)


@pytest.mark.parametrize("alpha", [0.3, 0.1])
def test_a_texture_tiles_and_shows_no_lines(alpha):
    names = ("gravel", "grass", "coffee")
    plain = {"edges": "keep", "seams": "cut"}
    pictures = {n: run(PHOTOGRAPHS[n], 2 * len(PHOTOGRAPHS[n]), alpha=alpha) for n in names}
    before = {n: run(PHOTOGRAPHS[n], 2 * len(PHOTOGRAPHS[n]), alpha=alpha, **plain) for n in names}
    assert np.median([seam(picture) for picture in before.values()]) > 1.3
    assert 0.85 < np.median([seam(picture) for picture in pictures.values()]) < 1.15
    for period in (8, 16, 32):
        assert 0.9 < np.median([lines(picture, period) for picture in pictures.values()]) < 1.06


def test_blending_takes_nothing_from_elsewhere():
    """What is drawn is the same; only bands where pieces meet differ."""
    sample = PHOTOGRAPHS["gravel"]
    (cut, one), (blend, two) = (run(sample, 192, seams=seams, full_output=True) for seams in ("cut", "blend"))
    assert_same_bits(one.source, two.source)
    assert (cut != blend).any()
    assert max(lines(blend, 8), lines(blend, 16)) < max(lines(cut, 8), lines(cut, 16))
