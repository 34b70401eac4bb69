"""Sessions of the live page: commands that repeat a result, restarts, frames during a run, and error messages."""

import io
import shlex
from functools import partial
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
from simdtex import commands as cli
from simdtex.io.image import read_bytes
from simdtex.jobs.classification import algorithm
from simdtex.live import results
from simdtex.live import session as sessions
from simdtex.live.job import LABELS, Picture, file_stem
from simdtex.live.results import PageResults
from simdtex.live.session import Levels
from simdtex.methods import mrf
from simdtex.model.display import read_labels
from simdtex.model.source_map import apply_source_map


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


@pytest.fixture
def every_frame(monkeypatch):
    monkeypatch.setattr(sessions, "INTERVAL", 0)
    monkeypatch.setattr(sessions, "MAX_RATE", 1e9)


def whole(shape=(28, 36), **options):
    """What is made by one call, as `asked` asks for it."""
    options = {"order": 2, "rng": 7} | options
    return simdtex.synthesize(texture(), shape, channel_axis=-1, device="reference", **options)


def stroke(*points, label=1, width=6):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


def strokes(*labels):
    """The classes of `striped`, a stroke over each."""
    places = [((20 + 40 * k, 10), (20 + 40 * k, 38)) for k in range(len(labels))]
    return {"sample": [stroke(*ends, label=label, width=12) for ends, label in zip(places, labels, strict=True)]}


def begin_and_pause(page, **settings):
    """Have something made, and pause it at its first frame."""
    page.say(**asked(**settings))
    page.ask("progress", kind="pause", wanted={"paused": True})


WINDOW = {"kind": "view", "left": 0, "top": 0, "width": 64, "height": 64, "step": 1, "tiled": False}
GUIDE = {
    "sample": [stroke((0, 10), (47, 10), width=20), stroke((0, 30), (47, 30), label=2, width=20)],
    "output": [stroke((0, 5), (55, 5), label=2, width=10)],
}
OPTIONS = {"balance": 1, "novelty": 0.5, "categorical": False, "finish": 0, "xi": -2.0}
JOBS = {
    "options": {"options": OPTIONS},
    "guide": {"guide": GUIDE, "part": [2, 1, 44, 38]},
    "hole": {"job": "fill", "of": 1, "hole": [stroke((20, 20), (30, 24)), stroke((25, 22), label=0, width=2)]},
    "multires": {"method": "multires"},
    "pyramid": {"method": "pyramid", "options": {"iterations": 2}},
    "seamless": {"job": "extend", "part": [0, 0, 40, 36]},
}
QUICK = ("options", "guide", "hole")


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


@pytest.mark.parametrize("case", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in JOBS])
def test_the_command_of_a_result_repeats_its_bytes(opened, case, tmp_path, monkeypatch):
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="Height map.png")
    if case == "hole":
        opened.result()
    result = opened.result(**JOBS[case])
    carried = ["map height-map"] * (case != "pyramid")
    assert [layer for layer in result["layers"] if layer.startswith("map")] == carried
    if case == "hole":
        assert result["files"] == ["texture.png", "texture-height-map.png", "arrangement.npz", "texture.zip"]
    assert_command_repeats(opened, result["result"], tmp_path, monkeypatch)


def test_a_classification_is_shown_over_the_picture_and_its_command_repeats_its_bytes(
    page, every_frame, tmp_path, monkeypatch
):
    monkeypatch.setattr(algorithm, "WORK", 2**25)
    pixels = np.dstack([striped(), np.where(striped(1) > 90, 255, 100).astype(np.uint8)])
    page.ask("picture", png(pixels), kind="open", name="Labels.png")
    page.ask("maps", png(pixels), kind="map", name="h.png")
    page.ask("frame", layer="labels", **WINDOW | {"width": 96})
    after = len(page.got)
    result = page.result(job="classify", guide=strokes(1, 3), part=[0, 0, 20, 20])
    page.wait("frame", after=after, of=1)
    assert (result["width"], result["height"], result["layers"]) == (96, 48, ["sample", "labels"])
    assert result["files"] == ["labels.png", "strokes.png", "labels.zip"]
    command = shlex.split(result["command"])
    assert command[:7] == ["simdtex", "classify", "sample.png", "-o", "labels.png", "--strokes", "strokes.png"]
    labels, painted = page.latest.image, page.latest.job.files["strokes.png"]
    assert np.unique(painted).tolist() == [0, 1, 3]
    assert (labels[:, :36] == 1).mean() > 0.3 and not (labels[:, :36] == 3).any()
    assert result["shares"] == [(label, pytest.approx((labels == label).mean())) for label in (0, 1, 3)]
    assert page.wait("begun")[0]["layers"] == ["labels", "sample"]
    sent = [(one, buffers) for one, buffers in page.got[after:] if one["kind"] == "frame" and one["of"] != "sample"]
    assert {one["layer"] for one, _ in sent} == {"labels"} and len(sent) > 4
    first, *_, last = [np.frombuffer(data, np.uint8).reshape(48, 96, 4)[..., :3] for _, (data,) in sent]
    plain = (first == striped()).all((1, 2))
    assert not plain[0] and plain[-1] and (np.diff(plain.astype(int)) >= 0).all(), "from the top to the bottom"
    np.testing.assert_array_equal(last, (striped().astype(int) + LABELS[labels]) // 2)
    assert_command_repeats(page, 1, tmp_path, monkeypatch)
    for name, expected in (("labels.png", labels), ("strokes.png", painted)):
        np.testing.assert_array_equal(read_labels(tmp_path / name), expected)


def test_too_little_paint_is_a_hint_and_no_error(page):
    page.ask("picture", png(striped()), kind="open", name="a.png")
    for sentence, guide in (
        ("no label is painted yet; paint over two or more textures of the picture, each with a label of its own", {}),
        ("only label 3 is painted; paint over two or more textures", strokes(3)),
        (
            "label 2 is painted on 5 pixels; paint 16 or more",
            {"sample": [*strokes(1)["sample"], stroke((60, 20), label=2, width=2)]},
        ),
    ):
        hint, _ = page.ask(("hint", "error", "begun"), **asked(job="classify", guide=guide))
        assert hint["kind"] == "hint" and hint["text"].startswith(sentence), hint


def test_no_file_of_a_package_takes_the_name_of_another():
    names = {"hole.png": "sample", "Guide sample.PNG": "sample", "?.png": "sample", "Old Wall.PNG": "old-wall"}
    assert {name: file_stem(name, "sample") for name in names} == names


def test_16_bits_stay_and_a_download_has_the_colours_of_the_picture(page):
    deep = Fake(Picture("sample.tif", texture(channels=1, dtype=np.uint16), None))
    deep.result(options={"finish": 0})
    _, (data,) = deep.ask("file", kind="download", result=1, name="texture.png")
    pixels = read_bytes("texture.png", data).pixels
    assert pixels.dtype == np.uint16 and set(np.unique(pixels)) <= set(np.unique(deep.latest.job.sample))
    deep.session.close()
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    file = io.BytesIO()
    PIL.Image.fromarray(texture()).save(file, "PNG", icc_profile=profile, dpi=(300, 300))
    page.ask("picture", file.getvalue(), kind="open", name="photo.png")
    package = page.package(page.result()["result"])
    for name in ("photo.png", "texture.png"):
        metadata = read_bytes(name, package[name]).metadata
        assert metadata.profile == profile and metadata.dpi == pytest.approx((300, 300), abs=0.01)


@pytest.mark.parametrize(
    ("before", "options", "level"),
    [
        ({}, {"finish": 0.5}, 0),
        ({"lattice": "none"}, {"lattice": "none", "search": "exact", "finish": 0}, 2),
        pytest.param({}, {"edges": "whole"}, None, marks=pytest.mark.slow),
    ],
)
def test_a_change_restarts_from_the_level_it_affects_and_gives_the_same_bytes(opened, before, options, level):
    opened.result(options=before)
    after = len(opened.got)
    opened.result(options=options)
    assert opened.wait("begun", after=after)[0]["from"] == level
    np.testing.assert_array_equal(opened.latest.image, whole(**options))


def test_a_cancelled_run_is_continued_and_another_one_begins_anew(opened):
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
    for other in ({"seed": 8}, {"part": [0, 0, 40, 40]}, {"guide": GUIDE}):
        assert opened.ask("begun", **asked(**other))[0]["from"] is None, other
    opened.ask("picture", png(texture(seed=3)), kind="open", name="other.png")
    assert opened.ask("begun", **asked(**other))[0]["from"] is None


def test_states_are_kept_apart_from_the_runs_that_use_them():
    before = Levels(("key",), mrf.Options())
    state = {"state": np.zeros(4), "observer": [1]}
    for ended, level in ((True, 1), (False, 0)):
        before.checkpointing.offer(SimpleNamespace(ended=ended, level=level), lambda: state)
    state["observer"].append(2)
    state["state"][:] = 1
    assert before.level == 1, "states within a level are not kept"
    kept = Levels(("key",), mrf.Options(finish=0.5), before).checkpointing.found
    assert kept["observer"] == [1] and not kept["state"].any()
    kept["observer"].append(3)
    assert before.checkpointing.found["observer"] == [1]
    for other in (Levels(("other",), mrf.Options(), before), Levels(None, mrf.Options(), before)):
        assert other.checkpointing.found is None
    other.checkpointing.offer(SimpleNamespace(ended=True, level=1), lambda: state)
    assert other.level is None, "without a key no state is kept"


def test_frames_go_from_coarse_to_fine_and_end_in_the_result(opened, every_frame):
    opened.ask("frame", layer="picture", **WINDOW)
    after = len(opened.got)
    opened.result()
    _, (pixels,) = opened.wait("frame", after=after, of=1)
    progress = [message for message, _ in opened.got[after:] if message["kind"] == "progress"]
    assert len(progress) == sum(message.get("of") == "run" for message, _ in opened.got[after:])
    levels = [one["level"] for one in progress]
    assert levels == sorted(levels, reverse=True) and set(levels) >= {0, 1}
    assert all(0 <= one["fraction"] <= 1 for one in progress)
    shown = np.frombuffer(pixels, np.uint8).reshape(28, 36, 4)
    np.testing.assert_array_equal(shown[..., :3], opened.latest.image)
    assert (shown[..., 3] == 255).all()


def test_layers_are_shown_during_a_run_and_afterwards(opened, every_frame):
    for seed, layer in enumerate(("temperature", "arrangement", "use", "sample")):
        opened.ask("frame", layer=layer, **WINDOW)
        after = len(opened.got)
        result = opened.result(seed=seed)
        message, (pixels,) = opened.wait("frame", after=after, of=result["result"])
        running = [one for one, _ in opened.got[after:] if one["kind"] == "frame" and one["of"] == "run"]
        assert running and all(one["layer"] == layer for one in running)
        shape = (40, 48) if layer in ("use", "sample") else (28, 36)  # of the sample, and of the output
        assert layer in result["layers"] and message["layer"] == layer
        assert (message["rows"], message["cols"]) == shape == (message["height"], message["width"])
        assert len(pixels) == 4 * shape[0] * shape[1]


def test_no_more_frames_are_sent_than_are_shown(every_frame):
    page = Fake(Picture("a.png", texture(), -1), sees=False)
    page.result()
    kinds = page.kinds()
    assert kinds[: kinds.index("result")].count("frame") <= sessions.MAX_UNSEEN
    page.session.close()


def test_an_earlier_result_is_shown_during_a_run(opened, monkeypatch):
    opened.result()
    begin_and_pause(opened, seed=8, width=50)
    frame, _ = opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    assert (frame["cols"], frame["layer"]) == (36, "picture")
    opened.ask("frame", kind="select", result=None, wanted={"of": "run"})
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    opened.ask("result", kind="resume", wanted={"result": 2, "width": 50})
    assert opened.ask("selected", kind="hello")[0]["result"] == 1, "the page goes on showing what it has selected"
    assert opened.kinds(after).count("selected") == 1
    monkeypatch.setattr(results, "MAX_RESULTS", 2)
    begin_and_pause(opened)
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    assert opened.ask("result", kind="resume")[0]["dropped"] == [1]
    assert opened.wait("selected", after=after)[0]["result"] == 3, "a dropped result is shown no longer"


def test_a_page_that_is_loaded_again_shows_what_runs(opened):
    assert opened.ask("picture", kind="hello")[0]["new"] is True
    opened.result()
    begin_and_pause(opened, seed=8)
    picture, _ = opened.ask("picture", kind="hello")
    assert not picture["new"] and picture["settings"] == opened.session._wanted
    opened.ask("frame", kind="select", result=1, wanted={"of": 1})
    after = len(opened.got)
    begun, _ = opened.ask("begun", kind="hello")
    kinds = [kind for kind in opened.kinds(after) if kind not in ("frame", "progress")]
    assert kinds == ["hello", "picture", "result", "begun"]
    assert begun["layers"] == ["picture", "sample", "arrangement", "use", "temperature"]
    after = len(opened.got)
    opened.ask("result", kind="resume")
    assert opened.wait("selected", after=after)[0]["result"] == 2


def test_a_run_pauses_and_resumes_and_the_last_request_counts(opened):
    begin_and_pause(opened)
    for layer in ("temperature", "picture"):
        opened.ask("frame", layer=layer, **WINDOW | {"width": 9}, wanted={"of": "run", "layer": layer, "width": 9})
    assert "result" not in opened.kinds()
    opened.ask("result", kind="resume")
    np.testing.assert_array_equal(opened.latest.image, whole())
    after = len(opened.got)
    for seed in range(1, 4):
        opened.say(**asked(seed=seed))
    assert opened.wait("result", after=after)[0]["settings"]["seed"] == 3
    assert opened.kinds(after).count("result") == 1
    begin_and_pause(opened, seed=1)
    assert opened.ask("begun", **asked(seed=2)), "which ends a paused run"
    after = len(opened.got)
    begin_and_pause(opened, seed=1)
    opened.ask("ended", png(texture(seed=3)), kind="open", name="other.png")
    assert [kind for kind in opened.kinds(after) if kind in ("picture", "ended")][-2:] == ["picture", "ended"]


def test_maps_have_the_pictures_size_and_are_carried_along(opened, monkeypatch):
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
    monkeypatch.setattr(sessions, "MAX_HELD", 48 * 40 * 4)
    error = opened.error(png(texture(channels=1)), kind="map", name="b.png")
    assert error == "the picture and its maps have 9600 bytes and at most 7680 are held; remove a map"


def hole(*strokes):
    return asked(job="fill", hole=list(strokes))


POINT = "a point of a stroke must be two numbers; paint again"
WRONG = [
    ("the page and simdtex are of different versions; load the page again", {"kind": "rm -rf"}),
    ("unknown example '../x'; choose one of: tissue, brick, grass, gravel", {"kind": "example", "name": "../x"}),
    ("no file came with that; give the picture again", {"kind": "open", "name": "a.png"}),
    ("result 5 is no longer kept; make it again with its command line", {"kind": "select", "result": 5}),
    ("Result width is 0; give 1 or more", asked(width=0)),
    ("unknown job 'rm'; choose one of: synth, extend, fill, classify", asked(job="rm")),
    ("there is no control for 'array'; choose one of: ", asked(options={"array": "4x4"})),
    ("Repeat less (balance) is -1; give a number of at least 0", asked(options={"balance": -1})),
    ("options must be names and values, not 3", asked() | {"options": 3}),
    ("the part reaches beyond the picture of 48x40; choose one within it", asked(part=[40, 0, 20, 20])),
    ("a part of the picture is four numbers: left, top, width and height", asked(part=[1, 2])),
    ("a guide is painted on the sample and on the output; paint both", asked(guide=[1])),
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
    ("step is 1000000; give ", {"kind": "view", "step": 10**6}),
    ("a window has at most 4194304 pixels; make it smaller", {"kind": "view", "width": 4096, "height": 4096}),
    ("the layer must be a name", {"kind": "view", "layer": 3}),
]


def test_what_is_wrong_is_said_in_a_sentence_and_the_session_goes_on(opened, monkeypatch, caplog):
    for sentence, message in WRONG:
        assert opened.error(**message).startswith(sentence), sentence
    monkeypatch.setattr(sessions, "MAX_PIXELS", 2000)
    monkeypatch.setattr(sessions, "MAX_BYTES", 10000)
    for data, sentence in (
        (b"", "a.png is empty (0 bytes): give a file with an image in it"),
        (b"hello", "a.png is not an image: give a PNG, JPEG, TIFF, BMP, WebP, GIF, TGA"),
        (png(texture(50, 48)), "a.png has 2400 pixels and no more than 2000"),
        (bytes(10001), "the file has 10001 bytes and at most 10000 are taken; give a smaller one"),
    ):
        assert opened.error(data, kind="open", name="/home/somebody/a.png").startswith(sentence), sentence
    assert opened.result(method="pyramid", options={"iterations": 0})["result"] == 1
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
        opened.result(seed=seed, method="pyramid", options={"iterations": 0})
    assert opened.ask("selected", kind="forget", result=3)[0]["result"] == 2
    after = len(opened.got)
    assert opened.error(kind="forget", result=3).startswith("result 3 is no longer kept")
    opened.ask("selected", kind="forget", result=2)
    opened.say(kind="select", result=1)
    assert opened.wait("selected", after=after, result=1) and list(opened.session.results) == [1]


def test_what_is_told_of_files_before_a_run(page, monkeypatch):
    names = ["T_Wall_N.png", "T_Wall_BC.png", "T_Wall_H.png"]
    assert [page.ask("lead", kind="lead", names=some)[0]["place"] for some in (names, names[::2])] == [1, 0]
    file = io.BytesIO()
    frames = [PIL.Image.fromarray(texture(seed=seed)) for seed in (1, 2)]
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:])
    assert page.ask("picture", file.getvalue(), kind="open", name="a.gif")[0]["more"] is True
    monkeypatch.setattr(sessions, "LARGE", 40)
    monkeypatch.setattr(sessions, "STARTING_SIDE", 32)
    message, (pixels,) = page.ask("picture", png(texture()), kind="open", name="a.png")
    assert (message["part"], message["more"]) == ([8, 4, 32, 32], False)
    assert len(pixels) == 4 * message["preview"][0] * message["preview"][1]


def test_a_page_without_a_picture_gets_a_small_run_to_play(page, monkeypatch):
    monkeypatch.setattr(sessions, "DEMO_SIDE", 20)
    monkeypatch.setattr(sessions, "synthesize", partial(simdtex.synthesize, order=2))
    message, pictures = page.ask("demo", kind="demo")
    assert len(set(pictures)) > 4
    assert {len(one) for one in pictures} == {4 * message["width"] * message["height"]}
    after = len(page.got)
    page.say(kind="demo")
    page.ask("hello", kind="hello")
    assert "demo" not in page.kinds(after), "which any message ends"


def test_a_result_is_a_whole_state(opened):
    settings = {"part": [4, 2, 32, 30], "options": {"finish": 0}, "seed": 9}
    opened.ask("maps", png(texture(channels=1, seed=2)), kind="map", name="h.png")
    first = opened.result(**settings)["result"]
    opened.ask("maps", kind="unmap", name="h")
    opened.ask("picture", png(texture(44, 52)), kind="open", name="other.png")
    second = opened.result(**settings)["result"]
    after = len(opened.got)
    chosen, _ = opened.ask("selected", kind="select", result=first)
    assert chosen["settings"] == asked(**settings)
    shown, _ = opened.wait("picture", after=after)
    assert (shown["new"], shown["width"], shown["height"], shown["maps"]) == (False, 48, 40, ["h"])
    assert opened.ask("begun", **asked(**settings))[0]["from"] is None, "states of another picture are not used"
    opened.wait("selected", after=len(opened.got) - 1, result=3)
    np.testing.assert_array_equal(opened.session.results[3].image, opened.session.results[first].image)
    assert opened.session.results[3].maps.keys() == {"h"}
    shown, _ = opened.ask("picture", kind="select", result=second)
    assert (shown["width"], shown["maps"]) == (52, [])
    begin_and_pause(opened)
    assert opened.ask("picture", kind="select", result=first)[0]["width"] == 48
    after = len(opened.got)
    shown, _ = opened.ask("picture", kind="select", result=None)
    assert shown["width"] == 52 and shown["settings"] == opened.session._wanted
    assert opened.wait("selected", after=after)[0]["settings"] == opened.session._wanted


def test_after_a_refusal_no_result_is_shown_as_its(opened, monkeypatch):
    opened.result()
    after = len(opened.got)
    assert opened.error(**asked(options={"finish": 99})).startswith("Soften seams (finish) is 99")
    assert opened.wait("error", after=after)[0]["job"] == "synth"
    assert opened.wait("selected", after=after)[0]["result"] is None
    after = len(opened.got)
    assert "no hole" in opened.error(**hole())
    opened.ask("hello", kind="hello")
    assert "selected" not in opened.kinds(after)[: opened.kinds(after).index("hello")], "it is what is to be filled"

    def none(*_, **__):
        raise MemoryError

    monkeypatch.setattr(sessions.frames, "render", none)
    assert "not enough memory" in opened.error(**WINDOW)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5000) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
FIELDS = "name result layer left width step tiled job method seed options part guide hole of open beside level sets row"
KINDS = "hello open example map unmap pause resume cancel view shown select download inside seek explain schedules"


@pytest.mark.slow
def test_no_message_does_harm():
    page = Fake()

    @given(
        st.sampled_from(KINDS.split()),
        st.dictionaries(st.sampled_from(FIELDS.split()), JSON, max_size=4),
        st.lists(st.binary(max_size=30), max_size=2),
    )
    @settings(max_examples=60)
    def say(kind, message, buffers):
        page.say(*buffers, **message | {"kind": kind})
        page.ask("hello", kind="hello")
        assert "this is an error in simdtex itself" not in str(page.got)
        page.got.clear()

    say()
    page.session.close()
