"""The picture that tiles see of one another: the stack, the lattice that points into it, and who reads it."""

from dataclasses import replace

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, problem
from test_relax import apart

from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.ops.neighbourhood import Field, near
from simdtex.ops.snapshot import TYPES, snapshot
from simdtex.ops.temperature import temperature

SHAPES = [(1, 1), (1, 7), (5, 4), (1, 1, 1), (2, 1, 5), (1, 6, 5), (3, 5, 7)]
BOUNDARIES = pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])


def picture(shape, dtype, seed=0):
    bounds = np.iinfo(dtype)
    return np.random.default_rng(seed).integers(bounds.min, bounds.max, shape, dtype, endpoint=True)


def stack(now, old):
    return np.concatenate([now, old], -2)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_both_halves_are_the_picture(machine, shape, dtype):
    now = picture(shape, dtype)
    for m in (REFERENCE, machine):
        stacked = m.get(snapshot(m, m.put(now), shape[-2]))
        assert stacked.dtype == now.dtype
        assert stacked.shape == (*shape[:-2], 2 * shape[-2], shape[-1])
        assert_same_bits(np.ascontiguousarray(stacked[..., : shape[-2], :]), now)
        assert_same_bits(np.ascontiguousarray(stacked[..., shape[-2] :, :]), now)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_a_stack_keeps_its_upper_half_and_forgets_the_lower(machine, shape, dtype):
    now, old = picture(shape, dtype, 1), picture(shape, dtype, 2)
    given = stack(now, old)
    for m in (REFERENCE, machine):
        assert_same_bits(np.asarray(m.get(snapshot(m, m.put(given), shape[-2]))), stack(now, now))


def test_a_device_makes_no_second_stack(machine):
    given = machine.put(stack(picture((2, 3, 4), "uint16", 1), picture((2, 3, 4), "uint16", 2)))
    assert snapshot(machine, given, 3) is given
    once = machine.put(picture((2, 3, 4), "uint16"))
    assert snapshot(machine, once, 3) is not once


def test_the_twin_changes_nothing_of_what_it_is_given():
    now = picture((2, 3, 4), "uint16")
    before = now.copy()
    stacked = snapshot(REFERENCE, now, 3)
    stacked += 1
    assert_same_bits(now, before)


@pytest.mark.parametrize("shape", [(1, 9, 3), (9, 1, 3), (5, 7, 3)], ids=str)
def test_a_stack_of_channels_last_is_written_in_place(shape):
    """As `commit` does, through a view with the rows side by side."""
    stacked = snapshot(REFERENCE, np.moveaxis(picture(shape, "uint16"), -1, 0), shape[0])
    assert stacked.flags.c_contiguous
    assert np.shares_memory(stacked.reshape(3, -1), stacked)


def tiles_of(grid, i, j):
    return i // grid.tile[0], j // grid.tile[1]


@BOUNDARIES
@pytest.mark.parametrize("order", [1, 2, 8])
@pytest.mark.parametrize(
    ("height", "width", "spacing", "tile"),
    [(6, 9, 1, (3, 3)), (7, 5, 1, (2, 4)), (4, 6, 1, (1, 1)), (9, 11, 2, (2, 3)), (5, 6, 1, (5, 2)), (1, 8, 1, (3, 3))],
    ids=str,
)
def test_exactly_the_neighbours_in_another_tile_are_read_elsewhere(height, width, spacing, tile, order, torus):
    grid = Grid(height, width, spacing, torus, tile)
    sites, offsets = grid.sites(), neighbourhood_offsets(order)
    found = grid.neighbours(sites, offsets)
    bare = replace(grid, tile=None).neighbours(sites, offsets)
    assert found.dtype == np.int32
    other = 0
    for s, site in enumerate(sites.tolist()):
        i, j = site // width // spacing, site % width // spacing
        for k, r in enumerate(plain.neighbours(i, j, order, grid.rows, grid.cols, torus)):
            expected = -1
            if r is not None:
                apart = tiles_of(grid, *r) != tiles_of(grid, i, j)
                expected = (r[0] * width + r[1]) * spacing + (height * width if apart else 0)
                other += apart
            assert found[k, s] == expected
    assert other, "some neighbour is in another tile"
    assert np.array_equal(np.where(found >= grid.plane, found - grid.plane, found), bare)


def tiled(seed, tile, **options):
    """A problem whose field stands on an older one; and that older field."""
    p, older = problem(seed, **options), problem(seed + 1000, **options).field
    field = Field(*(stack(now, old) for now, old in zip(p.field, older, strict=True)))
    return p._replace(field=field, grid=replace(p.grid, tile=tile)), p.field, older


TILED = [
    {"tile": (2, 3)},
    {"tile": (4, 4), "torus": False, "order": 5},
    {"tile": (1, 1), "channels": 3, "order": 1},
    {"tile": (2, 2), "spacing": 2, "shape": (13, 11), "channels": 2, "edges": "reflect"},
    {"tile": (50, 50), "channels": 3},
]


@pytest.mark.parametrize("options", TILED, ids=str)
def test_a_neighbourhood_reads_the_older_picture_across_an_edge(options):
    p, now, old = tiled(1, **options)
    _, values, confidence, *_ = near(p.sites, p.field, p.offsets, p.grid, p.confidences)
    spacing, grid = p.grid.spacing, p.grid
    for s, (row, col) in enumerate(p.where()):
        i, j = row // spacing, col // spacing
        for k, r in enumerate(plain.neighbours(i, j, p.order, grid.rows, grid.cols, grid.torus)):
            if r is None:
                assert not confidence[k, 0, s]
                continue
            seen = now if tiles_of(grid, i, j) == tiles_of(grid, *r) else old
            here = r[0] * spacing, r[1] * spacing
            u = 1 - seen.temperature[here] / 1024
            assert confidence[k, 0, s] == u
            assert np.array_equal(values[k, :, s], seen.values[(slice(None), *here)])


@pytest.mark.parametrize("exact", [False, True], ids=["list", "exact"])
@pytest.mark.parametrize("options", TILED, ids=str)
def test_every_reader_has_its_twins_bits_on_a_device(machine, options, exact):
    p, now, _ = tiled(2, **options)
    how = {"exact": exact, "coherence": 1.0}
    assert_same_bits(apart(machine, p, **how), apart(REFERENCE, p, **how))
    sites, field, offsets = p.on(machine)
    cooled = machine.get(temperature(machine, sites, field, offsets, p.grid, -1024))
    assert_same_bits(cooled, apart(REFERENCE, p, **how)[2])
    alone = p._replace(field=now, grid=replace(p.grid, tile=None))
    differs = (alone.cost() != p.cost()).any()
    assert differs == (options["tile"] != (50, 50)), "the older picture matters, unless there is one tile"
