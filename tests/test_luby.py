"""Luby's random maximal independent sets against a greedy choice in order of the same priorities, by plain loops."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex import random
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.ops.sites import IN, UNDECIDED, luby

TINY = [(1, 1), (1, 2), (1, 5), (5, 1), (2, 2), (2, 3), (3, 3)]
SMALL = [(6, 6), (7, 5), (4, 9)]
BOUNDARIES = pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])


def choose(grid, order, active=None, machine=REFERENCE, seed=1, level=0, count=1):
    """Members as (rows, cols) booleans; all sites are active where nothing else is said."""
    active = np.ones((grid.rows, grid.cols)) if active is None else active
    offsets = machine.put(neighbourhood_offsets(order))
    chosen = luby(machine, grid, offsets, machine.put(active.astype(np.uint8)), seed, level, count)
    assert (chosen.dtype, chosen.shape) == (np.uint8, (grid.rows, grid.cols))
    assert isinstance(chosen, np.ndarray), "on the host, where a schedule wants it"
    assert np.isin(chosen, (0, 1)).all()
    return chosen.astype(bool)


def masks(rows, cols, seed=0):
    """All active, none, every other, one alone, and two random ones."""
    rng = np.random.default_rng(seed)
    alone = np.zeros((rows, cols), bool)
    alone[rows // 2, cols // 2] = True
    yield from (np.ones((rows, cols), bool), np.zeros((rows, cols), bool), np.indices((rows, cols)).sum(0) % 2 == 0)
    yield from (alone, rng.random((rows, cols)) < 0.7, rng.random((rows, cols)) < 0.2)


def near(site, grid, order):
    """The neighbours of a site of the lattice, by plain loops."""
    return [r for r in plain.neighbours(*site, order, grid.rows, grid.cols, grid.torus) if r]


def greedy(grid, order, active, priority):
    """One site after another, the highest (priority, index) first, unless a neighbour was there before it."""
    chosen = np.zeros((grid.rows, grid.cols), bool)
    for site in sorted(range(chosen.size), key=lambda site: (priority[site], site), reverse=True):
        here = divmod(site, grid.cols)
        chosen[here] = active[here] and not any(chosen[r] for r in near(here, grid, order))
    return chosen


def priorities(grid, seed=1, level=0, count=1):
    return random.draw4(seed, level, count, np.arange(grid.rows * grid.cols), random.SCHEDULE)[0].tolist()


def check_set(chosen, grid, order, active):
    """Equation (14), and that no active site could join."""
    assert not (chosen & ~active).any(), "only active sites are members"
    for site in np.argwhere(active).tolist():
        beside = any(chosen[r] for r in near(site, grid, order))
        assert chosen[tuple(site)] != beside, "a member without a member beside it, or beside one"


@BOUNDARIES
@pytest.mark.parametrize("order", [1, 2, 5, 8])
def test_the_twin_is_the_greedy_choice_in_order_of_priorities(order, torus):
    for rows, cols in TINY + SMALL:
        grid = Grid(rows, cols, 1, torus)
        for active in masks(rows, cols, order):
            chosen = choose(grid, order, active, seed=order)
            assert_same_bits(chosen, greedy(grid, order, active, priorities(grid, order)))
            check_set(chosen, grid, order, active)


@given(
    st.integers(1, 20), st.integers(1, 9), st.integers(1, 9), st.booleans(), st.integers(0, 2**64 - 1),
    st.integers(0, 7), st.integers(0, 2**20), st.floats(0, 1),
)  # fmt: skip
@settings(max_examples=40)
def test_any_lattice(order, rows, cols, torus, seed, level, count, share):
    grid = Grid(rows, cols, 1, torus)
    active = np.random.default_rng(count).random((rows, cols)) < share
    chosen = choose(grid, order, active, seed=seed, level=level, count=count)
    assert_same_bits(chosen, greedy(grid, order, active, priorities(grid, seed, level, count)))


def test_equal_priorities_are_decided_by_the_higher_index(monkeypatch):
    few = np.random.default_rng(3).integers(0, 3, 63).astype(np.uint32)
    monkeypatch.setattr(random, "draw4", lambda *_: [few] * 4)
    for torus in (True, False):
        grid, active = Grid(7, 9, 1, torus), next(masks(7, 9))
        assert_same_bits(choose(grid, 2, active), greedy(grid, 2, active, few.tolist()))


def test_equal_priorities_are_decided_in_the_same_way_on_a_device(machine):
    """Rounds by hand: two priorities that happen to be equal are too rare to wait for."""
    grid, few = Grid(7, 9), np.random.default_rng(3).integers(0, 3, 63).astype(np.uint32)
    offsets, priority = machine.put(neighbourhood_offsets(2)), machine.put(few)
    state = machine.put(np.full((7, 9), UNDECIDED, np.uint8))
    for _ in range(63):
        following = machine.empty((7, 9), np.uint8)
        arguments = (grid.flat.struct, offsets, np.int32(offsets.shape[0]), priority, state, following)
        machine.launch("luby_round", (63,), *arguments)
        state = following
    assert_same_bits(machine.get(state) == IN, greedy(grid, 2, np.ones((7, 9), bool), few.tolist()))


def test_no_site_is_a_member_where_none_is_active(machine):
    for m in (REFERENCE, machine):
        assert not choose(Grid(5, 6), 8, np.zeros((5, 6)), m).any()


def test_seed_count_and_level_each_give_other_sets():
    grid = Grid(9, 8)
    changes = [{}, {"seed": 2}, {"seed": 1 + 2**32}, {"count": 2}, {"level": 1}]
    sets = [choose(grid, 2, **change).tobytes() for change in changes]
    assert len(set(sets)) == len(sets)
    assert choose(grid, 2, count=2).tobytes() == sets[3]


def test_every_site_is_a_member_sooner_or_later():
    often = np.sum([choose(Grid(5, 6), 2, count=count) for count in range(1, 101)], 0)
    assert often.min() > 5
    assert often.max() < 50


@pytest.mark.parametrize(("spacing", "tile"), [(2, None), (4, None), (1, (2, 3))])
def test_a_level_is_a_lattice_of_its_own_and_tiles_do_not_matter(machine, spacing, tile):
    grid = Grid(19, 22, spacing, True, tile)
    expected = choose(grid.flat, 5)
    assert_same_bits(choose(grid, 5), expected)
    assert_same_bits(choose(grid, 5, machine=machine), expected)


@BOUNDARIES
@pytest.mark.parametrize("order", [1, 2, 8, 18])
def test_a_device_has_the_references_bits(machine, order, torus):
    for rows, cols in [*TINY, (7, 5), (17, 19)]:
        grid = Grid(rows, cols, 1, torus)
        for count, active in enumerate(masks(rows, cols, order)):
            key = {"seed": 2**40 + order, "level": 3, "count": count}
            assert_same_bits(choose(grid, order, active, machine, **key), choose(grid, order, active, **key))
