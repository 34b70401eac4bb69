"""Local texture measures, equation (7): the bank of filters and the responses to it."""

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import correlate
from tolerances import HALF, TAP

from simdtex.model.stretched import TOP
from simdtex.ops.pyramids import bank, filters

UNIT = 2**14
BANKS = (1, 3, 4, 6)


def run(machine, picture, band, taps, torus):
    arrays = [machine.put(np.ascontiguousarray(a, np.int32)) for a in (picture, band, taps)]
    return np.asarray(machine.get(filters(machine, *arrays, torus)))


def responses(picture, taps, torus=True):
    """Of one plane: (filters, rows, cols), without F^0."""
    features = run(REFERENCE, picture[None], np.zeros_like(picture[None]), taps, torus)
    return np.moveaxis(features.reshape(*picture.shape, -1)[..., 1:], -1, 0)


def noise(shape, seed=0):
    return np.random.default_rng(seed).integers(0, TOP, shape, endpoint=True)


@st.composite
def levels(draw):
    """A level, its band, and filters of any taps at all, so that nothing may be turned or swapped unseen."""
    rows, cols, planes = draw(st.integers(1, 9)), draw(st.integers(1, 9)), draw(st.integers(1, 3))
    count, side = draw(st.integers(0, 3)), draw(st.sampled_from([3, 5]))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    picture = rng.integers(-TOP, TOP, (planes, rows, cols), endpoint=True)
    band = rng.integers(-TOP, TOP, (planes, rows, cols), endpoint=True)
    taps = rng.integers(-UNIT // 4, UNIT // 4, (count, side, side), endpoint=True)
    return picture, band, taps, draw(st.booleans())


@given(levels())
def test_the_reference_is_the_rule(case):
    picture, band, taps, torus = case
    planes, rows, cols = picture.shape
    features = run(REFERENCE, *case)
    assert features.dtype == np.int32
    assert features.shape == (rows * cols, planes * (1 + len(taps)))
    expected = []
    for g, own in zip(picture, band, strict=True):
        expected += [own, *(plain.response(g, f, torus) for f in taps)]
    assert (features == np.stack(expected, -1).reshape(rows * cols, -1)).all()


@given(case=levels())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))


def test_sums_beyond_32_bits_are_exact(machine):
    picture = np.full((1, 6, 5), TOP)
    taps = np.full((2, 5, 5), UNIT)
    taps[1] *= -1
    for m in (REFERENCE, machine):
        features = run(m, picture, picture, taps, True)
        assert (features == [TOP, 25 * TOP, -25 * TOP]).all()


def exact(orientations, sigma=0.7, side=3):
    """The bank in float64: positive parts that add up to 2**14, and what each was multiplied by."""
    both = [plain.derivative(degree, a, sigma, side) for degree in (1, 2) for a in plain.angles(orientations)]
    scale = np.array([UNIT / total for _, total in both])
    return np.array([f for f, _ in both]) * scale[:, None, None], scale


def around_centre(taps):
    """Taps, row by row, without the centre, which only makes the sum 0."""
    return np.delete(taps.reshape(len(taps), -1), taps[0].size // 2, 1)


@pytest.mark.parametrize("orientations", BANKS)
def test_the_bank_is_the_derivatives_of_a_gaussian(orientations):
    taps, (formula, _) = bank(orientations), exact(orientations)
    assert taps.dtype == np.int32
    assert taps.shape == formula.shape == (2 * orientations, 3, 3)
    assert abs(around_centre(taps) - around_centre(formula)).max() <= TAP


@pytest.mark.parametrize("orientations", BANKS)
def test_every_filter_adds_up_to_0_and_its_positive_taps_to_about_1(orientations):
    taps = bank(orientations)
    assert not taps.sum((1, 2)).any()
    # Every tap and the centre's making up for it.
    assert abs(np.where(taps > 0, taps, 0).sum((1, 2)) - UNIT).max() <= 2 * TAP * taps[0].size


def test_no_default_tap_is_near_a_tie():
    """So the last bits of another machine's exp and cos change none: taps are made on the host."""
    for orientations in range(1, 9):
        formula = around_centre(exact(orientations)[0])
        assert abs(formula % 1 - 0.5).min() > 1e-4


def test_a_bank_of_no_orientations_leaves_the_bands_alone(machine):
    taps = bank(0)
    assert (taps.dtype, taps.shape) == (np.int32, (0, 3, 3))
    picture = noise((2, 4, 5))
    for m in (REFERENCE, machine):
        features = run(m, picture, picture - TOP // 2, taps, True)
        assert_same_bits(features, (picture - TOP // 2).reshape(2, 20).T.astype(np.int32))


def test_angle_0_sees_change_along_columns_only_and_a_right_angle_along_rows_only():
    row, col = np.indices((9, 9))
    for change, blind, sees in ((col, 1, 0), (row, 0, 1)):
        picture = 1000 * change**2
        found = responses(picture, bank(2), torus=False)
        edges, lines = found[:2], found[2:]
        assert not edges[blind].any()
        assert (edges[sees, 1:-1, 1:-1] > 0).all(), "brighter towards larger indices is positive"
        assert (abs(lines[blind]) <= rounding(picture, 3, "mirror")).all()
        assert (lines[sees, 1:-1, 1:-1] > 100).all()


def rounding(picture, side, mode):
    """How far a response may be from that of the float filter.

    Taps add up to 0, so a response is the sum of every tap but the centre times how much its pixel differs from the
    centre's. Each of these taps is off by TAP at most, and the sum is rounded.
    """
    difference = np.zeros(picture.shape)
    for at in np.ndindex(side, side):
        one = np.zeros((side, side))
        one[at] = 1
        difference += abs(correlate(picture.astype(np.float64), one, mode=mode) - picture)
    return TAP * difference / UNIT + HALF


# The positive part of each filter is scaled to 1, so filters steer with the scale they had before.
