"""The sample: its pictures, their gaps and categories, working levels, integers without contrast, and colours."""

from fractions import Fraction

import numpy as np
import plain_pyramid as plain
import pytest
from cases import assert_same_bits, texture
from hypothesis import given
from hypothesis import strategies as st
from tolerances import CONTRAST, DECORRELATED, DIRECTION

from simdtex.methods.pyramid.palette import FLAT, decorrelated, palette
from simdtex.methods.pyramid.stretched import LUMA, TOP, Stretched
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale, highest, stretch

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


def test_what_is_said_to_be_unknown_is_so_beside_nan():
    unknown = (np.array([[False, True, False]]),)
    pictures = Pictures((line(5, 6, 7, dtype=np.uint8),), unknown)
    assert pictures.known[0].tolist() == [[True, False, True]]
    assert pictures.pixels[0].ravel().tolist()[::2] == [5, 7]
    with pytest.raises(ValueError, match="no known pixel"):
        Pictures((line(np.nan, np.nan),))


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


# -- From pixels to working levels, with weights and categories.


def scale(*variables, values=64, **kinds):
    """The scale of one picture whose channels are these lists of numbers, and its levels, (channels, n)."""
    pixels = np.stack([np.asarray(v) for v in variables], -1)[None]
    found = Scale(Pictures((pixels,), **kinds), values)
    return found, found.levels(pixels)[:, 0]


def test_variables_have_spreads_of_their_weights():
    """Three categories differ in two channels by a height; two in one."""
    found, levels = scale([0.0, 1, 2, 3], [0.0, 0, 1, 2], categorical=(False, True), weights=(1, 2))
    differing, deviation = 1 - (4 + 1 + 1) / 16, np.std([0, 1, 2, 3]) / 3
    height = round(found.top * 2 * np.sqrt(1 / differing) * deviation)
    assert levels[0].tolist() == [round(found.top * k / 3) for k in range(4)]
    assert (levels[1:] == np.array([[1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) * height).all() and height < found.top
    assert found.owners == [0, 1, 1, 1] and found.units[1:].tolist() == [0, 0, 0]
    assert found.units[0] == pytest.approx(3 / found.top, rel=1e-6)
    found, levels = scale([5, 7, 7], categorical=(True,))
    assert levels.tolist() == [[0, found.top, found.top]]


def test_the_highest_level_keeps_sums_exact():
    for values, top in ((1, 4095), (2**9, 4095), (2**11, 2047), (2**13, 1023)):
        assert highest(values) == top and np.log2(top) * 2 + 20 + np.log2(values) <= 53
        found, levels = scale(np.float32([0, 1, 0.5]), values=values)
        assert found.top == top and levels.tolist() == [[0, top, round(top / 2)]]
    low = np.iinfo(np.int64).min
    levels, unit = stretch(np.array([low, 0, -low - 1], np.int64), 4)
    assert levels.tolist() == [0, 2, 4]
    assert unit == 2.0**62
    assert stretch(np.uint8([7, 7]), 10)[0].tolist() == [0, 0]


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


@dtypes
def test_a_constant_sample_is_all_zero(dtype):
    pixels = np.full((3, 4, 2), 7).astype(dtype)
    sample = Stretched(pixels)
    assert not sample.planes.any() and sample.unit == 1
    assert_same_bits(sample.picture(sample.planes), pixels)


def test_the_smallest_of_floats_do_no_harm():
    """Below about 1e-302 the unit has fewer bits, or none, and the scale is not used to its end."""
    for spread in (5e-324, 1e-318, 1.5e-317, 1e-310, 1e-300):
        pixels = texture((5, 4), 1, np.float64)
        pixels = (pixels - pixels.min()) / np.ptp(pixels) * spread
        sample = Stretched(pixels)
        assert sample.planes.min() == 0 and sample.planes.max() < 2 * TOP
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


@pytest.mark.parametrize("channels", [2, 3])
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
    if dtype == np.float64:
        pixels = np.array([[[-0.0], [1.0]]])  # a zero keeps its sign
        sample = Stretched(pixels)
        assert_same_bits(sample.picture(sample.planes, identity((1, 2))), pixels)


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
    sample = Stretched(texture((5, 4), 1, np.bool_))
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
