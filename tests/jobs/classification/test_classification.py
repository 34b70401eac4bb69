"""`simdtex.classify`, `simdtex.TextureClassifier` and ``simdtex classify``."""

import copy
import json
import pickle
import subprocess
import sys

import joblib
import numpy as np
import PIL.Image
import pytest
from cases import assert_same_bits, texture
from click.testing import CliRunner
from commands import refused
from pages import assert_needs_nothing_else, read_page
from sklearn.base import clone, is_classifier
from sklearn.exceptions import NotFittedError, SkipTestWarning
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils import estimator_checks, get_tags

import simdtex
from simdtex.commands import main
from simdtex.io import image
from simdtex.jobs.classification.options import Options
from simdtex.jobs.classification.report import confusion_matrix
from simdtex.model.display import label_colours, read_labels, write_labels

# -- `simdtex.classify` and `simdtex.TextureClassifier`: what goes in, what comes out, and what is refused.

LEFT, RIGHT = texture((24, 20), seed=1), texture((24, 20), seed=2)[:, ::-1] // 3
PICTURE = np.hstack([LEFT, RIGHT])
TEXTURES = {"left": LEFT[:18], "right": RIGHT[6:]}
QUICK = {"exemplars": 100, "coupling": 2.0, "window": 3.0, "rng": 1, "device": "reference"}
TRUTH = np.repeat([1, 2], 20)[None].repeat(24, 0)
STROKES = np.zeros((24, 40), int)
STROKES[4:20, 4:14], STROKES[4:20, 26:36] = 3, 7


def classify(image=PICTURE, textures=TEXTURES, **options):
    return simdtex.classify(image, textures, **QUICK | options)


def colour(image):
    return np.stack([image, image // 2, 255 - image], -1)


def test_labels_are_bytes_and_the_output_tells_the_classes():
    seen = []
    labels, output = classify(unknown=0.0, full_output=True, callback=seen.append)
    assert (labels.dtype, labels.shape) == (np.uint8, (24, 40))
    assert (labels == TRUTH).mean() > 0.9 and (labels == output.made[..., 0]).all()
    classes = output.statistics["classes"]
    assert [(one["label"], one["name"]) for one in classes] == [(0, "unknown"), (1, "left"), (2, "right")]
    assert [one["share"] for one in classes] == [(labels == label).mean() for label in range(3)]
    assert output.fit.shape == output.probability.shape == (24, 40, 2)
    assert output.fit.min() >= 0 and output.fit.max() <= 1
    assert abs(output.probability.sum(-1) - 1).max() < 1e-6
    assert (output.probability.argmax(-1) + 1 == labels).mean() > 0.95
    assert output.statistics["seed"] == 1 and "24x40" in repr(output)
    assert [one.fraction for one in seen] == sorted(one.fraction for one in seen)
    assert seen[0].doing == "compared 100 %" and seen[1].doing == "sweep 1"
    assert set(np.unique(seen[-1].image())) <= {1, 2}


def test_channels_may_be_on_any_axis_and_several_samples_make_one_class():
    textures = {"left": [LEFT[:12], LEFT[10:]], "right": [RIGHT]}
    placed = {name: [np.moveaxis(colour(one), -1, 0) for one in several] for name, several in textures.items()}
    labels = classify(np.moveaxis(colour(PICTURE), -1, 0), placed, channel_axis=0, unknown=0.0)
    assert (labels == TRUTH).mean() > 0.9


@pytest.mark.parametrize("dtype", [np.int16, np.float32, np.bool_])
def test_any_real_type(dtype):
    def converted(image):
        return image > 60 if dtype == np.bool_ else (image.astype(np.float64) * 100 - 50).astype(dtype)

    textures = {name: converted(one) for name, one in TEXTURES.items()}
    assert (classify(converted(PICTURE), textures, unknown=0.0) == TRUTH).mean() > 0.85


def test_masked_parts_of_a_sample_are_not_used():
    """A sample that shows both textures, with a mask for each."""
    masks = {"left": TRUTH == 1, "right": TRUTH == 2}
    labels = classify(textures={"left": PICTURE, "right": PICTURE}, masks=masks, unknown=0.0)
    assert (labels == TRUTH).mean() > 0.9
    hidden = {name: np.ma.MaskedArray(PICTURE, ~mask) for name, mask in masks.items()}
    assert (classify(textures=hidden, unknown=0.0) == labels).mean() > 0.95


def test_pixels_without_a_value_are_unknown():
    picture = PICTURE.astype(np.float32)
    picture[5:8, 30:33] = np.nan
    textures = {name: one.astype(np.float32) for name, one in TEXTURES.items()}
    labels = classify(picture, textures, unknown=0.0)
    assert (labels[5:8, 30:33] == 0).all() and (labels == 0).sum() == 9


def test_one_class_is_this_or_unknown():
    whole = texture((60, 80), seed=1)
    picture = np.hstack([whole[:, :40], np.random.default_rng(0).integers(0, 256, (60, 40), np.uint8)])
    labels = classify(picture, {"a": whole[:, 40:]})
    assert set(np.unique(labels)) == {0, 1}
    assert (labels[:, 52:] == 0).all() and (labels[:, :28] == 1).mean() > 0.95


def test_a_sample_that_was_cut_from_the_picture_is_known_there():
    """It has no distance to its own exemplars, which no other part of the texture has."""
    whole = texture((60, 80), seed=1)
    _, output = classify(whole, {"a": whole[8:52, 4:44]}, full_output=True, exemplars=4000)
    assert (output.fit[12:48, 8:40] == 1).all() and output.fit.min() < 1


def test_training_regions_are_painted_on_the_picture():
    labels, output = classify(textures=STROKES, unknown=0.0, full_output=True)
    assert (labels == np.array([0, 3, 7])[TRUTH]).mean() > 0.9
    found = output.statistics["classes"]
    assert [(one["label"], one["name"]) for one in found] == [(0, "unknown"), (3, "3"), (7, "7")]


def test_the_estimator_is_trained_once():
    found = simdtex.TextureClassifier(**QUICK, unknown=0.0).fit(PICTURE, STROKES)
    assert found.classes_.tolist() == [3, 7] and found.n_features_in_ == 1
    labels = found.predict(PICTURE)
    assert (labels == classify(textures=STROKES, unknown=0.0)).all()
    _, output = classify(textures=STROKES, unknown=0.0, full_output=True)
    assert_same_bits(found.predict_fit(PICTURE), output.fit)
    chance = found.predict_proba(PICTURE[:, ::-1])
    assert chance.shape == (24, 40, 2) and abs(chance.sum(-1) - 1).max() < 1e-6
    both = simdtex.TextureClassifier(**QUICK).fit([PICTURE, PICTURE], [STROKES, np.where(STROKES == 3, 3, 0)])
    assert both.predict(PICTURE).shape == (24, 40)


def test_the_estimator_has_the_parameters_of_its_constructor():
    found = simdtex.TextureClassifier(exemplars=50, rng=3)
    own = {"channel_axis": None, "rng": 3, "device": None, **vars(Options()), "exemplars": 50}
    assert found.get_params() == own
    twin = clone(found)
    assert twin.set_params(rng=4, weight=2.0) is twin
    assert twin.get_params() == own | {"rng": 4, "weight": 2.0} and found.get_params() == own
    for unknown in (lambda: twin.set_params(rng=9, nonsense=1), lambda: type(twin)(nonsense=1)):
        with pytest.raises(ValueError, match="no parameter 'nonsense'; choose from: channel_axis, rng, device, order"):
            unknown()
    assert twin.get_params()["rng"] == 4
    generator = np.random.default_rng(1)
    assert clone(twin.set_params(rng=generator)).rng is not generator


def test_scikit_learn_takes_the_estimator_for_a_classifier():
    found = simdtex.TextureClassifier(**QUICK, unknown=0.0)
    assert is_classifier(found) and get_tags(found).target_tags.required
    with pytest.warns(SkipTestWarning, match="requires input"):
        assert {one["status"] for one in estimator_checks.check_estimator(found)} == {"passed"}
    for check in ("valid_tag_types", "estimator_repr", "set_params", "parameters_default_constructible"):
        getattr(estimator_checks, f"check_{check}")("TextureClassifier", found)
    pipeline = make_pipeline(FunctionTransformer(np.flipud), found)
    with pytest.raises(NotFittedError):
        pipeline.predict(PICTURE)
    labels = pipeline.set_params(textureclassifier__levels=2).fit(PICTURE, STROKES[::-1]).predict(PICTURE)
    own = simdtex.TextureClassifier(**QUICK, unknown=0.0, levels=2).fit(PICTURE[::-1], STROKES[::-1])
    assert (labels == own.predict(PICTURE[::-1])).all()
    assert is_classifier(pipeline) and (clone(pipeline).fit(PICTURE, STROKES).classes_ == [3, 7]).all()


LOADED = """
import sys
import joblib, numpy
picture, file, labels = sys.argv[1:]
numpy.save(labels, joblib.load(file).predict(numpy.load(picture)))
"""


@pytest.mark.slow
def test_a_trained_estimator_labels_the_same_as_a_copy_and_in_another_process(machine, tmp_path):
    picture = PICTURE.astype(np.float32)
    found = simdtex.TextureClassifier(**QUICK | {"device": machine, "levels": 1}).fit(picture, STROKES)
    labels, size = found.predict(picture), len(pickle.dumps(found))
    for copied in (copy.deepcopy(found), pickle.loads(pickle.dumps(found)), clone(found).fit(picture, STROKES)):
        assert_same_bits(copied.predict(picture), labels)
    assert isinstance(copy.deepcopy(found).device, str) and clone(found).device is found.device is machine
    joblib.dump(found, tmp_path / "found.joblib")
    np.save(tmp_path / "picture.npy", picture)
    names = [tmp_path / name for name in ("picture.npy", "found.joblib", "labels.npy")]
    subprocess.run([sys.executable, "-c", LOADED, *names], check=True, timeout=120)
    assert_same_bits(np.load(tmp_path / "labels.npy"), labels)
    larger = np.pad(picture, ((0, 200), (0, 200)))
    found.fit(larger, np.pad(STROKES, ((0, 200), (0, 200))))
    assert len(pickle.dumps(found)) == pytest.approx(size, rel=0.05), "the picture is not kept"


BAD = {
    "no class": ({"textures": {}}, "there are 0 classes; give 1 to 254"),
    "another type": (
        {"textures": {"a": LEFT * 0.5}},
        "class 'a' has 1 channel of float64 and the picture 1 channel of",
    ),
    "a tiny sample": ({"textures": {"a": LEFT[:5, :7]}}, "class 'a' has 3 whole neighbourhoods of 5x5"),
    "the name unknown": ({"textures": {"unknown": LEFT}}, "'unknown' is no name of a class"),
    "a name that is no text": ({"textures": {3: LEFT}}, "3 is no name of a class"),
    "a mask of another size": (
        {"masks": {"left": LEFT[:3, :3] > 0}},
        "class 'left': mask is 3x3 and the picture 18x20",
    ),
    "masks too many": ({"masks": {"left": [LEFT[:18] > 0] * 2}}, "class 'left' has 1 samples and 2 masks"),
    "validation of no class": ({"validation": {"x": LEFT}}, "validation name the class 'x'"),
    "strokes and masks": ({"textures": STROKES, "masks": {"a": LEFT}}, "belong to samples by name"),
    "strokes of another shape": ({"textures": STROKES[:3]}, r"give integers of the shape \(24, 40\)"),
    "strokes of floats": ({"textures": STROKES * 0.5}, "the training regions are float64"),
    "negative strokes": ({"textures": STROKES - 1}, "have the label -1; give 0 or more"),
    "a large label": ({"textures": STROKES * 100}, "have the label 700; give 254 at most"),
    "a stroke of one row": ({"textures": STROKES * (np.arange(24) == 9)[:, None]}, "painted on 10 pixels; paint 16 or"),
    "too many bands": (
        {"image": np.zeros((9, 9, 15)), "textures": {"a": np.zeros((9, 9, 15))}, "channel_axis": -1},
        "the picture has 15 bands; give 14 at most",
    ),
    "too many values": (
        {"image": np.zeros((40, 40, 2)), "textures": {"a": np.zeros((40, 40, 2))}, "channel_axis": -1, "order": 45},
        "order=45 with 2 bands compares 290 values; give a smaller order, so that there are 258 at most",
    ),
    "a misspelt input": ({"mask": {}}, "did you mean 'masks'"),
    "a schedule of many steps": ({"schedule": "raster"}, "takes more than 64 steps"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said(case):
    options, words = BAD[case]
    with pytest.raises((TypeError, ValueError), match=words):
        classify(**options)


def test_the_estimator_says_what_is_wrong():
    found = simdtex.TextureClassifier(**QUICK)
    with pytest.raises(ValueError, match="is not trained; call fit first"):
        found.predict(PICTURE)
    with pytest.raises(ValueError, match="there are 2 pictures and 1 of labels"):
        found.fit([PICTURE, PICTURE], [STROKES])
    with pytest.raises(ValueError, match=r"1 channel of float64 and .* 1 channel of uint8"):
        found.fit(PICTURE, STROKES).predict(PICTURE * 0.5)


# -- ``simdtex classify``, end to end: labels, fits, the report, and what is refused.

LEFT_RGB, RIGHT_RGB = texture((24, 20), 3, seed=1), texture((24, 20), 3, seed=2)[:, ::-1] // 3
PICTURE_RGB = np.hstack([LEFT_RGB, RIGHT_RGB])
TRUTH_BYTES = np.repeat([1, 2], 20)[None].repeat(24, 0).astype(np.uint8)
OPTIONS = {"exemplars": 100, "coupling": 2.0}
WORDS = ["--exemplars", 100, "--coupling", 2, "--seed", 5, "--device", "reference"]
SAMPLES = ["--texture", "left=left.png", "--texture", "right=right.png"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image.write("picture.png", PICTURE_RGB)
    image.write("left.png", LEFT_RGB[:18])
    image.write("right.png", RIGHT_RGB[6:])
    image.write("grey.png", LEFT_RGB[..., 0])
    image.write("truth.png", np.where(np.arange(40) < 2, 255, TRUTH_BYTES).astype(np.uint8))
    image.write("small.png", TRUTH_BYTES[:3])
    image.write("far.png", TRUTH_BYTES * 9)
    alpha = np.where(np.arange(40) < 20, 255, 0).astype(np.uint8)[None].repeat(24, 0)
    image.write("cut.png", np.dstack([PICTURE_RGB, alpha]))
    write_labels("strokes.png", np.where(TRUTH_BYTES == 1, 1, 0).astype(np.uint8))
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, ["classify", *map(str, args), *map(str, WORDS)])


def test_the_command_gives_the_bytes_of_the_function(folder):
    result = run("picture.png", *SAMPLES, "-o", "labels.png", "--confidence", "fit.tif", "--unknown", 0.02)
    assert result.exit_code == 0, result.output
    textures, how = {"left": LEFT_RGB[:18], "right": RIGHT_RGB[6:]}, {"rng": 5, "device": "reference"} | OPTIONS
    wanted, output = simdtex.classify(PICTURE_RGB, textures, channel_axis=-1, unknown=0.02, full_output=True, **how)
    assert (read_labels("labels.png") == wanted).all()
    with PIL.Image.open("labels.png") as shown:  # viewers see colours, and programs numbers
        assert (np.asarray(shown.convert("RGB")) == label_colours(256)[wanted]).all()
    assert (image.read("fit.tif").pixels == output.fit).all()
    shares = [f"{one['name']} {one['share']:.1%}" for one in output.statistics["classes"]]
    assert result.output.startswith("labels.png: 40x24, 2 classes in ") and "seed 5\n" in result.output
    assert result.output.endswith(f"{', '.join(shares)}\n")


@pytest.mark.slow
def test_labels_are_a_training_image(folder):
    assert run("picture.png", *SAMPLES, "-o", "labels.png", "--unknown", 0).exit_code == 0
    write_labels("known.png", np.where(np.arange(40) < 20, 1, 2).astype(np.uint8) * np.ones((24, 1), np.uint8))
    with PIL.Image.open("known.png") as picture:
        picture.save("known.png", transparency=2)
    words = ["estimate", "labels.png", "-o", "maps.npz", "--known", "known.png", "--categorical"]
    assert CliRunner().invoke(main, [*words, "--device", "reference"]).exit_code == 0
    labels, known = read_labels("labels.png")[::-1], np.ma.masked_equal(read_labels("known.png")[::-1], 0)
    wanted = simdtex.estimate(labels, known=known, categorical=True, device="reference")
    assert (np.load("maps.npz")["probability"] == wanted.probability.values).all()


def test_truth_is_unknown_where_it_is_transparent(folder):
    write_labels("truth.png", np.where(np.arange(24) < 12, 7, 1).astype(np.uint8)[:, None] * np.ones(40, np.uint8))
    with PIL.Image.open("truth.png") as picture:
        picture.save("truth.png", transparency=7)
    result = run("picture.png", *SAMPLES, "-o", "labels.png", "--truth", "truth.png")
    assert result.exit_code == 0, result.output
    agree = (read_labels("labels.png")[12:] == 1).mean()
    assert f"{agree:.1%} of the pixels agree with --truth" in result.output


def test_strokes_with_a_palette(folder):
    with PIL.Image.open("strokes.png") as picture:  # index 0 transparent, as painting programs save it
        picture.point([7, *range(1, 256)]).save("strokes.png", transparency=7)
    result = run("picture.png", "--strokes", "strokes.png", "-o", "labels.npy")
    assert result.exit_code == 0, result.output
    assert set(np.unique(np.load("labels.npy"))) <= {0, 1}


def test_several_samples_of_a_class_and_transparent_parts(folder):
    words = ["--texture", "left=cut.png,left.png", "--texture", "right=right.png", "--validation", "right=right.png"]
    result = run("picture.png", *words, "-o", "labels.png", "--unknown", 0)
    assert result.exit_code == 0, result.output
    hidden = np.ma.MaskedArray(PICTURE_RGB, np.arange(40)[None, :, None].repeat(24, 0).repeat(3, 2) >= 20)
    textures, how = {"left": [hidden, LEFT_RGB[:18]], "right": RIGHT_RGB[6:]}, {"rng": 5, "device": "reference"}
    how |= {"validation": {"right": RIGHT_RGB[6:]}, "channel_axis": -1, "unknown": 0.0}
    wanted = simdtex.classify(PICTURE_RGB, textures, **how, **OPTIONS)
    assert (read_labels("labels.png") == wanted).all()


def test_the_report_shows_labels_fits_and_the_confusion(folder):
    result = run("picture.png", *SAMPLES, "-o", "labels.png", "--truth", "truth.png", "--report", "page")
    assert result.exit_code == 0, result.output
    labels, truth = read_labels("labels.png"), read_labels("truth.png")
    numbers = json.loads((folder / "page/results.json").read_text())
    confusion = [[int(((truth == t) & (labels == c)).sum()) for c in range(3)] for t in range(3)]
    assert numbers["confusion"] == confusion
    right = (labels == truth)[truth < 3].mean()
    assert numbers["accuracy"] == pytest.approx(right)
    assert f"{right:.1%} of the pixels agree with --truth" in result.output
    page = read_page(folder / "page/index.html")
    assert_needs_nothing_else(page)
    text = (folder / "page/index.html").read_text()
    assert "The confusion matrix" in text and "left" in text
    assert {"labels.png", "fit.png"} <= {path.name for path in (folder / "page").iterdir()}


def test_confusion_leaves_out_what_is_not_known():
    truth = np.array([[0, 1, 1], [2, 2, 255]])
    assert confusion_matrix(np.array([[0, 1, 2], [2, 2, 1]]), truth, 3).tolist() == [[1, 0, 0], [0, 1, 1], [0, 0, 2]]


BAD_COMMAND = {
    "nothing to learn from": ([], "give --texture once for each class, or --strokes"),
    "validation of strokes": (
        ["--strokes", "strokes.png", "--validation", "left=left.png"],
        "--validation requires --texture; leave it out",
    ),
    "a name twice": ([*SAMPLES, "--texture", "left=cut.png"], "names left twice; give left=FILE0,FILE1"),
    "grey": (["--texture", "left=grey.png"], "grey.png has 1 channel of uint8 and picture.png 3 channels of uint8"),
    "truth of another size": ([*SAMPLES, "--truth", "small.png"], "small.png is 40x3 and picture.png 40x24"),
    "truth of no class": ([*SAMPLES, "--truth", "far.png"], "far.png has the label 9; give labels of the classes, 0"),
    "colours for strokes": (["--strokes", "picture.png"], "picture.png is no picture of labels"),
}


@pytest.mark.parametrize("case", BAD_COMMAND)
def test_what_is_wrong_is_said_in_one_sentence(folder, case):
    args, words = BAD_COMMAND[case]
    refused(words, "classify", "picture.png", *args, "-o", "labels.png", *WORDS)
