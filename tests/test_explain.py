"""Why a site takes what it takes: an explanation is what the run does, by the equations."""

import re

import numpy as np
import pytest
from cases import texture
from skimage import data

import simdtex
from simdtex.model.guide import UNKNOWN

BRICK = data.brick()[:24, :24]
SHAPE = (18, 21)
HALF = np.full(SHAPE, np.nan, np.float32)
HALF[::5, ::4] = 100
GUIDE = (BRICK // 128, data.brick()[40:58, :21] // 128)
GAPS = np.where(np.arange(24) % 11 == 5, np.nan, texture((24, 24), dtype=np.float32))
RUNS = {
    "coherent": {},
    "exact": {"search": "exact"},
    "gibbs": {"relaxation": "gibbs"},
    "gibbs of a list": {"relaxation": "gibbs", "search": "coherent", "phases": "all"},
    "paper": {"preset": "paper"},
    "paper in colour": {"preset": "paper", "sample": texture((24, 24), 3), "channel_axis": -1},
    "open, block": {"boundary": "open", "schedule": "block:6x7"},
    "random": {"schedule": "random-scan", "search": "exact", "xi": -8.0, "free_sweeps": 1},
    "synchronous": {"schedule": "synchronous"},
    "guide": {"guide": GUIDE},
    "guide, exact": {"guide": GUIDE, "search": "exact", "coherence": 0},
    "data": {"known": HALF, "sample": BRICK.astype(np.float32)},
    "data, open, gibbs": {"known": HALF, "sample": BRICK.astype(np.float32), "relaxation": "gibbs", "boundary": "open"},
    "gaps": {"sample": GAPS, "search": "exact"},
    "several": {"sample": [BRICK, texture((20, 15))]},
    "lattice": {"lattice": "6,0,0,8", "search": "exact"},
}


def arguments(name):
    options = {"order": 5, "levels": 2, "free_sweeps": 2, "rng": 3} | RUNS[name]
    return (options.pop("sample", BRICK), SHAPE), options


def sweeps_of(name, device):
    """The run, and of every sweep of every level what it has left."""
    seen = {}

    def watch(progress):
        if progress.end_of_sweep:
            seen[progress.level, progress.sweep] = progress.source(), progress.temperature(), progress.image()

    given, options = arguments(name)
    made, output = simdtex.synthesize(*given, **options, device=device, callback=watch, full_output=True)
    return made, output, seen


@pytest.mark.parametrize("name", RUNS)
def test_what_is_taken_is_what_the_run_takes(name):
    _, output, seen = sweeps_of(name, "reference")
    given, options = arguments(name)
    rng = np.random.default_rng(5)
    for level in (1, 0):
        last = max(sweep for number, sweep in seen if number == level)
        for sweep in (1, last - 1, None):
            source, t, picture = seen[level, sweep or last]
            site = tuple(int(rng.integers(side) // 2 * 2 + 1) % side for side in t.shape)
            if (site[0] << level) % 5 == 0 and (site[1] << level) % 4 == 0:
                site = (site[0], site[1] - 1)  # which is no datum
            try:
                why = simdtex.explain(*given, site, level=level, sweep=sweep, **options, device="reference")
            except ValueError as error:
                assert "does not relax" in str(error) and sweep is not None
                assert sweep == 1 or t[site] == 0
                continue
            assert (why.level, why.sweep) == (level, sweep or why.sweep)
            source, t, picture = seen[level, why.sweep]
            np.testing.assert_array_equal(why.candidates.place[why.taken], source[site])
            assert why.cooled == t[site]
            if options.get("preset") == "paper":
                np.testing.assert_array_equal(why.values, np.ravel(picture[site]))
            consistent(why)
            if level == 0 and sweep is None:
                assert why.sweep == last or name == "random"  # which leaves some sites out of a sweep
                np.testing.assert_array_equal(why.candidates.place[why.taken], output.source[site])
                assert why.cooled == output.temperature[site]


def consistent(why):
    """The terms are those of the equations, by the neighbourhoods of the explanation."""
    near, found = why.neighbours, why.candidates
    guides = "guide" in found.costs
    x, y, u = (a.astype(np.float64) for a in (near.values, found.around, near.confidence))
    assert (u[near.values == UNKNOWN] == 0).all()
    d = (((x - y) * u) ** 2).sum(1)  # (12), by channels
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
        discounted = np.where(found.continues > 0, -whole / 3, 0)
        np.testing.assert_allclose(found.costs["coherence"], discounted, rtol=1e-4, atol=0.02)
    if len(found.rank) == why.weighed:
        assert found.probability.sum() == pytest.approx(1)
    if why.density is None:
        share = np.exp(-(found.total - found.total[0].astype(np.float64)) / (2 * why.bandwidth**2))
        np.testing.assert_allclose(found.probability / found.probability[0], share, rtol=1e-3, atol=1e-11)
        np.testing.assert_array_equal(found.values[why.taken, : len(why.values)], why.values)
    else:
        np.testing.assert_allclose(why.density.sum(1), 1)


@pytest.mark.parametrize("name", ["coherent", "exact", "gibbs", "paper", "guide"])
def test_a_device_is_explained_alike(machine, name):
    given, options = arguments(name)
    first, second = (simdtex.explain(*given, (5, 7), **options, device=device) for device in ("reference", machine))
    assert first.table() == second.table()
    np.testing.assert_array_equal(first.neighbours.values, second.neighbours.values)
    np.testing.assert_array_equal(first.candidates.total, second.candidates.total)


def test_the_progress_explains_the_next_relaxation(machine):
    """All sites of a synchronous step see the field as a sweep has left it."""
    rules = {"schedule": "synchronous", "search": "exact", "balance": 0, "levels": 2, "order": 4, "rng": 2}
    rules |= {"relaxation": "icm", "device": machine}
    said, took = {}, {}

    def watch(progress):
        if progress.end_of_sweep and progress.level == 0:
            took[progress.sweep] = progress.source()
            said[progress.sweep] = [progress.explain(row, col) for row, col in ((1, 1), (3, 7))]

    made = simdtex.synthesize(BRICK, (8, 9), **rules, callback=watch)
    compared = 0
    for sweep in set(said) & {number - 1 for number in took}:
        for why in said[sweep]:
            assert (why.level, why.sweep, why.drawn) == (0, sweep, False)
            if why.temperature > 0:  # a site at 0 is relaxed no more, but in free sweeps
                np.testing.assert_array_equal(why.candidates.place[why.taken], took[sweep + 1][why.site])
                compared += 1
    assert compared > 3
    np.testing.assert_array_equal(made, simdtex.synthesize(BRICK, (8, 9), **rules))  # asking changes nothing


@pytest.mark.parametrize("relaxation", ["gibbs", "icm"])
def test_a_density_is_the_lcpdf(relaxation):
    seen = []

    def watch(progress):
        if progress.end_of_sweep and progress.level == 0:
            seen.append((progress.image(), progress.temperature(), progress.explain(4, 5)))

    sample = texture((14, 15))  # with levels near 0 and 255
    options = {"preset": "paper", "relaxation": relaxation, "levels": 2, "order": 4, "edges": "whole"}
    simdtex.synthesize(sample, (10, 11), **options, rng=1, callback=watch, device="reference")
    assert len(seen) > 2
    for image, t, why in seen:
        expected = simdtex.lcpdf(image, sample, [(4, 5)], order=4, temperature=t, device="reference")
        np.testing.assert_allclose(why.density, expected, atol=1e-6)
        if relaxation == "icm":
            assert why.values == expected.argmax()
            assert "takes the mode, the grey level of greatest density" in why.reason


def test_a_list_continues_the_nearest_neighbours_alone():
    """Here candidates are in the list that continue the source of a neighbour farther away."""
    consistent(simdtex.explain(data.brick()[:32, :32], (32, 32), (5, 7), order=8, rng=1, device="reference"))


def test_novelty_is_a_term():
    why = simdtex.explain(BRICK, SHAPE, (3, 3), level=1, levels=2, order=4, rng=1, novelty=2, device="reference")
    assert why.drawn and "novelty" in why.candidates.costs
    consistent(why)


def test_what_cannot_be_explained():
    given = BRICK, SHAPE
    rules = {"order": 4, "levels": 2, "rng": 1, "device": "reference"}
    for site, told, words in [
        ((18, 0), {}, "not of the 18 x 21 sites of level 0"),
        ((9, 0), {"level": 1}, "not of the 9 x 11 sites of level 1"),
        ((0, 0), {"level": 2}, "levels of this run are 0 to 1"),
        ((0, 0), {"free_sweeps": 0}, "does not relax at level 0: it keeps its value"),
        ((0, 0), {"sweep": 1}, "does not relax at level 0, sweep 1"),
        ((0,), {}, "site must be"),
        (3, {}, "site must be two integers"),
        ((0, 0), {"sweep": 0}, "sweep is 0"),
        ((0, 0), {"level": -1}, "level is -1"),
    ]:
        with pytest.raises(ValueError, match=re.escape(words)):
            simdtex.explain(*given, site, **rules, **told)


def test_what_a_notebook_shows():
    given, options = arguments("paper")
    why = simdtex.explain(*given, (5, 7), **options, device="reference")
    lines = why.table().splitlines()
    assert repr(why) == f"<{lines[0]}>"
    assert lines[0].startswith(f"Site (5, 7) of level 0, sweep {why.sweep}, draws from the LCPDF")
    marked = [line for line in lines if line.startswith("*")]
    assert len(marked) == 1
    assert marked[0].split()[1] == str(why.candidates.rank[why.taken])
    html = why._repr_html_()
    assert html.count("<img") == 1 + len(lines) - 2
    widths = [float(one) for one in re.findall(r"width:([\d.e+-]+)%", html)]
    np.testing.assert_allclose(widths[0], 100 * why.candidates.probability[0], rtol=0.01)
    assert html.count("<figcaption>taken: ") == 1
