"""``simdtex synth --method multires`` and ``simdtex sheet``, end to end."""

import re

import numpy as np
import pytest
from cases import texture
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.cli.options import numbers
from simdtex.io import image
from simdtex.model.source_map import load_source_map


@pytest.fixture
def folder(tmp_path):
    """A folder with a small grey sample, one in colour, and nothing else."""
    image.write(tmp_path / "sample.png", texture((16, 12)))
    image.write(tmp_path / "colour.png", texture((16, 12), 3))
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, [str(arg) for arg in args])


def synth(folder, *args):
    arguments = ["synth", folder / "sample.png", "-o", folder / "out.png", "--method", "multires", "--seed", 5]
    return run(*arguments, "--device", "reference", *args)


def sheet(folder, *args):
    arguments = ["sheet", folder / "sample.png", "-o", folder / "sheet.png", "--seed", 5, "--device", "reference"]
    return run(*arguments, *args)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


# ---------------------------------------------------------------- synth


def test_everything_at_once(folder):
    args = ["--size", "30x26", "--alpha", "0.6", "--beta", "0.5", "--orientations", 3]
    args += ["--levels", 4, "--boundary", "open", "--preset", "paper"]
    args += ["--stages", folder / "st"]
    result = synth(folder, *args, "--source-map", folder / "s.npz", "--also", f"{folder}/colour.png={folder}/c.png")
    assert result.exit_code == 0, result.output
    made = image.read(folder / "out.png").pixels
    options = {"alpha": 0.6, "beta": 0.5, "orientations": 3, "levels": 4, "boundary": "open", "preset": "paper"}
    options |= {"rng": 5, "device": "reference"}
    expected = simdtex.synthesize(texture((16, 12)), (26, 30), method="multires", **options)
    np.testing.assert_array_equal(made, expected)
    source, colour = load_source_map(folder / "s.npz"), texture((16, 12), 3)
    np.testing.assert_array_equal(image.read(folder / "c.png").pixels, colour[source[..., 0], source[..., 1]])
    stages = {f"{kind}level{level}.png" for kind in ("", "candidates-") for level in range(4)}
    assert set(files(folder / "st")) == stages | {"sheet.png", "animation.gif"}
    assert "alpha 0.6; candidates per level, coarse to fine: " in result.output


def test_alpha_0_tiles_and_auto_says_what_it_took(folder):
    assert synth(folder, "--alpha", 0, "--size", "24x32", "--edges", "keep").exit_code == 0
    np.testing.assert_array_equal(image.read(folder / "out.png").pixels, np.tile(texture((16, 12)), (2, 2)))
    alpha = simdtex.suggest_alpha(texture((16, 12)), device="reference")
    assert f"alpha {alpha};" in synth(folder, "--alpha", "auto").output
    assert "alpha inf;" in synth(folder, "--alpha", "inf").output
    assert synth(folder, "-q").output == ""


BAD = {
    "alpha": (["--alpha", "much"], "--alpha much is not a number; give one, or auto"),
    "negative alpha": (["--alpha", -1], "alpha is -1.0; give a number of at least 0"),
    "beta": (["--beta", -1], "beta is -1.0"),
    "edges": (["--edges", "reflect"], "choose one of: mend, keep"),
    "levels": (["--levels", 9], "levels=9 is too many for this sample; give at most 5"),
    "an option of mrf": (["--order", 8], "choose from: preset, alpha, beta"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_options_get_one_sentence_and_write_nothing(folder, case, monkeypatch):
    monkeypatch.chdir(folder)
    args, words = BAD[case]
    result = synth(folder, *args, "--stages", folder / "st")
    assert result.exit_code == 2
    assert words in result.output and result.output.count("\n") == 1
    assert files(folder) == ["colour.png", "sample.png"]


def test_an_option_of_multires_is_none_of_mrf(folder):
    result = run("synth", folder / "sample.png", "-o", folder / "out.png", "--alpha", 0.2)
    assert result.exit_code == 2 and "unknown option 'alpha' of the method 'mrf'" in result.output


# ---------------------------------------------------------------- sheet


def test_a_sheet_of_both_figures(folder):
    result = sheet(folder, "--alpha", "0,0.3,...,0.9", "--beta", "0,1", "--size", "20x18")
    assert result.exit_code == 0, result.output
    lines = result.output.splitlines()
    assert [line.partition(":")[0] for line in lines[:-1]] == [
        f"alpha {alpha}, beta {beta}" for beta in (0, 1) for alpha in (0, 0.3, 0.6, 0.9)
    ]
    assert all(re.search(r": candidates( [\d.]+){4}, [\d.]+ s$", line) for line in lines[:-1])
    assert "candidates 1 1 1 1," in lines[0] and "8 pictures of 20x18 from 12x16, seed 5" in lines[-1]
    pixels = image.read(folder / "sheet.png").pixels
    assert pixels.dtype == np.uint8 and pixels.shape[2] == 3
    assert set(files(folder)) == {"colour.png", "sample.png", "sheet.png"}


def test_a_sheet_of_colour_says_the_seed(folder):
    args = ["--alpha", "0.2", "--beta", "0", "--device", "reference", "--levels", 3]
    result = run("sheet", folder / "colour.png", "-o", folder / "sheet.png", *args)
    assert result.exit_code == 0 and re.search(r"seed \d+$", result.output.strip())
    assert sheet(folder, "--alpha", "0.2", "--beta", "0", "-q").output == ""


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["--alpha", "0.1,x"], "--alpha 0.1,x must be numbers parted by commas"),
        (["--alpha", ""], "must be numbers"),
        (["--alpha", "-0.1"], "alpha is -0.1"),
        (["--beta", "-1"], "beta is -1.0"),
        (["--alpha", "0.1", "--boundary", "round"], "choose one of: torus, open"),
        (["--size", "0x1"], "size"),
        (["-o", "sheet.xyz"], "end its name in"),
        (["-o", "sample.png"], "is an input and would be overwritten"),
    ],
)
def test_bad_sheets_get_one_sentence_and_write_nothing(folder, args, words, monkeypatch):
    monkeypatch.chdir(folder)
    result = sheet(folder, *args)
    assert result.exit_code == 2
    assert words in result.output and result.output.count("\n") == 1
    assert files(folder) == ["colour.png", "sample.png"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.2", [0.2]),
        ("0.2, 0.1,inf", [0.2, 0.1, float("inf")]),
        ("0.05,...,0.30", [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]),
        ("0,0.1,...,0.35", [0, 0.1, 0.2, 0.3]),
        ("1,2,...,2", [1, 2]),
    ],
)
def test_numbers(text, expected):
    assert numbers("--alpha", text) == expected


@pytest.mark.parametrize(
    "text", ["...", "0.1,...", "...,0.3", "0.1,...,0.2,0.3", "0,...,1", "2,1,...,0", "0,1e-9,...,1", "1,...,inf"]
)
def test_numbers_that_are_none(text):
    with pytest.raises(ValueError, match=r"--alpha .* must be numbers parted by commas"):
        numbers("--alpha", text)
