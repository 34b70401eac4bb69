"""What every schedule keeps, whatever it chooses; and what each claims, against plain loops."""

import functools
from importlib.metadata import EntryPoint
from itertools import chain, product
from typing import NamedTuple

import numpy as np
import plain
import pytest
from cases import REFERENCE, setting
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
    return grid.size == 1


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
}
GRIDS = [
    *(Grid((6, 8)), Grid((5, 7)), Grid.of((6, 7), 1, False), Grid((1, 9)), Grid((1, 8)), Grid((1, 1)), Grid((2, 3))),
    *(Grid.of((13, 11), 2), Grid.of((11, 16), 4, False), Grid((3, 18))),
]
every = pytest.mark.parametrize("name", CLAIMS)


def walk(schedule, grid, sweeps=1, *, order=2, seed=1, level=0, mask=None, machine=REFERENCE):
    """What the steps of each sweep decided; all sites active where nothing else is said."""
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


@functools.cache
def beside(grid, order):
    """The numbers of the neighbours of each site, by plain loops."""
    near = [plain.neighbours(*divmod(s, grid.cols), order, grid.rows, grid.cols, grid.torus) for s in range(grid.size)]
    return [{k * grid.cols + m for k, m in filter(None, sites)} for sites in near]


def clash(grid, order, sites):
    near, chosen = beside(grid, order), set(sites.tolist())
    return any(near[site] & chosen for site in chosen)


@every
def test_a_sweep_is_as_the_schedule_claims(name):
    assert set(SCHEDULES) <= set(CLAIMS)
    for grid in GRIDS:
        for share in (0.65, 0.0):
            mask, met = np.random.default_rng(1).random(grid.shape) < share, set()
            told = walk(Checked(get(name)), grid, 4, mask=mask)
            assert plainly(told) == plainly(walk(get(name), grid, 4, mask=mask))
            for infos in told:
                assert [info.last for info in infos] == [False] * (len(infos) - 1) + [True]
                relaxed = np.concatenate([info.sites for info in infos])
                assert relaxed.dtype == np.int32 and np.isin(relaxed, np.flatnonzero(mask)).all()
                pairs = [(site, info.turn) for info in infos for site in info.sites.tolist()]
                assert len({*pairs} - met) == len(pairs), "no site twice under a turn"
                met |= {*pairs}
                if CLAIMS[name].partition:
                    assert np.array_equal(np.sort(relaxed), np.flatnonzero(mask)), "each active site once"
                    assert all(info.sites.size for info in infos) or not mask.any()
                else:
                    assert relaxed.size - infos[-1].sites.size < mask.sum() <= relaxed.size or not mask.any()


@every
def test_choices_follow_from_state_seed_and_level_on_every_machine(machine, name):
    grid = Grid((6, 8))
    mask = np.random.default_rng(4).random(grid.shape) < 0.8
    first = plainly(walk(get(name), grid, 3, mask=mask))
    assert first == plainly(walk(get(name), grid, 3, mask=mask, machine=machine))
    for change in ({"seed": 2}, {"seed": 1 + 2**32}, {"level": 1}):
        assert (plainly(walk(get(name), grid, 3, mask=mask, **change)) != first) == CLAIMS[name].random
    sweeps = [tuple(tuple(sites) for sites, *_ in steps) for steps in first]
    assert len(set(sweeps)) == (3 if CLAIMS[name].random else 1)


@every
def test_independence_is_claimed_where_expected_and_where_claimed_it_holds(name):
    broken = set()
    for grid, order in product(GRIDS, (1, 2, 8)):
        claimed = get(name).independent(grid, neighbourhood_offsets(order))
        assert claimed is CLAIMS[name].independent(grid, order), (grid, order)
        for info in chain(*walk(get(name), grid, 2, order=order)):
            met = neighbours_in(grid, neighbourhood_offsets(order), info.sites)
            assert (met is not None) == clash(grid, order, info.sites)
            assert met is None or (set(met) <= set(info.sites.tolist()) and met[1] in beside(grid, order)[met[0]])
            if met:
                assert not claimed
                broken.add(order)
    assert bool(broken) == (CLAIMS[name].independent is not always)
    assert name != "checkerboard" or 1 in broken, "at the seam of an odd torus"


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


def test_random_subset_takes_each_site_with_its_probability():
    told = walk(schedules.RandomSubset(0.2), Grid((4, 5)), 100)
    counts = np.bincount(np.concatenate([info.sites for info in chain(*told)]), minlength=20)
    steps = sum(map(len, told))
    assert stats.binomtest(int(counts.sum()), 20 * steps, 0.2).pvalue > 0.01
    assert min(stats.binomtest(int(n), steps, 0.2).pvalue for n in counts) > 0.01 / 20, "each site"


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


def test_groups_of_ones_own_may_have_any_numbers_but_not_more_than_counted(machine):
    for m in (REFERENCE, machine):
        for numbers in NUMBERS:
            odd, even = walk(Own(*numbers), Grid((2, 4)), machine=m)[0]
            assert (odd.sites.tolist(), even.sites.tolist()) == ([1, 3, 5, 7], [0, 2, 4, 6])
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
    with pytest.raises(RuntimeError, match="the schedule told relaxes a site twice in one step"):
        walk(Checked(Told([7, 30, 7], False)), Grid((6, 9)))
    for foreign in ([0, 15], [-2]):
        with pytest.raises(RuntimeError, match="the schedule told relaxes sites that are not of the level's lattice"):
            walk(Checked(Told(foreign, False)), Grid.of((6, 9), 2))


def test_a_name_says_all_about_its_schedule():
    for schedule, name in [
        (schedules.RandomSubset(0.5), "random-subset"),
        (schedules.RandomSubset(np.float64(1 / 3)), "random-subset:0.3333333333333333"),
        (schedules.Block(np.int64(2), 7), "block:2x7"),
    ]:
        assert schedule.name == get(name).name == name
        assert vars(get(name)) == vars(schedule)


BAD = {
    "luby:3": "choose one of: " + ", ".join(SCHEDULES),
    "random-subset:0.0009": "'0.0009' is no share of sites; give one from 0.001 to 1: random-subset:0.5",
    "random-subset:nan": "no share of sites",
    "random-subset:x": "no share of sites",
    "block:0x3": "'0x3' is no size of a tile; give rows x columns from 1x1 up: block:16x16",
    "block:3x4x5": "no size of a tile",
    "block:" + "1" * 10 + "x1": "no size of a tile",
}


def test_what_is_no_schedule_is_refused():
    for wrong in (None, object(), schedules.Luby, schedules.Partition()):
        with pytest.raises(TypeError, match="a schedule must be a name, or an object with name, tile, windows, indep"):
            get(wrong)
    for name, words in BAD.items():
        with pytest.raises(ValueError, match=words):
            get(name)


def test_a_package_brings_schedules_as_entry_points(monkeypatch):
    brought = dict.fromkeys(("mine", "luby"), "simdtex.schedules:Raster")
    brought |= {"nothing": "builtins:object", "gone": "no_such_package:Schedule"}

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
