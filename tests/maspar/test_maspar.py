"""The processor array: its instructions against plain loops, on every machine, and the first programs for it."""

import operator

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, colors_of
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex import random
from simdtex.jobs.studies.ising import Experiment
from simdtex.jobs.studies.ising import ising as experiment
from simdtex.maspar.algorithm import ising
from simdtex.maspar.array import DIRECTIONS, MAPPINGS, ProcessorArray, path
from simdtex.maspar.machine import CLOCK, COSTS, FULL, MP1
from simdtex.maspar.sites import Walk, coloring
from simdtex.methods.mrf.lcpdf import Key
from simdtex.model.lattice import Grid, neighbourhood_offsets

TYPES = ("int32", "uint64", "float32")
BINARY = ("add", "sub", "mul", "lt", "le", "gt", "ge", "eq", "ne")
WHOLE = ("floordiv", "mod", "and_", "or_")
SHAPES = st.tuples(st.integers(1, 9), st.integers(1, 9))


@pytest.fixture(params=["reference", "device"])
def device(request, machine):
    return REFERENCE if request.param == "reference" else machine


def filled(mp1, picture, dtype="int32"):
    """A plural with the values of a picture (rows, cols) or (words, rows, cols); other PEs have 0."""
    words = np.atleast_3d(np.moveaxis(picture, 0, -1)) if picture.ndim > 2 else picture[..., None]
    variable = mp1.plural(dtype, words.shape[-1])
    whole = np.zeros((*mp1.layout.padded.shape, words.shape[-1]), dtype)
    whole[: picture.shape[-2], : picture.shape[-1]] = words
    row, col = np.moveaxis(mp1.layout.pixel, -1, 0)
    variable.data = mp1.machine.put(whole[row, col])
    return variable


def seen(variable, shape=None):
    """The picture of a variable's word."""
    mp1 = variable.mp1
    rows, cols = shape or mp1.shape
    held = mp1.machine.get(variable.data)[..., variable.word].ravel()
    return held[mp1.layout.address[:rows, :cols]]


@pytest.mark.parametrize("dtype", TYPES)
def test_arithmetic_is_pythons(device, dtype):
    """Every operation of every type, on plurals and with a singular number, rounded down also below 0."""
    mp1, rng = MP1(device, ProcessorArray(3, 4), (5, 7)), np.random.default_rng(1)
    least = 0 if dtype == "uint64" else -9
    a, b = rng.integers(least, 9, (5, 7)).astype(dtype), rng.integers(1, 9, (5, 7)).astype(dtype)
    x, y = filled(mp1, a, dtype), filled(mp1, b, dtype)
    for name in BINARY + WHOLE * (dtype != "float32"):
        plain, method = getattr(operator, name), getattr(x, f"__{name.strip('_')}__")
        if name != "sub" or dtype != "uint64":
            assert_same_bits(seen(method(y)), plain(a, b).astype(seen(method(y)).dtype))
            assert (seen(method(3)) == plain(a, np.asarray(3, dtype))).all(), name
    if dtype == "uint64":
        wide = np.full((5, 7), 2**63 + 5, np.uint64)
        z = filled(mp1, wide, dtype)
        assert (seen(x.bit()) == 2**a).all() and not seen(z.bit()).any()
        lowest = [[next(k for k in range(9) if not (2 * int(v) + 1) >> k & 1) for v in r] for r in a]
        assert (seen((x * 2 + 1).lowest()) == lowest).all()
        assert (seen(filled(mp1, ~np.zeros((5, 7), np.uint64), dtype).lowest()) == 64).all()
        assert (seen(z.share(10)) == 5).all() and (seen(z >> 60) == 8).all()
        assert (seen(z.as_type("int32")) == 5).all()


def test_masks_nest_and_inactive_elements_change_nothing(device):
    mp1 = MP1(device, ProcessorArray(2, 3), (4, 5))
    x, place = mp1.plural(), mp1.row * 5 + mp1.col
    x.set(7)
    with mp1.where(place >= 4) as outer, mp1.where(place % 2 == 0) as inner:
        x.set(place)
        with mp1.where(outer):  # all of it again
            assert mp1.sum(x * 0 + 1) == 16
    number = np.arange(20).reshape(4, 5)
    assert (seen(x) == np.where((number >= 4) & (number % 2 == 0), number, 7)).all()
    assert sum(outer.counts) == 16 and sum(inner.counts) == 8
    padded = seen(x, mp1.layout.padded.shape)
    assert not padded[:, 5:].any()  # a PE without a pixel is never active


@given(SHAPES, SHAPES, st.sampled_from(MAPPINGS), st.integers(1, 4))
@settings(max_examples=40)
def test_the_x_net_moves_by_pixels_around_the_edges(pes, shape, mapping, distance):
    mp1 = MP1(REFERENCE, ProcessorArray(*pes, mapping), shape)
    values = np.arange(mp1.layout.padded.size).reshape(mp1.layout.padded.shape)
    x = filled(mp1, values)
    for down, right in DIRECTIONS:
        got = seen(mp1.xnet(x, down, right, distance))
        wanted = np.roll(values, (-down * distance, -right * distance), (0, 1))
        assert (got == wanted[: shape[0], : shape[1]]).all()


@pytest.mark.parametrize("mapping", MAPPINGS)
def test_communication_is_alike_on_every_machine(machine, mapping):
    """X-Net, router and reductions of words of both sizes, under a mask."""
    rng, found = np.random.default_rng(2), []
    picture, row, col = rng.integers(0, 99, (2, 7, 9)), rng.integers(0, 7, (7, 9)), rng.integers(0, 9, (7, 9))
    for each in (REFERENCE, machine):
        mp1 = MP1(each, ProcessorArray(3, 4, mapping), (7, 9))
        for dtype in ("int32", "uint64"):
            x, i, j = filled(mp1, picture, dtype), filled(mp1, row), filled(mp1, col)
            with mp1.where(mp1.row % 2 == 0):
                routed, moved = mp1.plural(dtype, 2), mp1.plural(dtype, 2)
                mp1.router(routed, x, i, j)
                shifted = mp1.xnet(x, -1, 1, 2)
                moved[1].set(shifted[1])
                word = x[1].as_type("int32")
                found.append([seen(routed[1]), seen(moved[1]), mp1.sum(word), mp1.min(word), mp1.any(word < 0)])
            assert (found[-1][0] == np.where(np.arange(7)[:, None] % 2, 0, picture[1][row, col])).all()
            assert found[-1][2:] == [picture[1][::2].sum(), picture[1][::2].min(), False]
    for one, other in zip(found[:2], found[2:], strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_random_bits_and_tables(device):
    mp1, place = MP1(device, ProcessorArray(4, 4), (4, 6)), np.arange(24).reshape(4, 6)
    bits = seen(mp1.random(filled(mp1, place), Key(2**40 + 3, 1, 2), random.DRAW))
    lo, hi, *_ = random.draw4(2**40 + 3, 1, 2, place, random.DRAW)
    assert (bits == lo + hi.astype(np.uint64) * 2**32).all()
    x = mp1.plural(size=2)
    mp1.table(x[1], [5, 6, 7], filled(mp1, place % 3))
    assert (seen(x[1]) == 5 + place % 3).all() and not seen(x).any()


def test_memory_is_limited_and_freed():
    mp1 = MP1(REFERENCE, ProcessorArray(2, 2), (4, 4), 100)  # row and col of 4 layers take 32 bytes
    with mp1.frame():
        mp1.plural("uint64", 2)
        with pytest.raises(ValueError, match="112 bytes of each PE, which holds 4 pixels, and a PE has 100; give a"):
            mp1.plural()
    mp1.plural("float32", 4)


def test_instructions_are_counted_with_their_costs():
    """Two layers of 4 PEs; a mask with 3 PEs active; a word that moves 3 PEs."""
    mp1 = MP1(REFERENCE, ProcessorArray(2, 2), (2, 4))
    with mp1.section("walk"), mp1.where(mp1.col < 1), mp1.section("inside"):
        mp1.xnet(mp1.row, 0, 1, 3)
    assert vars(mp1.counts["inside", "x-net"]) == {"instructions": 6, "active": 3 * 2}
    assert mp1.seconds()["inside"] == {"x-net": 6 * 4 * FULL / 23e9}
    assert [round(COSTS[kind].seconds / CLOCK) for kind in ("integer", "float", "x-net", "router")] == [8, 171, 36, 640]
    assert {cost.source for cost in COSTS.values() if "Blank 1990" not in cost.source} == {"assumption"}


@pytest.mark.parametrize(("order", "moves"), [(1, 4), (8, 24), (18, 60)])
def test_one_path_of_unit_moves_leads_through_all_offsets(order, moves):
    offsets, at, met = neighbourhood_offsets(order), np.zeros(2, int), []
    steps = path(offsets)
    for down, right, number in steps:
        at += (down, right)
        assert max(abs(down), abs(right)) == 1
        if number is not None:
            assert (offsets[number] == at).all()
            met.append(number)
    assert sorted(met) == list(range(len(offsets)))
    assert len(steps) == moves


lattices = given(
    SHAPES,
    st.tuples(st.integers(1, 17), st.integers(1, 17)),
    st.sampled_from(MAPPINGS),
    st.booleans(),
    st.sampled_from([1, 2, 4, 8]),
    st.sampled_from([1, 2, 4]),
)
"""Arrays, shapes of pictures, mappings, boundaries, orders and spacings."""


@lattices
@settings(max_examples=20)
def test_a_walk_brings_each_site_its_neighbours(pes, shape, mapping, torus, order, spacing):
    mp1, grid = MP1(REFERENCE, ProcessorArray(*pes, mapping), shape), Grid.of(shape, spacing, torus)
    offsets, radius, number = neighbourhood_offsets(order), 4, 1 + np.arange(shape[0] * shape[1]).reshape(shape)
    walk, x, found = Walk(mp1, grid, offsets), filled(mp1, number), np.zeros((len(offsets), grid.rows, grid.cols), int)
    for k, there in walk.neighbours(x):
        kept = mp1.plural()
        kept.set(there)
        found[k] = grid.decimated(seen(kept))
    around = np.pad(grid.decimated(number), radius, mode="wrap" if torus else "constant")
    for (down, right), got in zip(offsets.tolist(), found, strict=True):
        itself = torus and not (down % grid.rows or right % grid.cols)
        wanted = around[radius + down :, radius + right :][: grid.rows, : grid.cols]
        assert (got == wanted * (not itself)).all()
    assert (grid.decimated(seen(walk.members)) == np.maximum((found > 0).sum(0), 1)).all()


@lattices
@settings(max_examples=8)
def test_elements_colour_their_sites_as_the_engine_does(pes, shape, mapping, torus, order, spacing):
    mp1, grid = MP1(REFERENCE, ProcessorArray(*pes, mapping), shape), Grid.of(shape, spacing, torus)
    color, count = coloring(mp1, Walk(mp1, grid, neighbourhood_offsets(order)), order, 5)
    wanted = colors_of(grid, order, 5)
    assert (grid.decimated(seen(color)) == wanted).all()
    assert count == wanted.max() + 1


@pytest.mark.slow
def test_colours_beyond_a_word_and_on_a_device(machine):
    for each, shape, order in ((machine, (13, 11), 8), (REFERENCE, (11, 11), 40)):
        mp1, grid = MP1(each, ProcessorArray(8, 8), shape), Grid(shape)
        color, count = coloring(mp1, Walk(mp1, grid, neighbourhood_offsets(order)), order, 7)
        assert (seen(color) == colors_of(grid, order, 7)).all()
    assert count > 64


@pytest.mark.parametrize(("synchronous", "mapping"), [(False, MAPPINGS[0]), (True, MAPPINGS[1])])
def test_ising_has_the_spins_of_the_experiment(device, mapping, synchronous):
    spins = ising(MP1(device, ProcessorArray(4, 8, mapping), (8, 16)), 2.5, 6, 3, synchronous)
    schedule = "synchronous" if synchronous else "checkerboard"
    chains = experiment(REFERENCE, Experiment((8, 16), [2.5], 1, 6, 0), schedule, seed=3)
    assert_same_bits(seen(spins).astype(np.uint8), chains.spins[0, 0])
