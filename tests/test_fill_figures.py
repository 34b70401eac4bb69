"""The figures of benchmarks/fill.py, on fillings whose fault is known."""

import csv
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from cases import texture
from scipy.ndimage import gaussian_filter

from simdtex.io.image import write

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture
def fill(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import fill

    return fill


@pytest.fixture
def cut():
    """A noise picture and a hole in it."""
    picture = np.random.default_rng(1).integers(0, 256, (112, 112), np.uint8)
    hole = np.zeros(picture.shape, bool)
    hole[40:68, 40:76] = True
    return picture, hole


def test_a_periodic_filling_is_found_in_the_known_part(fill):
    picture = np.tile(np.random.default_rng(1).integers(0, 256, (8, 8), np.uint8), (6, 6))
    known = picture.copy()
    known[40:] = np.random.default_rng(2).integers(0, 256, (8, 48), np.uint8)  # or known patches are all found too
    hole = np.zeros(picture.shape, bool)
    hole[12:24, 12:24] = True
    found = fill.score(known, known, hole)
    assert found["rim"] == found["inside"] == 0


def test_a_bright_filling_has_a_seam_and_a_blurred_one_small_steps(fill, cut):
    picture, hole = cut
    blurred = gaussian_filter(picture.astype(float), 1.5)
    smooth = np.where(hole, blurred, picture)
    assert fill.score(picture, smooth, hole)["step"] < 0.5
    soft = blurred.astype(np.uint8)
    raised = np.where(hole, soft + np.uint8(60), soft)
    assert fill.score(soft, soft, hole)["seam"] < 1.2
    assert fill.score(soft, raised, hole)["seam"] > 3


def test_one_command_gives_the_table_and_the_sheets(fill, tmp_path, monkeypatch, capsys):
    (tmp_path / "in").mkdir()
    write(tmp_path / "in" / "red.png", texture((20, 20), 3))
    words = ["fill.py", "--samples", tmp_path / "in", "--holes", "rectangle", "--options", "order=2", "--device"]
    monkeypatch.setattr(
        sys, "argv", [*map(str, words), "reference", *map(str, ["--out", tmp_path, "--csv", tmp_path / "t.csv"])]
    )
    fill.main()
    with open(tmp_path / "t.csv", encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    labels = ["fill", "order=2", "biharmonic", *["telea"] * (find_spec("cv2") is not None), "original"]
    assert [line["filling"] for line in lines] == 2 * labels
    assert (tmp_path / "fill-red.png").is_file()
    assert "original" in capsys.readouterr().out


@pytest.mark.parametrize("band", [4, 7])
def test_a_wrapping_picture_has_no_seam(fill, band):
    import tile

    row, col = np.indices((48, 40))
    picture = (127 + 60 * np.sin(2 * np.pi * row / 48) + 50 * np.cos(2 * np.pi * col / 40)).astype(np.uint8)
    assert tile.frame(picture.shape, band).sum() == picture.size - (48 - 2 * band) * (40 - 2 * band)
    assert tile.seamless(picture, band)["tiles"] < 1.7
    assert tile.twice(picture).shape == (96, 80)
    assert tile.seamless(np.maximum(picture, (row == 0) * np.uint8(255)), band)["tiles"] > 5
