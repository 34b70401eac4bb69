"""Sets of sites that do not neighbour: the colouring against equation (14), and Luby's random independent sets."""

from dataclasses import replace
from itertools import accumulate, chain

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, colors_of
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex import random
from simdtex.model.lattice import Grid, coloring_sublattice, neighbourhood_offsets
from simdtex.schedules import get
from simdtex.schedules import sites as module
from simdtex.schedules.sites import IN, UNDECIDED, by_color, lattice_plan, luby

# -- The colouring against equation (14), by brute force, for every order up to 32; and its number of colours.

SIZES = [(1, 1), (1, 2), (5, 1), (2, 3), (3, 3), (7, 7), (8, 13), (12, 10)]


def conflicts(colors, order, torus):
    """Whether equation (14) is broken anywhere."""
    rows, cols = colors.shape
    i, j = np.indices(colors.shape)
    for di, dj in plain.offsets(order):
        k, m = ((i + di) % rows, (j + dj) % cols) if torus else (i + di, j + dj)
        there = (k >= 0) & (k < rows) & (m >= 0) & (m < cols) & ((k != i) | (m != j))
        if (colors[k[there], m[there]] == colors[there]).any():
            return True
    return False


def colour(order, rows, cols, torus, seed=0):
    return colors_of(Grid.of((rows, cols), 1, torus), order, seed)


def check(colors, order, torus):
    assert not conflicts(colors, order, torus)
    used = np.unique(colors)
    assert np.array_equal(used, np.arange(used.size)), "every colour from 0 up is used"
    best, neighbours = coloring_sublattice(order).index, len(plain.offsets(order))
    assert used.size <= (max(best, neighbours + 1) if torus else best)
    assert used.size <= colors.size


@given(st.integers(1, 32), st.integers(1, 31), st.integers(1, 24), st.booleans(), st.integers(0, 2**64 - 1))
def test_no_neighbours_share_a_colour(order, rows, cols, torus, seed):
    check(colour(order, rows, cols, torus, seed=seed), order, torus)


@pytest.mark.parametrize("order", [1, 2, 4, 5, 8, 10, 13, 18, 25, 32])
def test_lattices_that_fit_have_the_best_patterns_number_of_colours(order):
    best = coloring_sublattice(order)
    for rows, cols in [(best.a, best.c), (best.a + 3, best.c + 5)]:
        assert colour(order, rows, cols, False).max() + 1 == best.index
    side = next(n for n in range(best.c, best.index**2 + 1, best.c) if best.fits(best.a, n))
    for rows in (best.a, 2 * best.a):
        if min(rows, side) ** 2 > order:  # else a site meets itself around the torus
            colors = colour(order, rows, side, True)
            check(colors, order, True)
            assert colors.max() + 1 == best.index


def plain_colors(order, rows, cols, seed):
    """The colours of a torus with plain loops, site by site in falling priority, which is what the rounds amount to."""
    best, n = coloring_sublattice(order), rows * cols
    coset = [(i - j // best.c * best.b) % best.a * best.c + j % best.c for i in range(rows) for j in range(cols)]
    beside = [
        [k * cols + m for k, m in filter(None, plain.neighbours(*divmod(s, cols), order, rows, cols, True))]
        for s in range(n)
    ]
    bare = [s for s in range(n) if any(r < s and coset[r] == coset[s] for r in beside[s])]
    colors = [None if s in bare else color for s, color in enumerate(coset)]
    priority = random.draw4(seed, 0, 0, np.arange(n), random.COLOR)[0].tolist()
    for s in sorted(bare, key=lambda s: (priority[s], s), reverse=True):
        taken = {colors[r] for r in beside[s]}
        colors[s] = next(color for color in range(n) if color not in taken)
    if len(set(colors)) > best.index:
        other = coloring_sublattice(order, rows, cols, limit=len(set(colors)))
        if other:
            colors = [
                (i - j // other.c * other.b) % other.a * other.c + j % other.c for i in range(rows) for j in range(cols)
            ]
    names = sorted(set(colors))
    return np.array([names.index(color) for color in colors], np.int32).reshape(rows, cols)


@pytest.mark.parametrize("order", [1, 2, 5, 8, 18])
def test_the_seam_is_coloured_as_by_plain_loops(order):
    for rows, cols in SIZES:
        seed = 2**40 + order
        assert_same_bits(colour(order, rows, cols, True, seed), plain_colors(order, rows, cols, seed))


@given(
    st.sampled_from([1, 2, 5, 8, 18]),
    st.tuples(*[st.integers(1, 45)] * 2),
    st.booleans(),
    st.tuples(*[st.integers(0, 44)] * 2),
    st.tuples(*[st.integers(1, 45)] * 2),
)
def test_a_window_has_the_colours_of_the_whole(order, shape, torus, corner, size):
    grid = Grid.of(shape, 1, torus)
    rows, cols = (min(a, b) for a, b in zip(size, shape, strict=True))
    top, left = corner if torus else (min(at, n - k) for at, n, k in zip(corner, shape, (rows, cols), strict=True))
    window = grid.window(top, left, rows, cols)
    assert_same_bits(colors_of(window, order, 7), window.cut(colors_of(grid, order, 7)))


def test_sites_are_looked_at_piece_by_piece(monkeypatch):
    whole = [colour(order, 30, 37, True) for order in (8, 18)]
    monkeypatch.setattr(module, "NEIGHBOURS_AT_ONCE", 500)
    module.lattice_plan.cache_clear()
    assert_same_bits([colour(order, 30, 37, True) for order in (8, 18)], whole)


def test_the_colours_of_a_vast_torus_are_known_by_its_seam():
    """No work goes with the area: 10^10 sites."""
    grid = Grid((99_991, 100_003))
    window = grid.window(99_980, 99_990, 30, 40)
    colors = colors_of(window, 2, 1)
    assert not conflicts(colors, 2, False)
    assert colors.max() < lattice_plan(99_991, 100_003, True, 2, 1).colors <= 9


def test_a_vast_torus_takes_a_pattern_that_fits():
    """The other one would be looked for along two million sites."""
    grid = Grid((2**20, 2**20))
    window = grid.window(2**20 - 20, 2**20 - 25, 45, 50)
    assert not conflicts(colors_of(window, 18, 1), 18, False)
    plan = lattice_plan(2**20, 2**20, True, 18, 1)
    assert (plan.seam.size, plan.colors) == (0, coloring_sublattice(18, 2**20, 2**20, limit=61).index)


# -- The kernels: cosets and the seam, for pictures, windows and volumes; and the list of sites, by plain loops.

WHOLES = [Grid((1, 1)), Grid((2, 3)), Grid((29, 37)), Grid.of((64, 40), 2), Grid((3, 18)), Grid.of((23, 30), 1, False)]
WINDOWS = [
    *(Grid((29, 37)).window(*place) for place in [(20, 30, 15, 16), (-3, 2, 29, 5), (0, 36, 7, 37)]),
    *(Grid.of((40, 30), 1, False).window(*place) for place in [(21, 3, 19, 20), (0, 0, 1, 30)]),
    *(Grid((99_991, 100_003)).window(*place) for place in [(99_980, 99_990, 30, 40), (50_000, 100_000, 9, 9)]),
]
VOLUMES = [Grid.of((5, 9, 11), 1, False), Grid.of((4, 6, 7), 2, False), Grid((3, 4, 5), False, 1, (8, 9, 7), (2, 5, 1))]


@pytest.mark.parametrize(
    "name", ["coloring", "coloring-fixed", "checkerboard", "synchronous", "raster", "block:3x5", "block"]
)
def test_a_device_has_the_groups_of_the_reference(machine, name):
    """Among them those of a coloring on a torus that does not fit, where the seam has colours of its own."""
    schedule, seams = get(name), 0
    for grid in [*WHOLES, *([] if schedule.tile else WINDOWS + VOLUMES)]:
        for order in (1, 2, 8) if name == "coloring" and grid.whole.size < 10**6 else (2,):
            ours, theirs = (schedule.groups(m, grid, None, order, 9) for m in (machine, REFERENCE))
            assert_same_bits(machine.get(ours), theirs)
            assert (theirs.shape, theirs.dtype) == (grid.shape, np.int32)
            count = schedule.count(grid, order, 9)
            assert theirs.max() + 1 == count if grid in WHOLES else theirs.max() < count
            seams += schedule.plan(grid, order, 9).seam.size > 0
    assert (seams > 4) == (name in ("coloring", "coloring-fixed"))


def test_groups_are_what_their_names_say():
    row, col = np.indices((13, 11))
    expected = {"checkerboard": (row + col) % 2, "block:3x5": row % 3 * 5 + col % 5, "synchronous": row * 0}
    expected |= {"block:20x4": row * 4 + col % 4, "raster": row * 11 + col}
    whole, volume = Grid((13, 11)), Grid.of((3, 4, 5), 1, False)
    window, cases = whole.window(4, -3, 9, 9), [(name, whole, groups) for name, groups in expected.items()]
    cases += [("checkerboard", window, window.cut((row + col) % 2))]
    cases += [("checkerboard", volume, np.indices((3, 4, 5)).sum(0) % 2), ("raster", volume, np.arange(60))]
    for name, grid, groups in cases:
        ours = get(name).groups(REFERENCE, grid, None, 2, 1)
        assert_same_bits(ours, groups.reshape(grid.shape).astype(np.int32))


@given(st.tuples(*[st.integers(1, 40)] * 2), st.integers(1, 90), st.sampled_from([1, 7, 256]), st.integers(0, 9))
@settings(max_examples=40)
def test_the_list_has_the_sites_colour_by_colour_and_row_by_row(machine, shape, count, chunk, seed):
    colors = np.random.default_rng(seed).integers(0, count, shape).astype(np.int32)
    each = [[site for site in range(colors.size) if colors.flat[site] == color] for color in range(count)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", chunk)
        for m in (REFERENCE, machine):
            sites, starts = by_color(m, m.put(colors), count)
            assert_same_bits(np.asarray(m.get(sites)), np.array([*chain(*each)], np.int32))
            assert starts.tolist() == [0, *accumulate(map(len, each))]
            for strange in (-1, count):
                with pytest.raises(ValueError, match=f"sites in groups that are not 0 to {count - 1}"):
                    by_color(m, m.put(np.append(colors, np.int32(strange))), count)


# -- Luby's random maximal independent sets against a greedy choice in order of the same priorities, by plain loops.


def choose(grid, order, active=None, machine=REFERENCE, seed=1, level=0, count=1):
    """Members as (rows, cols) booleans; all sites are active where nothing else is said."""
    active = np.ones(grid.shape) if active is None else active
    offsets = machine.put(neighbourhood_offsets(order))
    chosen = luby(machine, grid, offsets, machine.put(active.astype(np.uint8)), seed, level, count)
    assert isinstance(chosen, np.ndarray), "on the host, where a schedule wants it"
    assert (chosen.dtype, chosen.shape) == (np.uint8, grid.shape)
    return chosen.astype(bool)


def greedy(grid, order, active, priority):
    """One site after another, the highest (priority, index) first, unless a neighbour was there before it."""
    chosen = np.zeros(grid.shape, bool)
    for site in sorted(range(chosen.size), key=lambda site: (priority[site], site), reverse=True):
        near = plain.neighbours(*divmod(site, grid.cols), order, grid.rows, grid.cols, grid.torus)
        chosen.flat[site] = active.flat[site] and not any(chosen[r] for r in near if r)
    return chosen


@given(
    st.integers(1, 20), st.integers(1, 9), st.integers(1, 9), st.booleans(), st.integers(0, 2**64 - 1),
    st.integers(0, 7), st.integers(0, 2**20), st.floats(0, 1),
)  # fmt: skip
@settings(max_examples=40)
def test_sites_are_chosen_greedily_in_order_of_priorities(machine, order, rows, cols, torus, seed, level, count, share):
    grid = Grid.of((rows, cols), 1, torus)
    active = np.random.default_rng(count).random((rows, cols)) < share
    priority = random.draw4(seed, level, count, np.arange(rows * cols), random.SCHEDULE)[0].tolist()
    expected = greedy(grid, order, active, priority)
    for m in (REFERENCE, machine):
        assert_same_bits(choose(grid, order, active, m, seed, level, count), expected)


def test_equal_priorities_are_decided_by_the_higher_index(monkeypatch, machine):
    """On a device in rounds by hand: two priorities that happen to be equal are too rare to wait for."""
    grid, few = Grid((7, 9)), np.random.default_rng(3).integers(0, 3, 63).astype(np.uint32)
    offsets, priority = machine.put(neighbourhood_offsets(2)), machine.put(few)
    state, expected = machine.put(np.full((7, 9), UNDECIDED, np.uint8)), greedy(grid, 2, np.ones((7, 9)), few.tolist())
    for _ in range(63):
        following = machine.empty((7, 9), np.uint8)
        machine.launch("luby_round", (63,), grid.struct, offsets, np.int32(len(offsets)), priority, state, following)
        state = following
    assert_same_bits(machine.get(state) == IN, expected)
    monkeypatch.setattr(random, "draw4", lambda *_: [few] * 4)
    assert_same_bits(choose(grid, 2), expected)


@pytest.mark.parametrize(("spacing", "tile"), [(2, None), (1, (2, 3))])
def test_a_level_is_a_lattice_of_its_own_and_tiles_do_not_matter(machine, spacing, tile):
    grid = replace(Grid.of((19, 22), spacing), tile=tile)
    expected = choose(Grid(grid.shape), 5)
    for m in (REFERENCE, machine):
        assert_same_bits(choose(grid, 5, machine=m), expected)
    assert_same_bits(colors_of(grid, 5, 3), colour(5, *grid.shape, True, seed=3))
