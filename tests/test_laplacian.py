"""The Laplacian pyramid in integers, equations (5) and (6): its steps, its inverse, and tiles."""

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simdtex.methods.multires.analysis import pyramid
from simdtex.model.stretched import TOP
from simdtex.ops.laplacian import half, laplacian_band, laplacian_blend, laplacian_collapse, laplacian_reduce, within

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


def collapse(machine, band, source, coarse, torus, how=laplacian_collapse):
    arrays = [machine.put(np.ascontiguousarray(a)) for a in (band, source, coarse)]
    return np.asarray(machine.get(how(machine, *arrays, torus)))


def both(machine, g, levels, torus):
    """The Gaussian and the Laplacian pyramid, in NumPy arrays."""
    return [host(machine, a) for a in pyramid(machine, machine.put(g), levels, torus)]


def depth(shape):
    """Levels down to a single pixel."""
    return 1 + (max(shape) - 1).bit_length()


# -- the formulas ---------------------------------------------------------------------------------------------


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
    fine = collapse(REFERENCE, *case, torus, laplacian_blend)
    assert fine.dtype == np.int32
    for plane, own in enumerate(coarse):
        up = plain.expanded(own, source.shape, band.shape[1:], torus)
        assert (fine[plane] == plain.faded(band[plane], source, torus) + up).all()


@given(pictures(), st.integers(1, 3), st.integers(1, 3))
def test_where_pieces_go_on_a_blend_is_a_collapse(g, down, across):
    """Whole tiles on a torus, and the inside of pieces."""
    coarse, band = steps(REFERENCE, g, torus=True)
    tiles = np.tile(identity(g.shape[1:]), (down, across))
    above = np.tile(coarse, (1, down, across))
    assert_same_bits(collapse(REFERENCE, band, tiles, above, True, laplacian_blend), np.tile(g, (1, down, across)))
    coarse, band = steps(REFERENCE, g, torus=False)
    assert_same_bits(collapse(REFERENCE, band, identity(g.shape[1:]), coarse, False, laplacian_blend), g)


def test_a_blend_fades_over_one_pixel_on_either_side_of_a_join():
    band = np.zeros((1, 4, 16), np.int32)
    band[..., 8:] = 16  # two flat pieces, laid side by side with 4 columns of each
    source = identity((4, 16))[:, [2, 3, 4, 5, 10, 11, 12, 13]]
    made = collapse(REFERENCE, band, source, np.zeros((1, 2, 4), np.int32), False, laplacian_blend)
    assert (made[0] == [0, 0, 0, 4, 12, 16, 16, 16]).all()


@pytest.mark.parametrize("torus", [True, False])
def test_a_pixel_spreads_as_the_papers_kernel(torus):
    """An impulse of 1 far from any border, reduced and expanded: g itself in 1/16."""
    g = np.zeros((1, 17, 17), np.int32)
    g[0, 8, 8] = TOP
    weights = np.array([1, 4, 6, 4, 1])
    coarse, _ = steps(REFERENCE, g, torus)
    assert (coarse[0, 3:6, 3:6] * 256 == np.outer(weights[::2], weights[::2]) * TOP).all()
    assert coarse.sum() == coarse[0, 3:6, 3:6].sum()
    impulse = np.zeros((1, 9, 9), np.int32)
    impulse[0, 4, 4] = TOP
    spread = collapse(REFERENCE, np.zeros((1, 17, 17), np.int32), identity((17, 17)), impulse, torus)
    assert (spread[0, 6:11, 6:11] * 64 == np.outer(weights, weights) * TOP).all()
    assert spread.sum() == 4 * TOP


# -- machines -------------------------------------------------------------------------------------------------


@given(g=pictures(), torus=st.booleans())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, g, torus):
    assert_same_bits(steps(machine, g, torus), steps(REFERENCE, g, torus))


@given(case=levels_of_an_output(), torus=st.booleans())
@settings(max_examples=25)
def test_a_device_collapses_to_the_references_bits(machine, case, torus):
    for how in (laplacian_collapse, laplacian_blend):
        assert_same_bits(collapse(machine, *case, torus, how), collapse(REFERENCE, *case, torus, how))


@pytest.mark.parametrize("work_group", [3, 16])
def test_the_shape_of_a_launch_changes_no_bit(cl_device, work_group):
    machine = opencl(cl_device, work_group=work_group)
    g = picture((10, 13), 3)
    for torus in (True, False):
        coarse, band = steps(REFERENCE, g, torus)
        assert_same_bits(steps(machine, g, torus), [coarse, band])
        assert_same_bits(collapse(machine, band, identity((10, 13)), coarse, torus), g)


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
            for how in (laplacian_collapse, laplacian_blend):
                fine = collapse(machine, band, identity((8, 8)), coarse, True, how)
                assert (fine == sign * (most + TOP)).all()


# -- what a pyramid is for ------------------------------------------------------------------------------------


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


@given(pictures(), st.integers(1, 3), st.integers(1, 3))
def test_whole_tiles_of_a_torus_collapse_to_the_tiled_picture(g, down, across):
    """Odd sizes too: a tile's pixels have the parents that the sample's have."""
    _, bands = both(REFERENCE, g, depth(g.shape[1:]), torus=True)
    value = np.tile(bands[-1], (1, down, across))
    for band in reversed(bands[:-1]):
        value = collapse(REFERENCE, band, np.tile(identity(band.shape[1:]), (down, across)), value, torus=True)
    assert_same_bits(value, np.tile(g, (1, down, across)))


@pytest.mark.parametrize("shape", [(8, 8), (5, 7), (1, 6)])
def test_a_device_collapses_whole_tiles_to_the_tiled_picture(machine, shape):
    g = picture(shape, 2)
    _, bands = both(machine, g, depth(shape), torus=True)
    value = np.tile(bands[-1], (1, 2, 3))
    for band in reversed(bands[:-1]):
        value = collapse(machine, band, np.tile(identity(band.shape[1:]), (2, 3)), value, torus=True)
    assert_same_bits(value, np.tile(g, (1, 2, 3)))


@given(st.tuples(sides, sides), st.integers(-TOP, TOP), st.booleans())
def test_a_constant_picture_has_no_bands(shape, value, torus):
    gaussian, bands = both(REFERENCE, np.full((1, *shape), value, np.int32), depth(shape), torus)
    assert all((g == value).all() for g in gaussian)
    assert not any(band.any() for band in bands[:-1])


@given(pictures(), st.integers(-TOP, TOP), st.booleans())
def test_a_constant_is_added_to_every_g_and_changes_no_band(g, constant, torus):
    most = depth(g.shape[1:])
    (gaussian, bands), moved = both(REFERENCE, g, most, torus), both(REFERENCE, g + np.int32(constant), most, torus)
    assert_same_bits(moved[0], [level + np.int32(constant) for level in gaussian])
    assert_same_bits(moved[1][:-1], bands[:-1])


@given(pictures(), st.data())
def test_on_a_torus_a_shift_of_two_pixels_shifts_a_coarser_level_by_one(g, data):
    """Of sides that are whole multiples of two; a level has no place where it begins."""
    g = np.tile(g, (1, 2, 2))
    by = [2 * data.draw(st.integers(0, n // 2)) for n in g.shape[1:]]
    coarse, band = steps(REFERENCE, g, torus=True)
    shifted = steps(REFERENCE, np.roll(g, by, (1, 2)), torus=True)
    expected = [np.roll(coarse, [n // 2 for n in by], (1, 2)), np.roll(band, by, (1, 2))]
    assert_same_bits(shifted, expected)


@given(pictures(), st.booleans())
def test_planes_do_not_mix_and_rows_are_like_columns(g, torus):
    whole = steps(REFERENCE, g, torus)
    for plane in range(len(g)):
        assert_same_bits(steps(REFERENCE, g[plane : plane + 1], torus), [a[plane : plane + 1] for a in whole])
    turned = steps(REFERENCE, np.ascontiguousarray(g.swapaxes(1, 2)), torus)
    assert_same_bits(turned, [a.swapaxes(1, 2) for a in whole])
