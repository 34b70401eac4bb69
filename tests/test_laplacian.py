"""The Laplacian pyramid in integers, equations (5) and (6): its steps, its inverse, and tiles."""

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, assert_same_bits, host
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simdtex.methods.multires.analysis import pyramid
from simdtex.model.stretched import TOP
from simdtex.ops.pyramids import half, laplacian_band, laplacian_collapse, laplacian_reduce, within

RANGES = {"sample": (0, TOP), "bits": (0, 1), "signed": (-TOP, TOP), "small": (-3, 3)}
sides = st.integers(1, 9)


def picture(shape, planes=1, values="sample", seed=0):
    low, high = RANGES[values]
    return np.random.default_rng(seed).integers(low, high, (planes, *shape), np.int32, endpoint=True)


@st.composite
def pictures(draw):
    shape, planes = (draw(sides), draw(sides)), draw(st.integers(1, 3))
    return picture(shape, planes, draw(st.sampled_from(sorted(RANGES))), draw(st.integers(0, 2**16)))


@st.composite
def levels_of_an_output(draw):
    """A band of the sample, pixels of it that make up a level of whole and broken tiles, and the level above."""
    tile, planes = (draw(sides), draw(sides)), draw(st.integers(1, 3))
    shape = draw(st.integers(1, 2 * tile[0] + 1)), draw(st.integers(1, 2 * tile[1] + 1))
    seed = draw(st.integers(0, 2**16))
    rng = np.random.default_rng(seed)
    source = rng.integers(0, tile[0] * tile[1], shape).astype(np.int32)
    above = [n // m * k + -(-(n % m) // 2) for n, m, k in zip(shape, tile, half(tile), strict=True)]
    limit = draw(st.sampled_from([TOP, 2**24]))
    coarse = rng.choice([-limit, limit, 0, 1, *rng.integers(-limit, limit, 5)], (planes, *above)).astype(np.int32)
    return picture(tile, planes, "signed", seed), source, coarse


def identity(shape):
    """The source map of a picture that is copied from itself."""
    return np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)


def steps(machine, g, torus):
    """One reduction and the band it leaves."""
    fine = machine.put(g)
    coarse = laplacian_reduce(machine, fine, torus)
    return host(machine, [coarse, laplacian_band(machine, fine, coarse, torus)])


def collapse(machine, band, source, coarse, torus, blend=False):
    arrays = [machine.put(np.ascontiguousarray(a)) for a in (band, source, coarse)]
    return np.asarray(machine.get(laplacian_collapse(machine, *arrays, torus, blend)))


def both(machine, g, levels, torus):
    """The Gaussian and the Laplacian pyramid, in NumPy arrays."""
    return [host(machine, a) for a in pyramid(machine, machine.put(g), levels, torus)]


def depth(shape):
    """Levels down to a single pixel."""
    return 1 + (max(shape) - 1).bit_length()


@given(st.integers(-40, 40), st.integers(1, 9), st.booleans())
def test_indices_are_brought_within_the_border(i, n, torus):
    assert within(np.array([i]), n, torus) == [plain.within(i, n, torus)]


@given(pictures(), st.booleans())
def test_the_reference_is_the_rule(g, torus):
    coarse, band = steps(REFERENCE, g, torus)
    assert (coarse.dtype, band.dtype) == (np.int32, np.int32)
    for plane, own in enumerate(g):
        (_, above), (expected, _) = plain.pyramid(own, 2, torus)
        assert (coarse[plane] == above).all()
        assert (band[plane] == expected).all()


@given(levels_of_an_output(), st.booleans())
def test_the_reference_collapses_by_the_rule(case, torus):
    band, source, coarse = case
    fine = collapse(REFERENCE, *case, torus)
    assert fine.dtype == np.int32
    for plane, own in enumerate(coarse):
        expected = band[plane].ravel()[source] + plain.expanded(own, source.shape, band.shape[1:], torus)
        assert (fine[plane] == expected).all()


@given(levels_of_an_output(), st.booleans())
def test_the_reference_blends_by_the_rule(case, torus):
    band, source, coarse = case
    fine = collapse(REFERENCE, *case, torus, blend=True)
    assert fine.dtype == np.int32
    for plane, own in enumerate(coarse):
        up = plain.expanded(own, source.shape, band.shape[1:], torus)
        assert (fine[plane] == plain.faded(band[plane], source, torus) + up).all()


def test_a_blend_fades_over_one_pixel_on_either_side_of_a_join():
    band = np.zeros((1, 4, 16), np.int32)
    band[..., 8:] = 16  # two flat pieces, laid side by side with 4 columns of each
    source = identity((4, 16))[:, [2, 3, 4, 5, 10, 11, 12, 13]]
    made = collapse(REFERENCE, band, source, np.zeros((1, 2, 4), np.int32), False, blend=True)
    assert (made[0] == [0, 0, 0, 4, 12, 16, 16, 16]).all()


@given(g=pictures(), torus=st.booleans())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, g, torus):
    assert_same_bits(steps(machine, g, torus), steps(REFERENCE, g, torus))


@given(case=levels_of_an_output(), torus=st.booleans())
@settings(max_examples=25)
def test_a_device_collapses_to_the_references_bits(machine, case, torus):
    for blend in (False, True):
        assert_same_bits(collapse(machine, *case, torus, blend), collapse(REFERENCE, *case, torus, blend))


def test_nothing_overflows_at_the_limits(machine):
    """Sums of the sample, of what 30 levels can add up to, and of integers up to the 2**24 that is promised."""
    rng = np.random.default_rng(3)
    for g in (np.full((1, 8, 8), TOP), np.full((1, 8, 8), -TOP), rng.choice([-TOP, TOP], (1, 8, 8))):
        for torus in (True, False):
            coarse, band = steps(machine, g.astype(np.int32), torus)
            assert_same_bits(steps(REFERENCE, g.astype(np.int32), torus), [coarse, band])
            assert abs(coarse).max() <= TOP
            assert abs(band).max() <= 2 * TOP
    for most in (2**24, 30 * TOP):
        for sign in (1, -1):
            coarse = np.full((1, 4, 4), sign * most, np.int32)
            band = np.full((1, 8, 8), sign * TOP, np.int32)
            for blend in (False, True):
                fine = collapse(machine, band, identity((8, 8)), coarse, True, blend)
                assert (fine == sign * (most + TOP)).all()


@given(pictures(), st.booleans())
@example(picture((1, 1), 2), True)
@example(picture((1, 9)), False)
@example(picture((33, 2)), False)
@example(picture((21, 37)), True)
def test_a_collapsed_pyramid_is_the_picture_to_the_bit(g, torus):
    most = depth(g.shape[1:])
    gaussian, bands = both(REFERENCE, g, most, torus)
    assert gaussian[-1].shape[1:] == (1, 1)
    assert_same_bits(bands[-1], gaussian[-1])
    for levels in range(1, most + 1):
        shorter = both(REFERENCE, g, levels, torus)
        assert_same_bits(shorter[0], gaussian[:levels])
        assert_same_bits(shorter[1], [*bands[: levels - 1], gaussian[levels - 1]])
        value = gaussian[levels - 1]
        for level in reversed(range(levels - 1)):
            value = collapse(REFERENCE, bands[level], identity(bands[level].shape[1:]), value, torus)
        assert_same_bits(value, g)


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("shape", [(13, 10), (1, 9)])
def test_a_device_collapses_a_pyramid_to_the_picture(machine, shape, torus):
    g = picture(shape, 3)
    gaussian, bands = both(machine, g, depth(shape), torus)
    assert_same_bits(both(REFERENCE, g, depth(shape), torus), [gaussian, bands])
    value = bands[-1]
    for band in reversed(bands[:-1]):
        value = collapse(machine, band, identity(band.shape[1:]), value, torus)
    assert_same_bits(value, g)
