"""De Bonet's method: what it takes and tells, its limits, what a picture is made of, thresholds, and borders."""

import itertools
import logging
import math
from dataclasses import fields
from fractions import Fraction

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from plain_multires import as_large
from skimage import data

import simdtex
from simdtex.jobs.studies.quality import seam
from simdtex.methods.multires import options as multires
from simdtex.methods.multires.analysis import thresholds
from simdtex.methods.multires.mend import SHARE, _least, _path, mend
from simdtex.methods.multires.options import Options
from simdtex.methods.pyramid.stretched import Stretched

# -- De Bonet's method as users see it: its limits, what a picture is made of, thresholds, contrast and colour.

INF = math.inf


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


def ancestors(stage, size, level):
    """(row, column) of the pixels of another level above those of a stage, in an output of tiles of a sample's size."""
    indices, up = np.indices(stage.source.shape[:2]), level - stage.level
    own, their = sizes(size)[stage.level], sizes(size)[level]
    return tuple(i // n * m + (i % n >> up) for i, n, m in zip(indices, own, their, strict=True))


@pytest.mark.parametrize("size", [(8, 16), (13, 7), (5, 12), (6, 1)], ids=str)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.float32, np.float64, np.bool_])
def test_alpha_0_tiles_the_sample_to_the_bit(dtype, size):
    sample = texture(size, dtype=dtype)
    for whole in ((1, 1), (2, 3)):
        shape = size[0] * whole[0], size[1] * whole[1]
        image, output = run(sample, shape, alpha=0, edges="keep")
        assert_same_bits(image, np.tile(sample, whole))
        for stage, own in zip(output.stages, reversed(sizes(size)), strict=True):
            assert np.array_equal(stage.source, tiling(stage.source.shape[:2], own))


def alike(found, each, table):
    """Of each level but the finest, whether two of its nodes are similar: equations (9) to (11) word for word.

    `each` is the number of features of a plane; `table` T, the lowest frequency first.
    """
    result, begin = {}, 0
    for level, size in list(enumerate(found.shapes))[1:]:
        f = found.features[begin : begin + math.prod(size)].astype(float)
        begin += math.prod(size)
        z = (f**2).mean(0)
        if level == found.levels - 1:
            z[::each] = f[:, ::each].var(0)
        t = np.broadcast_to(table[found.levels - 1 - level], z.shape)
        with np.errstate(invalid="ignore"):
            result[level] = (((f[:, None] - f) ** 2 <= t * z) | np.isinf(t)).all(-1)
    return result


def passing(similar, output, size, level):
    """(rows, cols, nodes of the level above): whether the parent structures of a pixel and of a child are similar."""
    stages = {stage.level: stage for stage in output.stages}
    nodes = np.indices(sizes(size)[level + 1]).reshape(2, -1)
    passed = True
    for k in range(level + 1, len(stages)):
        cols = sizes(size)[k][1]
        own = stages[k].source[ancestors(stages[level], size, k)] @ [cols, 1]
        row, col = nodes >> k - level - 1
        passed = passed & similar[k][own][..., row * cols + col]
    return passed


def check_candidates(sample, shape, table, **options):
    """Every pixel was drawn from its candidates, and they were counted, as the equations have it."""
    _, output = run(sample, shape, **options)
    size, parity = sample.shape[:2], options.pop("parity", "match")
    bearing = {name: value for name, value in options.items() if name not in ("alpha", "beta", "thresholds")}
    found = analyse(REFERENCE, sample.reshape(*size, -1), **bearing)
    similar = alike(found, 1 + 2 * options.get("orientations", 4), table)
    for stage in output.stages[1:]:
        own, above = sizes(size)[stage.level : stage.level + 2]
        passed = passing(similar, output, size, stage.level)
        children = [np.minimum(2, n - 2 * i) for n, i in zip(own, np.indices(above), strict=True)]
        each = (children[0] * children[1]).ravel()
        if parity == "match":
            mine = (tiling(stage.candidates.shape, own)[..., axis] for axis in (0, 1))
            rows, cols = (
                np.array([as_large(n, stage.level, k) for k in range(m)])[places]
                for n, m, places in zip(size, own, mine, strict=True)
            )
            each = (rows[..., :, None] & cols[..., None, :]).reshape(*stage.candidates.shape, -1)
        assert np.array_equal((passed * each).sum(-1), stage.candidates)
        assert stage.candidates.min() >= 1
        parent = stage.source // 2 @ [above[1], 1]
        assert np.take_along_axis(passed, parent[..., None], -1).all(), "the parent is similar to the pixel's own"
        assert (stage.source < own).all() and (stage.source >= 0).all()
        if parity == "match":
            assert np.array_equal(stage.source % 2, tiling(stage.candidates.shape, own) % 2), "its parity"


@pytest.mark.parametrize("alpha", [0, 0.3, 0.77, 1.5, 3.0, INF])
@given(
    st.tuples(st.integers(1, 14), st.integers(1, 14)),
    st.tuples(st.integers(1, 20), st.integers(1, 20)),
    st.sampled_from([None, 2, 3]),
    st.sampled_from([0, 0.5, 1]),
    st.fixed_dictionaries(
        {},
        optional={
            "parity": st.just("free"),
            "boundary": st.just("open"),
            "orientations": st.sampled_from([1, 3]),
            "levels": st.sampled_from([1, 2, 3]),
        },
    ),
)
@settings(max_examples=16)
def test_candidates_are_those_of_the_equations(alpha, size, shape, channels, beta, options):
    levels = min(len(sizes(size)), options.get("levels", 30))
    options |= {"levels": levels} if "levels" in options else {}
    table = [[alpha / k**beta] for k in range(1, levels)]
    check_candidates(texture(size, channels), shape, table, alpha=alpha, beta=beta, **options)


@pytest.mark.parametrize("beta", [0, 0.5, 1, 2.5])
@pytest.mark.parametrize("levels", [2, 5, 9])
def test_thresholds_are_alpha_over_the_number_of_the_level_from_the_top(levels, beta):
    table = thresholds(levels, 0.3, beta)
    assert len(table) == levels
    expected = [0.3 / (levels - level) ** beta for level in range(1, levels)]
    assert np.array_equal(table[1:].astype(np.float32), np.float32(expected))
    assert table[-1] == 0.3


def test_equal_channels_are_as_good_as_one():
    grey = texture((13, 12))
    image, output = run(grey, (20, 22), alpha=0.6)
    for count in (1, 2, 3):
        many, other = run(np.repeat(grey[..., None], count, -1), (20, 22), alpha=0.6)
        assert_same_bits(other.source, output.source)
        assert_same_bits(many, np.ascontiguousarray(np.repeat(image[..., None], count, -1)))


# -- Thresholds of unusual size and type, and the alpha that is looked for.


@pytest.mark.parametrize("beta", [20, 20.0, 100, 1000.0, Fraction(1, 2)])
def test_a_large_beta_is_no_more_than_strict(beta):
    table = thresholds(11, 0.3, beta)
    assert table[-1] == 0.3, "k is 1 at the top"
    assert (np.diff(table) >= 0).all() and (table >= 0).all() and np.isfinite(table).all()
    assert np.isinf(thresholds(11, INF, beta)).all()


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_a_number_beyond_all_others_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} is 1000"):
        Options(**{name: 10**400})


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
PHOTOGRAPHS = {
    "gravel": data.gravel()[:128, :128],
    "grass": GRASS,
    "brick": data.brick()[:128, :128],
    "coffee": data.coffee()[266:362, 486:582],
}


def run_mending(sample, side, **options):
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
    image, output = run_mending(pixels, side, alpha=0, boundary=boundary, full_output=True)
    assert_same_bits(image, pixels[output.source[..., 0], output.source[..., 1]])
    assert_same_bits(image, np.tile(mended(pixels), (side // 96, side // 96, 1)))
    assert_same_bits(output.stages[-1].source, output.source)


def test_a_texture_tiles_and_shows_no_lines():
    samples, plain = [PHOTOGRAPHS[name] for name in ("gravel", "grass", "coffee")], {"edges": "keep", "seams": "cut"}
    pictures, before = ([run_mending(one, 2 * len(one), alpha=0.3, **how) for one in samples] for how in ({}, plain))
    assert np.median([seam(picture) for picture in before]) > 1.3
    assert 0.85 < np.median([seam(picture) for picture in pictures]) < 1.15
    for period in (8, 16, 32):
        assert 0.9 < np.median([lines(picture, period) for picture in pictures]) < 1.06


def test_blending_takes_nothing_from_elsewhere():
    """What is drawn is the same; only bands where pieces meet differ."""
    sample = PHOTOGRAPHS["gravel"]
    (cut, one), (blend, two) = (run_mending(sample, 192, seams=seams, full_output=True) for seams in ("cut", "blend"))
    assert_same_bits(one.source, two.source)
    assert (cut != blend).any()
    assert max(lines(blend, 8), lines(blend, 16)) < max(lines(cut, 8), lines(cut, 16))


# -- What the method takes, and what it says along the way.


def tiled(sample, shape):
    """The beginning of so many repetitions of a sample as fill a shape."""
    row, col = (np.arange(n) % m for n, m in zip(shape, sample.shape, strict=False))
    return sample[np.ix_(row, col)]


def halved(n, tile, times):
    """Pixels in a line at a level of an output that is made of tiles: each is halved and rounded up on its own."""
    whole, rest = divmod(n, tile)
    for _ in range(times):
        tile, rest = -(-tile // 2), -(-rest // 2)
    return whole * tile + rest


@pytest.mark.parametrize("axis", [0, 1])
def test_the_channel_axis_is_kept(axis):
    last = texture((9, 10), 3)
    image, output = run(np.moveaxis(last, -1, axis), (12, 17), channel_axis=axis)
    expected, other = run(last, (12, 17))
    assert_same_bits(np.ascontiguousarray(np.moveaxis(image, axis, -1)), expected)
    for ours, theirs in zip(output.stages, other.stages, strict=True):
        assert np.array_equal(np.moveaxis(ours.image, axis, -1), theirs.image)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1), (2, 2), (3, 3), (4, 4)], ids=str)
def test_a_sample_too_small_for_the_filters_works_and_says_so(size, caplog):
    sample = texture(size, 3)
    for options in ({"alpha": 0}, {}, {"parity": "free"}, {"boundary": "open", "alpha": INF}):
        caplog.clear()
        image, output = run(sample, (10, 15), **options)
        assert image.shape == (10, 15, 3)
        assert min(stage.candidates.min() for stage in output.stages) >= 1
        told = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
        assert len(told) == (size != (1, 1)), "where there are no candidates, nothing is missed"
        assert all(f"{size[0]} rows x {size[1]} columns" in note and "3 x 3" in note for note in told)
    image = synthesize(sample, (3 * size[0], 2 * size[1]), alpha=0)
    assert_same_bits(image, np.tile(sample, (3, 2, 1)))


def test_a_constant_sample_gives_a_constant():
    for dtype in (np.uint8, np.uint16, np.float64, np.bool_):
        for options in ({"alpha": 0}, {"alpha": INF}):
            image, output = run(np.ones((6, 8), dtype), (9, 20), **options)
            assert_same_bits(image, np.ones((9, 20), dtype))
            assert (output.stages[-1].candidates == 12).all(), "nothing tells one node from another"


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300, 8e307])
def test_float_pixels_of_any_magnitude(scale):
    sample = texture((9, 10), dtype=np.float64) * scale
    assert_same_bits(synthesize(sample, (18, 10), alpha=0), np.tile(sample, (2, 1)))
    image = synthesize(sample, (18, 10), alpha=INF)
    assert sample.min() <= image.min() < image.max() <= sample.max()


@pytest.mark.parametrize("dtype", [np.int64, np.uint64, np.int8])
def test_integer_pixels_of_any_magnitude(dtype):
    bounds = np.iinfo(dtype)
    sample = texture((9, 10), dtype=dtype)
    sample[4, 4:6] = bounds.min, bounds.max
    assert_same_bits(synthesize(sample, (18, 10), alpha=0), np.tile(sample, (2, 1)))
    assert synthesize(sample, (18, 10), alpha=INF).dtype == dtype


@pytest.mark.parametrize(("shape", "boundary"), [((20, 30), "torus"), ((5, 3), "open")], ids=str)
def test_one_level_is_a_tiling(shape, boundary):
    sample = texture((13, 7), 3, np.float32)
    image, output = run(sample, shape, levels=1, boundary=boundary, alpha=INF)
    assert_same_bits(image, tiled(sample, shape))
    [stage] = output.stages
    assert (stage.candidates == 1).all()


@pytest.mark.parametrize(
    ("size", "shape", "levels"), [((13, 7), (20, 17), None), ((16, 8), (39, 21), 2), ((3, 20), (2, 50), None)], ids=str
)
def test_the_stages_are_the_levels_of_every_tile_coarsest_first(size, shape, levels):
    sample = texture(size, 2, np.uint16)
    image, output = run(sample, shape, levels=levels)
    count = levels or 1 + math.ceil(math.log2(max(size)))
    assert [stage.level for stage in output.stages] == list(reversed(range(count)))
    for stage in output.stages:
        own = tuple(halved(n, m, stage.level) for n, m in zip(shape, size, strict=True))
        assert (stage.image.shape, stage.image.dtype) == ((*own, 2), np.uint16)
        assert (stage.source.shape, stage.source.dtype) == ((*own, 2), np.int32)
        assert stage.candidates.shape == own
        assert np.issubdtype(stage.candidates.dtype, np.integer)
    assert_same_bits(output.stages[-1].image, image)
    assert_same_bits(output.stages[-1].source, output.source)
    assert output.temperature is None


@pytest.mark.parametrize("alpha", [0.5, INF])
def test_the_statistics_count_what_was_done(alpha):
    sample = texture((13, 7))
    _, output = run(sample, (20, 17), alpha=alpha, rng=7)
    told = output.statistics
    assert (told["device"], told["seed"], told["device_seconds"]) == (REFERENCE.name, 7, None)
    assert set(told["options"]) == {option.name for option in fields(multires.Options)}
    assert told["options"]["alpha"] == alpha
    assert told["options"]["levels"] == 5
    assert [level["level"] for level in told["levels"]] == [4, 3, 2, 1, 0]
    nodes = [0, 1, 1 + 2, 1 + 2 + 8, 1 + 2 + 8 + 28]
    assert [level["nodes"] for level in told["levels"]] == nodes
    for level, stage in zip(told["levels"], output.stages, strict=True):
        assert (level["rows"], level["cols"]) == stage.candidates.shape
        assert level["most"] == stage.candidates.max()
        assert level["candidates"] == stage.candidates.mean()
        if alpha == INF:
            assert level["compared"] == level["nodes"]
        assert stage.level == 4 or 1 <= level["compared"] <= level["nodes"]
        assert level["seconds"] >= 0
    assert told["seconds"] >= sum(level["seconds"] for level in told["levels"])


@pytest.mark.parametrize("axis", [None, 0])
def test_progress_tells_every_piece_of_every_level(axis, monkeypatch):
    last = texture((13, 7), None if axis is None else 3)
    sample, seen = last if axis is None else np.moveaxis(last, -1, axis), []

    def look(progress):
        seen.append((progress, progress.image(), progress.candidates()))

    whole, output = run(sample, (40, 30), channel_axis=axis)
    monkeypatch.setattr("simdtex.methods.multires.analysis.LAUNCH", 1)  # so that levels come in pieces
    image = synthesize(sample, (40, 30), channel_axis=axis, callback=look)
    assert_same_bits(image, whole)
    fractions = [progress.fraction for progress, *_ in seen]
    assert fractions == sorted(fractions)
    assert fractions[0] > 0
    assert fractions[-1] == 1
    ends = [progress.level for progress, *_ in seen if progress.stage]
    assert ends == [4, 3, 2, 1, 0], "one end for each"
    assert len(seen) > 2 * len(ends)
    stages = {stage.level: stage for stage in output.stages}
    for progress, picture, candidates in seen:
        assert progress.levels == 5
        shown = stages[progress.level + (progress.stage is None)]  # else the level before
        assert_same_bits(picture, shown.image)
        assert_same_bits(candidates, shown.candidates)
        assert progress.doing == f"level {progress.level}"
        assert progress.stage in (None, f"level{progress.level}")


@pytest.mark.parametrize("shape", [(2**31, 2**31), (1, 2**31), (2**70, 1), (2**16, 2**15)], ids=str)
def test_an_output_beyond_32_bits_is_refused_before_any_work(shape, monkeypatch):
    def never(*_, **__):
        raise AssertionError("worked")

    monkeypatch.setattr("simdtex.methods.multires.algorithm.analyse", never)
    with pytest.raises(ValueError, match=f"{shape[0]} rows x {shape[1]} columns is beyond .*; give a smaller size"):
        synthesize(texture((13, 7)), shape)
