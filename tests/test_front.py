"""benchmarks/front.py: the picture of the README shows what it says."""

import re
from pathlib import Path

import numpy as np
import pytest

import simdtex
from simdtex.io.image import example

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def front(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    import front

    return front


def test_a_flat_height_map_has_flat_normals(front):
    assert np.array_equal(np.unique(front.normals(np.full((5, 7), 3.0)).reshape(-1, 3), axis=0), [[128, 128, 255]])


def test_a_slope_that_rises_to_the_right_faces_left(front):
    slope = front.normals(np.tile(np.arange(9.0) * 10, (9, 1)))[4, 4]
    assert slope[0] < 128 and slope[1] == 128


def test_the_mast_is_in_the_hole(front):
    photo, hole = front.mast(324)
    assert photo.shape == (324, 324, 3) and 0.05 < hole.mean() < 0.3
    assert photo[hole].max() > 50 + photo[:250, 200:235].max(), "it is lighter than the sky beside it"


def test_samples_are_pieces_of_one_size(front):
    sides = {name: sample.shape for name, sample in front.samples(front.SIDE).items()}
    assert sides == {"wood": (129, 129, 3), "tissue": (162, 162, 3), "stars": (162, 162, 3)}


@pytest.mark.slow
def test_the_picture_has_samples_results_and_the_hole(front, any_device):
    side = 100
    sheet = np.array(front.front(simdtex.open_machine(str(any_device.index)), side))
    line, wide = front.TEXT + 8, 2 * side + front.GAP
    assert np.array_equal(sheet[line : line + side, wide : wide + side], front.samples(side)["tissue"])
    below = line + side + front.GAP + 2 * side + front.GAP + line
    given, filled = (sheet[below : below + 2 * side, left : left + 2 * side] for left in (0, wide))
    photo, hole = front.mast(2 * side)
    assert np.array_equal(given, photo) and np.array_equal(filled[~hole], photo[~hole])
    assert (filled[hole] != photo[hole]).mean() > 0.8


def test_the_picture_of_the_readme_is_light():
    (name,) = re.findall(r"\]\((docs/_static/front\.\w+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert (ROOT / name).stat().st_size < 700_000


def test_the_wall_of_bricks_is_seen_from_the_front():
    wall = example("brick")
    assert wall.shape == (264, 216) and wall.dtype == np.uint8
    joints = np.argsort(wall.mean(0))[::-1][:24]  # the lightest columns are whole joints
    assert (wall[:, joints].mean(0) > wall.mean() + 10).all()
    assert example("gravel").shape == (512, 512)
