"""The field of a level: its start, temperatures, active sites, the end of a step, and the picture that tiles see."""

from dataclasses import replace
from itertools import product

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, host, problem, problems, slow_but, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare
from test_relax import apart
from tolerances import SIGNIFICANCE

from simdtex import random
from simdtex.methods.mrf.commit import commit
from simdtex.methods.mrf.lcpdf import Relaxed
from simdtex.methods.mrf.neighbourhood import Field, near
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


@given(starts())
def test_the_reference_is_the_rule(case):
    sample, positions, shape, seed = case
    values, source, temperature = run(REFERENCE, *case)
    assert [a.dtype for a in (values, source, temperature)] == [np.uint16, np.int32, np.uint16]
    assert source.shape == temperature.shape == values.shape[1:] == shape
    assert (temperature == 1024).all()
    for site, p in enumerate(source.ravel().tolist()):
        lo, hi, *_ = random.draw4(seed, 0, 0, site, random.START)
        assert p == positions[((int(hi) << 32 | int(lo)) * len(positions)) >> 64]
        row, col = divmod(p, sample.cols)
        inside = (row - sample.margin, col - sample.margin)
        assert all(0 <= i < n for i, n in zip(inside, sample.levels[0].shape[1:], strict=True))
        assert values.reshape(sample.channels, -1)[:, site].tolist() == sample.levels[0][:, *inside].tolist()


@given(case=starts())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))


def test_every_pixel_is_as_likely():
    sample = Sample(texture((5, 4), 1), 8)
    positions = sample.places(np.zeros((1, 2), np.int32), 1).positions
    _, source, _ = run(REFERENCE, sample, positions, (100, 100), 11)
    assert chisquare(np.bincount(source.ravel(), minlength=20)).pvalue > SIGNIFICANCE


# -- The temperature after a relaxation, equation (13), in integers of 1/1024.

xis = st.sampled_from([-1, -100, -1024, -5000, -(2**20)])


def run_temperature(machine, p, xi):
    sites, field, offsets = p.on(machine)
    return machine.get(temperature(machine, sites, field, offsets, p.grid, xi))


def check_formula(p, xi):
    t = p.in_picture(p.field.temperature)
    formula = [plain.cooled(t, site, p.order, p.grid.step, p.grid.torus, xi) for site in p.where()]
    ours = run_temperature(REFERENCE, p, xi)
    assert ours.dtype == p.field.temperature.dtype
    assert ours.tolist() == formula


@given(problems(max_order=20), xis)
@settings(max_examples=60)
def test_the_reference_is_the_formula(p, xi):
    check_formula(p, xi)


@given(p=problems(max_order=20), xi=xis)
@settings(max_examples=25)
def test_a_device_has_the_references_bits_of_temperature(machine, p, xi):
    assert_same_bits(run_temperature(machine, p, xi), run_temperature(REFERENCE, p, xi))


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 7), (2, 3)])
def test_tiny_pictures(machine, shape, torus):
    p = problem(1, order=5, shape=shape, torus=torus)
    check_formula(p, -1)
    assert_same_bits(run_temperature(machine, p, -1), run_temperature(REFERENCE, p, -1))


def test_all_hot_cools_by_the_share_of_xi():
    p = problem(3, order=8, temperatures="one")
    assert set(run_temperature(REFERENCE, p, -1024).tolist()) == {(24 * 1024 - 1024) // 24}


def test_the_least_xi_cools_everything_in_the_end():
    """Rounding down makes progress certain: 1/1024 a sweep at least."""
    p = problem(4, order=2, temperatures="one")
    assert set(run_temperature(REFERENCE, p, -1).tolist()) == {1023}


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


def outcome(p):
    """What a relaxation of the problem's sites might have given."""
    rng = np.random.default_rng(p.sites.size)
    count, channels = p.sites.size, len(p.field.values)
    choice = rng.integers(0, p.sample.rows * p.sample.cols, count).astype(np.int32)
    values = rng.integers(0, 4096, (channels, count)).astype(np.uint16)
    return choice, values, rng.integers(0, 1025, count).astype(np.uint16)


def run_commit(machine, p):
    sites, field, _ = p.on(machine)
    choice, values, cooled = (machine.put(a) for a in outcome(p))
    return host(machine, commit(machine, field, sites, Relaxed(choice, values), cooled))


def check_formula_commit(p):
    choice, values, cooled = outcome(p)
    expected = [np.array(a) for a in p.field]
    for s, (row, col) in enumerate(divmod(int(site), p.grid.cols) for site in p.sites):
        for c in range(len(values)):
            expected[0][c, row, col] = values[c, s]
        expected[1][row, col], expected[2][row, col] = choice[s], cooled[s]
    assert_same_bits(run_commit(REFERENCE, p), expected)


@given(problems())
@settings(max_examples=40)
def test_the_reference_is_the_assignment(p):
    check_formula_commit(p)


@given(p=problems())
@settings(max_examples=25)
def test_a_device_has_the_references_bits_of_commit(machine, p):
    assert_same_bits(run_commit(machine, p), run_commit(REFERENCE, p))


def test_a_machine_never_writes_to_the_callers_arrays(machine):
    p = problem(3)
    before = [a.copy() for a in p.field]
    for m in (REFERENCE, machine):
        run_commit(m, p)
        assert_same_bits(list(p.field), before)


# -- The picture that tiles see of one another: the stack, the lattice that points into it, and who reads it.

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
    spacing, grid = p.grid.step, p.grid
    for s, (row, col) in enumerate(p.where()):
        i, j = row // spacing, col // spacing
        for k, r in enumerate(plain.neighbours(i, j, p.order, grid.rows, grid.cols, grid.torus)):
            if r is None:
                assert not confidence[k, 0, s]
                continue
            seen = now if tiles_of(grid, i, j) == tiles_of(grid, *r) else old
            assert confidence[k, 0, s] == 1 - seen.temperature[r] / 1024
            assert np.array_equal(values[k, :, s], seen.values[(slice(None), *r)])


@pytest.mark.parametrize(
    ("options", "exact"),
    slow_but([(one, n % 2 > 0) for n, one in enumerate(TILED)], product(TILED, (False, True))),
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
