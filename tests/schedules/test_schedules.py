"""What every schedule keeps, whatever it chooses; and what each claims, against plain loops."""

import functools
from importlib.metadata import EntryPoint
from itertools import chain
from typing import NamedTuple

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, setting
from scipy import stats

from simdtex import schedules
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.schedules import SCHEDULES, Checked, Coloring, Info, Masked, get, neighbours_in
from simdtex.schedules.schedule import Trimmed


class Claim(NamedTuple):
    """What is expected of a schedule: one group after another; random choices; independence at (grid, order)."""

    partition: bool
    random: bool
    independent: object


def always(grid, order):
    return True


def alone(grid, order):
    return grid.rows * grid.cols == 1


def two_colours(grid, order):
    return order == 1 and (not grid.torus or all(n == 1 or n % 2 == 0 for n in (grid.rows, grid.cols)))


def within(rows, cols):
    return lambda grid, order: alone(grid, order) or (grid.rows <= rows and grid.cols <= cols)


CLAIMS = {
    "coloring": Claim(True, True, always),
    "coloring-fixed": Claim(True, False, always),
    "luby": Claim(False, True, always),
    "checkerboard": Claim(True, False, two_colours),
    "synchronous": Claim(True, False, alone),
    "random-subset": Claim(False, True, alone),
    "raster": Claim(True, False, always),
    "random-scan": Claim(False, True, always),
    "block": Claim(True, False, within(16, 16)),
    "random-subset:0.2": Claim(False, True, alone),
    "block:3x5": Claim(True, False, within(3, 5)),
    "block:100x100": Claim(True, False, within(100, 100)),
}
GRIDS = [
    Grid((6, 8)),
    Grid((5, 7)),
    Grid.of((6, 7), 1, False),
    Grid((1, 9)),
    Grid((1, 8)),
    Grid.of((9, 1), 1, False),
    Grid((1, 1)),
    Grid((2, 2)),
    Grid((2, 3)),
    Grid.of((13, 11), 2),
    Grid.of((11, 16), 4, False),
    Grid((3, 18)),
]
every = pytest.mark.parametrize("name", CLAIMS)


def test_every_schedule_is_looked_at():
    assert set(SCHEDULES) <= set(CLAIMS)


def everywhere(grid):
    return np.ones((grid.rows, grid.cols), bool)


def walk(schedule, grid, sweeps=1, *, order=2, seed=1, level=0, mask=None, machine=REFERENCE):
    """What the steps of each sweep decided; all sites active where nothing else is said."""
    mask = everywhere(grid) if mask is None else mask
    told_of = setting(grid, order, seed, level, machine)
    state, active = schedule.init(told_of), Masked(grid, mask)
    told = []
    for _ in range(sweeps):
        infos = []
        while not (infos and infos[-1].last):
            state, info = schedule.step(told_of, state, active)
            infos.extend(info.apart(machine))
            assert len(infos) < 5000, "a sweep ends"
        told.append(infos)
    return told


def plainly(told):
    """The same in numbers that can be compared."""
    return [[(info.sites.tolist(), info.turn, info.last) for info in infos] for infos in told]


def frozen(value):
    """A state in a form that can be compared: every array as its bytes."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    return tuple(map(frozen, value)) if isinstance(value, tuple) else value


@functools.cache
def beside(grid, order):
    """Pixel index of each site -> those of its neighbours, by plain loops."""
    near = {}
    for i in range(grid.rows):
        for j in range(grid.cols):
            found = plain.neighbours(i, j, order, grid.rows, grid.cols, grid.torus)
            pixels = {k * grid.cols + m for k, m in filter(None, found)}
            near[i * grid.cols + j] = pixels
    return near


def clash(grid, order, sites):
    near, chosen = beside(grid, order), set(sites.tolist())
    return any(near[site] & chosen for site in chosen)


@every
@pytest.mark.parametrize("grid", [Grid((5, 6)), Grid.of((9, 7), 2, False)], ids=str)
def test_a_step_is_a_pure_function_of_the_state(name, grid):
    schedule, mask = get(name), everywhere(grid)
    told_of = setting(grid)
    state = schedule.init(told_of)
    for n in range(40):
        if n % 7 == 6:  # as sites cool
            mask = mask & (np.random.default_rng(n).random(mask.shape) < 0.8)
        before, seen = frozen(state), mask.copy()
        one, first = schedule.step(told_of, state, Masked(grid, mask))
        two, second = get(name).step(told_of, state, Masked(grid, mask.copy()))
        assert frozen(one) == frozen(two)
        assert_same_bits(first.sites, second.sites)
        assert_same_bits(first.ranges, second.ranges)
        assert first[1:3] == second[1:3]
        assert frozen(state) == before
        assert_same_bits(mask, seen)
        state = one


@every
def test_sites_and_keys_are_in_order(name):
    for grid in GRIDS:
        rng, met = np.random.default_rng(1), set()
        mask = rng.random((grid.rows, grid.cols)) < 0.7
        for infos in walk(get(name), grid, 4, mask=mask):
            assert [info.last for info in infos] == [False] * (len(infos) - 1) + [True]
            for info in infos:
                assert (info.sites.dtype, info.sites.ndim) == (np.int32, 1)
                assert isinstance(info.turn, int) and 0 <= info.turn < 2**32
                assert np.isin(info.sites, np.flatnonzero(mask)).all(), "active sites of the lattice alone"
                pairs = {(site, info.turn) for site in info.sites.tolist()}
                assert len(pairs) == len(info.sites), "no site twice in a step"
                assert not pairs & met, "no site twice under a turn"
                met |= pairs


@every
def test_the_same_seed_gives_the_same_sequence_and_another_where_it_is_random_another(name):
    grid = Grid((6, 8))
    first, again = (plainly(walk(get(name), grid, 3)) for _ in range(2))
    assert first == again
    for change in ({"seed": 2}, {"seed": 1 + 2**32}, {"level": 1}):
        assert (plainly(walk(get(name), grid, 3, **change)) != first) == CLAIMS[name].random
    sweeps = [tuple(tuple(sites) for sites, *_ in steps) for steps in first]
    assert len(set(sweeps)) == (3 if CLAIMS[name].random else 1)


@every
def test_nothing_active_ends_the_sweep_with_no_site(name):
    for grid in (Grid((5, 6)), Grid((1, 1))):
        nothing = ~everywhere(grid)
        for infos in walk(get(name), grid, 3, mask=nothing):
            assert [(info.sites.size, info.last) for info in infos] == [(0, True)]
            assert infos[0].sites.dtype == np.int32


@every
def test_a_sweep_is_as_long_as_claimed(name):
    for grid in GRIDS:
        mask = np.random.default_rng(2).random((grid.rows, grid.cols)) < 0.6
        active = np.arange(grid.size, dtype=np.int32)[mask.ravel()]
        for infos in walk(get(name), grid, 3, mask=mask):
            relaxed = np.concatenate([info.sites for info in infos])
            if CLAIMS[name].partition:
                assert np.array_equal(np.sort(relaxed), active), "each active site once"
                assert all(info.sites.size for info in infos) or not active.size
            else:
                assert relaxed.size >= active.size
                assert relaxed.size - infos[-1].sites.size < active.size or not active.size, "and no longer"


@every
@pytest.mark.parametrize("grid", [Grid((5, 6)), Grid.of((7, 7), 2), Grid.of((1, 9), 1, False)], ids=str)
def test_every_site_gets_its_turn_until_none_is_active(name, grid):
    """Each site wants one to three relaxations, and is counted when it has been relaxed, as a temperature is."""
    schedule, pixel = get(name), np.arange(grid.size, dtype=np.int32)
    wants = np.random.default_rng(3).integers(1, 4, pixel.size)
    told_of = setting(grid)
    state = schedule.init(told_of)
    sweeps = 0
    while (wants > 0).any():
        sweeps += 1
        assert sweeps < 100
        begun, last = wants > 0, False
        while not last:
            active = wants > 0
            state, info = schedule.step(told_of, state, Masked(grid, active.reshape(grid.rows, grid.cols)))
            allowed = begun if CLAIMS[name].partition else active
            relaxed = np.isin(pixel, info.sites)
            assert not (relaxed & ~allowed).any()
            wants, last = wants - relaxed, info.last
    state, info = schedule.step(told_of, state, Masked(grid, ~everywhere(grid)))
    assert (info.sites.size, info.last) == (0, True)


@every
def test_a_machine_changes_no_choice(machine, name):
    for grid in (Grid((6, 7)), Grid.of((13, 11), 2, False)):
        mask = np.random.default_rng(4).random((grid.rows, grid.cols)) < 0.8
        for order in (1, 8):
            ours = walk(get(name), grid, 2, order=order, mask=mask, machine=machine)
            assert plainly(ours) == plainly(walk(get(name), grid, 2, order=order, mask=mask))


@every
@pytest.mark.parametrize("order", [1, 2, 8])
def test_independence_is_claimed_where_expected_and_where_claimed_it_holds(name, order):
    for grid in GRIDS:
        schedule = get(name)
        claimed = schedule.independent(grid, neighbourhood_offsets(order))
        assert isinstance(claimed, bool)
        assert claimed == CLAIMS[name].independent(grid, order), grid
        if claimed:
            for infos in walk(schedule, grid, 3, order=order):
                assert not any(clash(grid, order, info.sites) for info in infos), grid


@pytest.mark.parametrize("name", ["synchronous", "random-subset", "checkerboard", "random-subset:0.2"])
def test_those_that_claim_nothing_do_relax_neighbours_together(name):
    for grid in (Grid((6, 8)), Grid.of((6, 7), 1, False), Grid.of((13, 11), 2)):
        told = walk(get(name), grid, 3)
        assert any(clash(grid, 2, info.sites) for infos in told for info in infos)


def test_a_checkerboard_on_an_odd_torus_breaks_at_the_seam():
    for grid in (Grid((5, 6)), Grid((6, 5)), Grid((1, 7))):
        assert any(clash(grid, 1, info.sites) for info in walk(get("checkerboard"), grid, order=1)[0])


def test_neighbours_are_found_as_by_plain_loops():
    outcomes = set()
    for order in (1, 2, 5):
        for n, grid in enumerate(GRIDS):
            sites = np.arange(grid.size, dtype=np.int32)
            for share in (0.1, 0.3, 1):
                chosen = sites[np.random.default_rng(n).random(sites.size) < share]
                met = neighbours_in(grid, neighbourhood_offsets(order), chosen)
                assert (met is not None) == clash(grid, order, chosen)
                outcomes.add(met is not None)
                if met:
                    assert set(met) <= set(chosen.tolist())
                    assert met[1] in beside(grid, order)[met[0]]
    assert outcomes == {True, False}


def test_a_step_of_luby_is_a_maximal_set():
    for grid in GRIDS:
        mask = np.random.default_rng(5).random((grid.rows, grid.cols)) < 0.7
        active = np.arange(grid.size, dtype=np.int32)[mask.ravel()]
        for info in chain(*walk(get("luby"), grid, 2, mask=mask)):
            chosen = set(info.sites.tolist())
            for site in active.tolist():
                assert (site in chosen) != bool(beside(grid, 2)[site] & chosen)


def test_the_colours_of_coloring_are_those_of_coloring_fixed_in_any_order():
    grid = Grid((8, 8))
    fixed = [sites for sites, *_ in plainly(walk(get("coloring-fixed"), grid))[0]]
    orders = set()
    for steps in plainly(walk(get("coloring"), grid, 200)):
        colours = [sites for sites, *_ in steps]
        assert sorted(colours) == sorted(fixed)
        orders.add(tuple(fixed.index(sites) for sites in colours))
    assert len(orders) == 24, "four colours in every order"


def test_random_scan_takes_any_active_site_with_the_same_probability():
    grid = Grid((3, 4))
    mask = np.indices((3, 4)).sum(0) % 4 != 0
    taken = np.concatenate([info.sites for info in chain(*walk(get("random-scan"), grid, 200, mask=mask))])
    counts = np.bincount(taken, minlength=12)
    assert not counts[~mask.ravel()].any()
    assert stats.chisquare(counts[mask.ravel()]).pvalue > 0.01
    pairs = np.bincount(taken[:-1] * 12 + taken[1:], minlength=144).reshape(12, 12)[np.ix_(mask.ravel(), mask.ravel())]
    assert stats.chisquare(pairs.ravel()).pvalue > 0.01, "whatever came before"


@pytest.mark.parametrize("p", [0.2, 0.5, 0.9])
def test_random_subset_takes_each_site_with_its_probability(p):
    grid, steps = Grid((4, 5)), 600
    schedule = get(f"random-subset:{p}")
    told_of = setting(grid)
    state = schedule.init(told_of)
    chosen = np.zeros((steps, 20), int)
    for row in chosen:
        state, info = schedule.step(told_of, state, Masked(grid))
        row[info.sites] = 1
    assert stats.binomtest(int(chosen.sum()), chosen.size, p).pvalue > 0.01
    assert min(stats.binomtest(int(n), steps, p).pvalue for n in chosen.sum(0)) > 0.01 / 20, "each site"
    shares = np.corrcoef(chosen.T)[np.triu_indices(20, 1)]
    assert abs(shares).max() < 0.2, "independently of the others"


def test_raster_and_block_go_row_by_row():
    grid = Grid((4, 6))
    assert [sites for sites, *_ in plainly(walk(get("raster"), grid))[0]] == [[site] for site in range(24)]
    steps = [sites for sites, *_ in plainly(walk(get("block:2x3"), grid))[0]]
    assert steps == [[s, s + 3, s + 12, s + 15] for s in (0, 1, 2, 6, 7, 8)]
    assert plainly(walk(get("block:9x9"), Grid.of((13, 11), 2)))[0][:3] == [([s], 1, False) for s in (0, 1, 2)]


class Own(schedules.Partition):
    """Two groups of one's own, by the parity of the column."""

    name, windows = "own", False

    def __init__(self, odd, even, dtype):
        self.numbers = np.array([even, odd], dtype)

    def groups(self, machine, grid, offsets, order, seed):
        return self.numbers[np.indices((grid.rows, grid.cols))[1] % 2]

    def count(self, grid, order, seed):
        return 2


NUMBERS = [(-3, 10**12, "int64"), (0, 1, "int32"), (0, 200, "uint8"), (0, 2**63 + 1, "uint64"), (False, True, "bool")]


@pytest.mark.parametrize("numbers", NUMBERS, ids=str)
def test_groups_of_ones_own_may_have_any_numbers(machine, numbers):
    for m in (REFERENCE, machine):
        odd, even = walk(Own(*numbers), Grid((2, 4)), machine=m)[0]
        assert (odd.sites.tolist(), even.sites.tolist()) == ([1, 3, 5, 7], [0, 2, 4, 6])


def test_groups_that_are_not_as_many_as_counted_are_refused(machine):
    for m in (REFERENCE, machine):
        for odd, dtype in ((2, "uint8"), (2**32, "int64"), (-1, "int64")):
            own = Own(odd, 0, dtype)
            own.windows = True
            with pytest.raises(ValueError, match="sites in groups that are not 0 to 1, as its `count` says"):
                walk(own, Grid((2, 4)), machine=m)
        with pytest.raises(TypeError, match="Cannot cast"):
            walk(Own(1.5, 0, "float64"), Grid((2, 4)), machine=m)


class Told:
    """A schedule that says what it is told to, and then ends the sweep."""

    name, tile, windows = "told", None, False

    def __init__(self, sites, claim=True):
        self.sites, self.claim = np.asarray(sites, np.int32), claim

    def independent(self, grid, offsets):
        return self.claim

    def init(self, setting):
        return 0

    def step(self, setting, state, active):
        return state + 1, Info(self.sites, state, True)


def test_a_claim_that_does_not_hold_is_caught():
    words = r"the schedule told claims independent sites, but \(1, 2\) and \(0, 1\) are neighbours .* equation \(14\)"
    with pytest.raises(RuntimeError, match=words):
        walk(Checked(Told([1, 12, 24])), Grid((5, 10)))
    assert walk(Checked(Told([1, 12, 24], claim=False)), Grid((5, 10)))
    assert walk(Checked(Told([1, 12, 24])), Grid((5, 10)), order=1)


@pytest.mark.parametrize("claim", [True, False])
def test_a_site_twice_or_from_elsewhere_is_caught(claim):
    with pytest.raises(RuntimeError, match="the schedule told relaxes a site twice in one step"):
        walk(Checked(Told([7, 30, 7], claim)), Grid((6, 9)))
    for foreign in ([0, 15], [15], [54], [-2], [10**6]):
        with pytest.raises(RuntimeError, match="the schedule told relaxes sites that are not of the level's lattice"):
            walk(Checked(Told(foreign, claim)), Grid.of((6, 9), 2))


@every
def test_an_honest_schedule_passes_and_is_told_nothing_else(name):
    for grid in GRIDS:
        checked = Checked(get(name))
        assert checked.name == get(name).name
        assert checked.independent(grid, neighbourhood_offsets(2)) == CLAIMS[name].independent(grid, 2)
        assert plainly(walk(checked, grid, 2)) == plainly(walk(get(name), grid, 2))


@pytest.mark.parametrize(
    ("schedule", "name"),
    [
        (schedules.RandomSubset(0.5), "random-subset"),
        (schedules.RandomSubset(1 / 3), "random-subset:0.3333333333333333"),
        (schedules.RandomSubset(np.float64(0.25)), "random-subset:0.25"),
        (schedules.Block(), "block"),
        (schedules.Block(np.int64(2), 7), "block:2x7"),
    ],
)
def test_a_name_says_all_about_its_schedule(schedule, name):
    assert schedule.name == get(name).name == name
    assert vars(get(name)) == vars(schedule)


@pytest.mark.parametrize("wrong", [None, 3, ["luby"], object(), schedules.Luby, schedules.Partition(), np.zeros(3)])
def test_what_is_no_schedule_is_refused(wrong):
    with pytest.raises(TypeError, match="a schedule must be a name, or an object with name, tile, windows, indep"):
        get(wrong)


BAD = [
    *((name, "choose one of: " + ", ".join(SCHEDULES)) for name in ("rows", "", "Luby", "luby ", "luby:3", ":")),
    *((f"random-subset:{p}", "no share of sites; give one from 0.001 to 1: random-subset:0.5")
      for p in ("2", "0.0009", "x", "", "nan")),
    *((f"block:{size}", "no size of a tile; give rows x columns from 1x1 up: block:16x16")
      for size in ("0x3", "16", "", "3x", "2.5x3", "3x4x5", "1" * 10 + "x1")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "words"), BAD)
def test_a_bad_name_is_refused_with_a_remedy(name, words):
    with pytest.raises(ValueError, match=words) as caught:
        get(name)
    assert "\n" not in str(caught.value)
    assert any(repr(part) in str(caught.value) for part in (name, name.partition(":")[2]))


def test_a_package_brings_schedules_as_entry_points(monkeypatch):
    brought = {
        "mine": "simdtex.schedules:Raster",
        "luby": "simdtex.schedules:Raster",
        "nothing": "builtins:object",
        "gone": "no_such_package:Schedule",
    }

    def entry_points(*, group):
        assert group == "simdtex.schedules"
        return [EntryPoint(name, value, group) for name, value in brought.items()]

    monkeypatch.setattr("importlib.metadata.entry_points", entry_points)
    assert isinstance(get("mine"), schedules.Raster)
    assert isinstance(get("luby"), schedules.Luby), "what is here goes first"
    with pytest.raises(ValueError, match=r"choose one of: coloring, .*, block, mine, "):
        get("another")
    with pytest.raises(TypeError, match="a schedule must be a name, or an object"):
        get("nothing")


def test_a_trimmed_sweep_keeps_the_rows_that_reach_its_tile():
    told = setting(Grid.of((40, 9), 1, False), order=4)
    whole, trimmed = Coloring(), Trimmed(Coloring(), 18, 21)
    (_, every), (_, some) = (one.step(told, one.init(told), Masked(told.grid)) for one in (whole, trimmed))
    steps = list(zip(every.apart(REFERENCE), some.apart(REFERENCE), strict=True))
    assert len(steps) > 4
    for left, (before, after) in enumerate(reversed(steps)):
        rows = before.sites // 9
        kept = (rows >= 18 - 2 * left) & (rows < 21 + 2 * left)  # neighbours are two rows away at most
        assert after.sites.tolist() == before.sites[kept].tolist()
