"""Blocks of solid textures: the 3-D Laplacian pyramid and its inverse, slices the other ways, means of blocks."""

from itertools import permutations, product

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simdtex.ops import solid
from simdtex.ops.solid import above, solid_band, solid_collapse, solid_mean, solid_reduce, solid_turn

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
        for offset in product(plain.GAUSS, repeat=3):
            where = ((2 * k + o) % n for k, o, n in zip(at, offset, fine.shape, strict=True))
            total += plain.GAUSS[offset[0]] * plain.GAUSS[offset[1]] * plain.GAUSS[offset[2]] * int(fine[tuple(where)])
        coarse[at] = plain.rounded(total, 16**3)
    return coarse


def plain_expanded(coarse, shape):
    """Zeros between the voxels, then the Gaussian, twice as high in each direction; no zeros where a side is folded."""
    if any(n % 2 for n in shape):
        return plain_unfolded(coarse, shape)
    fine = np.zeros(shape, np.int32)
    for at in np.ndindex(shape):
        total = 0
        for offset in product(plain.GAUSS, repeat=3):
            place = [k + o for k, o in zip(at, offset, strict=True)]
            if all(p % 2 == 0 for p in place):
                where = (p // 2 % n for p, n in zip(place, coarse.shape, strict=True))
                total += (
                    plain.GAUSS[offset[0]] * plain.GAUSS[offset[1]] * plain.GAUSS[offset[2]] * int(coarse[tuple(where)])
                )
        fine[at] = plain.rounded(total, 8**3)
    return fine


def plain_unfolded(coarse, shape):
    """On a torus with an odd side: voxels back at their places 2 k, then the Gaussian."""
    spread = np.zeros(shape, object)
    for at in np.ndindex(coarse.shape):
        spread[tuple(2 * k % n for k, n in zip(at, shape, strict=True))] = int(coarse[at])
    fine, half = np.zeros(shape, np.int32), sum(n % 2 == 0 for n in shape)
    for at in np.ndindex(shape):
        total = 0
        for offset in product(plain.GAUSS, repeat=3):
            place = tuple((k + o) % n for k, o, n in zip(at, offset, shape, strict=True))
            total += plain.GAUSS[offset[0]] * plain.GAUSS[offset[1]] * plain.GAUSS[offset[2]] * spread[place]
        fine[at] = plain.rounded(total * 2**half, 16**3)
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
    expected = [plain.rounded(sum(map(int, values)), count) for values in zip(*(p.flat for p in parts), strict=True)]
    assert_same_bits(solid_mean(REFERENCE, parts), np.array(expected, np.int32).reshape(2, 3, 4))


def test_halves_are_rounded_up_below_zero_too():
    pairs = [np.array(p, np.int32) for p in ([-3, -1, 1, 3], [0, 0, 0, 0])]
    assert solid_mean(REFERENCE, pairs).tolist() == [-1, 0, 1, 2]


@given(g=blocks())
@settings(max_examples=25)
@example(g=block((1, 1, 1)))
@example(g=block((2, 33, 1)))
@example(g=block((16, 16, 16)))
@example(g=block((8, 12, 20)))
def test_a_device_has_the_references_bits(machine, g):
    ours = steps(machine, g)
    assert_same_bits(ours, steps(REFERENCE, g))
    assert_same_bits(ours[2], g)


@pytest.mark.parametrize("axes", list(permutations(range(3))))
def test_a_device_turns_a_block(machine, axes):
    for shape in [(3, 4, 5), (16, 7, 1)]:
        g = block(shape)
        turned = np.asarray(machine.get(solid_turn(machine, machine.put(g), axes)))
        assert_same_bits(turned, solid_turn(REFERENCE, g, axes))


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
