"""De Bonet's method: what it takes and tells, its limits, what a picture is made of, thresholds, and borders."""

import itertools
import logging
from fractions import Fraction
from math import inf as INF

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from skimage import data

import simdtex
from simdtex.jobs.studies.quality import seam
from simdtex.methods.multires.analysis import differences, thresholds
from simdtex.methods.multires.mend import SHARE, _least, _path, mend
from simdtex.methods.multires.options import Options
from simdtex.methods.pyramid.stretched import Stretched

# -- De Bonet's method as users see it: its limits, what a picture is made of, thresholds, contrast and colour.


def synthesize(sample, shape, **options):
    """An image; the last axis of a sample of three holds the channels."""
    given = {"rng": 1, "device": REFERENCE, "channel_axis": -1 if np.ndim(sample) == 3 else None} | options
    return simdtex.synthesize(sample, shape, method="multires", **given)


def run(sample, shape, **options):
    """Image and output."""
    return synthesize(sample, shape, full_output=True, **options)


def tiling(shape, size):
    """The (row, column) that each pixel has in its own tile."""
    row, col = np.indices(shape)
    return np.stack([row % size[0], col % size[1]], -1)


def sizes(shape, levels=None):
    """Rows and columns of the levels of a pyramid."""
    found = [tuple(shape)]
    while max(found[-1]) > 1:
        found.append(tuple(-(-n // 2) for n in found[-1]))
    return found[:levels]


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float64, np.bool_])
def test_alpha_0_tiles_the_sample_to_the_bit(dtype):
    for size in ((8, 16), (13, 7)):
        sample = texture(size, dtype=dtype)
        image, output = run(sample, (2 * size[0], 3 * size[1]), alpha=0, edges="keep")
        assert_same_bits(image, np.tile(sample, (2, 3)))
        for stage, own in zip(output.stages, reversed(sizes(size)), strict=True):
            assert np.array_equal(stage.source, tiling(stage.source.shape[:2], own))


def test_thresholds_are_alpha_over_the_number_of_the_level_from_the_top():
    for levels, beta in ((2, 0), (5, 0.5), (9, 2.5)):
        expected = [0.3 / (levels - level) ** beta for level in range(1, levels)]
        assert np.array_equal(thresholds(levels, 0.3, beta)[1:].astype(np.float32), np.float32(expected))
    for beta in (20, 1000.0, Fraction(1, 2)):
        table = thresholds(11, 0.3, beta)
        assert table[-1] == 0.3, "k is 1 at the top"
        assert (np.diff(table) >= 0).all() and (table >= 0).all() and np.isfinite(table).all()
        assert np.isinf(thresholds(11, INF, beta)).all()


@given(st.integers(1, 14), st.integers(1, 14), st.sampled_from([0, 0.3, 1.5, INF]), st.sampled_from([0, 1]))
def test_differences_are_the_largest_whose_squares_are_within_the_threshold(rows, cols, alpha, beta):
    options = Options(alpha=alpha, beta=beta, orientations=1)
    found = analyse(REFERENCE, texture((rows, cols), 1), orientations=1)
    table = differences(found, options).astype(object)[1:]
    if alpha == INF:
        assert (table == 2**32 - 1).all()
        return
    within = thresholds(found.levels, alpha, beta)[1:, None] * found.energy[1:]
    assert (table**2 <= within * (1 + 1e-9)).all() and ((table + 1) ** 2 > within).all()


def test_equal_channels_are_as_good_as_one():
    grey = texture((13, 12))
    image, output = run(grey, (20, 22), alpha=0.6)
    for count in (1, 3):
        many, other = run(np.repeat(grey[..., None], count, -1), (20, 22), alpha=0.6)
        assert_same_bits(other.source, output.source)
        assert_same_bits(many, np.ascontiguousarray(np.repeat(image[..., None], count, -1)))


def test_a_sample_beyond_32_bits_is_refused_before_any_work():
    vast = np.broadcast_to(np.uint8(0), (2**16, 2**13, 1))
    with pytest.raises(ValueError, match=r"65536 rows x 8192 columns with 9 features is beyond .* give a smaller one"):
        analyse(REFERENCE, vast)


# -- A sample is made to wrap around, pieces that meet fade into each other, and pictures show neither edges nor lines.


def mended(pixels):
    """A sample (rows, cols) or (rows, cols, channels) that wraps around."""
    planes = Stretched(pixels.reshape(*pixels.shape[:2], -1)).planes
    return pixels.reshape(-1, *pixels.shape[2:])[mend(planes)]


GRASS = data.grass()[:128, :128]
PHOTOGRAPHS = {"gravel": data.gravel()[:128, :128], "grass": GRASS, "coffee": data.coffee()[266:362, 486:582]}


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
def test_a_mended_photograph_wraps_around_and_only_a_strip_is_covered(name):
    pixels = PHOTOGRAPHS[name]
    rows, cols = pixels.shape[:2]
    assert seam(pixels) > 1.3
    assert seam(mended(pixels)) < 1.2
    place, itself = mend(Stretched(pixels.reshape(rows, cols, -1)).planes), np.arange(rows * cols).reshape(rows, cols)
    down, across = rows // SHARE, cols // SHARE
    inside = np.s_[down : rows - down, across : cols - across]
    assert np.array_equal(place[inside], itself[inside])
    assert (place != itself).any()


def test_an_axis_that_is_short_or_wraps_around_is_left_as_it_is():
    for shape in ((16, 15), (15, 16), (16, 16), (1, 40)):
        slope = np.indices(shape).sum(0) * 5 + texture(shape) % 7
        place = np.divmod(mend(Stretched(slope[..., None]).planes), shape[1])
        changed = [bool((there != own).any()) for there, own in zip(place, np.indices(shape), strict=True)]
        assert changed == [n >= 16 for n in shape]
    row, col = np.indices((48, 40))
    wave = np.cos((row + 0.5) * np.pi / 12) + np.cos((col + 0.5) * np.pi / 10)
    for pixels in (wave, np.ones((40, 40)), np.random.default_rng(1).normal(size=(64, 80)), mended(GRASS)):
        assert_same_bits(mended(pixels), pixels)
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


@given(arrays.arrays(np.int64, st.tuples(st.integers(1, 5), st.integers(1, 4)), elements=st.integers(0, 9)))
@settings(max_examples=60)
def test_a_path_is_the_least_and_a_closed_one_ends_beside_its_beginning(cost):
    path, closed = _path(cost, closed=False), _path(cost, closed=True)
    assert (abs(np.diff(path)) <= 1).all()
    assert cost[range(len(cost)), path].sum() == least(cost, closed=False)
    assert (abs(np.diff(closed, append=closed[0])) <= 1).all()
    totals = [cost[range(len(cost)), _least(cost, begin)].sum() for begin in range(cost.shape[1])]
    assert min(totals) == least(cost, closed=True)
    assert cost[range(len(cost)), closed].sum() in totals


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


def test_the_source_map_is_of_the_sample_as_given():
    """At alpha = 0, where each pixel is that of its source; a mirror fits its bands to no other tile."""
    pixels = PHOTOGRAPHS["coffee"]
    for boundary, times in (("torus", 2), ("open", 1)):
        image, output = run(pixels, (96 * times,) * 2, alpha=0, boundary=boundary, device=None)
        assert_same_bits(image, pixels[output.source[..., 0], output.source[..., 1]])
        assert_same_bits(image, np.tile(mended(pixels), (times, times, 1)))


def test_a_texture_tiles_and_shows_no_lines():
    samples, plain = PHOTOGRAPHS.values(), {"edges": "keep", "seams": "cut"}
    pictures, before = (
        [synthesize(one, (2 * len(one),) * 2, device=None, alpha=0.3, **how) for one in samples] for how in ({}, plain)
    )
    assert np.median([seam(picture) for picture in before]) > 1.3
    assert 0.85 < np.median([seam(picture) for picture in pictures]) < 1.15
    for period in (8, 16, 32):
        assert 0.9 < np.median([lines(picture, period) for picture in pictures]) < 1.06


# -- What the method takes, and what it says along the way.


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (2, 2), (4, 4)], ids=str)
def test_a_sample_too_small_for_the_filters_works_and_says_so(size, caplog):
    sample = texture(size, 3)
    for options in ({}, {"parity": "free"}, {"boundary": "open", "alpha": INF}):
        caplog.clear()
        _, output = run(sample, (10, 15), **options)
        assert min(stage.candidates.min() for stage in output.stages) >= 1
        told = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
        assert len(told) == (size != (1, 1)), "where there are no candidates, nothing is missed"
        assert all(f"{size[0]} rows x {size[1]} columns" in note and "3 x 3" in note for note in told)


def test_a_constant_sample_gives_a_constant():
    for dtype in (np.uint8, np.float64):
        for options in ({"alpha": 0}, {"alpha": INF}):
            image, output = run(np.ones((6, 8), dtype), (9, 20), **options)
            assert_same_bits(image, np.ones((9, 20), dtype))
            assert (output.stages[-1].candidates == 12).all(), "nothing tells one node from another"


def test_pixels_of_any_magnitude():
    bounds, whole = np.iinfo(np.int64), texture((9, 10), dtype=np.int64)
    whole[4, 4:6] = bounds.min, bounds.max
    for sample in (whole, *(texture((9, 10), dtype=np.float64) * scale for scale in (1e-300, 8e307))):
        assert_same_bits(synthesize(sample, (18, 10), alpha=0), np.tile(sample, (2, 1)))
        image = synthesize(sample, (18, 10), alpha=INF)
        assert image.dtype == sample.dtype
        assert sample.min() <= image.min() < image.max() <= sample.max()


def test_one_level_is_a_tiling():
    sample = texture((13, 7), 3, np.float32)
    for shape, boundary in (((20, 30), "torus"), ((5, 3), "open")):
        image, output = run(sample, shape, levels=1, boundary=boundary, alpha=INF)
        assert_same_bits(image, sample[np.ix_(*(np.arange(n) % m for n, m in zip(shape, (13, 7), strict=True)))])
        [stage] = output.stages
        assert (stage.candidates == 1).all()


@pytest.mark.parametrize("alpha", [0.5, INF])
def test_the_statistics_count_what_was_done_level_by_level(alpha):
    image, output = run(texture((13, 7)), (20, 17), alpha=alpha, rng=7)
    told = output.statistics
    assert (told["device"], told["seed"], told["device_seconds"]) == (REFERENCE.name, 7, None)
    assert told["options"] == vars(Options(alpha=alpha)) | {"levels": 5}
    assert [level["nodes"] for level in told["levels"]] == [0, 1, 1 + 2, 1 + 2 + 8, 1 + 2 + 8 + 28]
    shapes = [(2, 3), (3, 3), (6, 5), (11, 10), (20, 17)]  # 20 is a tile of 13 and 7 more, each halved on its own
    for level, number, stage, own in zip(told["levels"], range(4, -1, -1), output.stages, shapes, strict=True):
        assert level["level"] == stage.level == number
        assert (level["rows"], level["cols"]) == stage.candidates.shape == own
        assert stage.image.shape == own and stage.source.shape == (*own, 2)
        assert (level["most"], level["candidates"]) == (stage.candidates.max(), stage.candidates.mean())
        assert level["compared"] == level["nodes"] if alpha == INF else level["compared"] <= level["nodes"]
    assert told["seconds"] >= sum(level["seconds"] for level in told["levels"]) > 0
    assert_same_bits(output.stages[-1].image, image)
    assert_same_bits(output.stages[-1].source, output.source)
    assert output.temperature is None
    assert len(run(texture((16, 8)), (39, 21), levels=2)[1].stages) == 2


def test_progress_tells_every_piece_of_every_level(monkeypatch):
    sample, seen = np.moveaxis(texture((13, 7), 3), -1, 0), []
    whole, output = run(sample, (40, 30), channel_axis=0)
    monkeypatch.setattr("simdtex.methods.multires.analysis.LAUNCH", 1)  # so that levels come in pieces
    image = synthesize(sample, (40, 30), channel_axis=0, callback=lambda p: seen.append((p, p.image(), p.candidates())))
    assert_same_bits(image, whole)
    fractions = [progress.fraction for progress, *_ in seen]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < fractions[-1] == 1
    ends = [progress.level for progress, *_ in seen if progress.stage]
    assert ends == [4, 3, 2, 1, 0] and len(seen) > 2 * len(ends)
    stages = {stage.level: stage for stage in output.stages}
    for progress, picture, candidates in seen:
        shown = stages[progress.level + (progress.stage is None)]  # else the level before
        assert_same_bits([picture, candidates], [shown.image, shown.candidates])
        assert (progress.levels, progress.doing) == (5, f"level {progress.level}")
        assert progress.stage in (None, f"level{progress.level}")


@pytest.mark.parametrize("shape", [(2**70, 1), (2**16, 2**15)], ids=str)
def test_an_output_beyond_32_bits_is_refused_before_any_work(shape, monkeypatch):
    def never(*_, **__):
        raise AssertionError("worked")

    monkeypatch.setattr("simdtex.methods.multires.algorithm.analyse", never)
    with pytest.raises(ValueError, match=f"{shape[0]} rows x {shape[1]} columns is beyond .*; give a smaller size"):
        synthesize(texture((13, 7)), shape)
