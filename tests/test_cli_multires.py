"""``simdtex synth --method multires``, end to end."""

import numpy as np
import pytest
from cases import texture
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
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


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_everything_at_once(folder):
    args = ["--size", "30x26", "--alpha", "0.6", "--orientations", 3]
    args += ["--levels", 4, "--boundary", "open", "--preset", "paper"]
    args += ["--stages", folder / "st"]
    result = synth(folder, *args, "--source-map", folder / "s.npz", "--also", f"{folder}/colour.png={folder}/c.png")
    assert result.exit_code == 0, result.output
    made = image.read(folder / "out.png").pixels
    options = {"alpha": 0.6, "orientations": 3, "levels": 4, "boundary": "open", "preset": "paper"}
    options |= {"rng": 5, "device": "reference"}
    expected = simdtex.synthesize(texture((16, 12)), (26, 30), method="multires", **options)
    np.testing.assert_array_equal(made, expected)
    source, colour = load_source_map(folder / "s.npz"), texture((16, 12), 3)
    np.testing.assert_array_equal(image.read(folder / "c.png").pixels, colour[source[..., 0], source[..., 1]])
    stages = {f"{kind}level{level}.png" for kind in ("", "candidates-") for level in range(4)}
    assert set(files(folder / "st")) == stages
    assert "candidates per level, coarse to fine: " in result.output


def test_alpha_0_tiles(folder):
    assert synth(folder, "--alpha", 0, "--size", "24x32", "--edges", "keep").exit_code == 0
    np.testing.assert_array_equal(image.read(folder / "out.png").pixels, np.tile(texture((16, 12)), (2, 2)))
    assert synth(folder, "--alpha", "inf").exit_code == 0
    assert synth(folder, "-q").output == ""


BAD = {
    "negative alpha": (["--alpha", -1], "alpha is -1.0; give a number of at least 0"),
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
