"""Why a site takes what it takes: an explanation is what the run does, by the equations."""

import re

import numpy as np
import pytest
from cases import REFERENCE, slow_but, texture
from runs import RUNS, SEED
from skimage import data

import simdtex
from simdtex.model.guide import UNKNOWN

BRICK = data.brick()[:24, :24]
EXPLAINED = ("more", "reduced", "more-gibbs", "density-colour", "block-exact", "labels", "known-open", "lattice-exact")
EXPLAINED += ("several", "novelty-exact")
"""Runs of the table: with every search and relaxation, several schedules, and every cost."""


def replayed(name, device=REFERENCE):
    """The replay of a run of the table, and its options."""
    given, options = RUNS[name].inputs()
    return simdtex.replay(*given, **options, rng=SEED, device=device), options


@pytest.mark.parametrize("name", EXPLAINED)
def test_what_is_taken_is_what_the_run_takes(reference, name):
    """As in the last sweep of the run itself, and as in the fields of the replay."""
    replay, options = replayed(name)
    (_, source, temperature, *_), _ = reference(name)
    rng, compared = np.random.default_rng(5), 0
    last = {one.level: (n, one.sweep) for n, one in enumerate(replay.sweeps)}
    for level, (n, final) in last.items():
        for back, sweep in ((final - 1, 1), (1, final - 1), (0, None)):
            if back >= final:  # a level of one sweep
                continue
            state = replay.at(n - max(0, back))
            site = tuple(int(rng.integers(side)) // 2 * 2 + 1 for side in state.temperature.shape)
            site = tuple(min(at, side - 1) for at, side in zip(site, state.temperature.shape, strict=True))
            try:
                why = replay.explain(site, level, sweep)
            except ValueError as error:
                assert "does not relax" in str(error)
                continue
            state = replay.at(n - final + why.sweep)
            np.testing.assert_array_equal(why.candidates.place[why.taken], state.source[site])
            assert (why.level, why.sweep, why.cooled) == (level, sweep or why.sweep, state.temperature[site])
            if options.get("preset") == "paper":
                np.testing.assert_array_equal(why.values, np.ravel(state.image[site]))
            consistent(why, options.get("coherence", 0.0 if "preset" in options else 0.5))
            if level == 0 and sweep is None:
                np.testing.assert_array_equal(why.candidates.place[why.taken], source[site])
                assert why.cooled == temperature[site]
            compared += 1
    assert compared >= 2


def consistent(why, coherence=0.5):
    """The terms are those of the equations, by the neighbourhoods of the explanation."""
    near, found = why.neighbours, why.candidates
    guides = "guide" in found.costs
    x, y, u = (a.astype(np.float64) for a in (near.values, found.around, near.confidence))
    assert (u[near.values == UNKNOWN] == 0).all()
    np.testing.assert_array_equal(why.terms, ((x - y) * u) ** 2)
    d = why.terms.sum(1)  # (12), by channels
    assert why.channels.count("guide") == guides * (d.shape[1] - len(why.values))
    assert (len(why.channels), why.totals.size) == (d.shape[1], why.weighed)
    np.testing.assert_array_equal(why.totals[found.rank], found.total)
    made = d.shape[1] - guides * (d.shape[1] - len(why.values))
    np.testing.assert_allclose(found.distance, d[:, :made].sum(1), rtol=1e-5)
    if guides:
        np.testing.assert_allclose(found.costs["guide"], d[:, made:].sum(1), rtol=1e-5, atol=0.01)
        assert (near.offsets[-1] == 0).all()
    np.testing.assert_allclose(found.distance + sum(found.costs.values()), found.total, rtol=1e-5)
    assert (np.diff(found.total) >= 0).all()
    assert found.rank[0] == 0
    assert why.drawn or found.rank[why.taken] == 0
    if "coherence" in found.costs:
        whole = found.distance + found.costs.get("guide", 0)
        discounted = np.where(found.continues > 0, -whole * coherence / (1 + coherence), 0)
        np.testing.assert_allclose(found.costs["coherence"], discounted, rtol=1e-4, atol=0.02)
    if len(found.rank) == why.weighed:
        assert found.probability.sum() == pytest.approx(1)
    if why.density is None:
        share = np.exp(-(found.total - found.total[0].astype(np.float64)) / (2 * why.bandwidth**2))
        np.testing.assert_allclose(found.probability / found.probability[0], share, rtol=1e-3, atol=1e-11)
        np.testing.assert_array_equal(found.values[why.taken, : len(why.values)], why.values)
    else:
        np.testing.assert_allclose(why.density.sum(1), 1)


@pytest.mark.parametrize("name", slow_but(["labels"], ["more-gibbs", "labels"]))
def test_a_device_is_explained_alike(machine, name):
    first, second = (replayed(name, device)[0].explain((2, 2)) for device in (REFERENCE, machine))
    assert first.table() == second.table()
    np.testing.assert_array_equal(first.neighbours.values, second.neighbours.values)
    np.testing.assert_array_equal(first.candidates.total, second.candidates.total)


def test_a_density_is_the_lcpdf():
    seen = []

    def watch(progress):
        if progress.stage and progress.level == 0:
            seen.append((progress.image(), progress.temperature(), progress.explain(4, 5)))

    sample = texture((14, 15))  # with levels near 0 and 255
    options = {"preset": "paper", "levels": 2, "order": 4, "pixel": "density"}
    made = simdtex.synthesize(sample, (10, 11), **options, rng=1, callback=watch, device="reference")
    assert len(seen) > 2
    np.testing.assert_array_equal(seen[-1][0], made)
    for image, t, why in seen:
        expected = simdtex.lcpdf(image, sample, [(4, 5)], order=4, temperature=t, device="reference")
        np.testing.assert_allclose(why.density, expected, atol=1e-6)
        assert why.values == expected.argmax()
        assert "takes the mode, the grey level of greatest density" in why.reason


def test_a_list_continues_the_nearest_neighbours_alone():
    """Here candidates are in the list that continue the source of a neighbour farther away."""
    consistent(simdtex.explain(data.brick()[:32, :32], (32, 32), (5, 7), order=8, rng=1, levels=2, device="reference"))


def test_what_cannot_be_explained():
    given, rules = (BRICK, (10, 11)), {"order": 2, "levels": 2, "rng": 1, "device": "reference"}
    with pytest.raises(ValueError, match="does not relax at level 0: it keeps its value"):
        simdtex.explain(*given, (0, 0), **rules, free_sweeps=0)
    replay = simdtex.replay(*given, **rules)
    for site, told, words in [
        ((10, 0), {}, "not of the 10 x 11 sites of level 0"),
        ((0, 0), {"level": 2}, "levels of this run are 0 to 1"),
        ((0, 0), {"sweep": 1}, "does not relax at level 0, sweep 1"),
    ]:
        with pytest.raises(ValueError, match=re.escape(words)):
            replay.explain(site, **told)
    for site, told, words in [
        ((0,), {}, "site must be"),
        (3, {}, "site must be two integers"),
        ((0, 0), {"sweep": 0}, "sweep is 0"),
        ((0, 0), {"level": -1}, "level is -1"),
    ]:
        with pytest.raises(ValueError, match=re.escape(words)):
            simdtex.explain(*given, site, **rules, **told)


def test_what_a_notebook_shows():
    given, options = RUNS["paper-density"].inputs()
    why = simdtex.explain(*given, (4, 5), **options, rng=SEED, device="reference")
    assert why.table() == replayed("paper-density")[0].explain((4, 5)).table()
    lines = why.table().splitlines()
    assert repr(why) == f"<{lines[0]}>"
    assert lines[0].startswith(f"Site (4, 5) of level 0, sweep {why.sweep}, draws from the LCPDF")
    marked = [line for line in lines if line.startswith("*")]
    assert len(marked) == 1
    assert marked[0].split()[1] == str(why.candidates.rank[why.taken])
    assert why._repr_html_().count("<img") == 1 + len(lines) - 2


EXACT = {
    **{"search": "exact", "levels": 2, "order": 2, "relaxation": "gibbs", "edges": "whole", "rng": 3},
    **{"balance": 0, "coherence": 0, "structure": 0, "novelty": 0, "device": REFERENCE},
}


@pytest.fixture(scope="module")
def exact():
    """The replay of an exact run whose candidates are whole neighbourhoods, at some moment before its end."""
    replay = simdtex.replay(BRICK, (12, 14), **EXACT)
    return replay, next(n for n, one in enumerate(replay.sweeps) if one.level == 0) + 1


@pytest.mark.parametrize("order", [1, 8])
def test_a_site_is_explained_with_another_order(exact, order):
    """The neighbours are those of the order in the field of the moment; the candidates those of a run of the order."""
    replay, n = exact
    own = replay.explain_pixel(5, 7, n)
    assert replay.explain_pixel(5, 7, n, order=2).table() == own.table()
    why = replay.explain_pixel(5, 7, n, order=order)
    consistent(why, 0)
    assert (why.level, why.sweep, why.temperature) == (own.level, own.sweep, own.temperature)
    near, squared = why.neighbours, (why.neighbours.offsets**2).sum(1)
    assert squared.max() <= order and len(squared) == {1: 4, 8: 24}[order]
    in_both = (own.neighbours.offsets[:, None] == near.offsets).all(2)
    assert in_both.any(1).all() == (order > 2)
    for k, m in np.argwhere(in_both):
        np.testing.assert_array_equal(own.neighbours.values[k], near.values[m])
        np.testing.assert_array_equal(own.neighbours.confidence[k], near.confidence[m])
    there = simdtex.replay(BRICK, (12, 14), **EXACT | {"order": order}).explain((5, 7))
    assert (why.weighed, why.bandwidth) == (there.weighed, there.bandwidth)


def test_a_site_is_explained_with_more_trust(exact):
    replay, n = exact
    own, half, certain = (replay.explain_pixel(5, 7, n, trust=trust) for trust in (0, 0.5, 1))
    assert own.table() == replay.explain_pixel(5, 7, n).table()
    t = 1 - own.neighbours.confidence
    assert (t > 0.1).any() and (certain.neighbours.confidence == 1).all()
    np.testing.assert_allclose(half.neighbours.confidence, 1 - t / 2, atol=1 / 1024)
    assert own.temperature == half.temperature == certain.temperature
    consistent(certain, 0)


def test_what_no_site_can_be_explained_with_is_refused(exact):
    replay, n = exact
    assert [replay.largest_order(level) for level in (0, 1)] == [8, 3]
    refused = {
        "order at level 0 is 9; give 8 or fewer": {"order": 9},
        "trust is 1.5; give at most 1": {"trust": 1.5},
    }
    for words, other in refused.items():
        with pytest.raises((ValueError, TypeError), match=re.escape(words)):
            replay.explain_pixel(5, 7, n, **other)
    listed = simdtex.replay(BRICK, (12, 14), **EXACT | {"search": "coherent"})
    assert listed.largest_order(0) == 0
    with pytest.raises(ValueError, match='give search="exact"'):
        listed.explain((5, 7), order=4)
    assert listed.explain((5, 7), trust=1).neighbours.confidence.min() == 1
    counted = simdtex.replay(BRICK, (12, 14), **EXACT | {"balance": 1})
    with pytest.raises(ValueError, match="give balance=0"):
        counted.explain((5, 7), order=4)
