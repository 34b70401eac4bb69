"""The live page's side of the work: the bytes of the command line, restarts, stops, and sentences."""

import runpy
import shlex

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from live import Fake, asked, png, texture

import simdtex
from simdtex import cli
from simdtex.live import results
from simdtex.live import session as sessions
from simdtex.live.levels import Levels
from simdtex.live.results import Results
from simdtex.live.settings import parsed
from simdtex.methods import mrf
from simdtex.model.source_map import apply_source_map


@pytest.fixture
def page():
    fake = Fake()
    yield fake
    fake.session.close()


@pytest.fixture
def opened(page):
    page.ask("picture", png(texture()), kind="open", name="C:\\photos\\Old Wall.PNG")
    return page


def stroke(*points, label=1, width=6):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


GUIDE = {
    "sample": [stroke((0, 10), (47, 10), width=20), stroke((0, 30), (47, 30), label=2, width=20)],
    "output": [stroke((0, 5), (55, 5), label=2, width=10)],
}
JOBS = {
    "plain": {},
    "options": {"options": {"balance": 1, "novelty": 0.5, "categorical": False, "finish": 0, "free_sweeps": 1}},
    "part": {"part": [4, 2, 32, 30]},
    "guide": {"guide": GUIDE},
    "guide-of-a-part": {"guide": GUIDE, "part": [2, 1, 44, 38]},
    "guide-everywhere": {"guide": GUIDE | {"output": [stroke((0, 20), (55, 20), width=99)]}},
    "multires": {"method": "multires"},
    "multires-auto": {"method": "multires", "options": {"alpha": "auto"}},
    "pyramid": {"method": "pyramid", "options": {"iterations": 2}},
    "tile": {"job": "tile"},
    "tile-a-part": {"job": "tile", "part": [0, 0, 40, 36]},
}


SLOW = (
    *("guide-everywhere", "guide-of-a-part", "tile-a-part", "multires-auto", "a result"),
    *("search", "both", "similar", "suggesting", "edges", "levels"),
)


def cases(names):
    """The cases of these names; some are like others, and wait for `make slow`."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in names]


@pytest.mark.parametrize("case", cases(JOBS))
def test_what_is_taken_away_makes_the_same_bytes(opened, case, tmp_path, monkeypatch):
    wanted = JOBS[case]
    made = wanted.get("method") != "pyramid"
    if made:
        opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="Height map.png")
    result = opened.result(**wanted)
    assert result["maps"] == (["height-map"] if made else [])
    files = opened.package(result["result"])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SIMDTEX_DEVICE", "reference")
    outputs = [name for name in files if name.startswith("texture")]
    assert len(outputs) == 1 + made
    for name in set(files) - set(outputs):
        (tmp_path / name).write_bytes(files[name])
    assert files["again.txt"].decode() == result["command"]
    for line in result["command"].splitlines():
        words = shlex.split(line)
        done = CliRunner().invoke(cli.main, [*words[1:], "--quiet"], catch_exceptions=False)
        assert (words[0], done.exit_code) == ("simdtex", 0), done.output
    for name in outputs:
        assert (tmp_path / name).read_bytes() == files[name], name
        (tmp_path / name).unlink()
    (tmp_path / "again.py").write_bytes(files["again.py"])
    assert files["again.py"].decode() == result["python"]
    runpy.run_path(str(tmp_path / "again.py"))
    for name in outputs:
        assert (tmp_path / name).read_bytes() == files[name], name


@pytest.mark.parametrize("of", cases(["the picture", "a result", "a result of that"]))
def test_a_hole_is_filled_with_the_same_bytes(opened, of, tmp_path, monkeypatch):
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="h.png")
    before = None
    if of != "the picture":
        before = opened.result()["result"]
    if of == "a result of that":
        before = opened.result(job="fill", of=before, hole=[stroke((10, 10))])["result"]
    result = opened.result(job="fill", of=before, hole=[stroke((30, 20), (40, 24)), stroke((35, 22), label=0, width=2)])
    files = opened.package(result["result"])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SIMDTEX_DEVICE", "reference")
    outputs = [shlex.split(line)[shlex.split(line).index("-o") + 1] for line in result["command"].splitlines()]
    assert len(outputs) == {"the picture": 1, "a result": 2, "a result of that": 3}[of]
    last = {name: data for name, data in files.items() if name.startswith(outputs[-1].removesuffix(".png"))}
    assert len(last) == 2
    for name in set(files) - set(last):
        (tmp_path / name).write_bytes(files[name])
    for line in result["command"].splitlines():
        done = CliRunner().invoke(cli.main, [*shlex.split(line)[1:], "--quiet"], catch_exceptions=False)
        assert done.exit_code == 0, done.output
    for name, data in last.items():
        assert (tmp_path / name).read_bytes() == data, name
        (tmp_path / name).unlink()
    runpy.run_path(str(tmp_path / "again.py"))
    for name, data in last.items():
        assert (tmp_path / name).read_bytes() == data, name


def test_categories_stay_categories(page):
    labels = (texture(channels=1) // 80).astype(np.uint8)
    page.ask("picture", png(labels), kind="open", name="facies.png")
    result = page.result(options={"categorical": True})
    assert set(np.unique(page.session.latest.image)) <= set(np.unique(labels))
    assert "--categorical" in shlex.split(result["command"])


def test_16_bits_stay_16_bits(page):
    from simdtex.io import image

    deep = texture(channels=1, dtype=np.uint16)
    page.session.use(sessions.Picture("deep.tif", deep, None))
    result = page.result()
    assert page.package(result["result"])
    assert page.session.latest.image.dtype == np.uint16
    message, (data,) = page.ask("file", kind="take", result=1, what="tif")
    assert message["name"] == "texture.tif"
    np.testing.assert_array_equal(image.read_bytes("texture.tif", data).pixels, page.session.latest.image)


CHANGES = {
    "finish": ({"finish": 0.5}, 0),
    "nothing": ({}, 0),
    "chance": ({"chance": 8}, "coarsest"),
    "similar": ({"similar": 2}, "coarsest"),
    "suggesting": ({"suggesting": 4}, "coarsest"),
    "exhaustive": ({"exhaustive": 4096}, "coarsest"),
    "search": ({"search": "exact"}, "coarsest"),
    "both": ({"search": "exact", "finish": 0}, "coarsest"),
    "coherence": ({"coherence": 1.0}, None),
    "overview": ({"overview": 64}, None),
    "edges": ({"edges": "whole"}, None),
    "levels": ({"levels": 2}, None),
}


@pytest.mark.parametrize("change", cases(CHANGES))
def test_a_change_restarts_from_the_level_it_affects_and_gives_the_same_bytes(opened, change):
    options, level = CHANGES[change]
    opened.result()
    after = len(opened.got)
    opened.result(options=options)
    begun, _ = opened.wait("begun", after=after)
    told = opened.session._levels
    coarsest = max(told._states)
    assert coarsest > 0
    assert begun["from"] == (coarsest if level == "coarsest" else level)
    whole = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, rng=7, device="reference", order=4, **options)
    np.testing.assert_array_equal(opened.session.latest.image, whole)


def test_a_run_that_was_given_up_is_gone_on_from_where_it_was(opened):
    seen = []
    send = opened.session._send

    def stopping(message, buffers):
        send(message, buffers)
        if message["kind"] == "frame" and message.get("level") == 0 and not seen:
            seen.append(message)
            opened.session.receive({"kind": "end"})

    opened.session.attach(stopping)
    opened.ask("ended", **asked())
    opened.session.attach(send)
    after = len(opened.got)
    opened.result()
    assert opened.wait("begun", after=after)[0]["from"] == 1
    whole = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, rng=7, device="reference", order=4)
    np.testing.assert_array_equal(opened.session.latest.image, whole)


def test_another_seed_size_part_or_picture_begins_anew(opened):
    opened.result()
    for other in ({"seed": 8}, {"width": 37}, {"part": [0, 0, 40, 40]}, {"guide": GUIDE}):
        after = len(opened.got)
        opened.result(**other)
        assert opened.wait("begun", after=after)[0]["from"] is None, other
    opened.ask("picture", png(texture(seed=3)), kind="open", name="other.png")
    after = len(opened.got)
    opened.result()
    assert opened.wait("begun", after=after)[0]["from"] is None


def test_states_that_are_held_are_their_own():
    before = Levels(("key",), mrf.Options())
    state = {"state": {"values": np.zeros(4)}, "observer": {"stages": [1]}}
    assert before.offer(lambda: state, 1) and not before.offer(lambda: state)
    state["observer"]["stages"].append(2)
    state["state"]["values"][:] = 1
    found = Levels(("key",), mrf.Options(finish=0.5), before).found
    assert found["observer"]["stages"] == [1] and not found["state"]["values"].any()
    found["observer"]["stages"].append(3)
    assert before.found["observer"]["stages"] == [1]
    assert Levels(("other",), mrf.Options(), before).found is None
    assert Levels(None, mrf.Options(), before).found is None


def test_frames_go_from_coarse_to_fine_and_end_in_the_result(opened):
    sessions.SHARE, share = 0, sessions.SHARE
    try:
        opened.ask("frame", kind="look", layer="picture", left=0, top=0, width=36, height=28, step=1, tiled=False)
        after = len(opened.got)
        opened.result()
        final = opened.wait("frame", after=len(opened.got) - 1)
    finally:
        sessions.SHARE = share
    frames = [(message, buffers) for message, buffers in opened.got[after:] if message["kind"] == "frame"]
    running = [message for message, _ in frames if "fraction" in message]
    assert [one["level"] for one in running] == sorted((one["level"] for one in running), reverse=True)
    assert {one["level"] for one in running} >= {0, 1}
    assert all(0 <= one["fraction"] <= 1 for one in running)
    pixels = np.frombuffer(final[1][0], np.uint8).reshape(28, 36, 4)
    np.testing.assert_array_equal(pixels[..., :3], opened.session.latest.image)
    assert (pixels[..., 3] == 255).all()


@pytest.mark.parametrize("layer", ["temperature", "arrangement", "use", "sample"])
def test_layers_are_seen_while_a_run_goes_on_and_afterwards(opened, layer):
    opened.ask("frame", kind="look", layer=layer, left=0, top=0, width=64, height=64, step=1, tiled=False)
    after = len(opened.got)
    result = opened.result()
    running = [one for one, _ in opened.got[after:] if one["kind"] == "frame" and "fraction" in one]
    assert running and all(one["layer"] == layer for one in running)
    message, (pixels,) = opened.wait("frame", after=len(opened.got) - 1)
    assert layer in result["layers"] and message["layer"] == layer
    shape = (40, 48) if layer in ("use", "sample") else (28, 36)  # of the sample, and of the output
    assert (message["rows"], message["cols"]) == shape == (message["height"], message["width"])
    assert len(pixels) == 4 * shape[0] * shape[1]


def test_no_more_frames_come_than_are_seen():
    page = Fake(sees=False)
    page.ask("picture", png(texture()), kind="open", name="a.png")
    page.wait("frame")
    sessions.SHARE, share = 0, sessions.SHARE
    try:
        page.result()
    finally:
        sessions.SHARE = share
    assert sum("fraction" in message for message, _ in page.got) <= 1  # beside that of the picture
    page.session.close()


def frame_of(page, found, **message):
    """The first frame of this kind after something was said."""
    after = len(page.got)
    page.say(**message)
    while not found(one := page.wait("frame", after=after)[0]):
        after += 1
    return one


def begin_and_stop(page, **settings):
    """Have something made, and stop it at its first frame."""
    send, stopped = page.session._send, []

    def stopping(message, buffers):
        if message["kind"] == "frame" and "fraction" in message and not stopped:
            stopped.append(message)
            page.session.receive({"kind": "stop"})
        send(message, buffers)

    page.session.attach(stopping)
    frame_of(page, lambda one: one.get("paused"), **asked(**settings))


def test_an_earlier_result_is_looked_at_while_a_run_goes_on(opened, monkeypatch):
    opened.result()
    begin_and_stop(opened, seed=8, width=50)
    frame = frame_of(opened, lambda one: one.get("result") == 1, kind="choose", result=1)
    assert (frame["cols"], frame["layer"], "fraction" in frame) == (36, "picture", False)
    assert opened.wait("progress")[0]["paused"]
    where = {"left": 0, "top": 0, "width": 9, "height": 9, "step": 1, "tiled": False}
    frame = frame_of(opened, lambda one: one["width"] == 9, kind="look", layer="use", **where)
    assert (frame["result"], frame["layer"], frame["cols"]) == (1, "use", 48)
    frame = frame_of(opened, lambda one: "fraction" in one, kind="choose", result=None)
    assert (frame["cols"], frame["layer"]) == (48, "use"), "what is being made is looked at again"
    assert opened.error(kind="choose", result=2) == "result 2 is no longer there; make it again with its command line"
    frame_of(opened, lambda one: one.get("result") == 1, kind="choose", result=1)
    result, _ = opened.ask("result", kind="go")
    assert (result["result"], result["width"], result["chosen"]) == (2, 50, False)
    assert opened.ask("chosen", kind="hello")[0]["result"] == 1
    whole = simdtex.synthesize(texture(), (28, 50), channel_axis=-1, rng=8, device="reference", order=4)
    np.testing.assert_array_equal(opened.session.latest.image, whole)
    monkeypatch.setattr(results, "KEPT", 2)
    begin_and_stop(opened)
    frame_of(opened, lambda one: one.get("result") == 1, kind="choose", result=1)
    result, _ = opened.ask("result", kind="go")
    assert (result["gone"], result["chosen"]) == ([1], True), "what is let go is looked at no longer"


def test_a_page_that_comes_back_looks_at_what_is_being_made(opened):
    opened.result()
    begin_and_stop(opened, seed=8)
    frame_of(opened, lambda one: one.get("result") == 1, kind="choose", result=1)
    after = len(opened.got)
    opened.say(kind="hello")
    told = [one for one, _ in opened.got[after:] if one["kind"] not in ("frame", "progress")]
    assert [one["kind"] for one in told] == ["hello", "picture", "result", "begun"]
    assert told[-1]["layers"] == ["picture", "sample", "arrangement", "use", "temperature"]
    assert not told[2]["chosen"]
    assert opened.ask("result", kind="go")[0]["chosen"]


def test_it_stops_and_goes_on_and_shows_what_is_asked_for_meanwhile(opened):
    begin_and_stop(opened)
    where = {"left": 0, "top": 0, "width": 9, "height": 9, "step": 1, "tiled": False}
    message = opened.ask("frame", kind="look", layer="temperature", **where)[0]
    while not message.get("paused"):
        message = opened.wait("frame", after=len(opened.got) - 1)[0]
    message = opened.ask("frame", kind="look", layer="picture", **where)[0]
    assert (message["paused"], message["width"]) == (True, 9)
    after = len(opened.got)
    opened.say(kind="hello")  # of a page that comes back meanwhile
    assert [one["kind"] for one, _ in opened.got[after:]] == ["hello", "picture", "begun"]
    assert "result" not in opened.kinds()
    opened.ask("result", kind="go")
    whole = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, rng=7, device="reference", order=4)
    np.testing.assert_array_equal(opened.session.latest.image, whole)


def test_one_thing_is_made_at_a_time_and_the_last_wish_counts(opened):
    for seed in range(1, 6):
        opened.say(**asked(seed=seed))
    message, _ = opened.wait("result")
    assert message["asked"]["seed"] == 5
    assert opened.kinds().count("result") == 1


def test_a_stopped_run_gives_way_to_another_wish(opened):
    opened.session.receive({"kind": "stop"})
    opened.say(**asked(seed=1))
    opened.session.receive({"kind": "stop"})
    opened.say(**asked(seed=2))
    assert opened.wait("result")[0]["asked"]["seed"] == 2


def test_figures_of_quality_come_when_nothing_else_is_wanted(page, monkeypatch):
    monkeypatch.setattr(sessions, "AFTER", 0.05)
    page.ask("picture", png(texture(64, 64)), kind="open", name="a.png")
    page.result(width=64, height=64)
    while len(page.wait("quality", after=len(page.got) - 1)[0]["figures"]) < 8:
        pass
    figures = {one["label"]: one["value"] for one in page.session.latest.figures}
    found = simdtex.quality.measure(texture(64, 64), page.session.latest.image, page.session.latest.source)
    assert figures["Effective share of the sample"] == found.effective_share
    assert figures["Repeats in the result"] == found.repeats


def test_a_page_that_comes_back_is_told_all_again(opened):
    opened.result()
    opened.result(seed=8)
    after = len(opened.got)
    opened.say(kind="hello")
    opened.wait("chosen", after=after)
    told = [message for message, _ in opened.got[after:] if message["kind"] != "frame"]
    hello, picture, *results = told[:4]
    assert (hello["kind"], hello["fresh"], picture["kind"], picture["new"]) == ("hello", False, "picture", False)
    assert [one["result"] for one in results] == [1, 2]


def test_a_picture_that_is_there_from_the_beginning_is_new_to_the_first_page(page):
    page.session.use(sessions.Picture("a.png", texture(), -1))
    message, _ = page.ask("picture", kind="hello")
    assert page.kinds()[:2] == ["hello", "picture"], "what the page is made of comes first"
    assert (message["name"], message["new"]) == ("a.png", True)
    page.result()
    assert page.ask("picture", kind="hello")[0]["new"] is False


def test_maps_are_of_the_pictures_size_and_have_names_of_their_own(opened):
    assert opened.error(png(texture(9, 9)), kind="map", name="n.png") == (
        "n.png is 9x9 and the picture 48x40; give a map of the picture's size"
    )
    for _ in range(2):
        opened.ask("maps", png(texture(channels=1)), kind="map", name="n.png")
    assert opened.ask("maps", kind="unmap", name="n")[0]["names"] == ["n-2"]
    result = opened.result()
    source = opened.session.latest.source
    np.testing.assert_array_equal(opened.session.latest.maps["n-2"], apply_source_map(source, texture(channels=1)))
    assert "map n-2" in result["layers"]
    where = {"left": 0, "top": 0, "width": 36, "height": 28, "step": 1, "tiled": False}
    message = opened.ask("frame", kind="look", layer="map n-2", **where)[0]
    while message["layer"] != "map n-2":  # that of the result comes first
        message = opened.wait("frame", after=len(opened.got) - 1)[0]


WRONG = {
    "a kind": ({"kind": "rm -rf"}, "the page and simdtex do not understand each other; load the page again"),
    "no kind": ({}, "the page and simdtex do not understand each other; load the page again"),
    "an example": (
        {"kind": "example", "name": "../x"},
        "there is no example ../x; choose one of: brick, grass, gravel",
    ),
    "no file": ({"kind": "open", "name": "a.png"}, "no file came with that; give the picture again"),
    "a result": ({"kind": "choose", "result": 5}, "result 5 is no longer there; make it again with its command line"),
    "a result's kind": ({"kind": "choose", "result": "x"}, "the result must be an integer, not 'x'"),
    "a size": (asked(width=0), "width is 0; give 1 or more"),
    "a large size": (asked(height=10**6), "height is 1000000; give 16384 or fewer"),
    "a size in words": (asked(width="big"), "width must be an integer, not 'big'"),
    "a seed": (asked(seed=-1), "seed is -1; give 0 or more"),
    "a job": (asked(job="rm"), "unknown job 'rm'; choose one of: synth, tile, fill"),
    "a method": (asked(method="os"), "unknown method 'os'; choose one of: mrf, multires, pyramid"),
    "an option": (asked(options={"array": "4x4"}), "there is no control for 'array'; choose one of: "),
    "an option's value": (asked(options={"balance": -1}), "balance is -1.0; give a number of at least 0"),
    "an option's kind": (asked(options={"balance": [1]}), "balance must be a number, not "),
    "options": (asked(options={}) | {"options": 3}, "options must be names and values, not 3"),
    "a part": (asked(part=[40, 0, 20, 20]), "the part reaches beyond the picture of 48x40; choose one within it"),
    "a small part": (asked(part=[0, 0, 2, 20]), "the width of the part is 2; give 8 or more"),
    "no part": (asked(part=[1, 2]), "a part of the picture is four numbers: left, top, width and height"),
    "a guide": (asked(guide=[1]), "a guide is painted on the sample and on the result; paint both"),
    "half a guide": (
        asked(guide={"output": [stroke((1, 1))]}),
        "the result is to have label 1, and nothing of the sample has it; paint it on the sample too",
    ),
    "no hole": (
        asked(job="fill"),
        "nothing is painted, so there is nothing to fill; paint over what is to be made anew",
    ),
    "all hole": (
        asked(job="fill", hole=[stroke((20, 20), width=200)]),
        "all of the picture is painted, so nothing of it is known; leave some of it",
    ),
    "strokes": (asked(job="fill", hole="x"), "what is painted is no list of strokes; paint again"),
    "a stroke": (asked(job="fill", hole=[{}]), "a stroke has no points; paint again"),
    "points": (
        asked(job="fill", hole=[{"label": 1, "width": 4, "points": [["a", 1]]}]),
        "a point of a stroke is no pair of numbers; paint again",
    ),
    "far points": (
        asked(job="fill", hole=[stroke((1e30, 0))]),
        "a point of a stroke is no pair of numbers; paint again",
    ),
    "a label": (asked(job="fill", hole=[stroke((1, 1), label=99)]), "the label of a stroke is 99; give 8 or fewer"),
    "many points": (
        asked(job="fill", hole=[stroke(*[(1, 1)] * 70000)]),
        "more than 65536 points are painted; paint with a wider brush",
    ),
    "a look": ({"kind": "look", "width": 0}, "width is 0; give 1 or more"),
    "a large look": (
        {"kind": "look", "width": 4096, "height": 4096},
        "a window has 4194304 pixels at most; make it smaller",
    ),
    "a layer": ({"kind": "look", "layer": 3}, "a layer has a name; choose one of those that are there"),
    "what to take": ({"kind": "take", "result": 1, "what": "/etc"}, "result 1 is no longer there; make it again with"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_in_a_sentence_and_the_page_goes_on(opened, case):
    message, sentence = WRONG[case]
    assert opened.error(**message).startswith(sentence)
    assert opened.result(method="pyramid", options={"iterations": 0})["result"] == 1


FILES = {
    "empty": (b"", "a.png is empty (0 bytes): give a file with an image in it"),
    "text": (b"hello", "a.png is not an image: give a PNG, JPEG, TIFF, BMP, WebP, GIF or .npy file"),
    "cut": (png(texture())[:100], "a.png cannot be decoded, it is truncated, damaged or of an unknown kind"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_picture_is_refused(opened, case):
    data, sentence = FILES[case]
    assert opened.error(data, kind="open", name="/home/somebody/a.png").startswith(sentence)
    assert opened.result(method="pyramid", options={"iterations": 0})["result"] == 1


def test_a_picture_of_too_many_pixels_or_bytes_is_refused(page, monkeypatch):
    monkeypatch.setattr(sessions, "PIXELS", 100)
    assert page.error(png(texture()), kind="open", name="a.png").startswith(
        "a.png has 1920 pixels and no more than 100"
    )
    monkeypatch.setattr(sessions, "BYTES", 100)
    assert page.error(bytes(101), kind="open", name="a.png") == (
        "the file has 101 bytes and 100 are taken at most; give a smaller one"
    )


def test_what_fails_unforeseen_is_told_without_its_words(opened, monkeypatch, caplog):
    monkeypatch.setattr(sessions, "job", lambda *_: 1 / 0)
    assert opened.error(**asked()) == "something is wrong in simdtex itself; the terminal says more"
    assert "ZeroDivisionError" in caplog.text


def test_few_results_are_kept(monkeypatch):
    from simdtex.live import results

    class Small:
        def __init__(self, number, size):
            self.number, self.size = number, size

    monkeypatch.setattr(results, "Result", Small)
    monkeypatch.setattr(results, "KEPT", 3)
    monkeypatch.setattr(results, "HELD", 100)
    kept = Results()
    for size in (10, 10, 10, 10):
        kept.add(size)
    assert ([one.number for one in kept], kept.gone) == ([2, 3, 4], [1])
    kept.add(95)
    assert [one.number for one in kept] == [5]
    kept.add(1000)
    assert [one.number for one in kept] == [6]


def test_a_large_picture_begins_with_its_middle(page, monkeypatch):
    monkeypatch.setattr(sessions, "LARGE", 32)
    message, (pixels,) = page.ask("picture", png(texture(40, 48)), kind="open", name="a.png")
    assert message["part"] == [8, 4, 32, 32]
    assert len(pixels) == 4 * message["shown"][0] * message["shown"][1]


HARDY = Fake()
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5000) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
FIELDS = ("name", "result", "what", "layer", "left", "top", "width", "height", "step", "tiled", "job", "method", "seed")
FIELDS += ("options", "part", "guide", "hole", "of")


@given(
    st.sampled_from(
        ["hello", "open", "example", "map", "unmap", "stop", "go", "end", "look", "seen", "choose", "take"]
    ),
    st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=4),
    st.lists(st.binary(max_size=30), max_size=2),
)
@settings(max_examples=200)
def test_no_message_does_harm(kind, message, buffers):
    HARDY.say(*buffers, **message | {"kind": kind})
    assert "something is wrong in simdtex itself" not in str(HARDY.got)
    HARDY.got.clear()


@given(st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=3), st.sampled_from(["synth", "tile", "fill"]))
@settings(max_examples=150)
def test_no_wish_does_harm(message, job):
    picture = sessions.Picture("a.png", texture(), -1)
    try:
        found = parsed(asked(job=job) | message, picture)
    except (ValueError, TypeError) as error:
        assert str(error)
    else:
        assert found.job in ("synth", "tile", "fill") and min(found.shape) >= 1
