"""Pyramids in integers: noise, folding, the steerable pyramid, the transform that methods use, and solids."""

import numpy as np
import plain_multires as plain_solid
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from pyrtools.pyramids.filters import parse_filter
from subbands import decompose
from tolerances import HALF, RECONSTRUCTION, UNIT32

from simdtex import random
from simdtex.methods.pyramid import operations_solid as solid
from simdtex.methods.pyramid.laplacian import fold, noise, unfold
from simdtex.methods.pyramid.operations_solid import (
    above,
    solid_band,
    solid_collapse,
    solid_mean,
    solid_reduce,
    solid_turn,
)
from simdtex.methods.pyramid.pyramids import most_levels
from simdtex.methods.pyramid.steerable import ORIENTATIONS, UNIT, filters, steerable_join, steerable_split

# -- White noise: uniform 32-bit words, a function of seed, level, plane and site alone.


@given(st.integers(1, 9), st.sampled_from([1, 2, 13]), st.integers(0, 2**64 - 1), st.integers(0, 30))
def test_the_reference_is_a_word_of_each_sites_draw(planes, n, seed, level):
    values = noise(REFERENCE, planes, n, seed, level)
    assert (values.dtype, values.shape) == (np.int32, (planes, n))
    for p, s in np.ndindex(planes, n):
        word = int(random.draw4(seed, level, p // 4, s, 5, 0)[p % 4])
        assert values[p, s] == (word if word < 2**31 else word - 2**32)


# -- Every second pixel of a torus of any size, and back.


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 3), (4, 6), (5, 4), (4, 5)])
def test_every_second_pixel_around_the_torus_and_back(shape):
    """Unfolding is the transpose: <fold x, y> = <x, unfold y>; and folding what was unfolded gives it back."""
    x = noise_steerable((2, *shape))
    y = fold(REFERENCE, x)
    rows, cols = (n if n % 2 else n // 2 for n in shape)
    expected = [[[x[p, 2 * i % shape[0], 2 * j % shape[1]] for j in range(cols)] for i in range(rows)] for p in (0, 1)]
    assert_same_bits(y, np.array(expected, np.int32))
    assert_same_bits(fold(REFERENCE, unfold(REFERENCE, y, shape)), y)
    other = noise_steerable(y.shape, 1).astype(np.int64)
    assert (y * other).sum() == (x * unfold(REFERENCE, other.astype(np.int32), shape).astype(np.int64)).sum()


# -- The steerable pyramid in integers: its filters, its two operations, and pyramids made with them.
TOP = 2**20
BANKS = pytest.mark.parametrize("orientations", ORIENTATIONS)


def noise_steerable(shape, seed=0, top=TOP):
    return np.random.default_rng(seed).integers(-top, top, shape, np.int32, endpoint=True)


def any_taps(count, side, seed):
    """Filters of any taps at all, so that nothing may be turned or swapped unseen."""
    taps = np.random.default_rng(seed).normal(0, 1 / side, (count, side, side))
    return (np.rint(taps * UNIT) / UNIT).astype(np.float32)


def split(machine, picture, taps, torus, step=1):
    arrays = machine.put(np.ascontiguousarray(picture)), machine.put(taps)
    return np.asarray(machine.get(steerable_split(machine, *arrays, torus, step)))


def join(machine, terms, shape, torus):
    terms = [(machine.put(np.ascontiguousarray(bands)), machine.put(taps), step) for bands, taps, step in terms]
    return np.asarray(machine.get(steerable_join(machine, terms, shape, torus)))


def half(shape):
    return tuple(-(-n // 2) for n in shape)


def float32_error(terms):
    """How far a sum of products in float32 may be from the exact one."""
    total = sum(abs(taps).sum(dtype=float) * max(1, abs(values).max()) for values, taps, _ in terms)
    return HALF + (sum(taps.size for _, taps, _ in terms) + 1) * UNIT32 * total


@BANKS
def test_the_filters_are_those_of_pyrtools(orientations):
    theirs = parse_filter(f"sp{orientations - 1}_filters", normalize=False)
    ours = filters(orientations)
    side = ours.bands.shape[1]
    bands = theirs["bfilts"].T.reshape(orientations, side, side).swapaxes(1, 2)
    for found, known in [
        *((ours.high, theirs["hi0filt"]), (ours.low, theirs["lo0filt"])),
        *((ours.down, theirs["lofilt"] / 2), (ours.bands, bands)),
    ]:
        assert found.dtype == np.float32
        assert (found == np.rint(known * UNIT) / UNIT).all()
        assert found.shape == known.shape
        assert not found.flags.writeable
    with pytest.raises(ValueError, match="orientations is 3; give one of 1, 2, 4, 6"):
        filters(3)


@st.composite
def splits(draw, counts=(1, 2, 4, 6)):
    shape = draw(st.integers(1, 3)), draw(st.integers(1, 9)), draw(st.integers(1, 9))
    seed = draw(st.integers(0, 2**16))
    taps = any_taps(draw(st.sampled_from(counts)), draw(st.sampled_from([3, 5, 9])), seed)
    return noise_steerable(shape, seed), taps, draw(st.booleans()), draw(st.sampled_from([1, 2]))


@st.composite
def joins(draw):
    planes, shape = draw(st.integers(1, 3)), (draw(st.integers(1, 9)), draw(st.integers(1, 9)))
    seed, terms = draw(st.integers(0, 2**16)), []
    for n in range(draw(st.integers(1, 3))):
        count, side, step = (draw(st.sampled_from(some)) for some in ([1, 2, 4], [3, 5, 9], [1, 2]))
        size = half(shape) if step == 2 else shape
        terms.append((noise_steerable((count, planes, *size), seed + n), any_taps(count, side, seed + n), step))
    return terms, shape, draw(st.booleans())


@given(splits())
@settings(max_examples=60)
def test_the_reference_correlates_by_the_rule(case):
    picture, taps, torus, step = case
    found = split(REFERENCE, *case)
    assert found.dtype == np.int32
    assert found.shape == (len(taps), *picture[:, ::step, ::step].shape)
    for f, bands in zip(taps, found, strict=True):
        bound = float32_error([(picture, f, step)])
        for g, band in zip(picture, bands, strict=True):
            assert abs(band - plain.split(g, f, torus, step)).max() <= bound


@given(joins())
@settings(max_examples=60)
def test_the_reference_joins_by_the_rule(case):
    terms, shape, torus = case
    found = join(REFERENCE, *case)
    assert found.dtype == np.int32
    assert found.shape == (terms[0][0].shape[1], *shape)
    bound = float32_error(terms)
    for plane, picture in enumerate(found):
        single = [(b[plane], f, step) for bands, taps, step in terms for b, f in zip(bands, taps, strict=True)]
        assert abs(picture - plain.join(single, shape, torus)).max() <= bound


@pytest.mark.parametrize(("scratch", "bound"), [(2**12, 2**12), (1, 10 * 48 * 4)])
def test_scratch_memory_is_bounded(any_device, scratch, bound):
    """What is laid out at a time fits in it, or is the rows of one work-item; all launches use the same."""
    machine, sizes = opencl(any_device, scratch=scratch), []
    arrays, empty = [machine.put(array) for array in (noise_steerable((4, 37, 31)), filters(4).bands)], machine.empty
    machine.empty = lambda shape, dtype: (sizes.append((shape, dtype)), empty(shape, dtype))[1]
    try:
        steerable_split(machine, *arrays, True, 1)
    finally:
        machine.empty = empty
    padded = [4 * int(np.prod(shape)) for shape, dtype in sizes if dtype == np.float32]
    assert len(padded) == 1
    assert padded[0] <= bound


# -- Pyramids of pictures in their own unit, and the transform that methods use.
KINDS = pytest.mark.parametrize("kind", ["steerable", "laplacian"])
BORDERS_PYRAMIDS = pytest.mark.parametrize("boundary", ["open", "torus"])


def white(shape, seed=0):
    return np.random.default_rng(seed).normal(100, 5, shape)


def made(picture, **options):
    return decompose(picture, device=REFERENCE, **options)


def lost(picture, pyramid):
    """rms of what is lost, relative to the picture's standard deviation."""
    return np.sqrt(np.mean((pyramid.collapse(device=REFERENCE)[..., 0] - picture) ** 2)) / picture.std()


@given(
    st.tuples(st.integers(1, 13), st.integers(1, 13)),
    st.sampled_from(["open", "torus"]),
    st.sampled_from([np.uint8, np.float64, np.bool_, np.uint16]),
    st.integers(0, 20),
)
@settings(max_examples=60)
def test_a_laplacian_pyramid_is_exact_to_half_a_unit(shape, boundary, dtype, levels):
    """But on a torus with an odd side, where every level is rounded twice."""
    picture, levels = texture(shape, None, dtype), min(levels, most_levels(*shape))
    pyramid = made(picture, kind="laplacian", boundary=boundary, levels=levels)
    back = pyramid.collapse(device=REFERENCE)
    assert back.shape == (*shape, 1)
    odd = sum(any(n % 2 for n in band.shape[2:]) for band in pyramid.subbands[:-1])
    assert abs(back[..., 0] - picture.astype(float)).max() <= (HALF + (boundary == "torus") * odd) * pyramid.unit


@BANKS
def test_a_steerable_pyramid_loses_little_on_a_torus_of_any_size(orientations):
    """Whatever the mean: half as many rows of an odd number would leave a seam, which a mean makes worse."""
    for shape in ((65, 97), (33, 64)):
        picture = white(shape)
        pyramid = made(picture, orientations=orientations, levels=3, boundary="torus")
        assert lost(picture, pyramid) <= RECONSTRUCTION[orientations]


@KINDS
@BORDERS_PYRAMIDS
def test_tiny_pictures_have_a_pyramid_of_every_height(kind, boundary):
    for shape, most in (((1, 1), 0), ((1, 7), 0), ((5, 3), 1)):
        assert most_levels(*shape) == most
        for levels in range(most + 1):
            pyramid = made(texture(shape, None, np.float64), kind=kind, levels=levels, boundary=boundary)
            assert len(pyramid.subbands) == levels + (2 if kind == "steerable" else 1)
            assert np.isfinite(pyramid.collapse(device=REFERENCE)).all()
            assert pyramid.subbands[0].shape == (1, 1, *shape)


@KINDS
@BORDERS_PYRAMIDS
def test_a_device_has_the_references_bits_of_pyramids(machine, kind, boundary):
    for shape, orientations in (((37, 41), 1), ((18, 64), 4)):
        picture, how = white(shape), {"kind": kind, "levels": 2, "boundary": boundary, "orientations": orientations}
        ours, theirs = decompose(picture, device=machine, **how), made(picture, **how)
        assert_same_bits(ours.subbands, theirs.subbands)
        assert_same_bits(ours.collapse(device=machine), theirs.collapse(device=REFERENCE))


# -- Blocks of solid textures: the 3-D Laplacian pyramid and its inverse, slices the other ways, means of blocks.

MOST = 2**22
sides = st.integers(1, 5)
shapes = st.tuples(sides, sides, sides)


def block(shape, limit=MOST, seed=0):
    return np.random.default_rng(seed).integers(-limit, limit, shape, np.int32, endpoint=True)


def blurred(voxels):
    """The block under the Gaussian of 16 in each direction, around the torus."""
    for axis in range(3):
        voxels = sum(weight * np.roll(voxels, -offset, axis) for offset, weight in plain_solid.GAUSS.items())
    return voxels


def coarser(shape):
    """The places on the level below of the voxels of the next."""
    return np.ix_(*(2 * np.arange(n if n % 2 else n // 2) % n for n in shape))


def plain_reduced(fine):
    return plain_solid.rounded(blurred(fine.astype(np.int64))[coarser(fine.shape)], 16**3).astype(np.int32)


def plain_expanded(coarse, shape):
    """Voxels back at their places, and the Gaussian, twice as high in each direction where zeros are between."""
    spread = np.zeros(shape, np.int64)
    spread[coarser(shape)] = coarse
    return plain_solid.rounded(blurred(spread) << sum(n % 2 == 0 for n in shape), 16**3).astype(np.int32)


def steps(machine, g):
    """One reduction, the band it leaves, and what they collapse to."""
    fine = machine.put(g)
    coarse = solid_reduce(machine, fine)
    band = solid_band(machine, fine, coarse)
    return host(machine, [coarse, band, solid_collapse(machine, band, coarse)])


@given(shapes, st.sampled_from([1, 100, MOST]), st.integers(0, 2**16))
@settings(max_examples=40)
def test_the_reference_is_the_rule(shape, limit, seed):
    g = block(shape, limit, seed)
    coarse, band, back = steps(REFERENCE, g)
    assert coarse.shape == above(g.shape)
    assert_same_bits(coarse, plain_reduced(g))
    assert_same_bits(band, g - plain_expanded(coarse, g.shape))
    assert_same_bits(back, g)


@given(shapes, st.sampled_from([3, 2**24]), st.integers(0, 2**16))
@settings(max_examples=40)
def test_the_reference_collapses_any_two_blocks_by_the_rule(shape, limit, seed):
    """After matching, a band is no longer what its coarse level left."""
    band, coarse = block(shape, seed=seed), block(above(shape), limit, seed + 1)
    expected = band + plain_expanded(coarse, shape)
    assert_same_bits(solid_collapse(REFERENCE, band, coarse), expected)


def test_slices_lie_the_other_ways():
    g = block((3, 4, 5))
    x_z, y_z = solid_turn(REFERENCE, g, (1, 0, 2)), solid_turn(REFERENCE, g, (2, 0, 1))
    assert all((x_z[y] == g[:, y]).all() for y in range(4)) and all((y_z[x] == g[:, :, x]).all() for x in range(5))
    assert x_z.flags.c_contiguous and y_z.flags.c_contiguous


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_mean_is_the_rule(machine, count):
    for limit in (2, 2**31 - 1):
        parts = [block((3, 5, 7), limit, k) for k in range(count)]
        expected = plain_solid.rounded(np.sum(parts, 0, dtype=np.int64), count).astype(np.int32)
        for m in (REFERENCE, machine):
            assert_same_bits(np.asarray(m.get(solid_mean(m, [m.put(p) for p in parts]))), expected)


def test_the_shape_of_a_launch_and_launches_in_parts_change_no_bit(cl_device, monkeypatch):
    monkeypatch.setattr(solid, "MOST_ITEMS", 50)  # of 24 pixels: two slices of the coarser level a launch
    machine = opencl(cl_device, work_group=3)
    g = block((10, 8, 12))
    before = machine.launches
    assert_same_bits(steps(machine, g), steps(REFERENCE, g))
    assert machine.launches - before == 3 * 3
    turned = np.asarray(machine.get(solid_turn(machine, machine.put(g), (2, 0, 1))))
    assert_same_bits(turned, solid_turn(REFERENCE, g, (2, 0, 1)))


def test_nothing_overflows_at_the_limits(machine):
    """What is promised: 2**23 exclusive for what is reduced, 2**25 exclusive for what is expanded."""
    for shape, sign in (((3, 4, 5), 1), ((2, 4, 6), -1)):
        g, most = (np.full(of, sign * (2**bits - 1), np.int32) for of, bits in ((shape, 23), (above(shape), 25)))
        coarse, band, _ = steps(machine, g)
        assert (coarse == g.flat[0]).all() and not band.any()
        assert_same_bits(steps(REFERENCE, g)[0], coarse)
        arrays = [machine.put(a) for a in (np.zeros_like(g), most)]
        assert (np.asarray(machine.get(solid_collapse(machine, *arrays))) == most.flat[0]).all()
