"""Sessions of the live page: commands that repeat a result, frames, strokes, a look inside a run, and controls."""

import io
import json
import shlex
import tracemalloc
from math import inf
from types import SimpleNamespace

import click
import numpy as np
import PIL.Image
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from live import Fake, asked, png, striped, texture
from PIL import ImageCms

import simdtex
from simdtex import commands as cli
from simdtex.io.image import read_bytes
from simdtex.jobs.classification import algorithm
from simdtex.live import frames, results
from simdtex.live import session as sessions
from simdtex.live.frames import Layer, View, parse_view, render
from simdtex.live.job import LABELS, LIGHT, TABLES, Picture, controls, paint
from simdtex.live.results import BARS, FILM_FRAMES, SET_COLOURS, PageResults
from simdtex.live.session import FILMED, Levels
from simdtex.methods import mrf
from simdtex.model.display import read_labels
from simdtex.model.source_map import apply_source_map
from simdtex.options import table

# -- The sessions of the live page: command lines that repeat a result, restarts, pauses, frames, and error messages.


@pytest.fixture(autouse=True)
def reading(monkeypatch):
    """Files are read in this process, since a process for each takes long; those of the server are read apart."""
    monkeypatch.setattr(sessions, "read_apart", lambda *file: read_bytes(*file, max_pixels=sessions.MAX_PIXELS))


@pytest.fixture
def page():
    fake = Fake()
    yield fake
    fake.session.close()


@pytest.fixture
def opened(page):
    page.ask("picture", png(texture()), kind="open", name="C:\\photos\\Old Wall.PNG")
    return page


def whole(shape=(28, 36), **options):
    """What is made by one call, as `asked` asks for it."""
    options = {"order": 2, "rng": 7} | options
    return simdtex.synthesize(texture(), shape, channel_axis=-1, device="reference", **options)


def stroke(*points, label=1, width=6):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


GUIDE = {
    "sample": [stroke((0, 10), (47, 10), width=20), stroke((0, 30), (47, 30), label=2, width=20)],
    "output": [stroke((0, 5), (55, 5), label=2, width=10)],
}
JOBS = {
    "plain": {},
    "options": {"options": {"balance": 1, "novelty": 0.5, "categorical": False, "finish": 0, "xi": -2.0}},
    "part": {"part": [4, 2, 32, 30]},
    "guide": {"guide": GUIDE},
    "guide-of-a-part": {"guide": GUIDE, "part": [2, 1, 44, 38]},
    "guide-everywhere": {"guide": GUIDE | {"output": [stroke((0, 20), (55, 20), width=99)]}},
    "multires": {"method": "multires"},
    "pyramid": {"method": "pyramid", "options": {"iterations": 2}},
    "extend": {"job": "extend"},
    "extend-a-part": {"job": "extend", "part": [0, 0, 40, 36]},
}


SLOW = ("part", "guide-everywhere", "guide-of-a-part", "extend-a-part")


def assert_command_repeats(page, number, folder, monkeypatch):
    """The command line of a package writes the bytes of its outputs from its other files."""
    files, result = page.package(number), page.session.results[number]
    assert files["again.txt"].decode() == result.job.command
    outputs = [result.job.output, *(name for name in files if name.startswith("texture-"))]
    assert len(outputs) == 1 + len(result.maps)
    for name in set(files) - set(outputs):
        (folder / name).write_bytes(files[name])
    monkeypatch.chdir(folder)
    monkeypatch.setenv("SIMDTEX_DEVICE", "reference")
    words = shlex.split(result.job.command)
    done = CliRunner().invoke(cli.main, [*words[1:], "--quiet"], catch_exceptions=False)
    assert (words[0], done.exit_code) == ("simdtex", 0), done.output
    for name in outputs:
        assert (folder / name).read_bytes() == files[name], name


@pytest.mark.parametrize("case", [pytest.param(one, marks=[pytest.mark.slow] * (one in SLOW)) for one in JOBS])
def test_the_command_of_a_result_repeats_its_bytes(opened, case, tmp_path, monkeypatch):
    carries = JOBS[case].get("method") != "pyramid"
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="Height map.png")
    result = opened.result(**JOBS[case])
    maps = ["map height-map"] * carries
    assert [layer for layer in result["layers"] if layer.startswith("map")] == maps
    assert_command_repeats(opened, 1, tmp_path, monkeypatch)


@pytest.mark.parametrize("of_result", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_command_of_a_filled_hole_repeats_its_bytes(opened, of_result, tmp_path, monkeypatch):
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="h.png")
    before = opened.result()["result"] if of_result else None
    result = opened.result(job="fill", of=before, hole=[stroke((30, 20), (40, 24)), stroke((35, 22), label=0, width=2)])
    assert set(result["files"]) == {"texture.png", "texture-h.png", "arrangement.npz", "texture.zip"}
    assert_command_repeats(opened, result["result"], tmp_path, monkeypatch)


def strokes(*labels):
    """The classes of `striped`, a stroke over each."""
    return {
        "sample": [stroke((20 + 40 * k, 10), (20 + 40 * k, 38), label=one, width=12) for k, one in enumerate(labels)]
    }


CLASSIFIED = {
    "colour": (striped(), {}),
    "grey-16-bits": (striped(1, np.uint16), {"options": {"coupling": 3.5, "unknown": 0}}),
    "alpha": (np.dstack([striped(), np.where(striped(1) > 90, 255, 100).astype(np.uint8)]), {"part": [0, 0, 20, 20]}),
}


@pytest.mark.parametrize("case", CLASSIFIED)
def test_the_command_of_a_classification_repeats_its_bytes(page, case, tmp_path, monkeypatch):
    pixels, settings = CLASSIFIED[case]
    page.ask("picture", png(pixels), kind="open", name="Labels.png")
    page.ask("maps", png(pixels), kind="map", name="h.png")
    result = page.result(job="classify", guide=strokes(1, 3), **settings)
    assert (result["width"], result["height"], result["layers"]) == (96, 48, ["sample", "labels"])
    assert result["files"] == ["labels.png", "strokes.png", "labels.zip"]
    command = shlex.split(result["command"])
    assert command[:7] == ["simdtex", "classify", "sample.png", "-o", "labels.png", "--strokes", "strokes.png"]
    labels, painted = page.latest.image, page.latest.job.files["strokes.png"]
    assert np.unique(painted).tolist() == [0, 1, 3]
    assert (labels[:, :36] == 1).mean() > 0.3 and not (labels[:, :36] == 3).any()
    assert (labels[:, 44:76] == 3).mean() > 0.3 and not (labels[:, 44:76] == 1).any()
    assert [label for label, _ in result["shares"]] == [0, 1, 3], "the labels as they are painted"
    counted = [(labels == label).mean() for label in (0, 1, 3)]
    np.testing.assert_allclose([share for _, share in result["shares"]], counted)
    assert_command_repeats(page, 1, tmp_path, monkeypatch)
    for name, found in (("labels.png", labels), ("strokes.png", painted)):
        np.testing.assert_array_equal(read_labels(tmp_path / name), found)


def test_labels_are_shown_over_the_picture_and_rows_that_are_not_compared_yet_have_none(page, monkeypatch):
    monkeypatch.setattr(sessions, "INTERVAL", 0)
    monkeypatch.setattr(sessions, "MAX_RATE", 1e9)
    monkeypatch.setattr(algorithm, "WORK", 2**25)
    page.ask("picture", png(striped()), kind="open", name="a.png")
    page.ask("frame", layer="labels", **WINDOW | {"width": 96, "height": 48})
    after = len(page.got)
    page.result(job="classify", guide=strokes(1, 3))
    page.wait("frame", after=after, of=1)
    assert page.wait("begun")[0]["layers"] == ["labels", "sample"]
    sent = [(one, pixels) for one, pixels in page.got[after:] if one["kind"] == "frame" and one["of"] != "sample"]
    assert {one["layer"] for one, _ in sent} == {"labels"} and len(sent) > 4
    frames = [np.frombuffer(pixels, np.uint8).reshape(48, 96, 4)[..., :3] for _, (pixels,) in sent]
    picture, first = striped(), frames[0]
    plain = (first == picture).all((1, 2))
    assert not plain[0] and plain[-1] and (np.diff(plain.astype(int)) >= 0).all(), "from the top to the bottom"
    colours = LABELS[page.latest.image]
    np.testing.assert_array_equal(frames[-1], (picture.astype(int) + colours) // 2)
    assert (page.latest.image == 0).any(), "where it is darker"


HINTS = [
    ("no label is painted yet; paint over two or more textures of the picture, each with a label of its own", {}),
    ("only label 3 is painted; paint over two or more textures", strokes(3)),
    (
        "label 2 is painted on 5 pixels; paint 16 or more",
        {"sample": [*strokes(1)["sample"], stroke((60, 20), label=2, width=2)]},
    ),
]


def test_too_little_paint_is_a_hint_and_no_error(page):
    page.ask("picture", png(striped()), kind="open", name="a.png")
    for sentence, guide in HINTS:
        hint, _ = page.ask(("hint", "error", "begun"), **asked(job="classify", guide=guide))
        assert hint["kind"] == "hint" and hint["text"].startswith(sentence), hint
    page.result(job="classify", guide=strokes(1, 2))


@pytest.mark.parametrize("name", ["hole.png", "guide-sample.png", "texture.png"])
def test_no_file_of_a_package_takes_the_name_of_another(page, name):
    page.ask("picture", png(texture()), kind="open", name=name)
    hole = page.result(job="fill", hole=[stroke((30, 20))])
    assert {"sample.png", "hole.png", "texture.png"} <= set(page.package(hole["result"]))


@pytest.mark.parametrize("kind", ["categories", "16 bits"])
def test_categories_and_16_bits_stay(kind):
    deep = kind == "16 bits"
    pixels = texture(channels=1, dtype=np.uint16) if deep else (texture(channels=1) // 80).astype(np.uint8)
    page = Fake(Picture("sample.tif", pixels, None))
    result = page.result(options={"finish": 0} if deep else {"categorical": True})
    _, (data,) = page.ask("file", kind="download", result=1, name="texture.png")
    found = read_bytes("texture.png", data).pixels
    assert found.dtype == pixels.dtype and set(np.unique(found)) <= set(np.unique(pixels))
    assert ("--categorical" in shlex.split(result["command"])) is not deep
    page.session.close()


def test_a_download_has_the_colours_of_the_picture(page):
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    file = io.BytesIO()
    PIL.Image.fromarray(texture()).save(file, "PNG", icc_profile=profile, dpi=(300, 300))
    page.ask("picture", file.getvalue(), kind="open", name="photo.png")
    result = page.result()
    for name, data in page.package(result["result"]).items():
        if name in ("photo.png", "texture.png"):
            found = read_bytes(name, data).metadata
            assert found.profile == profile and found.dpi == pytest.approx((300, 300), abs=0.01)


COARSEST = 2  # of three levels
PLAIN = {"lattice": "none"}
CHANGES = [
    ({}, {"finish": 0.5}, 0),
    ({}, {}, 0),
    ({}, {"search": "exact", "finish": 0}, None),  # the search matters at the coarsest level of a regular sample
    (PLAIN, PLAIN | {"search": "exact", "finish": 0}, COARSEST),
    ({}, {"coherence": 1.0}, None),
    pytest.param({}, {"edges": "whole"}, None, marks=pytest.mark.slow),
    pytest.param({}, {"levels": 1}, None, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("before", "options", "level"), CHANGES, ids=str)
def test_a_change_restarts_from_the_level_it_affects_and_gives_the_same_bytes(opened, before, options, level):
    opened.result(options=before)
    after = len(opened.got)
    opened.result(options=options)
    assert opened.wait("begun", after=after)[0]["from"] == level
    np.testing.assert_array_equal(opened.latest.image, whole(**options))


def test_a_cancelled_run_is_continued(opened):
    send = opened.session.send

    def cancelling(message, buffers):
        send(message, buffers)
        if message["kind"] == "progress" and message["level"] == 0:
            opened.say(kind="cancel")

    opened.session.send = cancelling
    opened.ask("ended", **asked())
    opened.session.send = send
    assert opened.ask("begun", **asked())[0]["from"] == 1
    opened.wait("result")
    np.testing.assert_array_equal(opened.latest.image, whole())


def test_another_seed_size_part_or_picture_begins_anew(opened):
    opened.result()
    for other in ({"seed": 8}, {"width": 37}, {"part": [0, 0, 40, 40]}, {"guide": GUIDE}):
        assert opened.ask("begun", **asked(**other))[0]["from"] is None, other
    opened.ask("picture", png(texture(seed=3)), kind="open", name="other.png")
    assert opened.ask("begun", **asked())[0]["from"] is None


def test_states_are_kept_apart_from_the_runs_that_use_them():
    before = Levels(("key",), mrf.Options())
    state = {"state": np.zeros(4), "observer": [1]}
    for ended, level in ((True, 1), (False, 0)):
        before.checkpointing.offer(SimpleNamespace(ended=ended, level=level), lambda: state)
    state["observer"].append(2)
    state["state"][:] = 1
    assert before.level == 1, "states within a level are not kept"
    found = Levels(("key",), mrf.Options(finish=0.5), before).checkpointing.found
    assert found["observer"] == [1] and not found["state"].any()
    found["observer"].append(3)
    assert before.checkpointing.found["observer"] == [1]
    for other in (Levels(("other",), mrf.Options(), before), Levels(None, mrf.Options(), before)):
        assert other.checkpointing.found is None
    other.checkpointing.offer(SimpleNamespace(ended=True, level=1), lambda: state)
    assert other.level is None, "without a key no state is kept"


WINDOW = {"kind": "view", "left": 0, "top": 0, "width": 36, "height": 28, "step": 1, "tiled": False}


def test_frames_go_from_coarse_to_fine_and_end_in_the_result(opened, monkeypatch):
    monkeypatch.setattr(sessions, "INTERVAL", 0)
    monkeypatch.setattr(sessions, "MAX_RATE", 1e9)
    opened.ask("frame", layer="picture", **WINDOW)
    after = len(opened.got)
    opened.result()
    _, (pixels,) = opened.wait("frame", after=after, of=1)
    progress = [message for message, _ in opened.got[after:] if message["kind"] == "progress"]
    frames = [message for message, _ in opened.got[after:] if message["kind"] == "frame" and message["of"] == "run"]
    assert len(frames) == len(progress)
    levels = [one["level"] for one in progress]
    assert levels == sorted(levels, reverse=True) and set(levels) >= {0, 1}
    assert all(0 <= one["fraction"] <= 1 for one in progress)
    shown = np.frombuffer(pixels, np.uint8).reshape(28, 36, 4)
    np.testing.assert_array_equal(shown[..., :3], opened.latest.image)
    assert (shown[..., 3] == 255).all()


@pytest.mark.parametrize("layer", ["temperature", "arrangement", "use", "sample"])
def test_layers_are_shown_during_a_run_and_afterwards(opened, layer):
    opened.ask("frame", layer=layer, **WINDOW | {"width": 64, "height": 64})
    after = len(opened.got)
    result = opened.result()
    message, (pixels,) = opened.wait("frame", after=after, of=1)
    running = [one for one, _ in opened.got[after:] if one["kind"] == "frame" and one["of"] == "run"]
    assert running and all(one["layer"] == layer for one in running)
    shape = (40, 48) if layer in ("use", "sample") else (28, 36)  # of the sample, and of the output
    assert layer in result["layers"] and message["layer"] == layer
    assert (message["rows"], message["cols"]) == shape == (message["height"], message["width"])
    assert len(pixels) == 4 * shape[0] * shape[1]


def test_no_more_frames_are_sent_than_are_shown(monkeypatch):
    monkeypatch.setattr(sessions, "INTERVAL", 0)
    page = Fake(sees=False)
    page.ask("frame", png(texture()), kind="open", name="a.png")
    page.result()
    kinds = page.kinds()
    assert kinds[: kinds.index("result")].count("frame") <= sessions.MAX_UNSEEN
    page.session.close()


def begin_and_pause(page, **settings):
    """Have something made, and pause it at its first frame."""
    page.say(**asked(**settings))
    page.ask("progress", kind="pause", wanted={"paused": True})


def test_an_earlier_result_is_shown_during_a_run(opened, monkeypatch):
    opened.result()
    begin_and_pause(opened, seed=8, width=50)
    frame, _ = opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    assert (frame["cols"], frame["layer"]) == (36, "picture")
    frame, _ = opened.ask("frame", layer="use", **WINDOW, wanted={"layer": "use"})
    assert (frame["of"], frame["cols"]) == (1, 48)
    frame, _ = opened.ask("frame", kind="select", result=None, wanted={"of": "run"})
    assert frame["layer"] == "use"
    assert opened.error(kind="select", result=2) == "result 2 is no longer kept; make it again with its command line"
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    opened.ask("result", kind="resume", wanted={"result": 2, "width": 50})
    assert opened.ask("selected", kind="hello")[0]["result"] == 1, "the page goes on showing what it has selected"
    assert opened.kinds(after).count("selected") == 1
    np.testing.assert_array_equal(opened.latest.image, whole((28, 50), rng=8))
    monkeypatch.setattr(results, "MAX_RESULTS", 2)
    begin_and_pause(opened)
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    assert opened.ask("result", kind="resume")[0]["dropped"] == [1]
    assert opened.wait("selected", after=after)[0]["result"] == 3, "a dropped result is shown no longer"


def test_a_page_that_is_loaded_again_shows_the_run(opened):
    opened.result()
    begin_and_pause(opened, seed=8)
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    begun, _ = opened.ask("begun", kind="hello")
    kinds = [kind for kind in opened.kinds(after) if kind not in ("frame", "progress")]
    assert kinds == ["hello", "picture", "result", "begun"]
    assert begun["layers"] == ["picture", "sample", "arrangement", "use", "temperature"]
    after = len(opened.got)
    opened.ask("result", kind="resume")
    assert opened.wait("selected", after=after)[0]["result"] == 2


def test_a_run_pauses_and_resumes_and_shows_other_layers_meanwhile(opened):
    begin_and_pause(opened)
    for layer in ("temperature", "picture"):
        opened.ask("frame", layer=layer, **WINDOW | {"width": 9}, wanted={"of": "run", "layer": layer, "width": 9})
    assert "result" not in opened.kinds()
    opened.ask("result", kind="resume")
    np.testing.assert_array_equal(opened.latest.image, whole())


def test_the_last_request_counts(opened):
    for seed in range(1, 6):
        opened.say(**asked(seed=seed))
    assert opened.wait("result")[0]["settings"]["seed"] == 5
    assert opened.kinds().count("result") == 1
    begin_and_pause(opened, seed=1)
    assert opened.ask("result", **asked(seed=2))[0]["settings"]["seed"] == 2, "and ends a paused run"


def test_another_picture_ends_the_run(opened):
    begin_and_pause(opened)
    after = len(opened.got)
    opened.ask("ended", png(texture(seed=3)), kind="open", name="other.png")
    assert [kind for kind in opened.kinds(after) if kind in ("picture", "ended")] == ["picture", "ended"]


def test_the_first_picture_is_new_to_the_page_until_it_has_a_result():
    page = Fake(Picture("a.png", texture(), -1))
    message, _ = page.ask("picture", kind="hello")
    assert page.kinds()[:2] == ["hello", "picture"]
    assert (message["name"], message["new"]) == ("a.png", True)
    page.result()
    assert page.ask("picture", kind="hello")[0]["new"] is False
    page.session.close()


def test_maps_have_the_pictures_size_and_are_carried_along(opened):
    assert opened.error(png(texture(9, 9)), kind="map", name="n.png") == (
        "n.png is 9x9 and the picture 48x40; give a map of the picture's size"
    )
    for seed in (1, 2):  # the second replaces the first
        opened.ask("maps", png(texture(channels=1, seed=seed)), kind="map", name="n.png")
    opened.ask("maps", png(texture()), kind="map", name="other.png")
    assert opened.ask("maps", kind="unmap", name="other")[0]["names"] == ["n"]
    opened.result()
    carried = apply_source_map(opened.latest.source, texture(channels=1, seed=2))
    np.testing.assert_array_equal(opened.latest.maps["n"], carried)
    _, (pixels,) = opened.ask("frame", layer="map n", **WINDOW, wanted={"layer": "map n"})
    np.testing.assert_array_equal(np.frombuffer(pixels, np.uint8).reshape(28, 36, 4)[..., 0], carried)


def hole(*strokes):
    return asked(job="fill", hole=list(strokes))


VERSION = "the page and simdtex are of different versions; load the page again"
POINT = "a point of a stroke must be two numbers; paint again"
WRONG = [
    (VERSION, {"kind": "rm -rf"}),
    ("unknown example '../x'; choose one of: tissue, brick, grass, gravel", {"kind": "example", "name": "../x"}),
    ("no file came with that; give the picture again", {"kind": "open", "name": "a.png"}),
    ("result 5 is no longer kept; make it again with its command line", {"kind": "select", "result": 5}),
    ("Result width is 0; give 1 or more", asked(width=0)),
    ("Result width must be an integer, not 'big'", asked(width="big")),
    ("unknown job 'rm'; choose one of: synth, extend, fill, classify", asked(job="rm")),
    ("unknown method 'os'; choose one of: mrf, multires, pyramid", asked(method="os")),
    ("there is no control for 'array'; choose one of: ", asked(options={"array": "4x4"})),
    ("Repeat less (balance) is -1; give a number of at least 0", asked(options={"balance": -1})),
    ("options must be names and values, not 3", asked() | {"options": 3}),
    ("the part reaches beyond the picture of 48x40; choose one within it", asked(part=[40, 0, 20, 20])),
    ("a part of the picture is four numbers: left, top, width and height", asked(part=[1, 2])),
    ("a guide is painted on the sample and on the output; paint both", asked(guide=[1])),
    ("a guide is painted on the sample and on the output; paint both", asked(job="classify", guide=[1])),
    (
        "there is no control for 'order'; choose one of: exemplars, ",
        asked(job="classify", guide=GUIDE, options={"order": 4}),
    ),
    (
        'the mode of a density is of all candidates; give Search "exact", or Relaxation "gibbs"',
        asked(options={"pixel": "density", "search": "coherent"}),
    ),
    (
        "Soften seams (finish) 3 takes means, and of categories there are none; set it",
        asked(options={"finish": 3, "categorical": True}),
    ),
    ("label 1 is on the output and not on the sample;", asked(guide={"output": [stroke((1, 1))]})),
    ("there is no hole to fill; paint over what is to be replaced", hole()),
    ("the hole covers the whole picture; leave some of it", hole(stroke((20, 20), width=200))),
    ("strokes must be a list; paint again", asked(job="fill", hole="x")),
    ("a stroke has no points; paint again", hole({})),
    (POINT, hole({"label": 1, "width": 4, "points": [["a", 1]]})),
    (POINT, hole(stroke((1e30, 0)))),
    ("there are more than 65536 points; paint with a wider brush", hole(stroke(*[(1, 1)] * 70000))),
    ("Result width is 0; give 1 or more", {"kind": "view", "width": 0}),
    ("step is 1000000; give ", {"kind": "view", "step": 10**6}),
    ("a window has at most 4194304 pixels; make it smaller", {"kind": "view", "width": 4096, "height": 4096}),
    ("the layer must be a name", {"kind": "view", "layer": 3}),
]


def test_what_is_wrong_is_said_in_a_sentence_and_the_session_goes_on(opened):
    for sentence, message in WRONG:
        assert opened.error(**message).startswith(sentence), sentence
    assert opened.result(method="pyramid", options={"iterations": 0})["result"] == 1


FILES = [
    (b"", "a.png is empty (0 bytes): give a file with an image in it"),
    (b"hello", "a.png is not an image: give a PNG, JPEG, TIFF, BMP, WebP, GIF, TGA"),
    (png(texture())[:100], "a.png cannot be read as an image"),
    (png(texture(50, 48)), "a.png has 2400 pixels and no more than 2000"),
    (bytes(10001), "the file has 10001 bytes and at most 10000 are taken; give a smaller one"),
]


def test_a_file_that_is_no_picture_is_refused(opened, monkeypatch):
    monkeypatch.setattr(sessions, "MAX_PIXELS", 2000)
    monkeypatch.setattr(sessions, "MAX_BYTES", 10000)
    for data, sentence in FILES:
        assert opened.error(data, kind="open", name="/home/somebody/a.png").startswith(sentence), sentence
    assert opened.result(method="pyramid", options={"iterations": 0})["result"] == 1


def test_an_unforeseen_error_is_told_without_its_words(opened, monkeypatch, caplog):
    monkeypatch.setattr(sessions, "PageJob", lambda *_: 1 / 0)
    assert opened.error(**asked()) == "this is an error in simdtex itself; the terminal says more"
    assert "ZeroDivisionError" in caplog.text


def test_few_results_are_kept(monkeypatch):
    monkeypatch.setattr(results, "Result", lambda _, job, *__: SimpleNamespace(arrays=[np.zeros(job, np.uint8)]))
    monkeypatch.setattr(results, "MAX_RESULTS", 3)
    monkeypatch.setattr(results, "MAX_BYTES", 100)
    kept = PageResults()
    for size, left in ((10, [1]), (10, [1, 2]), (10, [1, 2, 3]), (10, [2, 3, 4]), (95, [5]), (1000, [6])):
        kept.add(size, None, None, 0.0)
        assert list(kept) == left
    assert kept.dropped == [1, 2, 3, 4, 5]


def test_a_result_is_deleted_and_the_latest_other_one_is_shown(opened):
    for seed in (1, 2, 3):
        opened.result(seed=seed)
    assert opened.ask("selected", kind="forget", result=3)[0]["result"] == 2
    after = len(opened.got)
    assert opened.error(kind="forget", result=3).startswith("result 3 is no longer kept")
    opened.ask("selected", kind="forget", result=2)
    opened.say(kind="select", result=1)
    assert opened.wait("selected", after=after, result=1) and list(opened.session.results) == [1]


def test_the_albedo_leads_the_maps_of_a_material(page):
    names = ["T_Wall_N.png", "T_Wall_BC.png", "T_Wall_H.png"]
    assert [page.ask("lead", kind="lead", names=one)[0]["place"] for one in (names, names[::2])] == [1, 0]


def test_a_large_picture_begins_with_its_middle(page, monkeypatch):
    monkeypatch.setattr(sessions, "LARGE", 40)
    monkeypatch.setattr(sessions, "STARTING_SIDE", 32)
    message, (pixels,) = page.ask("picture", png(texture(40, 48)), kind="open", name="a.png")
    assert message["part"] == [8, 4, 32, 32]
    assert len(pixels) == 4 * message["preview"][0] * message["preview"][1]


HARDY = Fake()
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5000) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
FIELDS = ("name", "result", "what", "layer", "left", "top", "width", "height", "step", "tiled", "job", "method", "seed")
FIELDS += ("options", "part", "guide", "hole", "of", "open", "beside", "level", "sweep", "sets", "row", "col")


def test_a_page_without_a_picture_gets_a_small_run_to_play(page, monkeypatch):
    monkeypatch.setattr(sessions, "DEMO_SIDE", 20)
    message, pictures = page.ask("demo", kind="demo")
    assert len(pictures) > 15 and len(set(pictures)) > 10
    assert {len(one) for one in pictures} == {4 * message["width"] * message["height"]}


def test_a_picture_ends_the_small_run(page):
    page.say(kind="demo")
    assert page.ask("picture", png(texture()), kind="open", name="t.png", timeout=60)[0]["new"]
    assert "demo" not in page.kinds()


KINDS = ["hello", "open", "example", "map", "unmap", "pause", "resume", "cancel", "view", "shown", "select", "download"]
KINDS += ["inside", "seek", "explain", "schedules"]


@given(
    st.sampled_from(KINDS),
    st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=4),
    st.lists(st.binary(max_size=30), max_size=2),
)
@settings(max_examples=60)
def test_no_message_does_harm(kind, message, buffers):
    HARDY.say(*buffers, **message | {"kind": kind})
    HARDY.ask("hello", kind="hello")
    assert "this is an error in simdtex itself" not in str(HARDY.got)
    HARDY.got.clear()


def test_a_page_that_is_loaded_during_a_run_shows_what_runs(opened):
    begin_and_pause(opened)
    wanted = opened.session._wanted
    message, _ = opened.ask("picture", kind="hello")
    assert not message["new"] and message["settings"] == wanted
    opened.ask("ended", kind="cancel")
    message, _ = opened.ask("picture", kind="hello")
    assert not message["new"] and message["settings"] == wanted, "also after the run was cancelled"


def test_a_result_is_a_whole_state(opened):
    settings = {"part": [4, 2, 32, 30], "options": {"finish": 0}, "seed": 9}
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="h.png")
    first = opened.result(**settings)["result"]
    opened.ask("maps", kind="unmap", name="h")
    opened.result()
    opened.ask("picture", png(texture(44, 52)), kind="open", name="other.png")
    opened.result(**settings)
    after = len(opened.got)
    chosen, _ = opened.ask("selected", kind="select", result=first)
    assert chosen["settings"] == asked(**settings)
    shown, _ = opened.wait("picture", after=after)
    assert (shown["new"], shown["width"], shown["height"], shown["maps"]) == (False, 48, 40, ["h"])
    assert opened.ask("begun", **asked(**settings))[0]["from"] is None, "states of another picture are not used"
    opened.wait("selected", after=len(opened.got) - 1, result=4)
    np.testing.assert_array_equal(opened.session.results[4].image, opened.session.results[first].image)
    assert opened.session.results[4].maps.keys() == {"h"}
    shown, _ = opened.ask("picture", kind="select", result=3)
    assert (shown["width"], shown["maps"]) == (52, [])


def test_the_present_run_comes_back_with_its_picture(opened):
    first = opened.result()["result"]
    opened.ask("picture", png(texture(20, 24)), kind="open", name="other.png")
    begin_and_pause(opened)
    assert opened.ask("picture", kind="select", result=first)[0]["width"] == 48
    after = len(opened.got)
    shown, _ = opened.ask("picture", kind="select", result=None)
    assert shown["width"] == 24 and shown["settings"] == opened.session._wanted
    assert opened.wait("selected", after=after)[0]["settings"] == opened.session._wanted
    opened.say(kind="resume")
    assert opened.wait("result", after=after)[0]["picture"] == "other.png"


def test_after_a_refusal_no_result_is_shown_as_its(opened):
    opened.result()
    after = len(opened.got)
    assert opened.error(**asked(options={"finish": 99})).startswith("Soften seams (finish) is 99")
    assert opened.wait("error", after=after)[0]["job"] == "synth"
    assert opened.wait("selected", after=after)[0]["result"] is None
    after = len(opened.got)
    assert "no hole" in opened.error(**hole())
    opened.ask("hello", kind="hello")
    assert "selected" not in opened.kinds(after)[: opened.kinds(after).index("hello")], "it is what is to be filled"


def test_too_little_memory_for_a_frame_is_said(opened, monkeypatch):
    def none(*_, **__):
        raise MemoryError

    opened.result()
    monkeypatch.setattr(sessions.frames, "render", none)
    assert "not enough memory" in opened.error(**WINDOW)
    monkeypatch.undo()
    opened.ask("frame", **WINDOW)


def test_picture_and_maps_together_are_bounded(opened, monkeypatch):
    monkeypatch.setattr(sessions, "MAX_HELD", 48 * 40 * 4)
    opened.ask("maps", png(texture(channels=1)), kind="map", name="a.png")
    error = opened.error(png(texture(channels=1)), kind="map", name="b.png")
    assert error == "the picture and its maps have 9600 bytes and at most 7680 are held; remove a map"


def test_a_file_with_further_frames_is_said(page):
    file = io.BytesIO()
    frames = [PIL.Image.fromarray(texture(seed=seed)) for seed in (1, 2)]
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:])
    assert page.ask("picture", file.getvalue(), kind="open", name="a.gif")[0]["more"] is True
    assert page.ask("picture", png(texture()), kind="open", name="a.png")[0]["more"] is False


# -- Strokes become labels, and windows of layers become frames; labels lie over a picture.


def stroke_frames(label, width, *points):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


def test_a_stroke_is_round_and_the_last_one_counts():
    label = paint([stroke_frames(1, 9, (10, 10))], (21, 21))
    i, j = np.indices((21, 21))
    distance = np.hypot(i - 10, j - 10)
    assert (label[distance <= 3.5] == 1).all() and not label[distance > 5.5].any()
    label = paint([stroke_frames(1, 8, (2, 10), (18, 10)), stroke_frames(2, 4, (10, 0), (10, 20))], (21, 21))
    assert (label[10, 4], label[10, 10], label[0, 10], label[0, 0]) == (1, 2, 2, 0)
    assert 7 <= (label[:, 5] == 1).sum() <= 9, "as wide as its stroke"
    assert paint([stroke_frames(1, 8, (5, 5)), stroke_frames(0, 30, (5, 5))], (12, 12)).sum() == 0
    assert paint([stroke_frames(1, 4, (-50, 5), (500, 5))], (12, 12))[5].all(), "it goes on beyond the edges"


@pytest.mark.parametrize("channels", [(), (1,), (2,), (4,)], ids=str)
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_labels_lie_over_a_picture(channels, dtype):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 6, *channels)).astype(dtype)
    pixels[:2, 0] = np.array([0, 255]).reshape(2, *[1] * len(channels))  # black and white
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6) % 3
    colours = np.array([[0, 0, 0], [200, 100, 0], [255, 255, 255]], np.uint8)
    own = pixels.reshape(4, 6, -1)
    own = (own[..., :3] if own.shape[2] > 2 else own[..., :1]).astype(int) * np.ones(3, int)
    for shares in ([0.5, 0.5, 0.5], [0, 0.25, 1]):
        found = render(frames.overlay(pixels, labels, colours, shares), View(width=6, height=4))
        shown = np.frombuffer(found.pixels, np.uint8).reshape(4, 6, 4)[..., :3]
        share = np.array(shares)[labels][..., None]
        np.testing.assert_array_equal(shown, np.floor(own * (1 - share) + colours[labels] * share))


@given(
    *(st.integers(-40, 40), st.integers(-40, 40), st.integers(1, 30), st.integers(1, 30), st.integers(1, 7)),
    st.booleans(),
)
def test_a_window_of_a_layer(left, top, width, height, step, tiled):
    values = np.random.default_rng(0).integers(0, 256, (20, 24, 3), np.uint8)
    found = render(Layer((20, 24), values, np.asarray), View("picture", left, top, width, height, step, tiled))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(found.height, found.width, 4)
    padded = np.pad(values.astype(float), ((200, 200), (200, 200), (0, 0)), "wrap" if tiled else "edge")
    for row in range(found.height):
        for col in range(found.width):
            y, x = found.top + row * step + 200, found.left + col * step + 200
            mean = padded[y : y + step, x : x + step].mean((0, 1))
            assert np.abs(shown[row, col, :3] - mean).max() <= 0.5 + 1e-3
    beside = 20 if tiled else 0  # three times the layer, itself in the middle
    inside = [one for one in range(top, top + step * height, step) if -beside - step < one < 20 + beside]
    assert found.height == len(inside) and (not inside or found.top == inside[0])


def test_a_coarse_level_stands_for_the_whole():
    values = np.arange(9, dtype=np.uint8).reshape(3, 3)
    found = render(Layer((6, 6), values, np.asarray), View(width=6, height=6))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(6, 6, 4)[..., 0]
    np.testing.assert_array_equal(shown, values.repeat(2, 0).repeat(2, 1))


def test_parts_of_a_large_window_are_the_same(monkeypatch):
    values = np.random.default_rng(0).integers(0, 256, (40, 40), np.uint8)
    layer, window = Layer((40, 40), values, np.asarray), View(width=14, height=14, step=3)
    whole = render(layer, window)
    monkeypatch.setattr(frames, "CHUNK", 3 * 3 * 14 * 2)
    assert render(layer, window) == whole


@pytest.mark.slow
def test_a_coarse_window_of_a_tiled_layer_takes_little_memory():
    window = parse_view({"width": 4096, "height": 1024, "step": frames.MAX_STEP, "tiled": True, "left": -(2**14)})
    layer = Layer((512, 2**14), np.zeros((512, 2**14, 3), np.uint8), np.asarray)
    tracemalloc.start()
    found = render(layer, window)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (found.width, found.height) == (96, 2)
    assert most < 50 * 2**20


# -- A look inside a result: moments of its run, and why pixels have their values, as the page is sent them.

SAMPLE = texture(24, 28)
RULES = {"order": 2, "channel_axis": -1, "device": "reference"}


@pytest.fixture
def page_inside():
    page = Fake(Picture("t.png", SAMPLE, -1))
    yield page
    page.session.close(10)


def inside(page, **message):
    return page.ask("inside", kind="inside", open=True, **message)[0]["panes"]


def frame(page, after, pane=0, **values):
    message, (data,) = page.wait("frame", after=after, pane=pane, **values)
    return message, np.frombuffer(data, np.uint8).reshape(message["height"], message["width"], 4)


def after_moments(page):
    """The number of messages up to the answer to a seek: frames that came before it show another moment."""
    return 1 + max(n for n, (message, _) in enumerate(page.got) if message["kind"] == "moments")


def test_moments_are_those_of_the_run(page_inside):
    page_inside.result(width=20, height=18)
    (pane,) = inside(page_inside)
    replay = simdtex.replay(SAMPLE, (18, 20), rng=7, **RULES)
    assert (pane["result"], pane["moment"]) == (1, None)
    assert pane["sweeps"] == [list(one) for one in replay.sweeps]
    for layer in ("picture", "temperature", "sets"):
        page_inside.say(kind="view", layer=layer, left=0, top=0, width=20, height=18, step=1)
        for n in (0, len(replay.sweeps) - 1):
            level, sweep, *_ = replay.sweeps[n]
            assert page_inside.ask("moments", kind="seek", level=level, sweep=sweep, sets=1)[0]["moments"] == [(n, 1)]
            message, seen = frame(page_inside, after_moments(page_inside), layer=layer)
            now = replay.at(n, 1)
            assert (message["rows"], message["cols"]) == (18, 20)
            rows, cols = np.arange(18) // 2**level, np.arange(20) // 2**level
            if layer == "picture":
                np.testing.assert_array_equal(seen[..., :3], now.image[np.ix_(rows, cols)])
            if layer == "sets":
                last = now.relaxed[np.ix_(rows, cols)] == 2
                np.testing.assert_array_equal((seen[..., :3] == SET_COLOURS[2]).all(-1), last)
    assert page_inside.ask("moments", kind="seek", level=99, sweep=99, sets=10**6)[0]["moments"][0][0] < len(
        replay.sweeps
    )
    assert page_inside.ask("moments", kind="seek")[0]["moments"] == [None]
    page_inside.say(kind="view", layer="picture", left=0, top=0, width=20, height=18, step=1)
    seen = frame(page_inside, after_moments(page_inside), layer="picture")[1][..., :3]
    np.testing.assert_array_equal(seen, page_inside.latest.image)


def test_a_pixel_is_explained_as_in_python(page_inside):
    page_inside.result(width=20, height=18)
    inside(page_inside)
    after = len(page_inside.got)
    found, _ = page_inside.ask("explained", kind="explain", row=5, col=7)
    assert json.loads(json.dumps(found, allow_nan=False)) == json.loads(json.dumps(found))
    why = simdtex.explain(SAMPLE, (18, 20), (5, 7), rng=7, **RULES)
    assert (found["pixel"], found["reason"]) == ([5, 7], why.reason)
    taken = next(one for one in found["candidates"] if one["taken"])
    assert taken["place"] == why.candidates.place[why.taken].tolist()
    assert taken["costs"]["total"] == why.candidates.total[why.taken]
    np.testing.assert_array_equal(taken["pixels"], why.candidates.pixels[why.taken])
    np.testing.assert_array_equal(found["pixels"], why.neighbours.pixels)
    assert list(found["channels"]) == ["picture"] * 3 + ["structure"]
    for one, n in zip(found["candidates"], why.shown(), strict=True):  # what is shown adds up to the distance
        terms = ((np.array(found["levels"]) - one["values"][1:]) * found["trust"]) ** 2
        assert terms.sum() == pytest.approx(why.candidates.distance[n], rel=1e-3, abs=1)
    assert len(found["totals"]) == why.weighed and found["totals"][0] == pytest.approx(why.totals[0], abs=0.1)
    page_inside.say(kind="seek", level=9, sweep=1, sets=0)
    assert "has not relaxed yet" in page_inside.ask("explained", kind="explain", row=5, col=7)[0]["reason"]
    assert "error" not in page_inside.kinds(after)
    for row, words in [(18, "give 17 or fewer"), (-1, "give 0 or more"), ("x", "the row of the pixel")]:
        assert words in str(page_inside.ask(("explained", "error"), kind="explain", row=row, col=0)[0])


EXACT = {"order": 2, "search": "exact", "levels": 2, "balance": 0, "relaxation": "gibbs"}


def test_a_pixel_is_explained_with_another_order_and_more_trust(page_inside):
    page_inside.result(width=20, height=18, options=EXACT)
    inside(page_inside)
    (level, sweep, sets, *_) = inside(page_inside)[0]["sweeps"][-2]
    page_inside.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)
    replay = simdtex.replay(SAMPLE, (18, 20), rng=7, **RULES | EXACT)
    for other in ({}, {"order": 4}, {"trust": 1}, {"order": 1, "trust": 0.5}):
        found, _ = page_inside.ask("explained", kind="explain", row=5, col=7, **other)
        why = replay.explain_pixel(5, 7, -2, sets, **other)
        assert (found["order"], found["orders"]) == (other.get("order", 2), 8)
        assert found["reason"] == why.reason
        assert found["offsets"] == why.neighbours.offsets.tolist()
        np.testing.assert_allclose(found["trust"], why.neighbours.confidence, atol=1e-4)
        np.testing.assert_allclose(found["totals"], why.totals[: len(found["totals"])], atol=0.1)
    assert "give 8 or fewer" in page_inside.ask("explained", kind="explain", row=5, col=7, order=9)[0]["reason"]
    assert "trust is 2" in page_inside.ask("explained", kind="explain", row=5, col=7, trust=2)[0]["reason"]
    assert "order at level 0 must be an integer" in page_inside.error(kind="explain", row=5, col=7, order="x")


@pytest.mark.slow
def test_films_of_four_schedules_are_made_while_nothing_else_is_asked(page_inside):
    run = asked(width=7, height=8, options=EXACT | {"levels": 1}, part=[0, 0, 12, 12])
    page_inside.say(**run | {"kind": "schedules"})
    page_inside.result(width=7, height=8)
    found = {name: page_inside.wait("schedule", name=name) for name in FILMED}
    kinds = [kind for kind in page_inside.kinds() if kind in ("result", "schedule")]
    assert kinds.index("result") < len(FILMED), "another request comes before the next film"
    for name, (one, films) in found.items():
        replay = simdtex.replay(SAMPLE[:12, :12], (8, 7), rng=7, **RULES | EXACT | {"levels": 1}, schedule=name)
        assert (one["width"], one["height"]) == (7, 8)
        assert (one["steps"], one["sweeps"]) == (replay.sweeps[0].sets, len(replay.sweeps))
        assert (one["together"] == 0) == (name in ("coloring", "raster"))
        end = np.frombuffer(films[-1], np.uint8).reshape(8, 7, 4)[..., :3]
        np.testing.assert_array_equal(end, replay.at(-1).image, "the last picture is the result")
        seen = np.frombuffer(films[0], np.uint8).reshape(8, 7, 4)
        assert (seen[replay.at(0, 1).relaxed == 2, 0] >= 178).all(), "the sites of the first set are magenta"
        assert len(films) <= FILM_FRAMES + 1
    assert found["synchronous"][0]["together"] == 1


def test_what_no_film_is_made_of(page_inside):
    run = asked(options=EXACT) | {"kind": "schedules"}
    assert "at most 64 x 64" in page_inside.error(**run | {"width": 80})
    assert "no control for 'schedule'" in page_inside.error(**run | {"job": "extend"})
    assert "no control for" in page_inside.error(**run | {"method": "pyramid", "options": {}})


def test_a_density_has_few_bars(page_inside):
    page_inside.result(
        width=14, height=12, options={"pixel": "density", "relaxation": "gibbs", "structure": 0, "levels": 1}
    )
    inside(page_inside)
    found, _ = page_inside.ask("explained", kind="explain", row=5, col=7)
    bars = np.array(found["density"]["bars"])
    assert bars.shape == (3, BARS)
    np.testing.assert_allclose(bars.sum(1), 1)
    assert len(found["density"]["starts"]) == BARS


def test_two_results_side_by_side(page_inside):
    page_inside.result(width=20, height=18)
    page_inside.result(width=20, height=18, options={"schedule": "synchronous"})
    first, second = inside(page_inside, beside=1)
    assert (first["result"], second["result"]) == (2, 1)
    after = len(page_inside.got)
    page_inside.say(kind="view", layer="picture", left=0, top=0, width=20, height=18, step=1)
    level, sweep, sets, *_ = first["sweeps"][-1]
    moments = page_inside.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)[0]["moments"]
    assert [len(one) for one in moments] == [2, 2]
    assert {frame(page_inside, after, pane)[0]["of"] for pane in (0, 1)} == {1, 2}
    page_inside.say(kind="explain", row=3, col=4)
    assert page_inside.wait("explained", pane=1, after=after)[0]["pixel"] == [3, 4]


def test_a_seamless_picture_is_looked_into(page_inside):
    page_inside.result(job="extend", options={"order": 2})
    (pane,) = inside(page_inside)
    assert pane["sweeps"]
    found, _ = page_inside.ask("explained", kind="explain", row=0, col=0)
    assert found["candidates"]
    assert "value is given" in page_inside.ask("explained", kind="explain", row=11, col=13)[0]["reason"]


@pytest.mark.parametrize("message", [{"method": "pyramid"}, {"method": "multires"}])
def test_other_methods_are_refused(page_inside, message):
    page_inside.result(width=20, height=18, **message)
    assert 'method "Markov random field"' in page_inside.error(kind="inside", open=True)


def test_what_cannot_be_looked_into(page_inside):
    assert "no result" in page_inside.error(kind="inside", open=True)
    page_inside.result(width=20, height=18)
    assert "no longer kept" in page_inside.error(kind="inside", open=True, beside=5)
    inside(page_inside)
    page_inside.result(width=20, height=18, seed=2)
    assert page_inside.session._inside == {}, "another result is not looked into by itself"
    inside(page_inside)
    page_inside.ask("frame", kind="inside", open=False)
    assert page_inside.session._inside == {}


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


def test_a_filled_hole_is_looked_into(page_inside):
    page_inside.result(job="fill", hole=HOLE, options={"order": 2, "finish": 0})
    image, hole = page_inside.latest.image, paint(HOLE, SAMPLE.shape) > 0
    (pane,) = inside(page_inside)
    level, sweep, sets, *_ = pane["sweeps"][-1]
    page_inside.say(kind="view", layer="picture", left=0, top=0, width=28, height=24, step=1)
    page_inside.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)
    seen = frame(page_inside, after_moments(page_inside), layer="picture")[1][..., :3]
    np.testing.assert_array_equal(seen, image, "the end is the result")
    page_inside.ask("moments", kind="seek", level=pane["sweeps"][0][0], sweep=1, sets=0)
    seen = frame(page_inside, after_moments(page_inside), layer="picture")[1][..., :3]
    np.testing.assert_array_equal(seen[~hole], SAMPLE[~hole])
    assert (seen[hole] != image[hole]).any(), "the hole has changed since"

    row, col = np.argwhere(hole)[0].tolist()
    page_inside.ask("moments", kind="seek")
    found, _ = page_inside.ask("explained", kind="explain", row=row, col=col)
    taken = next(one for one in found["candidates"] if one["taken"])
    assert taken["place"] == page_inside.latest.source[row, col].tolist()
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
    assert "value is given" in page_inside.ask("explained", kind="explain", row=0, col=0)[0]["reason"]


def test_moments_of_a_hole_in_uneven_light_have_the_light():
    """Up to the finish, which changes a pixel by less than the trend from the first row to the last."""
    picture = (SAMPLE // 16 + np.arange(24, dtype=np.uint8)[:, None, None] * 10).astype(np.uint8)
    page = Fake(Picture("sky.png", picture, -1))
    try:
        page.result(job="fill", hole=[{"label": 1, "width": 5, "points": [[4, 3], [22, 3]]}], options={"order": 2})
        level, sweep, sets, *_ = inside(page)[0]["sweeps"][-1]
        page.say(kind="view", layer="picture", left=0, top=0, width=28, height=24, step=1)
        page.ask("moments", kind="seek", level=level, sweep=sweep, sets=sets)
        seen = frame(page, after_moments(page), layer="picture")[1][..., :3]
        assert abs(seen - page.latest.image.astype(int)).max() < 16
    finally:
        page.session.close(10)


def test_the_sample_of_a_look_is_that_of_the_run(page_inside):
    page_inside.result(width=20, height=18, part=[4, 2, 16, 12])
    told, (small,) = page_inside.ask("inside", kind="inside", open=True)
    assert (told["panes"][0]["width"], told["panes"][0]["height"]) == (16, 12)
    part = np.frombuffer(small, np.uint8).reshape(*told["panes"][0]["preview"][::-1], 4)[..., :3]
    np.testing.assert_array_equal(part, SAMPLE[2:14, 4:20])
    after = len(page_inside.got)
    page_inside.say(kind="view", layer="sample", left=0, top=0, width=28, height=24, step=1)
    np.testing.assert_array_equal(frame(page_inside, after, layer="sample")[1][..., :3], part)


def test_several_holes_are_not_looked_into():
    page = Fake(Picture("t.png", texture(90, 100), -1))
    try:
        hole = [{"label": 1, "width": 5, "points": [[x, 12]]} for x in (10, 90)]
        page.result(job="fill", hole=hole, options={"order": 2})
        assert "fill one hole" in page.error(kind="inside", open=True)
    finally:
        page.session.close(10)


# -- The controls of the live page are the declared options.


@pytest.mark.parametrize("name", TABLES)
def test_controls_are_what_options_may_be_and_the_command_line_has_them(name):
    options, command = TABLES[name]
    flags = {flag for one in cli.load(command).params if isinstance(one, click.Option) for flag in one.opts}
    own = {other: one for other, one in table(options).items() if command in one.shown} | {"light": LIGHT}
    found = json.loads(json.dumps(controls(name), allow_nan=False))  # as the page gets them
    assert {one["name"] for one in found} <= own.keys()
    for control in found:
        one = own[control["name"]]
        assert f"--{control['name'].replace('_', '-')}" in flags
        assert control["hint"].startswith(one.hint or one.help) and control["group"] == one.group and control["label"]
        assert control["default"] == one.default_of(command)
        if control["kind"] == "words":
            assert [word for word, _ in control["valid"]] == list(one.kind.valid)
            assert "[" not in control["hint"] and "DY" not in control["hint"], "a choice takes no text"
        elif control["kind"] != "switch":
            least, most, step = control["span"]
            assert control["least"] == (one.kind.least if one.kind.least > -inf else None)
            assert one.kind.least <= least < most <= one.kind.most and step > 0
            if control["default"] is None:
                assert control["empty"], "it says what an empty field means"
            else:
                assert least <= control["default"] <= most


def test_jobs_have_their_own_defaults():
    assert {one["name"]: one["default"] for one in controls("fill")}["balance"] == 0
    assert "boundary" not in {one["name"] for one in controls("extend")}
