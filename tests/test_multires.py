"""De Bonet's method: its limits, what a picture is made of, thresholds, contrast, colour, and borders."""

import itertools
import math
from fractions import Fraction
from math import inf

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from plain_multires import as_large
from skimage import data

import simdtex
from simdtex.experiments.quality import seam
from simdtex.methods.multires import Options
from simdtex.methods.multires.analysis import thresholds
from simdtex.methods.multires.mend import SHARE, _least, _path, mend
from simdtex.model.stretched import Stretched

# -- De Bonet's method as users see it: its limits, what a picture is made of, thresholds, contrast and colour.

INF = math.inf


def run(sample, shape, **options):
    """Image and output; the last axis of a sample of three holds the channels."""
    given = {"rng": 1, "device": REFERENCE, "channel_axis": -1 if sample.ndim == 3 else None} | options
    return simdtex.synthesize(sample, shape, method="multires", full_output=True, **given)


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


def same_places(output, other):
    """Whether two runs took everything from the same places, among the same number of candidates."""
    pairs = zip(output.stages, other.stages, strict=True)
    return all(np.array_equal(a.source, b.source) and np.array_equal(a.candidates, b.candidates) for a, b in pairs)


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


def border(i, n, torus):
    """Index i brought to 0 .. n-1."""
    while not 0 <= i < n:
        i = i % n if torus or n == 1 else -i if i < 0 else 2 * n - 2 - i
    return i


def halving(n, torus):
    """Matrix that takes n pixels in a line to half as many."""
    matrix = np.zeros((-(-n // 2), n))
    for k in range(len(matrix)):
        for step, weight in zip(range(-2, 3), (1, 4, 6, 4, 1), strict=True):
            matrix[k, border(2 * k + step, n, torus)] += weight / 16
    return matrix


def doubling(n, tile, coarse, torus):
    """Matrix that takes `coarse` pixels in a line to n, in tiles."""
    matrix = np.zeros((n, coarse))
    for i in range(n):
        parent = i // tile * -(-tile // 2) + i % tile // 2
        for step, weight in [(-1, 1 / 8), (0, 6 / 8), (1, 1 / 8)] if i % tile % 2 == 0 else [(0, 1 / 2), (1, 1 / 2)]:
            matrix[i, border(parent + step, coarse, torus)] += weight
    return matrix


def expanded(coarse, shape, tile, torus):
    row, col = (doubling(n, t, m, torus) for n, t, m in zip(shape, tile, coarse.shape, strict=False))
    return np.einsum("ik,jl,klc->ijc", row, col, coarse)


def faded(band, source, torus):
    """A level's band where pieces that meet fade into each other: nine neighbours say what goes on at a pixel."""
    made = np.zeros((*source.shape[:2], band.shape[-1]))
    for pixel in np.ndindex(*source.shape[:2]):
        for step in itertools.product((-1, 0, 1), repeat=2):
            shifted = zip(pixel, step, source.shape, strict=False)
            near = [i + s if torus else min(max(i + s, 0), n - 1) for i, s, n in shifted]
            back = [k - i for i, k in zip(pixel, near, strict=True)]
            own = source[near[0] % made.shape[0], near[1] % made.shape[1]]
            place = tuple(border(k - b, n, torus) for k, b, n in zip(own, back, band.shape, strict=False))
            made[pixel] += (2 - abs(step[0])) * (2 - abs(step[1])) * band[place] / 16
    return made


def reconstructions(sample, output, torus, blend=True):
    """The picture of every level, coarsest first: bands in floats, copied as the source maps say, and added up."""
    gaussian = [sample.astype(float)]
    while len(gaussian) < len(output.stages):
        row, col = (halving(n, torus) for n in gaussian[-1].shape[:2])
        gaussian.append(np.einsum("ki,lj,ijc->klc", row, col, gaussian[-1]))
    picture = None
    for stage in output.stages:
        own = gaussian[stage.level]
        if picture is not None:
            shape = own.shape[:2]
            band = own - expanded(gaussian[stage.level + 1], shape, shape, torus)
            copied = faded(band, stage.source, torus) if blend else band[tuple(np.moveaxis(stage.source, -1, 0))]
            picture = copied + expanded(picture, stage.source.shape[:2], shape, torus)
        else:
            picture = own[tuple(np.moveaxis(stage.source, -1, 0))]
        yield picture


@pytest.mark.parametrize(("seams", "boundary"), [("blend", "torus"), ("blend", "open"), ("cut", "torus")])
@pytest.mark.parametrize(("size", "shape"), [((13, 7), (20, 24)), ((9, 22), (4, 30))], ids=str)
def test_every_level_is_its_copied_bands_added_up(size, shape, boundary, seams):
    sample = texture(size, 3)
    for options in ({}, {"alpha": INF, "parity": "free"}, {"alpha": 1.0}):
        _, output = run(sample, shape, boundary=boundary, edges="keep", seams=seams, **options)
        pictures = reconstructions(sample, output, boundary == "torus", seams == "blend")
        for stage, expected in zip(output.stages, pictures, strict=True):
            # Half a grey level is the last rounding; those of the levels are 2**-20 of the range each, a few dozen.
            assert abs(stage.image - np.clip(expected, 0, 255)).max() < 1


def test_float_pixels_stay_in_the_samples_range():
    sample = texture((13, 7), dtype=np.float32)
    image, output = run(sample, (20, 24), alpha=INF, seams="cut")
    assert image.dtype == np.float32
    assert all(sample.min() <= s.image.min() <= s.image.max() <= sample.max() for s in output.stages)
    [*_, expected] = reconstructions(sample[..., None], output, torus=True, blend=False)
    beyond = (expected[..., 0] < sample.min()) | (expected[..., 0] > sample.max())
    assert beyond.any() and np.isin(image[beyond], [sample.min(), sample.max()]).all()


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


@given(
    st.tuples(st.integers(1, 14), st.integers(1, 14)),
    st.tuples(st.integers(1, 20), st.integers(1, 20)),
    st.sampled_from([None, 2, 3]),
    st.sampled_from([0, 0.3, 0.77, 1.5, 3.0, INF]),
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
@settings(max_examples=80)
def test_candidates_are_those_of_the_equations(size, shape, channels, alpha, beta, options):
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
        assert same_places(output, other)
        assert_same_bits(many, np.ascontiguousarray(np.repeat(image[..., None], count, -1)))


# -- Thresholds of unusual size and type, and the alpha that is looked for.


@pytest.mark.parametrize("beta", [20, 20.0, 100, 1000.0, Fraction(1, 2)])
def test_a_large_beta_is_no_more_than_strict(beta):
    table = thresholds(11, 0.3, beta)
    assert table[-1] == 0.3, "k is 1 at the top"
    assert (np.diff(table) >= 0).all() and (table >= 0).all() and np.isfinite(table).all()
    assert np.isinf(thresholds(11, inf, beta)).all()


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
