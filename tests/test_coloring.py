"""The colouring against equation (14), by brute force, for every order up to 32; and its number of colours.

The bound where a torus does not hold the best pattern: a site at the seam takes the lowest colour that none of its
neighbours has, so there are at most max(colours of the best pattern, neighbours + 1).
"""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given
from hypothesis import strategies as st

from simdtex.model.lattice import Grid, coloring_sublattice, neighbourhood_offsets
from simdtex.ops.coloring import UNCOLORED, coloring, greedy_coloring, lattice_coloring

TINY = [(1, 1), (1, 2), (1, 5), (5, 1), (2, 2), (2, 3), (3, 3), (4, 2)]
SMALL = [(6, 6), (7, 7), (8, 13), (13, 8), (12, 10), (9, 15)]
LARGER = [(17, 19), (24, 24), (31, 11)]
ORDERS = range(1, 33)


def colour(order, rows, cols, torus, machine=REFERENCE, seed=0):
    colors = coloring(machine, Grid(rows, cols, 1, torus), neighbourhood_offsets(order), order, seed)
    assert colors.shape == (rows, cols)
    assert colors.dtype == np.int32
    return colors


def conflicts(colors, order, torus):
    """Whether equation (14) is broken anywhere, for each offset by slices or rolls."""
    for di, dj in plain.offsets(order):
        if torus:
            other = np.roll(colors, (-di, -dj), (0, 1))
            itself = di % colors.shape[0] == 0 and dj % colors.shape[1] == 0
            if not itself and (colors == other).any():
                return True
            continue
        rows, cols = colors.shape
        here = colors[max(0, -di) : rows - max(0, di), max(0, -dj) : cols - max(0, dj)]
        there = colors[max(0, di) : rows + min(0, di), max(0, dj) : cols + min(0, dj)]
        if abs(di) < rows and abs(dj) < cols and (here == there).any():
            return True
    return False


def check(colors, order, torus):
    assert not conflicts(colors, order, torus)
    used = np.unique(colors)
    assert np.array_equal(used, np.arange(used.size)), "every colour from 0 up is used"
    best, neighbours = coloring_sublattice(order).index, len(plain.offsets(order))
    assert used.size <= (max(best, neighbours + 1) if torus else best)
    assert used.size <= colors.size


def test_the_check_finds_what_the_plain_loops_find():
    rng = np.random.default_rng(0)
    outcomes = set()
    for order in (1, 2, 5):
        for torus in (True, False):
            for rows, cols in [*TINY, (5, 4)]:
                for colors in (rng.integers(0, 12, (rows, cols)), rng.integers(0, 40, (rows, cols))):
                    found = conflicts(colors, order, torus)
                    assert found == bool(plain.clashes(colors, order, torus))
                    outcomes.add(found)
    assert outcomes == {True, False}


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("order", ORDERS)
def test_no_neighbours_share_a_colour(order, torus):
    for rows, cols in TINY + SMALL + LARGER:
        check(colour(order, rows, cols, torus), order, torus)


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("order", [1, 2, 5, 8, 13, 18, 32])
def test_no_neighbours_share_a_colour_on_prime_and_long_lattices(order, torus):
    for rows, cols in [(29, 37), (41, 3), (2, 53), (1, 64)]:
        check(colour(order, rows, cols, torus), order, torus)


@given(st.integers(1, 32), st.integers(1, 20), st.integers(1, 20), st.booleans(), st.integers(0, 2**64 - 1))
def test_any_lattice(order, rows, cols, torus, seed):
    check(colour(order, rows, cols, torus, seed=seed), order, torus)


@pytest.mark.parametrize("order", ORDERS)
def test_an_open_lattice_has_the_best_patterns_number_of_colours(order):
    best = coloring_sublattice(order)
    for rows, cols in [(best.a, best.c), (best.a + 3, best.c + 5), (40, 40)]:
        assert colour(order, rows, cols, False).max() + 1 == best.index


@pytest.mark.parametrize("order", ORDERS)
def test_a_torus_that_fits_has_the_best_patterns_number_of_colours(order):
    best = coloring_sublattice(order)
    side = next(n for n in range(best.c, best.index**2 + 1, best.c) if best.fits(best.a, n))
    for times in (1, 2):
        rows, cols = best.a * times, side
        if min(rows, cols) ** 2 > order:  # else a site meets itself around the torus
            colors = colour(order, rows, cols, True)
            check(colors, order, True)
            assert colors.max() + 1 == best.index


@pytest.mark.parametrize(
    ("order", "sides"), [(1, (8, 64, 256)), (2, (8, 64, 256)), (8, (9, 48, 255)), (18, (20, 80, 240))]
)
def test_usual_sizes_need_no_more_than_the_best_pattern(order, sides):
    for side in sides:
        assert colour(order, side, side, True).max() + 1 == coloring_sublattice(order).index


@pytest.mark.parametrize("order", [1, 2, 5, 8])
def test_a_seam_costs_few_colours(order):
    """Far below the bound, at odd sizes."""
    best = coloring_sublattice(order).index
    for rows, cols in [(33, 35), (37, 41)]:
        assert colour(order, rows, cols, True).max() + 1 <= 2 * best + 1


def test_the_seed_moves_only_the_seam():
    first, second = (colour(2, 7, 9, True, seed=seed) for seed in (1, 2))
    check(first, 2, True)
    check(second, 2, True)
    assert np.array_equal(colour(2, 8, 8, True, seed=1), colour(2, 8, 8, True, seed=2))
    assert np.array_equal(first, colour(2, 7, 9, True, seed=1))


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("order", [1, 2, 4, 5, 8, 13, 18, 25, 32])
def test_a_device_has_the_references_bits(machine, order, torus):
    for rows, cols in [*TINY, *SMALL, (29, 37)]:
        theirs = colour(order, rows, cols, torus, seed=order)
        assert_same_bits(colour(order, rows, cols, torus, machine, order), theirs)


@pytest.mark.parametrize("spacing", [1, 2, 4])
def test_a_coarser_level_is_coloured_as_a_lattice_of_its_own(machine, spacing):
    offsets = neighbourhood_offsets(5)
    grid = Grid(23, 30, spacing)
    ours = coloring(machine, grid, offsets, 5, 3)
    assert_same_bits(ours, colour(5, grid.rows, grid.cols, True, seed=3))


def test_each_kernel_has_its_twins_bits(machine):
    """One round of each, so that no later round can hide a difference."""
    offsets, seed = neighbourhood_offsets(8), 2**40 + 5
    for rows, cols in [(7, 9), (10, 11), (1, 5), (16, 14)]:
        for torus in (True, False):
            grid, pattern = Grid(rows, cols, 1, torus), coloring_sublattice(8)
            on_device = machine.put(offsets)
            colors = lattice_coloring(REFERENCE, grid, offsets, pattern)
            assert_same_bits(machine.get(lattice_coloring(machine, grid, on_device, pattern)), colors)
            bare = np.full((rows, cols), UNCOLORED, np.int32)
            for start in (colors, bare):
                left = np.flatnonzero(start == UNCOLORED).astype(np.int32)
                once = greedy_coloring(REFERENCE, grid, offsets, left, start, seed)
                assert (once == UNCOLORED).sum() < max(1, (start == UNCOLORED).sum())
                again = greedy_coloring(machine, grid, on_device, machine.put(left), machine.put(start), seed)
                assert_same_bits(machine.get(again), once)


def test_more_than_32_colours_are_told_apart(machine):
    """All sites of a small torus are neighbours, so every one needs its own."""
    offsets = neighbourhood_offsets(32)
    colors = np.full((7, 7), UNCOLORED, np.int32)
    theirs = colors
    ours, every = machine.put(colors), np.arange(49, dtype=np.int32)
    for _ in range(49):
        theirs = greedy_coloring(REFERENCE, Grid(7, 7), offsets, every, theirs, 1)
        ours = greedy_coloring(machine, Grid(7, 7), machine.put(offsets), machine.put(every), ours, 1)
    assert sorted(theirs.ravel().tolist()) == list(range(49))
    assert_same_bits(machine.get(ours), theirs)
