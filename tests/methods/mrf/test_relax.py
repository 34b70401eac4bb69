"""The relaxation of a site: candidates that neighbours suggest, or all of them, and the choice among them."""

import numpy as np
import plain
import pyopencl as cl
import pytest
from cases import REFERENCE, assert_same_bits, colors_of, host, opencl, problem, slow_but
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.machine.opencl import OpenCL
from simdtex.methods.mrf.commit import commit
from simdtex.methods.mrf.relax import SUGGESTING, relax, relax_out_of_place


def counter(machine, p):
    return machine.put(np.zeros(p.field.source.shape, np.int32))


def apart(machine, p, turn=3, **how):
    """What the problem's sites become, and how many candidates each has evaluated."""
    sites, field, _ = p.on(machine)
    evaluations = counter(machine, p)
    relaxed, cooled = relax_out_of_place(machine, sites, field, evaluations, p.relaxation(machine, **how), turn)
    return host(machine, [relaxed.choice, relaxed.values, cooled, evaluations])


def suggestions(p, site):
    """Sample positions that the nearest neighbours suggest, each once, in the neighbours' order."""
    i, j = site[0] // p.grid.step, site[1] // p.grid.step
    near = plain.neighbours(i, j, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
    found = []
    for (di, dj), r in list(zip(plain.offsets(p.order), near, strict=True))[:SUGGESTING]:
        if r is None or p.field.temperature[r] >= 1024:
            continue
        row, col = divmod(int(p.field.source[r]), p.sample.cols)
        position = (row - di * p.grid.step, col - dj * p.grid.step)
        if position in p.positions() and position not in found:
            found.append(position)
    return found


@st.composite
def reflecting(draw):
    """Problems whose sources lie inside the sample, as those of a run do."""
    return problem(
        draw(st.integers(0, 2**16)),
        order=draw(st.sampled_from([2, 8])),  # each is a program of its own, as are channels
        channels=draw(st.sampled_from([1, 3])),
        sample_shape=(draw(st.integers(5, 12)), draw(st.integers(5, 12))),
        shape=(draw(st.integers(1, 12)), draw(st.sampled_from([1, 5, 12, 31]))),
        spacing=draw(st.sampled_from([1, 2, 4])),
        torus=draw(st.booleans()),
        dtype=draw(st.sampled_from([np.uint8, np.uint16, np.float32])),
        temperatures=draw(st.sampled_from(["mixed", "zero", "one"])),
        edges="reflect",
        phases=draw(st.sampled_from([64, 2, 1])),
        count=24,
        regular=draw(st.booleans()),
        between=draw(st.booleans()),
        soft=draw(st.sampled_from([0, 1, 2])),
    )


FORMS = st.fixed_dictionaries(
    {
        "chance": st.sampled_from([0, 1, 4, 6]),
        "exact": st.sampled_from([False, False, True]),
        "gibbs": st.booleans(),
        "density": st.booleans(),
        "coherence": st.sampled_from([0.0, 0.7, 3.0]),
        "dear": st.sampled_from([0.0, 1.0]),
        "novelty": st.sampled_from([0.0, 0.0, 2.0]),
    }
)


@given(p=reflecting(), form=FORMS)
@settings(max_examples=8)
def test_a_device_has_the_references_bits(machine, p, form):
    form["density"] &= form["gibbs"] or (form["exact"] and not form["novelty"])
    assert_same_bits(apart(machine, p, **form), apart(REFERENCE, p, **form))


HOWS = [
    *({"chance": 9}, {"gibbs": True}, {"chance": 40, "novelty": 2.0}),
    *({"exact": True, "novelty": 2.0}, {"exact": True, "gibbs": True}),
]
GIVEN = [
    {"nowhere": 0.3, "weight": 1.0},
    {"guides": 2, "channels": 2, "spacing": 2, "torus": False},
    {"guides": 1, "nowhere": 0.2, "weight": 1.0, "masked": 0.3},
    {"channels": 2, "regular": True, "between": True},
    {"guides": 1, "nowhere": 0.2, "between": True},
]
"""Hard data, guides, and a sample that may be used in part."""


@pytest.mark.parametrize("case", slow_but((0, 4), range(5)))
def test_a_device_and_a_group_have_the_references_bits_of_what_is_given(machine, cl_device, case):
    how, form = GIVEN[case], HOWS[case]
    p = problem(9, order=8, sample_shape=(11, 12), shape=(13, 17), edges="reflect", count=90, **how)
    expected = apart(REFERENCE, p, dear=0.3, **form)
    for m in (machine, opencl(cl_device, items=48)):
        assert_same_bits(apart(m, p, dear=0.3, **form), expected)


def test_a_group_that_does_not_fit_local_memory_is_one_item(cl_device, monkeypatch):
    p, machine, seen = problem(1, order=2, count=9), OpenCL(cl_device, items=32), []
    kernel = machine.kernel

    def noted(function, defines):
        seen.append((defines.get("ITEMS", 1), kernel(function, defines)))
        return seen[-1][1]

    monkeypatch.setattr(machine, "kernel", noted)
    expected = apart(REFERENCE, p, exact=True)
    assert_same_bits(apart(machine, p, exact=True), expected)
    takes = seen[0][1].get_work_group_info(cl.kernel_work_group_info.LOCAL_MEM_SIZE, cl_device.handle)
    monkeypatch.setattr(machine, "local_memory", takes - 1)
    assert_same_bits(apart(machine, p, exact=True), expected)
    assert [items for items, _ in seen] == [32, 1]


def test_a_wide_neighbourhood_takes_more_than_one_vector_a_row(machine):
    p = problem(6, order=66, shape=(19, 40), sample_shape=(20, 21), count=60, edges="reflect")
    assert_same_bits(apart(machine, p, gibbs=True), apart(REFERENCE, p, gibbs=True))


@pytest.mark.parametrize(("longest", "how"), [(16, {}), (2**17, {"exact": True, "gibbs": True})], ids=str)
def test_steps_in_place_are_step_after_step(machine, monkeypatch, longest, how):
    """In pieces, too, where a step has more sites than a launch may."""
    monkeypatch.setattr("simdtex.machine.opencl.LONGEST", longest)
    p = problem(11, order=4, shape=(20, 24), edges="reflect")
    colors = colors_of(p.grid, p.order).ravel()
    sites = np.argsort(colors, kind="stable").astype(np.int32)
    bounds = np.concatenate([[0], np.cumsum(np.bincount(colors))])
    steps = np.stack([bounds[:-1], bounds[1:]], 1)[::-1]
    after = {}
    for m in (REFERENCE, machine):
        _, field, _ = p.on(m)
        evaluations = counter(m, p)
        field = relax(m, m.put(sites), steps, field, evaluations, p.relaxation(m, **how), 3)
        after[m.name] = host(m, [*field, evaluations])
    first, second = after.values()
    assert_same_bits(first, second)

    _, field, _ = p.on(REFERENCE)
    evaluations, rule = counter(REFERENCE, p), p.relaxation(REFERENCE, **how)
    for begin, end in steps:
        here = sites[begin:end]
        field = commit(REFERENCE, field, here, *relax_out_of_place(REFERENCE, here, field, evaluations, rule, 3))
    assert_same_bits(first, [*field, evaluations])


@pytest.mark.parametrize(("spacing", "dear"), [(1, 1.0), (2, 0.0)])
def test_the_mode_is_the_least_of_distance_discounted_or_not_and_penalty(spacing, dear):
    p = problem(3, order=5, shape=(10, 11), spacing=spacing, edges="reflect", temperatures="mixed", channels=2)
    penalty, discount, decides = p.penalty(dear), 1 / (1 + 0.7), 0
    numbers = {position: n for n, position in enumerate(p.positions())}
    choice, values, cooled, evaluations = apart(REFERENCE, p, chance=0, coherence=0.7, dear=dear)
    for s, site in enumerate(p.where()):
        found = suggestions(p, site)
        own = tuple(int(n) for n in p.source()[site])
        listed = found + [own] * (own in numbers and own not in found)
        t, here = p.temperature(), (p.order, spacing, p.grid.torus)
        d = [plain.distance(p.image(), t, site, p.padded(), position, *here) for position in listed]
        d = [a * (discount if position in found else 1) for a, position in zip(d, listed, strict=True)]
        total = [a + penalty[numbers[position]] for a, position in zip(d, listed, strict=True)]
        assert p.in_picture(evaluations)[site] == len(listed)
        best = listed.index(divmod(int(choice[s]), p.sample.cols))
        assert total[best] <= min(total) * (1 + 1e-5)
        assert_same_bits(values[:, s], p.sample.working[:, choice[s]])
        assert cooled[s] == plain.cooled(p.in_picture(p.field.temperature), site, p.order, spacing, p.grid.torus, -1024)
        decides += d[best] > min(d)
    assert bool(decides) == bool(dear), "a penalty decides somewhere"


def test_each_neighbour_that_is_continued_or_taken_again_costs():
    p = problem(4, order=4, shape=(10, 11), edges="reflect", sample_shape=(9, 10))
    plainly, charged, cost = p.cost(), p.cost(novelty=2.0), np.float32(2 * p.sample.variance)
    most = 0
    for s, site in enumerate(p.where()):
        i, j = site
        times = dict.fromkeys(p.positions(), 0)
        near = plain.neighbours(i, j, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
        for (di, dj), r in zip(plain.offsets(p.order), near, strict=True):
            if r is not None and p.field.temperature[r] < 1024:
                row, col = p.source()[r]
                for position, often in (((int(row) - di, int(col) - dj), 1), ((int(row), int(col)), 4)):
                    times[position] = times.get(position, 0) + often
        for n, position in enumerate(p.positions()):
            assert charged[n, s] == plainly[n, s] + cost * np.float32(times[position])
            most = max(most, times[position])
    assert most > 5


SKIPPING = [
    ({"order": 5, "spacing": 2, "edges": "whole", "phases": 64, "sample_shape": (23, 22)}, {}),
    ({"order": 5, "spacing": 4, "edges": "reflect", "phases": 64, "sample_shape": (23, 3)}, {"vector": 4, "step": 1}),
    ({"order": 5, "spacing": 2, "edges": "reflect", "sample_shape": (41, 82)}, {"items": 48, "step": 2}),
    ({"order": 50, "channels": 3, "sample_shape": (33, 31), "regular": True, "between": True, "soft": 2}, {}),
    ({"order": 8, "sample_shape": (26, 31), "edges": "reflect", "masked": 0.9}, {"vector": 1, "step": 8}),
]
"""Problems with runs of candidates, short runs, decimated or masked samples; and forms of a launch."""


@pytest.mark.parametrize(("how", "options"), slow_but((SKIPPING[0], SKIPPING[4]), SKIPPING), ids=str)
def test_the_exact_search_skips_nothing_that_the_reference_takes(cl_device, how, options):
    p = problem(2, shape=(12, 13), count=24, **{"phases": 1} | how)
    for gibbs in (False, True):
        form = {"exact": True, "dear": 0.1, "gibbs": gibbs}
        assert_same_bits(apart(opencl(cl_device, **options), p, **form), apart(REFERENCE, p, **form))


def flat(p, levels):
    """The problem with only so many grey levels, so that most distances have equals."""
    few = (p.sample.levels[0] // (256 // levels)).astype(np.uint16)
    p.sample._lay([few], p.sample.margin)
    return p._replace(field=p.field._replace(values=p.sample.working[:, p.field.source]))


@pytest.mark.parametrize(
    ("levels", "temperatures", "coherence"), [(1, "one", 0.0), (2, "mixed", 1.0), (3, "zero", 0.0)]
)
def test_icm_takes_the_first_of_the_least_costs(machine, levels, temperatures, coherence):
    p = flat(problem(4, order=2, sample_shape=(19, 24), shape=(10, 9), temperatures=temperatures), levels)
    found, cost = p.candidates(REFERENCE), p.cost(coherence=coherence)
    for m in (REFERENCE, machine):
        choice, values, *_ = apart(m, p, exact=True, coherence=coherence)
        assert_same_bits(choice, found.positions[cost.argmin(0)])
        assert_same_bits(values, p.sample.working[:, choice])


@pytest.mark.parametrize("rank", [1, 4])
def test_a_candidate_just_within_the_bound_is_found(machine, rank):
    """Every site's source is the second nearest, which is the bound; or the fifth, and the second becomes the bound."""
    p = problem(1, order=2, channels=2, sample_shape=(30, 31), shape=(12, 13), temperatures="zero")
    cost, candidates = p.cost(), p.candidates(REFERENCE)
    first, second, last = np.argsort(cost, 0, kind="stable")[[0, 1, rank]]
    near, bound = (np.take_along_axis(cost, which[None], 0)[0] for which in (first, second))
    assert np.count_nonzero((near < bound) & (near > 0.95 * bound)) > 10
    source = p.field.source.copy()
    source.ravel()[p.sites] = candidates.positions[last]
    p = p._replace(field=p.field._replace(source=source))
    assert_same_bits(apart(machine, p, exact=True, coherence=0.0)[0], candidates.positions[first])


def test_a_site_that_nothing_suggests_for_evaluates_one_candidate_at_random():
    p = problem(12, order=2, temperatures="one", edges="whole", phases=64, sample_shape=(9, 9), shape=(12, 12))
    choice, _, _, evaluations = apart(REFERENCE, p, chance=0)
    lonely = [s for s, site in enumerate(p.where()) if tuple(p.source()[site]) not in p.positions()]
    assert lonely
    assert all(evaluations[p.where()[s]] == 1 for s in lonely)
    assert len({int(choice[s]) for s in lonely}) > 1


def test_more_candidates_are_drawn_than_there_are(machine):
    p = problem(4, order=8, sample_shape=(9, 8), shape=(7, 9), edges="reflect", count=40)
    ours, theirs = (apart(m, p, chance=300) for m in (machine, REFERENCE))
    assert_same_bits(ours, theirs)
    assert 64 < ours[-1].max() < 300, "more proposals than candidates, which a list of those would not hold"
