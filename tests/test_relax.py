"""The relaxation of a site: candidates that neighbours suggest, or all of them, weighed in one kernel or in several."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, host, opencl, problem, texture
from hypothesis import given, settings
from hypothesis import strategies as st

import simdtex
from simdtex.machine.opencl import OpenCL
from simdtex.ops import lcpdf
from simdtex.ops.commit import commit
from simdtex.ops.lcpdf import Choice
from simdtex.ops.relax import SUGGESTING, Everything, Listed, Relaxation, relax, relax_apart
from simdtex.ops.sites import coloring
from simdtex.schedules import Checked, Coloring


def proposal(machine, p, exhaustive=False, chance=4):
    """The coherent search's proposer; `exhaustive`: the exact one's."""
    if exhaustive:
        return Everything(p.candidates(machine, every=True), p.strip(machine))
    return Listed(p.candidates(machine), p.square(machine), len(p.offsets), chance)


def relaxation(machine, p, gibbs=False, noisy=False, coherence=1.0, level=0, dear=0.0, novelty=0.0, **options):
    window, _ = p.window(0.5)
    discount, choice = np.float32(1 / (1 + coherence)), Choice(gibbs, noisy, window)
    terms = (
        discount,
        np.float32(novelty * p.sample.variance),
        p.costs(machine, dear, options.get("exhaustive", False)),
    )
    proposed = proposal(machine, p, **options)
    return Relaxation(p.grid, machine.put(p.offsets), proposed, *terms, choice, -1024, 2**33 + 5, level, p.confidences)


def counter(machine, p):
    return machine.put(np.zeros(p.field.source.shape, np.int32))


def apart(machine, p, turn=3, **how):
    """What the problem's sites become, and how many candidates each weighed."""
    sites, field, _ = p.on(machine)
    weighed = counter(machine, p)
    relaxed, cooled = relax_apart(machine, sites, field, weighed, relaxation(machine, p, **how), turn)
    return host(machine, [relaxed.choice, relaxed.values, cooled, weighed])


def suggestions(p, site):
    """Sample positions that the nearest neighbours suggest, each once, in the neighbours' order."""
    i, j = site[0] // p.grid.spacing, site[1] // p.grid.spacing
    near = plain.neighbours(i, j, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
    found = []
    for (di, dj), r in list(zip(plain.offsets(p.order), near, strict=True))[:SUGGESTING]:
        if r is None or p.field.temperature[r[0] * p.grid.spacing, r[1] * p.grid.spacing] >= 1024:
            continue
        row, col = p.source()[r[0] * p.grid.spacing, r[1] * p.grid.spacing]
        position = (int(row) - di * p.grid.spacing, int(col) - dj * p.grid.spacing)
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
        phases=draw(st.sampled_from(["all", "decimated"])),
        count=24,
        regular=draw(st.booleans()),
        between=draw(st.booleans()),
        soft=draw(st.sampled_from([0, 1, 2])),
    )


FORMS = st.fixed_dictionaries(
    {
        "chance": st.sampled_from([0, 1, 4, 6]),
        "exhaustive": st.sampled_from([False, False, True]),
        "gibbs": st.booleans(),
        "noisy": st.booleans(),
        "coherence": st.sampled_from([0.0, 0.7, 3.0]),
        "dear": st.sampled_from([0.0, 1.0]),
        "novelty": st.sampled_from([0.0, 0.0, 2.0]),
    }
)


@given(p=reflecting(), form=FORMS)
@settings(max_examples=20)
def test_a_device_has_the_references_bits(machine, p, form):
    form = form | {"noisy": form["noisy"] and (form["gibbs"] or (form["exhaustive"] and not form["novelty"]))}
    if not form["exhaustive"]:  # a list knows no novelty
        form["novelty"] = 0.0
    assert_same_bits(apart(machine, p, **form), apart(REFERENCE, p, **form))


HOWS = [{"chance": 9}, {"gibbs": True}, {"exhaustive": True, "novelty": 2.0}, {"exhaustive": True, "gibbs": True}]
GIVEN = [
    {"nowhere": 0.3, "weight": 1.0},
    {"guides": 2, "channels": 2, "spacing": 2, "torus": False},
    {"guides": 1, "nowhere": 0.2, "weight": 1.0, "masked": 0.3},
    {"channels": 2, "regular": True, "between": True},
    {"guides": 1, "nowhere": 0.2, "between": True},
]
"""Hard data, guides, and a sample that may be used in part."""


@pytest.mark.parametrize("form", HOWS, ids=str)
@pytest.mark.parametrize("how", GIVEN, ids=str)
def test_a_device_has_the_references_bits_of_what_is_given(machine, monkeypatch, how, form):
    """In one kernel, and of all candidates in several."""
    p = problem(9, order=8, sample_shape=(11, 12), shape=(13, 17), edges="reflect", count=90, **how)
    expected = apart(REFERENCE, p, dear=0.3, **form)
    assert_same_bits(apart(machine, p, dear=0.3, **form), expected)
    if form.get("exhaustive"):
        monkeypatch.setattr("simdtex.ops.relax.KEPT", 10)
        form = form | {"novelty": 0.0}
        assert not relaxation(machine, p, **form).fused
        assert_same_bits(apart(machine, p, dear=0.3, **form), apart(REFERENCE, p, dear=0.3, **form))


@pytest.mark.parametrize("form", HOWS, ids=str)
def test_nothing_is_taken_that_may_not_be(form):
    p = problem(3, order=2, channels=2, edges="reflect", masked=0.5, shape=(12, 13))
    choice, *_ = apart(REFERENCE, p, dear=0.3, **form)
    assert p.sample.inside.ravel()[choice].all()


def test_a_wide_neighbourhood_takes_more_than_one_vector_a_row(machine):
    p = problem(6, order=66, shape=(19, 40), sample_shape=(20, 21), count=60, edges="reflect")
    assert_same_bits(apart(machine, p, gibbs=True), apart(REFERENCE, p, gibbs=True))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spacing", [1, 2])
def test_the_mode_is_the_nearest_of_what_is_suggested(seed, spacing):
    p = problem(seed, order=5, shape=(10, 11), spacing=spacing, edges="reflect", temperatures="mixed", channels=2)
    discount = 1 / (1 + 0.7)
    choice, values, cooled, weighed = apart(REFERENCE, p, chance=0, coherence=0.7)
    for s, site in enumerate(p.where()):
        found = suggestions(p, site)
        own = tuple(int(n) for n in p.source()[site])
        listed = found + [own] * (own in p.positions() and own not in found)
        t, here = p.temperature(), (p.order, spacing, p.grid.torus)
        d = [plain.distance(p.image(), t, site, p.padded(), position, *here) for position in listed]
        d = [a * (discount if position in found else 1) for a, position in zip(d, listed, strict=True)]
        assert weighed[site] == len(listed)
        best = listed.index(divmod(int(choice[s]), p.sample.cols))
        assert d[best] <= min(d) * (1 + 1e-5)
        assert_same_bits(values[:, s], p.sample.working[:, choice[s]])
        assert cooled[s] == plain.cooled(p.field.temperature, site, p.order, spacing, p.grid.torus, -1024)


def test_an_exhaustive_draw_has_the_probabilities_of_the_exact_one():
    p = problem(8, order=2, edges="reflect", sample_shape=(4, 5), temperatures="mixed", count=1)
    found, candidates = p.distances(REFERENCE, 1.0)
    window, _ = p.window(0.5)
    share = lcpdf.weights(found.distance, window.scale)[:, 0].astype(float)
    drawn = [int(apart(REFERENCE, p, turn, gibbs=True, exhaustive=True)[0][0]) for turn in range(700)]
    seen = np.array([drawn.count(int(position)) for position in candidates.positions[: candidates.size]])
    expected = share / share.sum() * len(drawn)
    often = expected > 5
    chi2 = ((seen - expected)[often] ** 2 / expected[often]).sum()
    assert often.sum() > 2
    assert chi2 < 3 * often.sum() + 10


@pytest.mark.parametrize("longest", [16, 2**17])
@pytest.mark.parametrize("how", [{}, {"exhaustive": True}, {"exhaustive": True, "gibbs": True}], ids=str)
def test_steps_in_place_are_step_after_step(machine, monkeypatch, longest, how):
    """In pieces, too, where a step has more sites than a launch may."""
    monkeypatch.setattr("simdtex.machine.opencl.LONGEST", longest)
    p = problem(11, order=4, shape=(20, 24), edges="reflect")
    colors = coloring(p.grid, p.order).ravel()
    sites = np.argsort(colors, kind="stable").astype(np.int32)
    bounds = np.concatenate([[0], np.cumsum(np.bincount(colors))])
    steps = np.stack([bounds[:-1], bounds[1:]], 1)[::-1]
    after = {}
    for m in (REFERENCE, machine):
        _, field, _ = p.on(m)
        weighed = counter(m, p)
        field = relax(m, m.put(sites), steps, field, weighed, relaxation(m, p, **how), 3)
        after[m.name] = host(m, [*field, weighed])
    first, second = after.values()
    assert_same_bits(first, second)

    _, field, _ = p.on(REFERENCE)
    weighed, rule = counter(REFERENCE, p), relaxation(REFERENCE, p, **how)
    for begin, end in steps:
        here = sites[begin:end]
        field = commit(REFERENCE, field, here, *relax_apart(REFERENCE, here, field, weighed, rule, 3))
    assert_same_bits(first, [*field, weighed])


def test_each_candidate_has_its_penalty():
    """The mode is the least of distance, discounted or not, and penalty."""
    p = problem(3, order=5, shape=(10, 11), edges="reflect", temperatures="mixed", channels=2)
    penalty, discount = p.penalty(), 1 / (1 + 0.7)
    _, candidates = p.distances(REFERENCE)
    numbers = {int(position): n for n, position in enumerate(candidates.positions[: candidates.size])}
    dear = cheap = 0
    choice, *_ = apart(REFERENCE, p, chance=0, coherence=0.7, dear=1.0)
    for s, site in enumerate(p.where()):
        found = suggestions(p, site)
        own = tuple(int(n) for n in p.source()[site])
        listed = found + [own] * (own in p.positions() and own not in found)
        t, here = p.temperature(), (p.order, 1, p.grid.torus)
        d = [plain.distance(p.image(), t, site, p.padded(), position, *here) for position in listed]
        d = [a * (discount if position in found else 1) for a, position in zip(d, listed, strict=True)]
        total = [a + penalty[numbers[r * p.sample.cols + c]] for a, (r, c) in zip(d, listed, strict=True)]
        best = listed.index(divmod(int(choice[s]), p.sample.cols))
        assert total[best] <= min(total) * (1 + 1e-5)
        dear += d[best] > min(d)
        cheap += d[best] == min(d)
    assert dear, "a penalty decides somewhere"
    assert cheap, "and somewhere does not"


def test_each_neighbour_that_is_continued_or_taken_again_costs():
    p = problem(4, order=4, shape=(10, 11), edges="reflect", sample_shape=(9, 10))
    cost = np.float32(2 * p.sample.variance)
    rule, sites = relaxation(REFERENCE, p, exhaustive=True, coherence=0.0), p.sites
    _, plainly = rule.proposal.weighed(sites, p.field, rule, 3)
    _, charged = rule.proposal.weighed(sites, p.field, rule._replace(novelty=cost), 3)
    most = 0
    for s, site in enumerate(p.where()):
        i, j = site
        costs = {position: [] for position in p.positions()}
        near = plain.neighbours(i, j, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
        for (di, dj), r in zip(plain.offsets(p.order), near, strict=True):
            if r is not None and p.field.temperature[r] < 1024:
                row, col = p.source()[r]
                costs.setdefault((int(row) - di, int(col) - dj), []).append(cost)
                costs.setdefault((int(row), int(col)), []).append(4 * cost)
        for n, position in enumerate(p.positions()):
            expected = plainly.distance[n, s]
            for each in costs[position]:
                expected = np.float32(expected + each)
            assert charged.distance[n, s] == expected
            most = max(most, len(costs[position]))
    assert most > 1


@pytest.mark.parametrize("dear", [0.0, 1.0])
@pytest.mark.parametrize("how", [{}, {"gibbs": True}, {"gibbs": True, "noisy": True}], ids=str)
def test_few_candidates_in_one_kernel_are_many_in_several(machine, monkeypatch, how, dear):
    """The exact search has the same bits in either form."""
    how = how | {"dear": dear}
    p = problem(14, order=8, channels=2, shape=(11, 13), edges="reflect", sample_shape=(9, 13))
    one = apart(machine, p, exhaustive=True, **how)
    monkeypatch.setattr("simdtex.ops.relax.KEPT", 10)
    assert not relaxation(machine, p, exhaustive=True, **how).fused
    assert_same_bits(apart(machine, p, exhaustive=True, **how), one)


def test_a_site_that_nothing_suggests_for_weighs_one_candidate_at_random():
    p = problem(12, order=2, temperatures="one", edges="whole", phases="all", sample_shape=(9, 9), shape=(12, 12))
    choice, _, _, weighed = apart(REFERENCE, p, chance=0)
    lonely = [s for s, site in enumerate(p.where()) if tuple(p.source()[site]) not in p.positions()]
    assert lonely
    assert all(weighed[p.where()[s]] == 1 for s in lonely)
    assert len({int(choice[s]) for s in lonely}) > 1


def run(device=None, **options):
    sample = texture((24, 23), seed=4)
    image, output = simdtex.synthesize(
        sample, (30, 26), search="coherent", rng=5, device=device, full_output=True, **options
    )
    levels = [{k: v for k, v in level.items() if k != "seconds"} for level in output.statistics["levels"]]
    return [image, output.source, output.temperature], levels


def test_a_schedule_that_is_watched_changes_no_bit(cl_device):
    """Which takes the sweeps step by step, and not in place."""
    machine = opencl(cl_device)
    ahead, apart_ = run(machine, order=8), run(machine, order=8, schedule=Checked(Coloring()))
    assert_same_bits(ahead[0], apart_[0])
    assert ahead[1] == apart_[1]


def test_a_partition_with_steps_of_its_own_takes_them(cl_device):
    class Reversed(Coloring):
        """Sites in the opposite order within a step, which changes nothing but goes through `step`."""

        steps = 0

        def step(self, setting, state, active):
            state, info = super().step(setting, state, active)
            here = [step.sites[::-1] for step in info.apart(setting.machine)]
            self.steps += len(here)
            ends = np.cumsum([sites.size for sites in here])
            steps = np.stack([ends - [sites.size for sites in here], ends], 1)
            return state, info._replace(sites=np.concatenate(here), steps=steps)

    own = Reversed()
    machine = opencl(cl_device)
    ours, levels = run(machine, order=8, schedule=own)
    assert own.steps == sum(level["steps"] for level in levels)
    assert_same_bits(ours, run(machine, order=8)[0])


def test_the_work_is_counted(cl_device):
    _, levels = run(OpenCL(cl_device), order=8, chance=2)
    for level in levels:
        assert 1 <= level["weighed"] <= (level["candidates"] if level is levels[0] else 15)
        channels = 2  # one of them the structure channel
        assert level["fma"] == round(2 * 24 * channels * level["weighed"] * level["relaxations"])
    assert levels[0]["weighed"] == levels[0]["candidates"], "the coarsest level is exact"
