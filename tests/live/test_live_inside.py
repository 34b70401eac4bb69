"""A look inside a result of the live page: moments of its run, why pixels have their values, and films."""

import json

import numpy as np
import pytest
from live import Fake, asked, texture

import simdtex
from simdtex.live.job import Picture, paint
from simdtex.live.results import BARS, FILM_FRAMES, SET_COLOURS
from simdtex.live.session import FILMED

SAMPLE = texture(24, 28)
RULES = {"order": 2, "channel_axis": -1, "device": "reference"}
EXACT = {"order": 2, "search": "exact", "levels": 2, "balance": 0, "relaxation": "gibbs"}
WHOLE = {"kind": "view", "left": 0, "top": 0, "width": 28, "height": 24, "step": 1}


def opened(*picture):
    page = Fake(Picture(*picture))
    yield page
    page.session.close(10)


@pytest.fixture
def page():
    yield from opened("t.png", SAMPLE, -1)


def inside(page, **message):
    return page.ask("inside", kind="inside", open=True, **message)[0]["panes"]


def frame(page, after, pane=0, **values):
    message, (data,) = page.wait("frame", after=after, pane=pane, **values)
    return message, np.frombuffer(data, np.uint8).reshape(message["height"], message["width"], 4)[..., :3]


def seek(page, *place):
    """Seek a level, sweep and set, none for the result; the moments, and the place of the answer among the messages."""
    answer = page.ask("moments", kind="seek", **dict(zip(("level", "sweep", "sets"), place, strict=False)))[0]
    return answer["moments"], max(n for n, (message, _) in enumerate(page.got) if message["kind"] == "moments")


def test_moments_are_those_of_the_run(page):
    page.result(width=20, height=18)
    (pane,) = inside(page)
    replay = simdtex.replay(SAMPLE, (18, 20), rng=7, **RULES)
    assert (pane["result"], pane["moment"]) == (1, None)
    assert pane["sweeps"] == [list(one) for one in replay.sweeps]
    for layer in ("picture", "temperature", "sets"):
        page.say(**WHOLE, layer=layer)
        for n in (0, len(replay.sweeps) - 1):
            level, sweep, *_ = replay.sweeps[n]
            moments, after = seek(page, level, sweep, 1)
            assert moments == [(n, 1)]
            message, seen = frame(page, after, layer=layer)
            now = replay.at(n, 1)
            assert (message["rows"], message["cols"]) == (18, 20)
            at = np.ix_(np.arange(18) // 2**level, np.arange(20) // 2**level)
            if layer == "picture":
                np.testing.assert_array_equal(seen, now.image[at])
            if layer == "sets":
                np.testing.assert_array_equal((seen == SET_COLOURS[2]).all(-1), now.relaxed[at] == 2)
    assert seek(page, 99, 99, 10**6)[0][0][0] < len(replay.sweeps)
    moments, _ = seek(page)
    assert moments == [None]
    page.say(**WHOLE, layer="picture")
    np.testing.assert_array_equal(frame(page, seek(page)[1], layer="picture")[1], page.latest.image)


def test_a_pixel_is_explained_as_in_python(page):
    page.result(width=20, height=18)
    inside(page)
    why, _ = page.ask("explained", kind="explain", row=5, col=7)
    assert json.loads(json.dumps(why, allow_nan=False)) == json.loads(json.dumps(why))
    expected = simdtex.explain(SAMPLE, (18, 20), (5, 7), rng=7, **RULES)
    assert (why["pixel"], why["reason"]) == ([5, 7], expected.reason)
    taken = next(one for one in why["candidates"] if one["taken"])
    assert taken["place"] == expected.candidates.place[expected.taken].tolist()
    assert taken["costs"]["total"] == expected.candidates.total[expected.taken]
    np.testing.assert_array_equal(taken["pixels"], expected.candidates.pixels[expected.taken])
    np.testing.assert_array_equal(why["pixels"], expected.neighbours.pixels)
    assert list(why["channels"]) == ["picture"] * 3 + ["structure"]
    for one, n in zip(why["candidates"], expected.shown(), strict=True):  # what is shown adds up to the distance
        terms = ((np.array(why["levels"]) - one["values"][1:]) * why["trust"]) ** 2
        assert terms.sum() == pytest.approx(expected.candidates.distance[n], rel=1e-3, abs=1)
    assert len(why["totals"]) == expected.weighed and why["totals"][0] == pytest.approx(expected.totals[0], abs=0.1)
    seek(page, 9, 1, 0)
    assert "has not relaxed yet" in page.ask("explained", kind="explain", row=5, col=7)[0]["reason"]
    for row, words in [(18, "give 17 or fewer"), (-1, "give 0 or more"), ("x", "the row of the pixel")]:
        assert words in str(page.ask(("explained", "error"), kind="explain", row=row, col=0)[0])


def test_a_pixel_is_explained_with_another_order_and_more_trust(page):
    page.result(width=12, height=10, options=EXACT, part=[0, 0, 16, 16])
    answer, (small,) = page.ask("inside", kind="inside", open=True)
    (pane,) = answer["panes"]
    sample = np.frombuffer(small, np.uint8).reshape(*pane["preview"], 4)[..., :3]
    np.testing.assert_array_equal(sample, SAMPLE[:16, :16], "the sample is that of the run")
    (level, sweep, sets, *_) = pane["sweeps"][-2]
    seek(page, level, sweep, sets)
    replay = simdtex.replay(SAMPLE[:16, :16], (10, 12), rng=7, **RULES | EXACT)
    for other in ({}, {"order": 4}, {"order": 1, "trust": 0.5}):
        shown, _ = page.ask("explained", kind="explain", row=5, col=7, **other)
        why = replay.explain_pixel(5, 7, -2, sets, **other)
        assert (shown["order"], shown["orders"]) == (other.get("order", 2), replay.largest_order(level))
        assert shown["reason"] == why.reason
        assert shown["offsets"] == why.neighbours.offsets.tolist()
        np.testing.assert_allclose(shown["trust"], why.neighbours.confidence, atol=1e-4)
        np.testing.assert_allclose(shown["totals"], why.totals[: len(shown["totals"])], atol=0.1)
    assert "trust is 2" in page.ask("explained", kind="explain", row=5, col=7, trust=2)[0]["reason"]
    assert "order at level 0 must be an integer" in page.error(kind="explain", row=5, col=7, order="x")


@pytest.mark.slow
def test_films_of_four_schedules_are_made_while_nothing_else_is_asked(page):
    page.say(**asked(width=7, height=8, options=EXACT | {"levels": 1}, part=[0, 0, 12, 12]) | {"kind": "schedules"})
    page.result(width=7, height=8)
    films = {name: page.wait("schedule", name=name) for name in FILMED}
    kinds = [kind for kind in page.kinds() if kind in ("result", "schedule")]
    assert kinds.index("result") < len(FILMED), "another request comes before the next film"
    for name, (counted, pictures) in films.items():
        replay = simdtex.replay(SAMPLE[:12, :12], (8, 7), rng=7, **RULES | EXACT | {"levels": 1}, schedule=name)
        assert (counted["width"], counted["height"]) == (7, 8)
        assert (counted["steps"], counted["sweeps"]) == (replay.sweeps[0].sets, len(replay.sweeps))
        assert (counted["together"] == 0) == (name in ("coloring", "raster"))
        end = np.frombuffer(pictures[-1], np.uint8).reshape(8, 7, 4)[..., :3]
        np.testing.assert_array_equal(end, replay.at(-1).image, "the last picture is the result")
        seen = np.frombuffer(pictures[0], np.uint8).reshape(8, 7, 4)
        assert (seen[replay.at(0, 1).relaxed == 2, 0] >= 178).all(), "the sites of the first set are magenta"
        assert len(pictures) <= FILM_FRAMES + 1
    assert films["synchronous"][0]["together"] == 1


def test_what_no_film_is_made_of(page):
    run = asked(options=EXACT) | {"kind": "schedules"}
    assert "at most 64 x 64" in page.error(**run | {"width": 80})
    assert "no control for 'schedule'" in page.error(**run | {"job": "extend"})


def test_a_density_has_few_bars(page):
    options = {"pixel": "density", "relaxation": "gibbs", "structure": 0, "levels": 1}
    page.result(width=10, height=9, options=options, part=[0, 0, 12, 12])
    inside(page)
    density = page.ask("explained", kind="explain", row=5, col=7)[0]["density"]
    assert np.shape(density["bars"]) == (3, BARS) and len(density["starts"]) == BARS
    np.testing.assert_allclose(np.sum(density["bars"], 1), 1)


def test_two_results_side_by_side(page):
    page.result(width=20, height=18)
    page.result(width=20, height=18, options={"schedule": "synchronous"})
    first, second = inside(page, beside=1)
    assert (first["result"], second["result"]) == (2, 1)
    page.say(**WHOLE, layer="picture")
    moments, after = seek(page, *first["sweeps"][-1][:3])
    assert [len(moment) for moment in moments] == [2, 2]
    assert {frame(page, after, pane)[0]["of"] for pane in (0, 1)} == {1, 2}
    page.say(kind="explain", row=3, col=4)
    assert page.wait("explained", pane=1, after=after)[0]["pixel"] == [3, 4]


def test_what_cannot_be_looked_into(page):
    assert "no result" in page.error(kind="inside", open=True)
    page.result(width=20, height=18, method="pyramid", options={"iterations": 0})
    assert 'method "Markov random field"' in page.error(kind="inside", open=True)
    page.result(job="extend")
    inside(page)
    assert page.ask("explained", kind="explain", row=0, col=0)[0]["candidates"]
    assert "value is given" in page.ask("explained", kind="explain", row=11, col=13)[0]["reason"]
    assert "no longer kept" in page.error(kind="inside", open=True, beside=5)
    inside(page)
    page.result(width=20, height=18, seed=2)
    assert page.session._inside == {}, "another result is not looked into by itself"
    inside(page)
    page.ask("frame", kind="inside", open=False)
    assert page.session._inside == {}


def test_the_lattice_and_its_faults_are_sent():
    i, j = np.indices((50, 50))
    bricks = np.where(((i % 8 < 2) | ((j + 6 * (i // 8 % 2)) % 12 < 2)), 230, 90).astype(np.uint8)
    bricks += np.random.default_rng(0).integers(0, 9, bricks.shape, np.uint8)
    for page in opened("bricks.png", bricks, None):
        cols, rows = page.ask("picture", kind="hello")[0]["size"]
        assert (cols % 12, rows % 16) == (0, 0), "a lattice of bricks fits the first size"
        result = page.result(width=48, height=48)
        assert len(result["lattice"]["vectors"]) == 2 and "faults" in result["layers"]
        page.say(**WHOLE | {"height": 48}, layer="faults")
        assert page.wait("frame", layer="faults")[0]["rows"] == 48


def test_a_filled_hole_is_looked_into(page):
    strokes = [{"label": 1, "width": 7, "points": [[12, 10], [16, 12]]}]
    page.result(job="fill", hole=strokes, options={"finish": 0})
    image, hole = page.latest.image, paint(strokes, SAMPLE.shape) > 0
    (pane,) = inside(page)
    page.say(**WHOLE, layer="picture")
    _, after = seek(page, *pane["sweeps"][-1][:3])
    np.testing.assert_array_equal(frame(page, after, layer="picture")[1], image, "the end is the result")
    _, after = seek(page, pane["sweeps"][0][0], 1, 0)
    seen = frame(page, after, layer="picture")[1]
    np.testing.assert_array_equal(seen[~hole], SAMPLE[~hole])
    assert (seen[hole] != image[hole]).any(), "the hole has changed since"
    row, col = np.argwhere(hole)[0].tolist()
    seek(page)
    why, _ = page.ask("explained", kind="explain", row=row, col=col)
    taken = next(one for one in why["candidates"] if one["taken"])
    assert taken["place"] == page.latest.source[row, col].tolist()
    np.testing.assert_array_equal(taken["pixels"][0], SAMPLE[tuple(taken["place"])])
    assert why["corner"] == [row, col]
    neighbours = [(row + down, col + across) for down, across in why["offsets"]]
    around = [(place, pixel) for place, pixel in zip(neighbours, why["pixels"], strict=True) if not hole[place]]
    assert len(around) > 2 and all((pixel == SAMPLE[place]).all() for place, pixel in around)
    assert "value is given" in page.ask("explained", kind="explain", row=0, col=0)[0]["reason"]


def test_moments_of_a_hole_in_uneven_light_have_the_light():
    """Up to the finish, which changes a pixel by less than the trend from the first row to the last."""
    picture = (SAMPLE // 16 + np.arange(24, dtype=np.uint8)[:, None, None] * 10).astype(np.uint8)
    for page in opened("sky.png", picture, -1):
        page.result(job="fill", hole=[{"label": 1, "width": 5, "points": [[4, 3], [22, 3]]}])
        last = inside(page)[0]["sweeps"][-1][:3]
        page.say(**WHOLE, layer="picture")
        seen = frame(page, seek(page, *last)[1], layer="picture")[1]
        assert abs(seen - page.latest.image.astype(int)).max() < 16


def test_several_holes_are_not_looked_into():
    for page in opened("t.png", texture(40, 90), -1):
        page.result(job="fill", hole=[{"label": 1, "width": 3, "points": [[x, 12]]} for x in (5, 85)])
        assert "fill one hole" in page.error(kind="inside", open=True)
