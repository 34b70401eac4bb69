"""The field of a level: its start, temperatures, active sites, the end of a step, and the picture that tiles see."""

from dataclasses import replace
from itertools import product

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, host, problem, problems, slow_but, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from test_relax import apart

from simdtex import random
from simdtex.methods.mrf.commit import commit
from simdtex.methods.mrf.lcpdf import Relaxed
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.snapshot import TYPES, snapshot
from simdtex.methods.mrf.start import start
from simdtex.methods.mrf.temperature import temperature
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.sample import Sample
from simdtex.schedules import sites as sites_module
from simdtex.schedules.sites import among, stretches, survey

# -- The picture before the first level: pixels of the sample at random, all hot.


def run(machine, sample, positions, shape, seed):
    planes = machine.put(sample.working.astype(np.float32))
    return host(machine, start(machine, planes, machine.put(positions), Grid(shape), seed))


@st.composite
def starts(draw):
    side = st.integers(1, 9)
    channels, margin = draw(st.integers(1, 3)), draw(st.integers(0, 3))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32]))
    sample = Sample(texture((draw(side), draw(side)), channels, dtype, 1), 8, margin)
    positions = sample.places(np.zeros((1, 2), np.int32), 1).positions
    return sample, positions, (draw(side), draw(side)), draw(st.integers(0, 2**64 - 1))


@given(case=starts())
@settings(max_examples=40)
def test_a_start_is_drawn_from_the_sample(machine, case):
    sample, positions, shape, seed = case
    values, source, temperature = run(REFERENCE, *case)
    assert_same_bits(temperature, np.full(shape, 1024, np.uint16))
    for site, p in enumerate(source.ravel().tolist()):
        lo, hi, *_ = random.draw4(seed, 0, 0, site, random.START)
        assert p == positions[((int(hi) << 32 | int(lo)) * len(positions)) >> 64]
        inside = tuple(n - sample.margin for n in divmod(p, sample.cols))
        assert min(inside) >= 0
        assert values.reshape(sample.channels, -1)[:, site].tolist() == sample.levels[0][:, *inside].tolist()
    assert_same_bits(run(machine, *case), [values, source, temperature])


# -- The temperature after a relaxation, equation (13), in integers of 1/1024.

xis = st.sampled_from([-1, -100, -1024, -5000, -(2**20)])


def run_temperature(machine, p, xi):
    sites, field, offsets = p.on(machine)
    return machine.get(temperature(machine, sites, field, offsets, p.grid, xi))


@given(problems(max_order=20), xis)
@settings(max_examples=40)
def test_the_reference_is_the_formula(p, xi):
    t = p.in_picture(p.field.temperature)
    formula = [plain.cooled(t, site, p.order, p.grid.step, p.grid.torus, xi) for site in p.where()]
    assert_same_bits(run_temperature(REFERENCE, p, xi), np.array(formula, np.uint16))


@given(p=problems(max_order=20), xi=xis)
@settings(max_examples=25)
def test_a_device_has_the_references_bits_of_temperature(machine, p, xi):
    assert_same_bits(run_temperature(machine, p, xi), run_temperature(REFERENCE, p, xi))


# -- Which sites are active: counted and listed on the machine as NumPy counts and lists them.


@st.composite
def temperatures(draw):
    grid = Grid((draw(st.integers(1, 40)), draw(st.integers(1, 60))), draw(st.booleans()))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    share = draw(st.sampled_from([0.0, 0.02, 0.5, 1.0]))
    t = rng.integers(1, 1025, grid.shape) * (rng.random(grid.shape) < share)
    return grid, t.astype(np.uint16)


@given(case=temperatures())
@settings(max_examples=30)
def test_a_survey_counts_sites_and_heat(machine, case):
    grid, t = case
    expected = int((t > 0).sum()), int(t.sum())
    assert survey(REFERENCE, grid, t) == survey(machine, grid, machine.put(t)) == expected


@given(case=temperatures(), groups=st.integers(1, 9), chunk=st.sampled_from([1, 3, 256]))
@settings(max_examples=40)
def test_the_active_sites_of_a_list_stay_in_order_group_by_group(machine, case, groups, chunk):
    grid, t = case
    rng = np.random.default_rng(groups)
    sites = rng.permutation(np.arange(grid.size, dtype=np.int32))
    starts = np.concatenate([[0], np.sort(rng.integers(0, sites.size + 1, groups - 1)), [sites.size]])
    expected = [s[t.ravel()[s] > 0] for s in np.split(sites, starts[1:-1])]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sites_module, "CHUNK", chunk)
        begins, firsts = stretches(starts)
    for m in (REFERENCE, machine):
        kept, bounds = among(m, m.put(sites), m.put(begins), firsts, m.put(t))
        kept = np.asarray(m.get(kept))
        assert_same_bits(kept, np.concatenate(expected).astype(np.int32))
        for group, (begin, end) in zip(expected, np.stack([bounds[:-1], bounds[1:]], 1).tolist(), strict=True):
            assert_same_bits(kept[begin:end], group)


# -- The end of a step: relaxed sites go into the field, and nothing else changes.


@given(p=problems())
@settings(max_examples=25)
def test_a_commit_is_the_assignment(machine, p):
    rng, count = np.random.default_rng(p.sites.size), p.sites.size
    choice = rng.integers(0, p.sample.rows * p.sample.cols, count).astype(np.int32)
    values = rng.integers(0, 4096, (len(p.field.values), count)).astype(np.uint16)
    cooled, expected = rng.integers(0, 1025, count).astype(np.uint16), [np.array(a) for a in p.field]
    for plane, new in zip(expected, (values, choice, cooled), strict=True):
        plane.reshape(*plane.shape[:-2], -1)[..., p.sites] = new
    before = [a.copy() for a in p.field]
    for m in (REFERENCE, machine):
        sites, field, _ = p.on(m)
        relaxed = Relaxed(m.put(choice), m.put(values))
        assert_same_bits(host(m, commit(m, field, sites, relaxed, m.put(cooled))), expected)
        assert_same_bits(list(p.field), before)  # a machine never writes to the caller's arrays


# -- The picture that tiles see of one another: the stack, the lattice that points into it, and who reads it.


def picture(shape, dtype, seed=0):
    bounds = np.iinfo(dtype)
    return np.random.default_rng(seed).integers(bounds.min, bounds.max, shape, dtype, endpoint=True)


def stack(now, old):
    return np.concatenate([now, old], -2)


@pytest.mark.parametrize("shape", [(1, 1), (5, 4), (3, 5, 7)], ids=str)
def test_both_halves_of_a_stack_are_its_upper_half(machine, shape):
    for dtype, m in product(TYPES, (REFERENCE, machine)):
        now, old = picture(shape, dtype, 1), picture(shape, dtype, 2)
        given, once = m.put(stack(now, old)), m.put(now)
        twice = snapshot(m, once, shape[-2])
        for stacked in (twice, snapshot(m, given, shape[-2])):
            assert_same_bits(np.asarray(m.get(stacked)), stack(now, now))
        assert m is REFERENCE or (twice is not once and snapshot(m, given, shape[-2]) is given), "no second stack"
    assert not np.shares_memory(snapshot(REFERENCE, now, shape[-2]), now)


def tiles_of(grid, i, j):
    return i // grid.tile[0], j // grid.tile[1]


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("order", [1, 8])
@pytest.mark.parametrize(
    ("height", "width", "spacing", "tile"),
    [(7, 5, 1, (2, 4)), (9, 11, 2, (2, 3)), (1, 8, 1, (3, 3))],
    ids=str,
)
def test_exactly_the_neighbours_in_another_tile_are_read_elsewhere(height, width, spacing, tile, order, torus):
    grid = replace(Grid.of((height, width), spacing, torus), tile=tile)
    sites, offsets = np.arange(grid.size, dtype=np.int32), neighbourhood_offsets(order)
    found = grid.neighbours(sites, offsets)
    bare = replace(grid, tile=None).neighbours(sites, offsets)
    assert found.dtype == np.int32
    other = 0
    for s in sites.tolist():
        i, j = divmod(s, grid.cols)
        for k, r in enumerate(plain.neighbours(i, j, order, grid.rows, grid.cols, torus)):
            expected = -1
            if r is not None:
                apart = tiles_of(grid, *r) != tiles_of(grid, i, j)
                expected = r[0] * grid.cols + r[1] + (grid.size if apart else 0)
                other += apart
            assert found[k, s] == expected
    assert other, "some neighbour is in another tile"
    assert np.array_equal(np.where(found >= grid.size, found - grid.size, found), bare)


def tiled(seed, tile, **options):
    """A problem whose field stands on an older one; and that older field."""
    p, older = problem(seed, **options), problem(seed + 1000, **options).field
    field = Field(*(stack(now, old) for now, old in zip(p.field, older, strict=True)))
    return p._replace(field=field, grid=replace(p.grid, tile=tile)), p.field, older


TILED = [
    {"tile": (4, 4), "torus": False, "order": 5},
    {"tile": (2, 2), "spacing": 2, "shape": (13, 11), "channels": 2, "edges": "reflect"},
    {"tile": (50, 50), "channels": 3},
]


@pytest.mark.parametrize(
    ("options", "exact"),
    slow_but([(TILED[0], False), (TILED[1], True)], product(TILED, (False, True))),
    ids=str,
)
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
