"""``simdtex synth --method pyramid``, ``simdtex solid`` and ``simdtex mix``, end to end."""

import re

import numpy as np
import pytest
from cases import texture
from click.testing import CliRunner
from volumes import loaded

import simdtex
from simdtex.cli import main
from simdtex.cli.inputs import last_iteration
from simdtex.io import image
from simdtex.report.sheet import view

GREY, COLOUR = texture((32, 28)), texture((32, 28), 3, seed=1)
OTHER, START = texture((30, 34), 3, seed=2), texture((24, 40), seed=3)
FILES = ["colour.png", "grey.png", "other.png", "start.png", "wide.png"]
SAME = {"rng": 5, "device": "reference"}
SEEDED = ["--seed", 5, "--device", "reference"]
QUICK = ["--levels", 1, "--iterations", 2]
EACH = {"levels": 1, "iterations": 2}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with samples and nothing else; the present one."""
    pictures = {"grey": GREY, "colour": COLOUR, "other": OTHER, "start": START, "wide": texture((32, 28), 3, np.uint16)}
    for name, picture in pictures.items():
        image.write(tmp_path / f"{name}.png", picture)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, [str(arg) for arg in args])


def synth(*args, sample="grey.png"):
    return run("synth", sample, "-o", "out.png", "--method", "pyramid", *SEEDED, *args)


def solid(*args, sample="grey.png", output="out.npz"):
    return run("solid", sample, "-o", output, *SEEDED, *args)


def mix(*args, samples=("colour.png", "other.png")):
    return run("mix", *samples, "-o", "out.png", *SEEDED, *args)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def picture(path="out.png"):
    return image.read(path).pixels


def assert_one_sentence(result, words, folder):
    """The command has failed with these words in one line, and written nothing."""
    assert result.exit_code == 2, result.output
    assert words in result.output and result.output.count("\n") == 1, result.output
    assert files(folder) == FILES


OPTIONS = {
    "plain": ([], {}),
    "sharing options": (
        ["--orientations", 2, "--levels", 2, "--edges", "wrap", "--iterations", 1],
        {"orientations": 2, "levels": 2, "edges": "wrap", "iterations": 1},
    ),
    "tables": (
        ["--pyramid", "laplacian", "--preset", "paper", *QUICK],
        {"pyramid": "laplacian", "match": "lookup", **EACH},
    ),
    "no iterations": (["--iterations", 0], {"iterations": 0}),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_synth_is_what_python_makes(folder, case):
    args, options = OPTIONS[case]
    result = synth("--size", "44x40", *args)
    assert result.exit_code == 0, result.output
    expected, run = simdtex.synthesize(GREY, (40, 44), method="pyramid", full_output=True, **options, **SAME)
    np.testing.assert_array_equal(picture(), expected)
    first, second = result.output.splitlines()[-2:]
    assert re.fullmatch(r"out\.png: 44x40 from 28x32 in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(run.statistics)
    assert files(folder) == sorted([*FILES, "out.png"])


def test_stages_of_synth_replace_those_of_an_earlier_run(folder):
    (folder / "st").mkdir()
    image.write("st/level3.png", GREY)
    image.write("st/iteration09.png", GREY)
    assert synth("--stages", "st", *QUICK).exit_code == 0
    assert files(folder / "st") == ["iteration01.png", "iteration02.png"]
    np.testing.assert_array_equal(np.sort(picture("st/iteration02.png"), None), np.sort(picture(), None))
    (folder / "st" / "mine.txt").write_text("kept")
    again = synth("--stages", "st", *QUICK)
    assert again.exit_code == 2 and again.output.count("\n") == 1 and (folder / "st" / "mine.txt").exists()


BAD_PYRAMID = {
    "pyramid": (["--pyramid", "wavelet"], "choose one of: steerable, laplacian"),
    "levels": (["--levels", 9], "levels=9 is too many"),
    "size 0": (["--size", "0"], "size '0' is not WIDTHxHEIGHT"),
    "suffix": (["-o", "out.xyz"], "end its name in"),
    "overwritten sample": (["-o", "grey.png"], "grey.png is an input and would be overwritten"),
    "stages in the output's place": (["--stages", "out.png"], "out.png would be written twice"),
}
BAD_SYNTH = BAD_PYRAMID | {
    "boundary": (["--boundary", "open"], "unknown option 'boundary' of the method 'pyramid'"),
    "source map": (
        ["--source-map", "map.npz"],
        "takes no pixel from the sample; give one picture, and leave --source-map",
    ),
    "another map": (["--also", "colour.png=c.png"], "leave --source-map and --also out"),
    "too large": (["--size", "60000x60000"], "give a smaller size"),
}


@pytest.mark.parametrize("case", BAD_SYNTH)
def test_bad_synth_gets_one_sentence_and_writes_nothing(folder, case):
    args, words = BAD_SYNTH[case]
    stages = [] if "--stages" in args else ["--stages", "st"]
    assert_one_sentence(synth(*stages, *args), words, folder)


def test_solid_is_what_python_makes(folder):
    args = ["--preset", "paper", "--orientations", 2, "--edges", "wrap", *QUICK]
    result = solid("--size", "6x10x8", "-o", "out.nrrd", "-o", "out.tif", "-o", "slices", "--view", "v.png", *args)
    assert result.exit_code == 0, result.output
    options = {"solids": "average", "slices": "each", "match": "lookup", "orientations": 2, "edges": "wrap", **EACH}
    expected, run = simdtex.synthesize_solid(GREY, (6, 10, 8), full_output=True, **options, **SAME)
    for name in ("out.npz", "out.nrrd", "out.tif", "slices"):
        np.testing.assert_array_equal(loaded(name), expected)
    np.testing.assert_array_equal(picture("v.png"), view(expected))
    first, second = result.output.splitlines()[-2:]
    names = r"out\.npz, out\.nrrd, out\.tif, slices, v\.png"
    assert re.fullmatch(rf"{names}: 6x10x8 from 28x32 in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(run.statistics)


def test_stages_of_a_solid_are_its_middle_slice(folder):
    (folder / "st").mkdir()
    image.write("st/iteration09.png", GREY)
    assert solid("--size", "5x12x9", "--stages", "st", *QUICK, sample="colour.png").exit_code == 0
    assert files(folder / "st") == ["iteration01.png", "iteration02.png"]
    made = loaded("out.npz")
    assert made.shape == (5, 12, 9, 3)
    np.testing.assert_array_equal(picture("st/iteration02.png"), made[2])


SOLID_SIZES = ["0", "4x5", "4x5x6x7", "1.5"]
PICTURES_ONLY = {"size 0", "suffix", "overwritten sample", "stages in the output's place"}
BAD_SOLID = {name: case for name, case in BAD_PYRAMID.items() if name not in PICTURES_ONLY} | {
    **{f"size {text}": (["--size", text], f"size '{text}' is not DEPTHxHEIGHTxWIDTH") for text in SOLID_SIZES},
    "beyond 2**31": (
        ["--size", "700"],
        "a block of 700 x 700 x 700 is beyond 2**31 values, 8 for each voxel; give a smaller size",
    ),
    "suffix": (["-o", "out.xyz"], "end its name in one of .npy, .npz"),
    "written twice": (["-o", "out.npz"], "out.npz would be written twice"),
    "view and output": (["-o", "a.npy", "--view", "grey.png"], "grey.png is an input"),
    "view suffix": (["--view", "v.npz"], "end its name in one of .png"),
    "no folder": (["--view", "nowhere/v.png"], "the folder nowhere does not exist"),
    "stages in the output's place": (["-o", "st"], "st would be written twice"),
}


@pytest.mark.parametrize("case", BAD_SOLID)
def test_bad_solids_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_SOLID[case]
    size = [] if "--size" in args else ["--size", "8"]
    assert_one_sentence(solid(*size, "--stages", "st", *args), words, folder)


MIXTURES = {
    "average of all": ([], {}),
    "palette by path, pattern by number": (["--palette", "other.png", "--pattern", 1], {"palette": 1, "pattern": 0}),
    "pattern by path": (["--pattern", "./other.png"], {"pattern": 1}),
    "weights": (["--average", "1,0.5"], {"average": [1, 0.5]}),
    "low and high": (["--low", 2, "--high", "colour.png"], {"low": 1, "high": 0}),
    "colours": (
        ["--palette", 2, "--color", "channels", "--edges", "wrap"],
        {"palette": 1, "color": "channels", "edges": "wrap"},
    ),
    "tables": (
        ["--pyramid", "laplacian", "--preset", "paper", "--pattern", 2],
        {"pyramid": "laplacian", "match": "lookup", "pattern": 1},
    ),
}


@pytest.mark.parametrize("case", MIXTURES)
def test_mix_is_what_python_makes(folder, case):
    args, options = MIXTURES[case]
    result = mix("--size", "44x40", "--orientations", 2, *QUICK, *args)
    assert result.exit_code == 0, result.output
    options = {"orientations": 2, "channel_axis": -1, **EACH, **options}
    expected, run = simdtex.mix([COLOUR, OTHER], (40, 44), full_output=True, **options, **SAME)
    np.testing.assert_array_equal(picture(), expected)
    first, second = result.output.splitlines()[-2:]
    assert re.fullmatch(r"out\.png: 44x40 from 2 samples in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(run.statistics)


def test_a_path_wins_over_a_number(folder):
    image.write("1.png", GREY)
    (folder / "1.png").rename("2")
    assert mix("--pattern", "2", *QUICK, samples=("2", "start.png")).exit_code == 0
    expected = simdtex.mix([GREY, START], (64, 56), pattern=0, **EACH, **SAME)
    np.testing.assert_array_equal(picture(), expected)


P = "give the path of one as in the command, or its number, 1 to 2"
BAD_MIX = {k: v for k, v in BAD_PYRAMID.items() if k != "overwritten sample"} | {
    "unknown palette": (["--palette", "grey.png"], f"--palette grey.png is none of the samples; {P}"),
    "pattern 0": (["--pattern", 0], f"--pattern 0 is none of the samples; {P}"),
    "pattern 3": (["--pattern", 3], P),
    "negative": (["--low", -1, "--high", 1], f"--low -1 is none of the samples; {P}"),
    "no number": (["--high", "1.0", "--low", 1], f"--high 1.0 is none of the samples; {P}"),
    "low alone": (["--low", 1], "low and high go together; give both, or neither"),
    "two patterns": (["--pattern", 1, "--average", "1,1"], "a mixture has one pattern"),
    "weights in words": (["--average", "much,little"], "--average much,little must be numbers separated by commas"),
    "overwritten sample": (["-o", "other.png"], "other.png is an input and would be overwritten"),
}


@pytest.mark.parametrize("case", BAD_MIX)
def test_bad_mixtures_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_MIX[case]
    stages = [] if "--stages" in args else ["--stages", "st"]
    assert_one_sentence(mix(*stages, *args), words, folder)


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (("grey.png", "none.png"), "none.png does not exist"),
        (("grey.png", "."), ". is a folder"),
        (("colour.png", "wide.png"), "sample 1 is of uint16 and the first of uint8; convert them to one type"),
        (("four.png", "colour.png"), "sample 1 has 3 channels and another 4; give all the same, or grey ones"),
    ],
)
def test_samples_that_do_not_mix(folder, samples, words, monkeypatch):
    if "four.png" in samples:
        pictures = {"four.png": texture((20, 20), 4), "colour.png": COLOUR}
        monkeypatch.setattr(image, "read", lambda path, palette: image.Image(pictures[str(path)], -1))
    assert_one_sentence(mix(samples=samples), words, folder)
