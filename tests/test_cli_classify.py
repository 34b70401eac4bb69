"""``simdtex classify``, end to end: labels, fits, the report, and what is refused."""

import json

import numpy as np
import PIL.Image
import pytest
from cases import texture
from click.testing import CliRunner
from test_page import assert_needs_nothing_else, read_page

import simdtex
from simdtex.cli import main
from simdtex.io import image
from simdtex.model.display import label_colours, read_labels, write_labels
from simdtex.report.synthesis import confusion_matrix

LEFT, RIGHT = texture((24, 20), 3, seed=1), texture((24, 20), 3, seed=2)[:, ::-1] // 3
PICTURE = np.hstack([LEFT, RIGHT])
TRUTH = np.repeat([1, 2], 20)[None].repeat(24, 0).astype(np.uint8)
OPTIONS = {"exemplars": 100, "coupling": 2.0}
WORDS = ["--exemplars", 100, "--coupling", 2, "--seed", 5, "--device", "reference"]
SAMPLES = ["--texture", "left=left.png", "--texture", "right=right.png"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image.write("picture.png", PICTURE)
    image.write("left.png", LEFT[:18])
    image.write("right.png", RIGHT[6:])
    image.write("grey.png", LEFT[..., 0])
    image.write("truth.png", np.where(np.arange(40) < 2, 255, TRUTH).astype(np.uint8))
    image.write("small.png", TRUTH[:3])
    image.write("far.png", TRUTH * 9)
    alpha = np.where(np.arange(40) < 20, 255, 0).astype(np.uint8)[None].repeat(24, 0)
    image.write("cut.png", np.dstack([PICTURE, alpha]))
    write_labels("strokes.png", np.where(TRUTH == 1, 1, 0).astype(np.uint8))
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, ["classify", *map(str, args), *map(str, WORDS)])


def test_the_command_gives_the_bytes_of_the_function(folder):
    result = run("picture.png", *SAMPLES, "-o", "labels.png", "--confidence", "fit.tif", "--unknown", 0.02)
    assert result.exit_code == 0, result.output
    wanted, output = simdtex.classify(
        PICTURE,
        {"left": LEFT[:18], "right": RIGHT[6:]},
        channel_axis=-1,
        rng=5,
        device="reference",
        full_output=True,
        unknown=0.02,
        **OPTIONS,
    )
    assert (read_labels("labels.png") == wanted).all()
    assert (image.read("fit.tif").pixels == output.fit).all()
    shares = [f"{one['name']} {one['share']:.1%}" for one in output.statistics["classes"]]
    assert result.output.startswith("labels.png: 40x24, 2 classes in ") and "seed 5\n" in result.output
    assert result.output.endswith(f"{', '.join(shares)}\n")


def test_viewers_see_the_colours_of_labels_and_programs_their_numbers(folder):
    assert run("picture.png", *SAMPLES, "-o", "labels.png", "--unknown", 0).exit_code == 0
    labels = read_labels("labels.png")
    with PIL.Image.open("labels.png") as shown:
        assert (np.asarray(shown.convert("RGB")) == label_colours(256)[labels]).all()
    assert run("picture.png", *SAMPLES, "-o", "labels.tif", "--unknown", 0).exit_code == 0
    assert (image.read("labels.tif").pixels == labels).all()


def test_labels_are_a_training_image(folder):
    assert run("picture.png", *SAMPLES, "-o", "labels.png", "--unknown", 0).exit_code == 0
    labels, common = read_labels("labels.png"), ["--categorical", "--order", 2, "--device", "reference"]
    words = ["simulate", "labels.png", "-o", "many.npz", "--seed", 5, *common]
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == 0, result.output
    wanted = simdtex.simulate(labels, 1, categorical=True, order=2, rng=5, device="reference")
    assert (np.load("many.npz")["values"] == wanted.values).all()
    write_labels("known.png", np.where(np.arange(40) < 20, 1, 2).astype(np.uint8) * np.ones((24, 1), np.uint8))
    with PIL.Image.open("known.png") as picture:
        picture.save("known.png", transparency=2)
    words = [
        "estimate",
        "labels.png",
        "-o",
        "maps.npz",
        "--known",
        "known.png",
        "--categorical",
        "--device",
        "reference",
    ]
    assert CliRunner().invoke(main, words).exit_code == 0
    known = np.ma.masked_equal(read_labels("known.png"), 0)
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
    hidden = np.ma.MaskedArray(PICTURE, np.arange(40)[None, :, None].repeat(24, 0).repeat(3, 2) >= 20)
    textures = {"left": [hidden, LEFT[:18]], "right": RIGHT[6:]}
    wanted = simdtex.classify(
        PICTURE, textures, validation={"right": RIGHT[6:]}, channel_axis=-1, rng=5, device="reference", unknown=0.0,
        **OPTIONS,
    )  # fmt: skip
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


def test_the_report_shows_a_grey_picture(folder):
    result = run("grey.png", "--texture", "left=grey.png", "-o", "labels.png", "--report", "page", "--unknown", 0)
    assert result.exit_code == 0, result.output
    shown = image.read(folder / "page/labels.png").pixels.reshape(-1, 3)
    assert set(map(tuple, np.repeat(LEFT[..., 0].reshape(-1, 1), 3, 1))) <= set(map(tuple, shown))


def test_confusion_leaves_out_what_is_not_known():
    truth = np.array([[0, 1, 1], [2, 2, 255]])
    assert confusion_matrix(np.array([[0, 1, 2], [2, 2, 1]]), truth, 3).tolist() == [[1, 0, 0], [0, 1, 1], [0, 0, 2]]


def test_resume_writes_what_the_command_writes(folder):
    from simdtex.checkpoint import Checkpoint

    args = ["picture.png", *SAMPLES, "-o", "labels.png"]
    assert run(*args).exit_code == 0
    wanted = (folder / "labels.png").read_bytes()
    (folder / "labels.png").unlink()
    line = {"name": "classify", "words": [*map(str, [*args, *WORDS])], "folder": str(folder)}
    kept = Checkpoint("state", every=0, command=line)
    with pytest.raises(KeyboardInterrupt):
        simdtex.classify(
            PICTURE, {"left": [LEFT[:18]], "right": [RIGHT[6:]]}, channel_axis=-1, rng=5, device="reference",
            callback=lambda progress: kept.stop(), checkpoint=kept, validation={}, **OPTIONS,
        )  # fmt: skip
    result = CliRunner().invoke(main, ["resume", "state"])
    assert result.exit_code == 0, result.output
    assert (folder / "labels.png").read_bytes() == wanted


BAD = {
    "nothing to learn from": ([], "give --texture once for each class, or --strokes"),
    "validation of strokes": (
        ["--strokes", "strokes.png", "--validation", "left=left.png"],
        "--validation requires --texture; leave it out",
    ),
    "both": ([*SAMPLES, "--strokes", "strokes.png"], "give --texture once for each class, or --strokes"),
    "no name": (["--texture", "left.png"], "--texture 'left.png' must be NAME=FILE"),
    "a name twice": ([*SAMPLES, "--texture", "left=cut.png"], "names left twice; give left=FILE0,FILE1"),
    "grey": (["--texture", "left=grey.png"], "grey.png has 1 channel of uint8 and picture.png 3 channels of uint8"),
    "no file": (["--texture", "left=none.png"], "none.png"),
    "truth of another size": ([*SAMPLES, "--truth", "small.png"], "small.png is 40x3 and picture.png 40x24"),
    "truth of no class": ([*SAMPLES, "--truth", "far.png"], "far.png has the label 9; give labels of the classes, 0"),
    "colours for strokes": (["--strokes", "picture.png"], "picture.png is no picture of labels"),
    "fits in a png": ([*SAMPLES, "--confidence", "fit.png"], "fit.png ends in .png: end its name in one of .npy"),
    "an input overwritten": (["--texture", "left=labels.png"], "labels.png is an input and would be overwritten"),
    "a schedule": ([*SAMPLES, "--schedule", "raster"], "takes more than 64 steps to a sweep"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said_in_one_sentence(folder, case):
    args, words = BAD[case]
    image.write("labels.png" if case == "an input overwritten" else "other.png", LEFT)
    before = sorted(path.name for path in folder.iterdir())
    result = run("picture.png", *args, "-o", "labels.png")
    assert result.exit_code == 2, result.output
    assert words in result.output and len(result.output.strip().splitlines()) == 1
    assert sorted(path.name for path in folder.iterdir()) == before
