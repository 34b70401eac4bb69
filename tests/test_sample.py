"""The sample: its pictures, their gaps and categories, working levels, integers without contrast, and colours."""

from fractions import Fraction

import numpy as np
import plain_pyramid as plain
import pytest
from cases import assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import CONTRAST, DECORRELATED, DIRECTION

from simdtex.methods.pyramid.palette import FLAT, decorrelated, palette
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Pictures, completed
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale, highest, stretch
from simdtex.model.stretched import LUMA, TOP, Stretched

# -- What a sample is made of: its gaps, what may be used, and its categories.


def line(*values, dtype=np.float32):
    """A picture of one row and one channel."""
    return np.array(values, dtype)[None, :, None]


def test_a_gap_is_completed_by_the_nearest_known_pixel():
    pictures = Pictures((line(1, np.nan, np.nan, np.nan, 9),))
    assert pictures.pixels[0].ravel().tolist()[:2] == [1, 1]
    assert pictures.pixels[0].ravel().tolist()[3:] == [9, 9]
    assert pictures.known[0].tolist() == [[True, False, False, False, True]]
    assert pictures.values(0, 0).tolist() == [1, 9]


@given(st.integers(0, 2**16), st.integers(1, 9), st.integers(1, 9))
@settings(max_examples=30)
def test_no_known_pixel_is_nearer_than_the_one_taken(seed, rows, cols):
    rng = np.random.default_rng(seed)
    picture, gap = rng.permutation(rows * cols).reshape(rows, cols, 1), rng.random((rows, cols)) < 0.7
    gap.flat[0] = False
    found = completed(picture, gap)
    place = {int(picture[i, j, 0]): (i, j) for i, j in np.ndindex(rows, cols) if not gap[i, j]}
    for i, j in np.ndindex(rows, cols):
        k, m = place[int(found[i, j, 0])]
        assert (k - i) ** 2 + (m - j) ** 2 == min((a - i) ** 2 + (b - j) ** 2 for a, b in place.values())


def test_what_is_said_to_be_unknown_is_so_beside_nan():
    unknown = (np.array([[False, True, False]]),)
    pictures = Pictures((line(5, 6, 7, dtype=np.uint8),), unknown)
    assert pictures.known[0].tolist() == [[True, False, True]]
    assert pictures.pixels[0].ravel().tolist()[::2] == [5, 7]
    with pytest.raises(ValueError, match="no known pixel"):
        Pictures((line(np.nan, np.nan),))


def test_clean_is_one_picture_all_known_and_all_usable():
    one = line(1, 2)
    assert Pictures((one,)).clean
    assert not Pictures((one, one)).clean
    assert not Pictures((one,), usable=(np.array([[True, True]]),)).clean
    assert not Pictures((line(1, np.nan),)).clean


def test_categories_are_those_of_all_pictures_that_are_known():
    pictures = Pictures((line(3, np.nan, 1), line(7, 3)), categorical=(True,))
    assert pictures.categories(0).tolist() == [1, 3, 7]
    assert pictures.channels == 3
    assert Pictures((line(3, 7),), categorical=(True,)).channels == 1, "of two, one says which"
    assert Pictures((line(3, 3),), categorical=(True,)).channels == 1
    assert Pictures((line(3, 4, 5),)).categories(0) is None


def two(step=2, margin=2, apart=0):
    first, second = np.arange(20).reshape(4, 5, 1), np.arange(100, 121).reshape(7, 3, 1)
    return Sample(Pictures((first.astype(np.uint8), second.astype(np.uint8))), 8, margin, step=step, apart=apart)


def test_pictures_lie_one_below_another():
    sample = two()
    assert sample.boxes == [(0, 4, 5), (8, 7, 3)]
    assert (sample.height, sample.width) == (15, 5)
    assert sample.inside.sum() == 20 + 21
    assert sample.pixels[8:15, :3, 0].ravel().tolist() == list(range(100, 121))
    assert two(step=4, margin=3).boxes[1][0] == 12, "at a multiple of the step"
    assert two(apart=9).boxes[1][0] == 14, "or further"
    margins = sample.working.reshape(sample.rows, sample.cols)[8 : 8 + 11, :7]
    assert (margins == np.pad(np.arange(100, 121).reshape(7, 3), 2, mode="reflect")).all()


def test_places_and_pixel_indices_are_each_others_inverse():
    sample = two()
    place = np.array([[0, 0, 0], [3, 4, 0], [0, 0, 1], [6, 2, 1], [-1, -1, -1]])
    index = sample.index(place)
    assert index[-1] == -1
    assert sample.place(index).tolist() == place.tolist()
    assert sample.picture_of(index[:4]).tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("edges", ["whole", "reflect", "auto"])
@pytest.mark.parametrize(("spacing", "phases"), [(1, "all"), (2, "all"), (2, "decimated")])
def test_candidates_are_those_of_each_picture_alone(edges, spacing, phases):
    rng = np.random.default_rng(1)
    masks = [rng.random((7, 8)) < 0.7, rng.random((9, 6)) < 0.7]
    pictures = [rng.integers(0, 9, (*mask.shape, 1)).astype(np.uint8) for mask in masks]
    sample = Sample(Pictures(tuple(pictures), usable=tuple(masks)), 8, 2, step=2)
    offsets, step = neighbourhood_offsets(1), 1 if phases == "all" else spacing
    found = [tuple(p) for p in sample.place(sample.places(offsets, spacing, phases, edges).positions).tolist()]
    every = [(i, j, n) for n, mask in enumerate(masks) for i, j in np.ndindex(mask.shape) if mask[i, j]]
    every = [(i, j, n) for i, j, n in every if i % step == j % step == 0]
    whole = [
        (i, j, n)
        for i, j, n in every
        if all(spacing <= x < side - spacing for x, side in zip((i, j), masks[n].shape, strict=True))
    ]
    all_of_them = edges == "reflect" or (edges == "auto" and (spacing > 1 or len(whole) < 0.75 * len(every)))
    assert found == (every if all_of_them else whole)


def test_a_candidate_knows_enough_of_its_neighbours(monkeypatch):
    known = np.ones((9, 9), bool)
    known[4, 4] = known[4, 5] = False
    pixels = (np.zeros((9, 9, 1), np.uint8),)
    offsets = neighbourhood_offsets(1)
    found = {}
    for unsure in (0.0, 0.25, 0.5):
        monkeypatch.setattr("simdtex.model.sample.UNSURE", unsure)
        sample = Sample(Pictures(pixels, unknown=(~known,)), 4, 1)
        found[unsure] = {tuple(p) for p in sample.place(sample.places(offsets, 1, "all", "reflect").positions).tolist()}
    everywhere = {(i, j) for i, j in np.ndindex(9, 9) if known[i, j]}
    beside = {(3, 4), (5, 4), (4, 3), (3, 5), (5, 5), (4, 6)}  # each sees one of the two
    assert found == {0.0: everywhere - beside, 0.25: everywhere, 0.5: everywhere}


def test_what_is_fair_is_in_proportion_to_shares():
    offsets = neighbourhood_offsets(1)
    where = (offsets, 1, "all", "reflect")
    first, second = np.zeros((4, 5, 1), np.uint8), np.zeros((8, 5, 1), np.uint8)
    sample = Sample(Pictures((first, second), shares=(3.0, 1.0)), 4, 1)
    places = sample.places(*where)
    fair, picture = sample.fair(places), sample.picture_of(places.everywhere)
    assert fair[picture == 0].sum() == pytest.approx(3 * fair[picture == 1].sum(), rel=1e-4)
    assert (fair > 0).sum() == 60
    several, one = Sample(Pictures((first, second)), 4, 1), Sample(Pictures((first,)), 4, 1)
    alike = several.fair(several.places(*where))
    assert sorted(set(alike.tolist())) == [0, 1]
    assert one.fair(one.places(*where)) is None


# -- From pixels to working levels, with weights and categories.


def scale(*variables, values=64, **kinds):
    """The scale of one picture whose channels are these lists of numbers, and its levels, (channels, n)."""
    pixels = np.stack([np.asarray(v) for v in variables], -1)[None]
    found = Scale(Pictures((pixels,), **kinds), values)
    return found, found.levels(pixels)[:, 0]


def test_eight_bits_are_their_own_levels():
    found, levels = scale(np.uint8([3, 255, 0]), np.uint8([9, 9, 9]))
    assert levels.tolist() == [[3, 255, 0], [9, 9, 9]]
    assert (found.top, found.unit, found.direct, found.owners) == (255, 1.0, True, [0, 1])
    assert found.units.tolist() == [1, 1]


@pytest.mark.parametrize(("values", "top"), [(1, 4095), (2**9, 4095), (2**11, 2047), (2**13, 1023)])
def test_the_highest_level_keeps_sums_exact(values, top):
    assert highest(values) == top
    bits = np.log2(top) * 2 + 20 + np.log2(values)
    assert bits <= 53
    found, levels = scale(np.float32([0, 1, 0.5]), values=values)
    assert found.top == top
    assert levels.tolist() == [[0, top, round(top / 2)]]


def test_channels_on_one_scale_keep_their_differences():
    found, levels = scale(np.float64([0, 100]), np.float64([40, 60]))
    assert levels.tolist() == [[0, 4095], [round(0.4 * 4095), round(0.6 * 4095)]]
    assert found.unit == pytest.approx(100 / 4095)
    assert found.levels(np.float64([[[-5, 500]]]))[:, 0, 0].tolist() == [0, 4095], "beyond the range, the nearest"


def test_integers_are_stretched_exactly():
    low = np.iinfo(np.int64).min
    levels, unit = stretch(np.array([low, 0, -low - 1], np.int64), 4)
    assert levels.tolist() == [0, 2, 4]
    assert unit == 2.0**62
    assert stretch(np.uint8([7, 7]), 10)[0].tolist() == [0, 0]


def test_weighted_variables_have_the_same_spread_times_their_weight():
    rng = np.random.default_rng(1)
    wide, narrow = rng.normal(size=400) * 1e6, rng.normal(size=400) * 1e-3
    found, levels = scale(wide, narrow, weights=(1.0, 2.0))
    one, two = levels.astype(float).std(1)
    assert two == pytest.approx(2 * one, rel=2e-3)
    assert levels.max() == found.top
    assert not found.direct
    assert found.units * levels.astype(float).std(1) == pytest.approx([wide.std(), narrow.std()], rel=2e-3)
    _, alone = scale(wide, narrow, weights=(0.0, 1.0))
    assert not alone[0].any()


def test_a_variable_that_never_varies_has_no_levels():
    found, levels = scale(np.float32([5, 5, 5]), np.float32([1, 2, 3]), weights=(1.0, 1.0))
    assert levels[0].tolist() == [0, 0, 0]
    assert levels[1].tolist() == [0, round(found.top / 2), found.top]
    assert found.units[0] == 0


def test_any_two_categories_differ_alike():
    found, levels = scale(np.int32([7, 7, 90, 31, 7]), categorical=(True,))
    assert found.owners == [0, 0, 0]
    high = found.top
    assert levels.tolist() == [[high, high, 0, 0, high], [0, 0, 0, high, 0], [0, 0, high, 0, 0]], "in ascending order"
    assert found.units.tolist() == [0, 0, 0]


def test_two_categories_are_one_channel_and_one_is_nothing():
    found, levels = scale(np.int32([7, 90, 7]), categorical=(True,))
    assert levels.tolist() == [[0, found.top, 0]]
    assert scale(np.int32([7, 7]), categorical=(True,))[1].tolist() == [[0, 0]]


@pytest.mark.parametrize("kinds", [2, 3, 4])
def test_two_pixels_differ_as_much_in_a_category_as_in_a_number(kinds):
    """By two variances, on average."""
    rng = np.random.default_rng(kinds)
    category, number = rng.integers(0, kinds, 600), rng.normal(size=600)
    found, levels = scale(category.astype(float), number, categorical=(True, False))
    squares = (levels[:, :, None].astype(float) - levels[:, None, :]) ** 2
    own = np.array(found.owners)
    assert squares[own == 0].sum(0).mean() == pytest.approx(squares[own == 1].sum(0).mean(), rel=1e-2)


def test_unknown_pixels_tell_nothing():
    pixels = np.float32([[[0.0], [np.nan], [2.0]]])
    far = np.where(np.isnan(pixels), 1e9, pixels)
    told = Scale(Pictures((far,), unknown=(np.isnan(pixels)[..., 0],)), 64)
    assert told.levels(pixels[:, ::2])[0, 0].tolist() == [0, 4095]


# -- The sample in integers that do not depend on its contrast, and the way back.

DTYPES = [np.bool_, np.uint8, np.int8, np.uint16, np.int16, np.int32, np.uint32, np.int64, np.uint64]
FLOATS = [np.float16, np.float32, np.float64]
dtypes = pytest.mark.parametrize("dtype", [*DTYPES, *FLOATS], ids=lambda dtype: dtype.__name__)


def identity(shape):
    return np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)


def limits(dtype):
    """The least and the greatest number of a type."""
    if dtype == np.bool_:
        return False, True
    info = np.iinfo(dtype) if np.issubdtype(dtype, np.integer) else np.finfo(dtype)
    return info.min, info.max


def extremes(dtype, seed=0, shape=(6, 5, 2)):
    """A sample of all a type's range: its limits, what is beside them, and numbers between."""
    low, high = limits(dtype)
    rng = np.random.default_rng(seed)
    if dtype == np.bool_:
        return rng.random(shape) < 0.5
    if np.issubdtype(dtype, np.integer):
        pixels = rng.integers(low, high, shape, dtype, endpoint=True)
    else:
        pixels = ((rng.random(shape) - 0.5) * 2 * float(high)).astype(dtype)
    pixels.flat[:4] = low, high, low + 1, high - 1
    return pixels


def steps(pixels):
    """The same in fractions. Float64 rounds 64-bit pixels first, but none so near a half that it would matter."""
    values = [Fraction(x) for x in pixels.astype(object).ravel()]
    low, span = min(values), max(values) - min(values)
    return np.array([round((x - low) * TOP / span) if span else 0 for x in values]).reshape(pixels.shape)


@dtypes
def test_a_sample_is_stretched_over_the_whole_scale(dtype):
    pixels = extremes(dtype)
    sample = Stretched(pixels)
    assert (sample.planes.dtype, sample.planes.shape) == (np.int32, (2, 6, 5))
    assert sample.planes.flags.c_contiguous
    assert (sample.planes.min(), sample.planes.max()) == (0, TOP)
    assert (sample.planes == np.moveaxis(steps(pixels), -1, 0)).all()
    low, high = (Fraction(int(x) if dtype in DTYPES else float(x)) for x in limits(dtype))
    assert abs(Fraction(sample.unit) * TOP / (high - low) - 1) < CONTRAST


@pytest.mark.parametrize("value", [0, 7, 255])
@dtypes
def test_a_constant_sample_is_all_zero(dtype, value):
    pixels = np.full((3, 4, 2), value).astype(dtype)
    sample = Stretched(pixels)
    assert not sample.planes.any()
    assert sample.unit == 1
    assert_same_bits(sample.picture(sample.planes), pixels)


@pytest.mark.parametrize("spread", [5e-324, 1e-320, 1e-318, 1.5e-317, 1e-316, 1e-310, 1e-300])
def test_the_smallest_of_floats_do_no_harm(spread):
    """Below about 1e-302 the unit has fewer bits, or none, and the scale is not used to its end."""
    pixels = texture((5, 4), 1, np.float64)
    pixels = (pixels - pixels.min()) / np.ptp(pixels) * spread
    sample = Stretched(pixels)
    assert sample.planes.min() == 0
    assert sample.planes.max() < 2 * TOP
    assert_same_bits(sample.picture(sample.planes, identity((5, 4))), pixels)


def by_contrast(dtype):
    """Pairs (a, b) with which a byte s goes to a s + b of a type exactly."""
    if np.issubdtype(dtype, np.integer):
        low, high = limits(dtype)
        low, high = max(low, -(2**53)), min(high, 2**53)  # what float64 holds
        factors = [a for a in (1, 2, 3, 100, 257, 10**6, 2**40) if 255 * a <= high - low]
        return [(a, b) for a in factors for b in (low, -7, 0, 11, high - 255 * a) if low <= b <= high - 255 * a]
    shifts = (-14, -3, 0, 5) if dtype == np.float16 else (-120, -3, 0, 80)
    return [(2.0**e, b * 2.0**e) for e in shifts for b in (-300, -1, 0, 17, 1000)]


@dtypes
def test_contrast_and_a_constant_change_nothing(dtype):
    byte = texture((7, 6), 3)
    sample = Stretched(byte)
    given = by_contrast(dtype) if dtype != np.bool_ else []
    for a, b in given:
        if np.issubdtype(dtype, np.integer):
            pixels = (byte.astype(object) * a + b).astype(dtype)
        else:
            pixels = (byte.astype(np.float64) * a + b).astype(dtype)
            assert (pixels.astype(np.float64) == byte * a + b).all(), "exactly so"
        other = Stretched(pixels)
        assert_same_bits(other.planes, sample.planes)
        assert abs(other.unit / (a * sample.unit) - 1) < CONTRAST
    two = Stretched(byte > 128)
    assert_same_bits(two.planes, Stretched((byte > 128) * np.uint8(99)).planes)


@pytest.mark.parametrize("channels", [1, 2, 3, 5])
def test_the_luminance(channels):
    sample = Stretched(texture((6, 7), channels, np.uint16))
    luminance = sample.luminance
    assert (luminance.dtype, luminance.shape) == (np.int32, (1, 6, 7))
    shares = [Fraction(share, 2**16) for share in LUMA] if channels == 3 else [Fraction(1, channels)] * channels
    for i, j in np.ndindex(6, 7):
        values = sample.planes[:, i, j].tolist()
        exact = sum(share * value for share, value in zip(shares, values, strict=True))
        assert luminance[0, i, j] == (exact + Fraction(1, 2)).__floor__()


@dtypes
def test_a_picture_of_the_sample_itself_is_the_sample_to_the_bit(dtype):
    pixels = extremes(dtype)
    sample = Stretched(pixels)
    assert_same_bits(sample.picture(sample.planes, identity((6, 5))), pixels)
    source = np.random.default_rng(1).integers(0, 30, (4, 9)).astype(np.int32)
    copied = sample.picture(sample.planes.reshape(2, -1)[:, source], source)
    assert_same_bits(copied, pixels.reshape(30, 2)[source])


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_a_copied_zero_keeps_its_sign(zero):
    pixels = np.array([[[zero], [1.0]]])
    sample = Stretched(pixels)
    assert_same_bits(sample.picture(sample.planes, identity((1, 2))), pixels)


@pytest.mark.parametrize("dtype", DTYPES[:5], ids=lambda dtype: dtype.__name__)
def test_values_alone_give_back_types_of_up_to_16_bits(dtype):
    """The scale is finer than they are. This is what stages of coarser levels rest on."""
    pixels = extremes(dtype)
    sample = Stretched(pixels)
    assert_same_bits(sample.picture(sample.planes), pixels)


@pytest.mark.parametrize("dtype", FLOATS[1:], ids=lambda dtype: dtype.__name__)
def test_values_alone_give_floats_to_half_a_unit(dtype):
    pixels = texture((6, 5), 2, dtype)
    sample = Stretched(pixels)
    picture = sample.picture(sample.planes)
    assert picture.dtype == dtype
    off = abs(picture.astype(np.float64) - pixels)
    assert off.max() <= sample.unit / 2 + np.finfo(dtype).eps * abs(pixels).max()


@dtypes
def test_values_beyond_the_scale_are_projected_onto_legal_pixels(dtype):
    """0 to 255 for 8 bits without a sign; else between the sample's smallest and largest pixel."""
    pixels = texture((6, 5), 2, dtype)
    pixels = pixels // 3 if np.issubdtype(dtype, np.integer) else pixels
    sample, source = Stretched(pixels), identity((6, 5))
    low, high = (0, 255) if dtype == np.uint8 else (pixels.min(), pixels.max())
    for origin in (None, source):
        for value, legal in ((-(2**25), low), (-4 * TOP, low), (4 * TOP, high), (2**25, high)):
            picture = sample.picture(np.full_like(sample.planes, value), origin)
            assert picture.dtype == dtype
            assert (picture == np.asarray(legal, dtype)).all()


@pytest.mark.parametrize("dtype", [np.int64, np.uint64, np.float64], ids=lambda dtype: dtype.__name__)
def test_extreme_values_are_projected_without_overflow(dtype):
    """Float64 has no number between 2**63 - 1024 and 2**63, so the closest legal one that it has is meant."""
    pixels = extremes(dtype)
    sample, (low, high) = Stretched(pixels), limits(dtype)
    for origin in (None, identity((6, 5))):
        assert (sample.picture(np.full_like(sample.planes, -(2**25)), origin) == low).all()
        most = sample.picture(np.full_like(sample.planes, 2**25), origin)
        # Where the value is the source's own, the pixel stays as it is.
        assert (most.astype(np.float64) >= float(high) * (1 - 2**-52)).all()
        assert (most <= high).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16], ids=lambda dtype: dtype.__name__)
@given(seed=st.integers(0, 2**16))
def test_whole_pixels_are_the_closest_to_the_value(dtype, seed):
    pixels = texture((5, 4), 1, dtype, seed % 7)
    sample = Stretched(pixels)
    rng = np.random.default_rng(seed)
    values = rng.integers(-TOP, 2 * TOP, sample.planes.shape, np.int32, endpoint=True)
    source = rng.integers(0, 20, (5, 4)).astype(np.int32)
    own, planes = pixels.ravel(), sample.planes.ravel()
    span = int(own.max()) - int(own.min())
    low, high = (0, 255) if dtype == np.uint8 else (int(own.min()), int(own.max()))
    alone, moved = sample.picture(values), sample.picture(values, source)
    for i, value in enumerate(values.ravel().tolist()):
        s = source.flat[i]
        exact = int(own.min()) + Fraction(value * span, TOP)
        assert alone.flat[i] == min(max(round(exact), low), high)
        exact = int(own[s]) + Fraction((value - int(planes[s])) * span, TOP)
        assert moved.flat[i] == min(max(round(exact), low), high)


def test_a_truth_value_turns_at_the_middle():
    pixels = texture((5, 4), 1, np.bool_)
    sample = Stretched(pixels)
    values = np.array([-TOP, 0, TOP // 2, TOP // 2 + 1, TOP, 3 * TOP], np.int32).reshape(1, 2, 3)
    picture = sample.picture(values)
    assert picture.dtype == np.bool_
    assert picture.ravel().tolist() == [False, False, False, True, True, True]


# -- Colours without correlation: against numpy.linalg in float64, there and back, flat channels, several pictures.


def planes_of(shape=(12, 11), channels=3, dtype=np.uint8, seed=0):
    return Stretched(texture(shape, channels, dtype, seed)).planes


def mixed(rng, channels, count=400, top=TOP):
    """Planes whose channels are any linear mixture of as many that have nothing to do with each other."""
    own = rng.uniform(-1, 1, (channels, count)) * rng.uniform(0.2, 1, (channels, 1))
    values = rng.normal(0, 1, (channels, channels)) @ own
    values = (values - values.min()) / (values.max() - values.min())
    return np.rint(values * top).astype(np.int32)[:, None]


def moments(channels):
    flat = channels.reshape(len(channels), -1)
    return flat.mean(1), np.cov(flat, bias=True).reshape(len(flat), -1)


@given(st.integers(0, 2**16), st.integers(1, 4))
def test_the_transform_is_that_of_a_plain_svd(seed, channels):
    planes = mixed(np.random.default_rng(seed), channels)
    matrix, _, mean = plain.decorrelating(planes.reshape(channels, -1).T.astype(float))
    own = palette([planes], [1.0])
    assert abs(own.mean - mean).max() <= 0.5 + 1e-6
    gaps = np.diff(np.linalg.svd(moments(planes)[1])[1]) / (own.deviations[0] / 2**14) ** 2
    if channels > 1 and abs(gaps).min() < 0.02:
        return  # the axes of variances that nearly agree may be any
    ours = own.axes / own.deviations[:, None]
    assert abs(ours - matrix).max() <= DIRECTION * abs(matrix).max()
    assert (np.diff(own.deviations) <= 0).all(), "the largest variance first"


@given(st.integers(0, 2**16), st.integers(1, 5), st.booleans())
def test_there_and_back_is_the_same(seed, channels, decorrelate):
    planes = mixed(np.random.default_rng(seed), channels)
    own = palette([planes], [1.0], decorrelate)
    if (own.deviations == 0).any():
        return
    assert (own.restored(own.decorrelated(planes)) == planes).all()


def test_what_is_scaled_comes_back_within_what_scaling_rounds():
    planes = planes_of()
    own = palette([planes], [1.0])
    scale = decorrelated([planes], [own])
    channels = scale.channels[0]
    assert channels.dtype == np.int32
    assert (abs(channels).reshape(3, -1).max(1) == TOP).all()
    step = (scale.spans / TOP * own.deviations / 2**14).sum()
    assert abs(own.restored(scale.normalised(channels)) - planes).max() <= 1.5 + step


def test_channels_kept_apart_are_only_centred_and_scaled():
    planes = planes_of()
    own = palette([planes], [1.0], decorrelate=False)
    assert (own.axes == np.eye(3, dtype=np.int64) * 2**14).all()
    flat = planes.reshape(3, -1).astype(float)
    assert own.deviations / 2**14 == pytest.approx(flat.std(1), rel=1e-9)
    assert (own.mean == np.rint(flat.mean(1))).all()


def test_grey_in_three_channels_is_one_channel():
    grey = planes_of(channels=1)
    planes = np.repeat(grey, 3, 0)
    own = palette([planes], [1.0])
    assert (own.deviations[1:] == 0).all()
    assert own.deviations[0] > 0
    channels = own.decorrelated(planes)
    assert not channels[1:].any()
    back = own.restored(np.concatenate([np.linspace(-3, 3, 77).reshape(1, 7, 11), np.zeros((2, 7, 11))]))
    assert (back == back[0]).all(), "grey to the bit"


@pytest.mark.parametrize("decorrelate", [True, False])
def test_a_constant_picture_has_flat_channels(decorrelate):
    planes = np.arange(3, dtype=np.int32).reshape(3, 1, 1).repeat(5, 1).repeat(4, 2)
    own = palette([planes], [1.0], decorrelate)
    scale = decorrelated([planes], [own])
    assert not own.deviations.any()
    assert not scale.channels[0].any()
    assert not scale.spans.any()
    assert (own.restored(scale.normalised(scale.channels[0])) == planes).all()


@pytest.mark.parametrize(("share", "flat"), [(2 * FLAT, False), (FLAT / 2, True)])
def test_a_channel_is_flat_below_a_share_of_the_largest(share, flat):
    rng = np.random.default_rng(2)
    planes = np.rint(rng.normal(0, 2**17, (2, 50, 50)) * np.array([1, share])[:, None, None]).astype(np.int32)
    own = palette([planes], [1.0])
    assert (own.deviations[1] == 0) == flat
    assert own.deviations[0] > 0


@given(st.integers(0, 2**16), st.lists(st.floats(0.01, 10), min_size=2, max_size=3))
def test_several_pictures_are_one_with_each_its_share(seed, weights):
    rng = np.random.default_rng(seed)
    pictures = [mixed(rng, 3, count) for count in (60, 110, 35)[: len(weights)]]
    shares = np.array(weights) / sum(weights)
    flat = [p.reshape(3, -1).astype(float) for p in pictures]
    mean = sum(s * f.mean(1) for s, f in zip(shares, flat, strict=True))
    covariance = sum(
        s * (f - mean[:, None]) @ (f - mean[:, None]).T / f.shape[1] for s, f in zip(shares, flat, strict=True)
    )
    own = palette(pictures, weights)
    assert abs(own.mean - mean).max() <= 0.5 + 1e-6
    axes = own.axes / 2**14
    found = axes @ covariance @ axes.T
    assert (own.deviations / 2**14) ** 2 == pytest.approx(np.diag(found), rel=1e-6, abs=2.0)
    assert abs(found - np.diag(np.diag(found))).max() <= DECORRELATED * found.max()


def test_channels_of_several_pictures_share_a_scale():
    a, b = planes_of(seed=1), planes_of((7, 9), seed=2)
    own = palette([a, b], [1, 1])
    scale = decorrelated([a, b], [own, own])
    most = np.max([abs(c).reshape(3, -1).max(1) for c in scale.channels], 0)
    assert (most == TOP).all()
    for picture, channels in zip((a, b), scale.channels, strict=True):
        assert channels.shape == picture.shape
        assert scale.normalised(channels) == pytest.approx(own.decorrelated(picture), abs=4 / TOP * scale.spans.max())
