"""The nearest candidate of each site: whatever is skipped, the reference's, which skips nothing."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl, problem, problems
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.ops import nearest as module
from simdtex.ops.leaves import FEATURES
from simdtex.ops.nearest import nearest

strengths = st.sampled_from([0.0, 0.5, 1.0, 7.0])
penalties = st.sampled_from([0.0, 0.1, 1.0])
FORMS = [
    {"vector": 1, "step": 1, "split": 64},  # a GPU's
    {"vector": 4, "step": 2, "split": 3},
    {"step": 8, "work_group": 3},
    {"split": 1000},
]


def run(machine, p, strength=1.0, dear=0.1):
    sites, field, offsets = p.on(machine)
    terms = (np.float32(1 / (1 + strength)), p.costs(machine, dear))
    candidates, strip = p.candidates(machine), p.strip(machine)
    return host(machine, nearest(machine, sites, field, offsets, p.grid, candidates, strip, *terms))


def apart(p, s):
    """What each candidate costs for its phases at the s-th site: whole numbers, which float32 adds exactly."""
    if not p.regular:
        return np.float32(0)
    waves, here, certain, free = p.phased(REFERENCE)
    at = here.reshape(4, -1)[:, p.sites[s], None].astype(np.float32)
    d = ((waves[:, : p.candidates(REFERENCE).size] - at) ** 2).sum(0) * certain**2
    return np.maximum(d - free, 0)


def misfit(p, s):
    """How far each candidate is from the data around the s-th site, datum by datum and rounded as `fma_sum` does."""
    found, data = p.candidates(REFERENCE), p.scattered(REFERENCE)
    if data is None:
        return np.float32(0)
    terms = [np.zeros(found.size, np.float32)]
    for k in range(data.begin[p.sites[s]], data.begin[p.sites[s] + 1]):
        for x, y in zip(data.values[k].tolist(), p.sample.working, strict=True):
            e = (x - y[found.positions[: found.size] + data.reach[k]].astype(np.float32)) * data.certain
            terms.append(e if x != UNKNOWN else 0 * e)
    return fma_sum(np.stack(terms, 1))


def of_kinds(p, s):
    """What each candidate costs the s-th site for its kinds."""
    kinds, found = p.kinds(REFERENCE), np.zeros(p.candidates(REFERENCE).size, np.float32)
    for of in kinds.candidates if kinds else []:
        found += kinds.sites.reshape(4, -1)[of[: found.size], p.sites[s]]
    return found


@given(problems(max_order=5), strengths, penalties)
@settings(max_examples=20)
def test_the_reference_is_the_nearest_of_the_rule_the_first_of_several(p, strength, dear):
    choice, values = run(REFERENCE, p, strength, dear)
    found, candidates = p.distances(REFERENCE, strength)
    for s in range(p.sites.size):
        column = found.distance[:, s] + p.penalty(dear)[: candidates.size] + apart(p, s) + misfit(p, s)
        column = (column + of_kinds(p, s)).tolist()
        assert choice[s] == candidates.positions[column.index(min(column))]
    assert np.array_equal(values, p.sample.working[:, choice])


@given(p=problems(max_order=18), strength=strengths, dear=penalties)
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, p, strength, dear):
    assert_same_bits(run(machine, p, strength, dear), run(REFERENCE, p, strength, dear))


@pytest.mark.parametrize("masked", [0.3, 0.9])
def test_places_that_may_not_be_taken_cost_infinity(machine, masked):
    """The list is of all places, then."""
    p = problem(3, order=8, channels=2, sample_shape=(26, 31), shape=(11, 9), edges="reflect", masked=masked)
    found = {}
    for m in (REFERENCE, machine):
        sites, field, offsets = p.on(m)
        terms = (np.float32(0.5), p.costs(m, 0.1, every=True))
        outcome = nearest(m, sites, field, offsets, p.grid, p.candidates(m, every=True), p.strip(m), *terms)
        found[m.name] = host(m, outcome)
    first, second = found.values()
    assert_same_bits(first, second)
    assert p.sample.inside.ravel()[first[0]].all()


@pytest.mark.parametrize(("channels", "dtype"), [(3, np.uint8), (2, np.uint16), (4, np.float32)])
def test_vectors_and_large_orders_have_the_references_bits(machine, channels, dtype):
    p = problem(
        2,
        order=50,
        channels=channels,
        dtype=dtype,
        sample_shape=(33, 31),
        shape=(20, 17),
        count=40,
        regular=True,
        between=True,
        soft=2,
    )
    assert_same_bits(run(machine, p), run(REFERENCE, p))


@pytest.mark.parametrize("phases", ["all", "decimated"])
@pytest.mark.parametrize("edges", ["whole", "reflect"])
def test_coarse_levels_have_the_references_bits(machine, phases, edges):
    p = problem(3, order=5, shape=(12, 13), spacing=2, edges=edges, phases=phases, sample_shape=(23, 22))
    assert_same_bits(run(machine, p), run(REFERENCE, p))


def flat(p, levels):
    """The problem with only so many grey levels, so that most distances have equals."""
    few = (p.sample.levels[0] // (256 // levels)).astype(np.uint16)
    p.sample._lay([few], p.sample.margin)
    return p._replace(field=p.field._replace(values=p.sample.working[:, p.field.source]))


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("temperatures", ["mixed", "zero", "one"])
def test_of_equals_it_is_the_first(machine, cl_device, levels, temperatures):
    p = flat(problem(4, order=2, sample_shape=(19, 24), shape=(10, 9), temperatures=temperatures), levels)
    for strength in (0.0, 1.0):
        theirs = run(REFERENCE, p, strength, dear=0.0)
        assert_same_bits(run(machine, p, strength, dear=0.0), theirs)
        assert_same_bits(run(opencl(cl_device, vector=1, split=7), p, strength, dear=0.0), theirs)


def test_what_is_skipped_is_counted(cl_device):
    p = problem(5, order=8, sample_shape=(40, 48), shape=(16, 16), temperatures="zero")
    machine = opencl(cl_device)
    before = machine.spared
    run(machine, p)
    candidates = p.candidates(REFERENCE).size
    fma = 2 * p.sites.size * candidates * len(p.offsets)
    spared = machine.spared - before
    assert fma // 4 < spared < fma
    assert spared % 8 == 0, "it is terms of two fma, and they are looked at by fours"
    assert REFERENCE.spared == 0


def test_nothing_is_skipped_where_nothing_is_known(cl_device):
    """Without a bound the first block is weighed whole."""
    p = problem(6, order=4, sample_shape=(9, 9), temperatures="one", edges="whole")
    p = p._replace(field=p.field._replace(source=np.zeros_like(p.field.source)))  # no candidate
    machine = opencl(cl_device, split=1)
    assert_same_bits(run(machine, p), run(REFERENCE, p))


@pytest.mark.parametrize("rank", [1, 4])
@pytest.mark.parametrize("options", FORMS[:2], ids=str)
def test_a_candidate_just_within_the_bound_is_found(cl_device, options, rank):
    """Sixteen values to a neighbourhood, so features are all of it.

    Every site's source is the second nearest, which is the bound; or the fifth, and the second becomes the bound.
    """
    p = problem(1, order=2, channels=2, sample_shape=(30, 31), shape=(12, 13), temperatures="zero")
    assert len(p.offsets) * 2 == FEATURES and p.strip(REFERENCE).leaves() is not None
    found, candidates = p.distances(REFERENCE)
    first, second, last = np.argsort(found.distance, 0, kind="stable")[[0, 1, rank]]
    near, bound = (np.take_along_axis(found.distance, which[None], 0)[0] for which in (first, second))
    assert np.count_nonzero((near < bound) & (near > 0.95 * bound)) > 10
    source = p.field.source.copy()
    source.ravel()[p.sites] = candidates.positions[last]
    p = p._replace(field=p.field._replace(source=source))
    choice, _ = run(opencl(cl_device, **options), p, 0.0, dear=0.0)
    assert_same_bits(choice, candidates.positions[first])


@pytest.mark.parametrize("order", [1, 8, 18, 50])
def test_the_order_in_which_neighbours_are_looked_at(order):
    offsets = neighbourhood_offsets(order)
    assert len(offsets) % module.CHECK == 0
    spread = module._spread(offsets.tobytes())
    assert sorted(spread) == list(range(len(offsets)))
    if order >= 8:
        first = offsets[spread[:4]]
        gaps = [abs(a - b).sum() for i, a in enumerate(first) for b in first[:i]]
        assert min(gaps) >= offsets.max(), "the first are far apart"


def fma_sum(e):
    total = np.zeros(len(e), np.float32)
    for column in e.T.astype(np.float64):
        total = (column * column + total).astype(np.float32)
    return total


def test_a_sum_in_another_order_keeps_within_the_slack():
    rng = np.random.default_rng(1)
    for terms in (4, 60, 640):
        e = rng.integers(-255 * 1024, 255 * 1024, (200, terms)).astype(np.float32) / np.float32(1024)
        sums = [fma_sum(e[:, order]) for order in (np.arange(terms), rng.permutation(terms), np.argsort(e[0]))]
        for a in sums:
            for b in sums:
                assert (a <= b * module.slack(terms)).all()
    assert module.slack(60) < 1 + 2.0**-15
