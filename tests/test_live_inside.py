"""A look inside a result: moments of its run, and why pixels have their values, as the page is sent them."""

import json

import numpy as np
import pytest
from live import Fake, texture

import simdtex
from simdtex.live.job import Picture, paint
from simdtex.live.results import BARS, SET_COLOURS

SAMPLE = texture(24, 28)
RULES = {"order": 4, "channel_axis": -1, "device": "reference"}


@pytest.fixture
def page():
    page = Fake(Picture("t.png", SAMPLE, -1))
    yield page
    page.session.close(10)


def inside(page, **message):
    return page.ask("inside", kind="inside", open=True, **message)[0]["panes"]


def frame(page, after, pane=0, **values):
    message, (data,) = page.wait("frame", after=after, pane=pane, **values)
    return message, np.frombuffer(data, np.uint8).reshape(message["height"], message["width"], 4)


def test_moments_are_those_of_the_run(page):
    page.result(width=20, height=18)
    (pane,) = inside(page)
    replay = simdtex.replay(SAMPLE, (18, 20), rng=7, **RULES)
    assert (pane["result"], pane["moment"]) == (1, None)
    assert pane["sweeps"] == [list(one) for one in replay.sweeps]
    for layer in ("picture", "temperature", "sets"):
        page.say(kind="view", layer=layer, left=0, top=0, width=20, height=18, step=1)
        for n in (0, len(replay.sweeps) - 1):
            level, sweep, *_ = replay.sweeps[n]
            after = len(page.got)
            assert page.ask("moments", kind="seek", level=level, sweep=sweep, sets=1)[0]["moments"] == [(n, 1)]
            message, seen = frame(page, after, layer=layer)
            now = replay.at(n, 1)
            assert (message["rows"], message["cols"]) == (18, 20)
            rows, cols = np.arange(18) // 2**level, np.arange(20) // 2**level
            if layer == "picture":
                np.testing.assert_array_equal(seen[..., :3], now.image[np.ix_(rows, cols)])
            if layer == "sets":
                last = now.relaxed[np.ix_(rows, cols)] == 2
                np.testing.assert_array_equal((seen[..., :3] == SET_COLOURS[2]).all(-1), last)
    assert page.ask("moments", kind="seek", level=99, sweep=99, sets=10**6)[0]["moments"][0][0] < len(replay.sweeps)
    after = len(page.got)
    assert page.ask("moments", kind="seek")[0]["moments"] == [None]
    page.say(kind="view", layer="picture", left=0, top=0, width=20, height=18, step=1)
    np.testing.assert_array_equal(frame(page, after, layer="picture")[1][..., :3], page.latest.image)


def test_a_pixel_is_explained_as_in_python(page):
    page.result(width=20, height=18)
    inside(page)
    after = len(page.got)
    found, _ = page.ask("explained", kind="explain", row=5, col=7)
    assert json.loads(json.dumps(found, allow_nan=False)) == json.loads(json.dumps(found))
    why = simdtex.explain(SAMPLE, (18, 20), (5, 7), rng=7, **RULES)
    assert (found["pixel"], found["reason"]) == ([5, 7], why.reason)
    taken = next(one for one in found["candidates"] if one["taken"])
    assert taken["place"] == why.candidates.place[why.taken].tolist()
    assert taken["costs"]["total"] == why.candidates.total[why.taken]
    np.testing.assert_array_equal(taken["pixels"], why.candidates.pixels[why.taken])
    np.testing.assert_array_equal(found["pixels"], why.neighbours.pixels)
    page.say(kind="seek", level=9, sweep=1, sets=0)
    assert "has not relaxed yet" in page.ask("explained", kind="explain", row=5, col=7)[0]["reason"]
    assert "error" not in page.kinds(after)
    for row, words in [(18, "give 17 or fewer"), (-1, "give 0 or more"), ("x", "the row of the pixel")]:
        assert words in str(page.ask(("explained", "error"), kind="explain", row=row, col=0)[0])


def test_a_density_has_few_bars(page):
    page.result(width=14, height=12, options={"pixel": "density", "relaxation": "gibbs", "structure": 0, "levels": 1})
    inside(page)
    found, _ = page.ask("explained", kind="explain", row=5, col=7)
    bars = np.array(found["density"]["bars"])
    assert bars.shape == (3, BARS)
    np.testing.assert_allclose(bars.sum(1), 1)
    assert len(found["density"]["starts"]) == BARS


def test_two_results_side_by_side(page):
    page.result(width=20, height=18)
    page.result(width=20, height=18, options={"schedule": "synchronous"})
    first, second = inside(page, beside=1)
    assert (first["result"], second["result"]) == (2, 1)
    after = len(page.got)
    page.say(kind="view", layer="picture", left=0, top=0, width=20, height=18, step=1)
    level, sweep, sets, *_ = first["sweeps"][-1]
    moments = page.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)[0]["moments"]
    assert [len(one) for one in moments] == [2, 2]
    assert {frame(page, after, pane)[0]["of"] for pane in (0, 1)} == {1, 2}
    page.say(kind="explain", row=3, col=4)
    assert page.wait("explained", pane=1, after=after)[0]["pixel"] == [3, 4]


def test_a_seamless_picture_is_looked_into(page):
    page.result(job="extend", options={"order": 4})
    (pane,) = inside(page)
    assert pane["sweeps"]
    found, _ = page.ask("explained", kind="explain", row=0, col=0)
    assert found["candidates"]
    assert "value is given" in page.ask("explained", kind="explain", row=11, col=13)[0]["reason"]


@pytest.mark.parametrize("message", [{"method": "pyramid"}, {"method": "multires"}])
def test_other_methods_are_refused(page, message):
    page.result(width=20, height=18, **message)
    assert "method mrf" in page.error(kind="inside", open=True)


def test_what_cannot_be_looked_into(page):
    assert "no result" in page.error(kind="inside", open=True)
    page.result(width=20, height=18)
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
    page = Fake(Picture("bricks.png", bricks, None))
    try:
        cols, rows = page.ask("picture", kind="hello")[0]["size"]
        assert (cols % 12, rows % 16) == (0, 0), "a lattice of bricks fits the first size"
        told = page.result(width=48, height=48)
        assert len(told["lattice"]["vectors"]) == 2 and "faults" in told["layers"]
        page.say(kind="view", layer="faults", left=0, top=0, width=48, height=48, step=1)
        assert page.wait("frame", layer="faults")[0]["rows"] == 48
    finally:
        page.session.close(10)


HOLE = [{"label": 1, "width": 7, "points": [[12, 10], [16, 12]]}]


def test_a_filled_hole_is_looked_into(page):
    page.result(job="fill", hole=HOLE, options={"order": 4})
    image, hole = page.latest.image, paint(HOLE, SAMPLE.shape) > 0
    (pane,) = inside(page)
    level, sweep, sets, *_ = pane["sweeps"][-1]
    page.say(kind="view", layer="picture", left=0, top=0, width=28, height=24, step=1)
    after = len(page.got)
    page.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)
    np.testing.assert_array_equal(frame(page, after, layer="picture")[1][..., :3], image, "the end is the result")
    after = len(page.got)
    page.ask("moments", kind="seek", level=pane["sweeps"][0][0], sweep=1, sets=0)
    seen = frame(page, after, layer="picture")[1][..., :3]
    np.testing.assert_array_equal(seen[~hole], SAMPLE[~hole])
    assert (seen[hole] != image[hole]).any(), "the hole has changed since"

    row, col = np.argwhere(hole)[0].tolist()
    page.ask("moments", kind="seek")
    found, _ = page.ask("explained", kind="explain", row=row, col=col)
    taken = next(one for one in found["candidates"] if one["taken"])
    assert taken["place"] == page.latest.source[row, col].tolist()
    np.testing.assert_array_equal(taken["pixels"][0], SAMPLE[tuple(taken["place"])])
    assert found["corner"] == [row, col]
    around = [
        ((row + down, col + across), pixel)
        for (down, across), pixel in zip(found["offsets"], found["pixels"], strict=True)
        if not hole[row + down, col + across]
    ]
    assert len(around) > 2
    for place, pixel in around:
        np.testing.assert_array_equal(pixel, SAMPLE[place])
    assert "value is given" in page.ask("explained", kind="explain", row=0, col=0)[0]["reason"]


def test_the_sample_of_a_look_is_that_of_the_run(page):
    page.result(width=20, height=18, part=[4, 2, 16, 12])
    told, (small,) = page.ask("inside", kind="inside", open=True)
    assert (told["panes"][0]["width"], told["panes"][0]["height"]) == (16, 12)
    part = np.frombuffer(small, np.uint8).reshape(*told["panes"][0]["preview"][::-1], 4)[..., :3]
    np.testing.assert_array_equal(part, SAMPLE[2:14, 4:20])
    after = len(page.got)
    page.say(kind="view", layer="sample", left=0, top=0, width=28, height=24, step=1)
    np.testing.assert_array_equal(frame(page, after, layer="sample")[1][..., :3], part)


def test_several_holes_are_not_looked_into():
    page = Fake(Picture("t.png", texture(90, 100), -1))
    try:
        hole = [{"label": 1, "width": 5, "points": [[x, 12]]} for x in (10, 90)]
        page.result(job="fill", hole=hole, options={"order": 2})
        assert "fill one hole" in page.error(kind="inside", open=True)
    finally:
        page.session.close(10)
