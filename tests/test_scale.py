"""From pixels to working levels, with weights and categories."""

import numpy as np
import pytest

from simdtex.model.pictures import Pictures
from simdtex.model.scale import Scale, highest, stretch


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
