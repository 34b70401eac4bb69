"""The sessions of the live page: command lines that repeat a result, restarts, pauses, frames, and error messages."""

import io
import shlex
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from live import Fake, asked, png, striped, texture
from PIL import ImageCms

import simdtex
from simdtex import cli
from simdtex.io.image import read_bytes
from simdtex.live import results
from simdtex.live import session as sessions
from simdtex.live.job import LABELS, Picture
from simdtex.live.results import Results
from simdtex.live.session import Levels
from simdtex.methods import mrf
from simdtex.methods.classifier import algorithm
from simdtex.model.labels import read_labels
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


def whole(shape=(28, 36), **options):
    """What is made by one call, as `asked` asks for it."""
    options = {"order": 4, "rng": 7} | options
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


SLOW = ("guide-everywhere", "guide-of-a-part", "extend-a-part")


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
CHANGES = [
    ({"finish": 0.5}, 0),
    ({}, 0),
    ({"search": "exact", "finish": 0}, COARSEST),
    ({"coherence": 1.0}, None),
    pytest.param({"edges": "whole"}, None, marks=pytest.mark.slow),
    pytest.param({"levels": 1}, None, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("options", "level"), CHANGES, ids=str)
def test_a_change_restarts_from_the_level_it_affects_and_gives_the_same_bytes(opened, options, level):
    opened.result()
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
        after = len(opened.got)
        opened.result(**other)
        assert opened.wait("begun", after=after)[0]["from"] is None, other
    opened.ask("picture", png(texture(seed=3)), kind="open", name="other.png")
    after = len(opened.got)
    opened.result()
    assert opened.wait("begun", after=after)[0]["from"] is None


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


def test_a_page_that_is_loaded_again_gets_everything(opened):
    opened.result()
    opened.result(seed=8)
    after = len(opened.got)
    assert opened.ask("selected", kind="hello")[0] == {"kind": "selected", "result": 2, "settings": None}
    told = [message for message, _ in opened.got[after:] if message["kind"] != "frame"]
    assert [one["kind"] for one in told] == ["hello", "picture", "result", "result", "selected"]
    assert not told[0]["fresh"] and not told[1]["new"]


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
    ("unknown example '../x'; choose one of: brick, grass, gravel", {"kind": "example", "name": "../x"}),
    ("no file came with that; give the picture again", {"kind": "open", "name": "a.png"}),
    ("result 5 is no longer kept; make it again with its command line", {"kind": "select", "result": 5}),
    ("width is 0; give 1 or more", asked(width=0)),
    ("width must be an integer, not 'big'", asked(width="big")),
    ("unknown job 'rm'; choose one of: synth, extend, fill, classify", asked(job="rm")),
    ("unknown method 'os'; choose one of: mrf, multires, pyramid", asked(method="os")),
    ("there is no control for 'array'; choose one of: ", asked(options={"array": "4x4"})),
    ("balance is -1; give a number of at least 0", asked(options={"balance": -1})),
    ("options must be names and values, not 3", asked() | {"options": 3}),
    ("the part reaches beyond the picture of 48x40; choose one within it", asked(part=[40, 0, 20, 20])),
    ("a part of the picture is four numbers: left, top, width and height", asked(part=[1, 2])),
    ("a guide is painted on the sample and on the output; paint both", asked(guide=[1])),
    ("a guide is painted on the sample and on the output; paint both", asked(job="classify", guide=[1])),
    (
        "there is no control for 'order'; choose one of: exemplars, ",
        asked(job="classify", guide=GUIDE, options={"order": 4}),
    ),
    ("label 1 is on the output and not on the sample;", asked(guide={"output": [stroke((1, 1))]})),
    ("there is no hole to fill; paint over what is to be replaced", hole()),
    ("the hole covers the whole picture; leave some of it", hole(stroke((20, 20), width=200))),
    ("strokes must be a list; paint again", asked(job="fill", hole="x")),
    ("a stroke has no points; paint again", hole({})),
    (POINT, hole({"label": 1, "width": 4, "points": [["a", 1]]})),
    (POINT, hole(stroke((1e30, 0)))),
    ("there are more than 65536 points; paint with a wider brush", hole(stroke(*[(1, 1)] * 70000))),
    ("width is 0; give 1 or more", {"kind": "view", "width": 0}),
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
    monkeypatch.setattr(sessions, "Job", lambda *_: 1 / 0)
    assert opened.error(**asked()) == "this is an error in simdtex itself; the terminal says more"
    assert "ZeroDivisionError" in caplog.text


def test_few_results_are_kept(monkeypatch):
    monkeypatch.setattr(results, "Result", lambda _, job, *__: SimpleNamespace(arrays=[np.zeros(job, np.uint8)]))
    monkeypatch.setattr(results, "MAX_RESULTS", 3)
    monkeypatch.setattr(results, "MAX_BYTES", 100)
    kept = Results()
    for size, left in ((10, [1]), (10, [1, 2]), (10, [1, 2, 3]), (10, [2, 3, 4]), (95, [5]), (1000, [6])):
        kept.add(size, None, None, 0.0)
        assert list(kept) == left
    assert kept.dropped == [1, 2, 3, 4, 5]


def test_a_large_picture_begins_with_its_middle(page, monkeypatch):
    monkeypatch.setattr(sessions, "LARGE", 32)
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
    assert len(pictures) > 15 and len(set(pictures)) > 15
    assert {len(one) for one in pictures} == {4 * message["width"] * message["height"]}


def test_a_picture_ends_the_small_run(page):
    page.say(kind="demo")
    assert page.ask("picture", png(texture()), kind="open", name="t.png", timeout=60)[0]["new"]
    assert "demo" not in page.kinds()


KINDS = ["hello", "open", "example", "map", "unmap", "pause", "resume", "cancel", "view", "shown", "select", "download"]
KINDS += ["inside", "seek", "explain"]


@given(
    st.sampled_from(KINDS),
    st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=4),
    st.lists(st.binary(max_size=30), max_size=2),
)
@settings(max_examples=200)
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
    assert opened.error(**asked(options={"finish": 99})).startswith("finish is 99")
    assert opened.wait("error", after=after)[0]["job"] == "synth"
    assert opened.wait("selected", after=after)[0]["result"] is None
    after = len(opened.got)
    assert "no hole" in opened.error(**hole())
    opened.ask("hello", kind="hello")
    assert "selected" not in opened.kinds(after)[: opened.kinds(after).index("hello")], "it is what is to be filled"


def test_frames_that_are_not_shown_are_few(opened):
    opened.sees = False
    opened.result()
    after = len(opened.got)
    for left in range(50):
        opened.session.receive(WINDOW | {"left": left}).wait(5)
    opened.ask("hello", kind="hello")
    assert opened.kinds(after).count("frame") <= sessions.MAX_UNSEEN


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


def test_results_hold_their_picture_once(opened, monkeypatch):
    for seed in (1, 2):
        opened.result(seed=seed)
    kept = opened.session.results
    own = sum(one.image.nbytes + one.source.nbytes + one.temperature.nbytes for one in kept.values())
    assert kept.nbytes == own + texture().nbytes


def test_a_file_with_further_frames_is_said(page):
    file = io.BytesIO()
    frames = [PIL.Image.fromarray(texture(seed=seed)) for seed in (1, 2)]
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:])
    assert page.ask("picture", file.getvalue(), kind="open", name="a.gif")[0]["more"] is True
    assert page.ask("picture", png(texture()), kind="open", name="a.png")[0]["more"] is False
