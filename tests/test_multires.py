"""De Bonet's method as users see it: its limits, what a picture is made of, thresholds, contrast and colour."""

import itertools
import math

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_multires import as_large
from scipy.stats import chisquare
from tolerances import SIGNIFICANCE

import simdtex
from simdtex.methods import multires
from simdtex.methods.multires.analysis import differences, thresholds
from simdtex.ops.candidates import Sampled, Structure, candidates

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


@pytest.mark.parametrize("shape", [(3, 5), (20, 17), (1, 30), (26, 8)], ids=str)
def test_alpha_0_tiles_the_source_map_of_an_output_of_any_size(shape):
    _, output = run(texture((13, 7)), shape, alpha=0)
    assert all((stage.candidates == 1).all() for stage in output.stages)
    assert np.array_equal(output.source, tiling(shape, (13, 7)))


def test_alpha_0_without_phase_keeps_to_one_parent_and_scrambles_its_children():
    _, output = run(texture((13, 7)), (39, 28), alpha=0, parity="free")
    above, fine = output.stages[-2:]
    assert np.array_equal(fine.source // 2, above.source[ancestors(fine, (13, 7), 1)])
    inside = (fine.source < [12, 6]).all(-1)  # of parents with four children
    assert (fine.candidates[inside] == 4).all()
    assert (fine.candidates[(fine.source == [12, 6]).all(-1)] == 1).all()
    assert chisquare(np.bincount((fine.source % 2 @ [2, 1])[inside])).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("size", [(8, 8), (13, 7)], ids=str)
@pytest.mark.parametrize("channels", [None, 3])
def test_alpha_0_on_an_open_plane_gives_the_sample_itself(size, channels):
    sample = texture(size, channels)
    image, output = run(sample, size, alpha=0, boundary="open")
    assert_same_bits(image, sample)
    _, output = run(sample, (20, 17), alpha=0, boundary="open")
    assert np.array_equal(output.source, tiling((20, 17), size))


@pytest.mark.parametrize("size", [(8, 8), (13, 7)], ids=str)
@pytest.mark.parametrize("beta", [0, 1])
def test_infinite_alpha_leaves_nothing_out(size, beta):
    for parity in ("match", "free"):
        _, output = run(texture(size), (17, 11), alpha=INF, beta=beta, parity=parity)
        assert (output.stages[0].candidates == 1).all()
        for stage in output.stages[1:]:
            own = sizes(size)[stage.level]
            for count, place in zip(
                stage.candidates.ravel(), tiling(stage.candidates.shape, own).reshape(-1, 2), strict=True
            ):
                of = [sum(as_large(n, stage.level, k)) for n, k in zip(size, place, strict=True)]
                assert count == math.prod(of if parity == "match" else own)


def test_infinite_alpha_draws_each_band_evenly_and_on_its_own():
    _, output = run(texture((8, 8)), (64, 64), alpha=INF)
    fine, above = output.stages[-1].source, output.stages[-2].source
    assert np.array_equal(fine % 2, tiling((64, 64), (2, 2))), "a pixel's own row and column parity"
    for p, q in itertools.product(range(2), range(2)):
        parent = fine[p::2, q::2] // 2
        assert chisquare(np.bincount((parent @ [4, 1]).ravel(), minlength=16)).pvalue > SIGNIFICANCE
    of_parent = np.repeat(np.repeat(above, 2, 0), 2, 1) @ [4, 1]
    pairs = of_parent * 16 + fine // 2 @ [4, 1]
    assert chisquare(np.bincount(pairs.ravel(), minlength=256)).pvalue > SIGNIFICANCE


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


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(("size", "shape"), [((16, 16), (40, 32)), ((13, 7), (20, 24)), ((9, 22), (4, 30))], ids=str)
@pytest.mark.parametrize("seams", ["blend", "cut"])
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


ALPHAS = [0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.3, 2.0, 4.0, INF]


@pytest.mark.parametrize("parity", ["match", "free"])
def test_candidates_grow_with_alpha_at_every_level(parity):
    sample = texture((12, 14))
    found = analyse(REFERENCE, sample[..., None])
    begins = np.cumsum([0, *(math.prod(size) for size in found.shapes)])
    lattice = np.array([(*size, begin, 0) for size, begin in zip(found.shapes, begins, strict=False)], np.int32)
    nodes = lattice - [[0, 0, begins[1], 0]]
    before = np.zeros(begins[-1])
    for alpha in ALPHAS:
        structure = Structure(found.features, differences(found, multires.Options(alpha=alpha)), nodes)
        counts = np.ones((begins[-1], 2), np.int32)
        for level, size in enumerate(found.shapes[:-1]):  # all of it is the sample itself
            source = np.concatenate([np.arange(math.prod(size), dtype=np.int32) for size in found.shapes])
            sampled = Sampled(source, counts, lattice)
            candidates(REFERENCE, structure, sampled, level, range(math.prod(size)), parity == "match", 1)
        assert (counts[:, 0] >= before).all()
        before = counts[:, 0]


@pytest.mark.parametrize("beta", [0, 0.5, 1, 2.5])
@pytest.mark.parametrize("levels", [2, 5, 9])
def test_thresholds_are_alpha_over_the_number_of_the_level_from_the_top(levels, beta):
    table = thresholds(levels, 0.3, beta)
    assert len(table) == levels
    expected = [0.3 / (levels - level) ** beta for level in range(1, levels)]
    assert np.array_equal(table[1:].astype(np.float32), np.float32(expected))
    assert table[-1] == 0.3


DARK = texture((13, 12)) // 2
SCALED = {
    "uint8 + 100": DARK + 100,
    "uint8 * 2 + 1": DARK * 2 + 1,
    "uint16": DARK.astype(np.uint16) * 257 + 3,
    "int16, negative": DARK.astype(np.int16) * 7 - 3000,
    "int64": DARK.astype(np.int64) * 2**40 - 2**50,
    "float32": DARK.astype(np.float32) * np.float32(2**-9) - np.float32(0.5),
    "float64": DARK * 0.1 - 7.3,
    "float64, large": DARK * 1e300,
}


@pytest.mark.parametrize("name", SCALED)
def test_neither_contrast_nor_a_constant_changes_an_arrangement(name):
    for options in ({}, {"alpha": 0.8, "beta": 1}, {"parity": "free", "boundary": "open"}):
        _, output = run(DARK, (20, 22), **options)
        image, other = run(SCALED[name], (20, 22), **options)
        assert image.dtype == SCALED[name].dtype
        assert same_places(output, other)
        assert output.statistics["options"]["alpha"] == other.statistics["options"]["alpha"]


def test_equal_channels_are_as_good_as_one():
    grey = texture((13, 12))
    image, output = run(grey, (20, 22), alpha=0.6)
    for count in (1, 2, 3):
        many, other = run(np.repeat(grey[..., None], count, -1), (20, 22), alpha=0.6)
        assert same_places(output, other)
        assert_same_bits(many, np.ascontiguousarray(np.repeat(image[..., None], count, -1)))
