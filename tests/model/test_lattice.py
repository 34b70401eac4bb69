"""Lattices, neighbourhoods and boundaries, equations (3), (10) and (11), against plain loops."""

from dataclasses import replace

import numpy as np
import plain
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.model.lattice import Grid, Sublattice, coloring_sublattice, neighbourhood_offsets


def test_offsets_are_those_of_equation_3_in_canonical_order():
    assert [len(neighbourhood_offsets(order)) for order in (1, 2, 3, 4, 5, 8, 18)] == [4, 8, 8, 12, 20, 24, 60]
    for order in (*range(1, 33), 225):
        offsets = neighbourhood_offsets(order)
        assert offsets.dtype == np.int32 and list(map(tuple, offsets.tolist())) == plain.offsets(order)
    for order in (0, -18):
        with pytest.raises(ValueError, match=f"order is {order}; give 1"):
            neighbourhood_offsets(order)
    for order in (1.0, "8", None, True):
        with pytest.raises(TypeError, match="order must be an integer"):
            neighbourhood_offsets(order)


sizes = st.integers(1, 11)
spacings = st.sampled_from([1, 2, 4, 8])


@given(sizes, sizes, spacings)
def test_the_sites_of_a_grid(height, width, spacing):
    grid = Grid.of((height, width), spacing)
    assert (grid.rows, grid.cols) == plain.grid_size((height, width), spacing)
    rows, cols = range(0, height, spacing), range(0, width, spacing)
    assert grid.places(np.arange(grid.size)).tolist() == [i * width + j for i in rows for j in cols]
    picture = np.arange(height * width).reshape(height, width)
    assert np.array_equal(grid.decimated(picture).ravel(), grid.places(np.arange(grid.size)))
    assert grid.decimated(np.stack([picture] * 3)).shape == (3, grid.rows, grid.cols)


@given(sizes, sizes, spacings, st.integers(1, 13), st.booleans())
def test_the_neighbours_of_every_site(height, width, spacing, order, torus):
    grid = Grid.of((height, width), spacing, torus)
    ours = grid.neighbours(np.arange(grid.size, dtype=np.int32), neighbourhood_offsets(order))
    assert ours.dtype == np.int32
    for site, column in enumerate(ours.T.tolist()):
        i, j = divmod(site, grid.cols)
        near = plain.neighbours(i, j, order, grid.rows, grid.cols, torus)
        assert column == [-1 if r is None else r[0] * grid.cols + r[1] for r in near]


def test_what_a_kernel_is_told():
    picture, volume = Grid.of((7, 9), 2, False), Grid.of((5, 7, 9), 2, False)
    assert picture.struct.tolist() == (1, 4, 5, 0, 0, 0, 0, 0, 0, 1, 4, 5, 2, 7, 9, 0, 0, 20, 0)
    assert volume.struct.tolist() == (3, 4, 5, 0, 0, 0, 0, 0, 0, 3, 4, 5, 2, 7, 9, 0, 0, 60, 0)
    window = replace(Grid.of((20, 30), 2), tile=(3, 4)).window(-2, 7, 10, 6)
    assert window.struct.tolist() == (1, 10, 6, 0, 1, 0, 0, 8, 7, 1, 10, 15, 2, 20, 30, 0, 0, 60, 0)
    part = replace(Grid.of((7, 9), 2, False), key=(50, 100, 4))
    assert part.struct.tolist() == (1, 4, 5, 0, 0, 0, 0, 0, 0, 1, 4, 5, 8, 7, 100, 0, 0, 20, 50)
    assert part.places(np.array([0, 1, 5])).tolist() == [50, 58, 850], "its pixels are 4 of the output's along a side"


def vectors(pattern, reach=8):
    """Of the sublattice, around the origin, by brute force."""
    steps = range(-2 * reach, 2 * reach + 1)
    found = ((n * pattern.a + m * pattern.b, m * pattern.c) for n in steps for m in steps)
    return {v for v in found if max(map(abs, v)) <= reach and v != (0, 0)}


@given(st.integers(1, 6), st.integers(0, 5), st.integers(1, 6), st.integers(1, 8), st.integers(1, 8))
def test_the_shortest_vector_of_a_sublattice_and_the_tori_that_it_fits(a, b, c, rows, cols):
    pattern = Sublattice(a, b % a, c)
    here = vectors(pattern)
    assert pattern.index == a * c and pattern.shortest() == min(i * i + j * j for i, j in here)
    assert pattern.fits(rows, cols) == ((rows, 0) in here and (0, cols) in here)


def test_the_sublattice_of_an_order_is_long_and_none_with_fewer_cosets_is():
    assert [coloring_sublattice(order).index for order in (1, 2, 8, 18)] == [2, 4, 9, 20]
    for order in range(1, 19):
        best = coloring_sublattice(order)
        assert min(i * i + j * j for i, j in vectors(best)) > order
        for index in range(1, best.index):
            for c in (c for c in range(1, index + 1) if index % c == 0):
                a = index // c
                for b in range(a):
                    short = ((i, j) for i, j in plain.offsets(order) if j % c == 0 and (i - j // c * b) % a == 0)
                    assert next(short, None) is not None


@given(st.integers(1, 20), st.integers(1, 40), st.integers(1, 40))
def test_a_sublattice_for_a_torus_fits_it(order, rows, cols):
    found = coloring_sublattice(order, rows, cols, limit=30)
    if found is not None:
        assert found.fits(rows, cols) and found.shortest() > order and found.index <= 30
