"""Pyramids in integers: noise, folding, the steerable pyramid, the transform that methods use, and solids."""

from itertools import product

import numpy as np
import plain_multires as plain_solid
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from pyrtools.pyramids import SteerablePyramidSpace
from pyrtools.pyramids.filters import parse_filter
from subbands import decompose
from tolerances import HALF, PYRTOOLS, RECONSTRUCTION, UNIT32

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

# -- Pyramids in integers: noise, folding, the steerable pyramid, and the transform that methods use.

# -- White noise: uniform 32-bit words, a function of seed, level, plane and site alone.
seeds = st.integers(0, 2**64 - 1)
levels = st.integers(0, 30)


def run(machine, *args):
    return np.asarray(machine.get(noise(machine, *args)))


@given(st.integers(1, 9), st.sampled_from([1, 2, 13]), seeds, levels)
def test_the_reference_is_a_word_of_each_sites_draw(planes, n, seed, level):
    values = run(REFERENCE, planes, n, seed, level)
    assert (values.dtype, values.shape) == (np.int32, (planes, n))
    for p, s in np.ndindex(planes, n):
        word = int(random.draw4(seed, level, p // 4, s, 5, 0)[p % 4])
        assert values[p, s] == (word if word < 2**31 else word - 2**32)


# -- Every second pixel of a torus of any size, and back.
SHAPES = [(1, 1), (1, 2), (2, 1), (3, 3), (4, 6), (5, 4), (4, 5), (7, 9), (8, 1)]


def picture(shape, planes=2):
    return np.random.default_rng(3).integers(-(2**20), 2**20, (planes, *shape)).astype(np.int32)


def folded(machine, x):
    return np.asarray(machine.get(fold(machine, machine.put(x))))


def unfolded(machine, x, shape):
    return np.asarray(machine.get(unfold(machine, machine.put(x), shape)))


@pytest.mark.parametrize("shape", SHAPES)
def test_every_second_pixel_around_the_torus(shape):
    x = picture(shape)
    rows, cols = (n if n % 2 else n // 2 for n in shape)
    expected = [[[x[p, 2 * i % shape[0], 2 * j % shape[1]] for j in range(cols)] for i in range(rows)] for p in (0, 1)]
    assert_same_bits(folded(REFERENCE, x), np.array(expected, np.int32))


@pytest.mark.parametrize("shape", SHAPES)
def test_back_is_the_transpose(shape):
    """<fold x, y> = <x, unfold y>, and folding what was unfolded gives it back."""
    x = picture(shape)
    y = folded(REFERENCE, x)
    back = unfolded(REFERENCE, y, shape)
    assert_same_bits(folded(REFERENCE, back), y)
    other = picture(y.shape[1:])
    left = (y.astype(np.int64) * other).sum()
    assert left == (x.astype(np.int64) * unfolded(REFERENCE, other, shape)).sum()


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
    """How far a sum of products in float32 may be from the exact one, given each product's largest taps and values."""
    count = sum(taps.size for _, taps, _ in terms)
    total = sum(abs(taps).sum(dtype=float) * max(1, abs(values).max()) for values, taps, _ in terms)
    return HALF + (count + 1) * UNIT32 * total


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


@pytest.mark.parametrize("orientations", [0, 3, 5, 8, -1])
def test_other_orientations_are_refused(orientations):
    with pytest.raises(ValueError, match=rf"orientations is {orientations}; give one of 1, 2, 4, 6"):
        filters(orientations)


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


@pytest.mark.parametrize(("scratch", "bound"), [(2**12, 2**12), (2**17, 2**17), (1, 10 * 48 * 4)])
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
BANKS_PYRAMIDS = pytest.mark.parametrize("orientations", [1, 2, 4, 6])


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


@pytest.mark.parametrize("shape", [(64, 64), (65, 97), (70, 50), (33, 64)])
@BANKS_PYRAMIDS
def test_a_steerable_pyramid_loses_little_on_a_torus_of_any_size(orientations, shape):
    """Whatever the mean: half as many rows of an odd number would leave a seam, which a mean makes worse."""
    for levels in (1, 3):
        picture = white(shape, levels)
        pyramid = made(picture, orientations=orientations, levels=levels, boundary="torus")
        assert lost(picture, pyramid) <= RECONSTRUCTION[orientations]


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (5, 3), (2, 2)])
@KINDS
@BORDERS_PYRAMIDS
def test_tiny_pictures_have_a_pyramid_of_every_height(shape, kind, boundary):
    picture = texture(shape, None, np.float64)
    for levels in range(most_levels(*shape) + 1):
        pyramid = made(picture, kind=kind, levels=levels, boundary=boundary)
        assert len(pyramid.subbands) == levels + (2 if kind == "steerable" else 1)
        back = pyramid.collapse(device=REFERENCE)
        assert np.isfinite(back).all()
        assert pyramid.subbands[0].shape == (1, 1, *shape)


@pytest.mark.parametrize("boundary", ["open", "torus"])
@BANKS_PYRAMIDS
def test_a_steerable_pyramid_is_that_of_pyrtools_in_the_pictures_unit(orientations, boundary):
    picture = white((72, 96))
    pyramid = made(picture, orientations=orientations, levels=3, boundary=boundary)
    edges = {"open": "reflect1", "torus": "circular"}[boundary]
    theirs = SteerablePyramidSpace(picture, height=3, order=orientations - 1, edge_type=edges).pyr_coeffs
    # What is left of a constant: bands have none, and the residue has that of what was taken away.
    high, *bands, low = pyramid.subbands
    low = 8 * low[0, 0]
    known = theirs["residual_lowpass"]
    constant = (known - low).mean() / pyramid.offset
    assert constant == pytest.approx(8, rel=1e-3)
    close = [(high[0, 0], theirs["residual_highpass"]), (low + constant * pyramid.offset, known)]
    close += [
        (2.0**level * own[i, 0], theirs[level, i]) for level, own in enumerate(bands) for i in range(orientations)
    ]
    for found, band in close:
        assert found.shape == band.shape
        assert abs(found - band).max() <= PYRTOOLS * max(abs(band).max(), np.ptp(picture))


@pytest.mark.parametrize("shape", [(24, 20), (23, 17)])
def test_a_laplacian_pyramid_is_that_of_the_plain_sums(shape):
    picture = white(shape)
    pyramid = made(picture, kind="laplacian", levels=3)
    theirs = list(plain.Laplacian(picture - pyramid.offset, 3, 1, False).subbands.values())
    for found, band in zip(pyramid.subbands, theirs, strict=True):
        assert abs(found[0, 0] - band).max() <= 4 * pyramid.unit, "rounded once a level"


@KINDS
def test_a_constant_is_all_offset(kind):
    pyramid = made(np.full((9, 9), 7.5), kind=kind, levels=2)
    assert not any(band.any() for band in pyramid.subbands)
    assert pyramid.offset == 7.5
    assert (pyramid.collapse(device=REFERENCE) == 7.5).all()


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
LIMITS = [1, 100, MOST]
sides = st.integers(1, 5)
shapes = st.tuples(sides, sides, sides)


def block(shape, limit=MOST, seed=0):
    return np.random.default_rng(seed).integers(-limit, limit, shape, np.int32, endpoint=True)


@st.composite
def blocks(draw):
    return block(draw(shapes), draw(st.sampled_from(LIMITS)), draw(st.integers(0, 2**16)))


def plain_reduced(fine):
    """Every second voxel of the block under the Gaussian, one after the other."""
    coarse = np.zeros([n if n % 2 else n // 2 for n in fine.shape], np.int32)
    for at in np.ndindex(coarse.shape):
        total = 0
        for offset in product(plain_solid.GAUSS, repeat=3):
            where = ((2 * k + o) % n for k, o, n in zip(at, offset, fine.shape, strict=True))
            total += (
                plain_solid.GAUSS[offset[0]]
                * plain_solid.GAUSS[offset[1]]
                * plain_solid.GAUSS[offset[2]]
                * int(fine[tuple(where)])
            )
        coarse[at] = plain_solid.rounded(total, 16**3)
    return coarse


def plain_expanded(coarse, shape):
    """Zeros between the voxels, then the Gaussian, twice as high in each direction; no zeros where a side is folded."""
    if any(n % 2 for n in shape):
        return plain_unfolded(coarse, shape)
    fine = np.zeros(shape, np.int32)
    for at in np.ndindex(shape):
        total = 0
        for offset in product(plain_solid.GAUSS, repeat=3):
            place = [k + o for k, o in zip(at, offset, strict=True)]
            if all(p % 2 == 0 for p in place):
                where = (p // 2 % n for p, n in zip(place, coarse.shape, strict=True))
                total += (
                    plain_solid.GAUSS[offset[0]]
                    * plain_solid.GAUSS[offset[1]]
                    * plain_solid.GAUSS[offset[2]]
                    * int(coarse[tuple(where)])
                )
        fine[at] = plain_solid.rounded(total, 8**3)
    return fine


def plain_unfolded(coarse, shape):
    """On a torus with an odd side: voxels back at their places 2 k, then the Gaussian."""
    spread = np.zeros(shape, object)
    for at in np.ndindex(coarse.shape):
        spread[tuple(2 * k % n for k, n in zip(at, shape, strict=True))] = int(coarse[at])
    fine, half = np.zeros(shape, np.int32), sum(n % 2 == 0 for n in shape)
    for at in np.ndindex(shape):
        total = 0
        for offset in product(plain_solid.GAUSS, repeat=3):
            place = tuple((k + o) % n for k, o, n in zip(at, offset, shape, strict=True))
            total += (
                plain_solid.GAUSS[offset[0]]
                * plain_solid.GAUSS[offset[1]]
                * plain_solid.GAUSS[offset[2]]
                * spread[place]
            )
        fine[at] = plain_solid.rounded(total * 2**half, 16**3)
    return fine


def steps(machine, g):
    """One reduction, the band it leaves, and what they collapse to."""
    fine = machine.put(g)
    coarse = solid_reduce(machine, fine)
    band = solid_band(machine, fine, coarse)
    return host(machine, [coarse, band, solid_collapse(machine, band, coarse)])


@given(blocks())
@settings(max_examples=40)
def test_the_reference_is_the_rule(g):
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
    assert all((x_z[y] == g[:, y]).all() for y in range(4))
    assert all((y_z[x] == g[:, :, x]).all() for x in range(5))
    assert x_z.flags.c_contiguous and y_z.flags.c_contiguous


@given(st.integers(1, 4), st.sampled_from([2, MOST, 2**31 - 1]), st.integers(0, 2**16))
def test_the_mean_is_the_rule(count, limit, seed):
    parts = [block((2, 3, 4), limit, seed + k) for k in range(count)]
    expected = [
        plain_solid.rounded(sum(map(int, values)), count) for values in zip(*(p.flat for p in parts), strict=True)
    ]
    assert_same_bits(solid_mean(REFERENCE, parts), np.array(expected, np.int32).reshape(2, 3, 4))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_device_has_the_references_mean(machine, count):
    for limit in (2, 2**31 - 1):
        parts = [block((3, 5, 7), limit, k) for k in range(count)]
        mean = np.asarray(machine.get(solid_mean(machine, [machine.put(p) for p in parts])))
        assert_same_bits(mean, solid_mean(REFERENCE, parts))


def test_the_shape_of_a_launch_and_launches_in_parts_change_no_bit(cl_device, monkeypatch):
    monkeypatch.setattr(solid, "MOST_ITEMS", 50)  # of 24 pixels: two slices of the coarser level a launch
    machine = opencl(cl_device, work_group=3)
    g = block((10, 8, 12))
    before = machine.launches
    assert_same_bits(steps(machine, g), steps(REFERENCE, g))
    assert machine.launches - before == 3 * 3
    turned = np.asarray(machine.get(solid_turn(machine, machine.put(g), (2, 0, 1))))
    assert_same_bits(turned, solid_turn(REFERENCE, g, (2, 0, 1)))


@pytest.mark.parametrize("shape", [(3, 4, 5), (2, 4, 6)], ids=str)
@pytest.mark.parametrize("sign", [1, -1])
def test_nothing_overflows_at_the_limits(machine, sign, shape):
    """What is promised: 2**23 exclusive for what is reduced, 2**25 exclusive for what is expanded."""
    g = np.full(shape, sign * (2**23 - 1), np.int32)
    coarse, band, _ = steps(machine, g)
    assert (coarse == g.flat[0]).all()
    assert not band.any()
    most = np.full(above(shape), sign * (2**25 - 1), np.int32)
    arrays = [machine.put(a) for a in (np.zeros_like(g), most)]
    assert (np.asarray(machine.get(solid_collapse(machine, *arrays))) == most.flat[0]).all()
