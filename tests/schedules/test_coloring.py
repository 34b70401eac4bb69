"""Sets of sites that do not neighbour: the colouring against equation (14), and Luby's random independent sets."""

from dataclasses import replace
from itertools import accumulate, chain

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, colors_of, slow_but
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex import random
from simdtex.model.lattice import Grid, coloring_sublattice, neighbourhood_offsets
from simdtex.schedules import get
from simdtex.schedules import sites as module
from simdtex.schedules.sites import IN, UNDECIDED, by_color, lattice_plan, luby

# -- The colouring against equation (14), by brute force, for every order up to 32; and its number of colours.
# The bound where a torus does not hold the best pattern: a site at the seam takes the lowest colour that none of its
# neighbours has, so there are at most max(colours of the best pattern, neighbours + 1).

TINY = [(1, 1), (1, 2), (1, 5), (5, 1), (2, 2), (2, 3), (3, 3), (4, 2)]
SMALL = [(6, 6), (7, 7), (8, 13), (13, 8), (12, 10), (9, 15)]
LARGER = [(17, 19), (24, 24), (31, 11)]
ORDERS = range(1, 33)


def colour(order, rows, cols, torus, seed=0):
    colors = colors_of(Grid.of((rows, cols), 1, torus), order, seed)
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
@pytest.mark.parametrize("order", slow_but(ORDERS[::3], ORDERS))
def test_no_neighbours_share_a_colour(order, torus):
    for rows, cols in TINY + SMALL + LARGER:
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


def test_the_seed_moves_only_the_seam():
    first, second = (colour(2, 7, 9, True, seed=seed) for seed in (1, 2))
    check(first, 2, True)
    check(second, 2, True)
    assert np.array_equal(colour(2, 8, 8, True, seed=1), colour(2, 8, 8, True, seed=2))
    assert np.array_equal(first, colour(2, 7, 9, True, seed=1))


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


@pytest.mark.parametrize("order", [1, 2, 4, 5, 8, 13, 18, 25])
def test_the_seam_is_coloured_as_by_plain_loops(order):
    for rows, cols in [*TINY, *SMALL, (29, 37)]:
        assert_same_bits(
            colour(order, rows, cols, True, seed=2**40 + order), plain_colors(order, rows, cols, 2**40 + order)
        )


@pytest.mark.parametrize("spacing", [1, 2, 4])
def test_a_coarser_level_is_coloured_as_a_lattice_of_its_own(spacing):
    grid = Grid.of((23, 30), spacing)
    assert_same_bits(colors_of(grid, 5, 3), colour(5, grid.rows, grid.cols, True, seed=3))


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
    assert lattice_plan(*shape, torus, order, 7).colors == colors_of(grid, order, 7).max() + 1


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
    for name, groups in expected.items():
        assert_same_bits(get(name).groups(REFERENCE, Grid((13, 11)), None, 2, 1), groups.astype(np.int32))
    window, volume = Grid((13, 11)).window(4, -3, 9, 9), Grid.of((3, 4, 5), 1, False)
    assert_same_bits(
        get("checkerboard").groups(REFERENCE, window, None, 2, 1), window.cut((row + col) % 2).astype("i4")
    )
    for name, groups in (
        ("checkerboard", np.indices((3, 4, 5)).sum(0) % 2),
        ("raster", np.arange(60).reshape(3, 4, 5)),
    ):
        assert_same_bits(get(name).groups(REFERENCE, volume, None, 2, 1), groups.astype(np.int32))


SIDES = st.integers(1, 40)


@given(st.tuples(SIDES, SIDES), st.integers(1, 90), st.sampled_from([1, 7, 256]), st.integers(0, 9))
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

TINY_LUBY = [(1, 1), (1, 2), (1, 5), (5, 1), (2, 2), (2, 3), (3, 3)]
SMALL_LUBY = [(6, 6), (7, 5), (4, 9)]
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
    for rows, cols in TINY_LUBY + SMALL_LUBY:
        grid = Grid.of((rows, cols), 1, torus)
        for active in masks(rows, cols, order):
            chosen = choose(grid, order, active, seed=order)
            assert_same_bits(chosen, greedy(grid, order, active, priorities(grid, order)))
            check_set(chosen, grid, order, active)


@given(
    st.integers(1, 20), st.integers(1, 9), st.integers(1, 9), st.booleans(), st.integers(0, 2**64 - 1),
    st.integers(0, 7), st.integers(0, 2**20), st.floats(0, 1),
)  # fmt: skip
@settings(max_examples=40)
def test_any_lattice_of_luby(order, rows, cols, torus, seed, level, count, share):
    grid = Grid.of((rows, cols), 1, torus)
    active = np.random.default_rng(count).random((rows, cols)) < share
    chosen = choose(grid, order, active, seed=seed, level=level, count=count)
    assert_same_bits(chosen, greedy(grid, order, active, priorities(grid, seed, level, count)))


def test_equal_priorities_are_decided_by_the_higher_index(monkeypatch):
    few = np.random.default_rng(3).integers(0, 3, 63).astype(np.uint32)
    monkeypatch.setattr(random, "draw4", lambda *_: [few] * 4)
    for torus in (True, False):
        grid, active = Grid.of((7, 9), 1, torus), next(masks(7, 9))
        assert_same_bits(choose(grid, 2, active), greedy(grid, 2, active, few.tolist()))


def test_equal_priorities_are_decided_in_the_same_way_on_a_device(machine):
    """Rounds by hand: two priorities that happen to be equal are too rare to wait for."""
    grid, few = Grid((7, 9)), np.random.default_rng(3).integers(0, 3, 63).astype(np.uint32)
    offsets, priority = machine.put(neighbourhood_offsets(2)), machine.put(few)
    state = machine.put(np.full((7, 9), UNDECIDED, np.uint8))
    for _ in range(63):
        following = machine.empty((7, 9), np.uint8)
        arguments = (grid.struct, offsets, np.int32(offsets.shape[0]), priority, state, following)
        machine.launch("luby_round", (63,), *arguments)
        state = following
    assert_same_bits(machine.get(state) == IN, greedy(grid, 2, np.ones((7, 9), bool), few.tolist()))


def test_no_site_is_a_member_where_none_is_active(machine):
    for m in (REFERENCE, machine):
        assert not choose(Grid((5, 6)), 8, np.zeros((5, 6)), m).any()


def test_seed_count_and_level_each_give_other_sets():
    grid = Grid((9, 8))
    changes = [{}, {"seed": 2}, {"seed": 1 + 2**32}, {"count": 2}, {"level": 1}]
    sets = [choose(grid, 2, **change).tobytes() for change in changes]
    assert len(set(sets)) == len(sets)
    assert choose(grid, 2, count=2).tobytes() == sets[3]


def test_every_site_is_a_member_sooner_or_later():
    often = np.sum([choose(Grid((5, 6)), 2, count=count) for count in range(1, 101)], 0)
    assert often.min() > 5
    assert often.max() < 50


@pytest.mark.parametrize(("spacing", "tile"), [(2, None), (4, None), (1, (2, 3))])
def test_a_level_is_a_lattice_of_its_own_and_tiles_do_not_matter(machine, spacing, tile):
    grid = replace(Grid.of((19, 22), spacing), tile=tile)
    expected = choose(Grid(grid.shape), 5)
    assert_same_bits(choose(grid, 5), expected)
    assert_same_bits(choose(grid, 5, machine=machine), expected)


@BOUNDARIES
@pytest.mark.parametrize("order", [1, 2, 8, 18])
def test_a_device_has_the_references_bits(machine, order, torus):
    for rows, cols in [*TINY_LUBY, (7, 5), (17, 19)]:
        grid = Grid.of((rows, cols), 1, torus)
        for count, active in enumerate(masks(rows, cols, order)):
            key = {"seed": 2**40 + order, "level": 3, "count": count}
            assert_same_bits(choose(grid, order, active, machine, **key), choose(grid, order, active, **key))
