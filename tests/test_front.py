"""benchmarks/front.py: the picture of the README shows what it says."""

import re
from pathlib import Path

import numpy as np
import pytest
from skimage import data

import simdtex
from simdtex.io.examples import example

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


def test_the_hole_is_neither_empty_nor_the_whole(front):
    assert 0.05 < front.scribble(312).mean() < 0.3


def test_samples_are_pieces_of_one_size(front):
    given = front.samples(front.SIDE)
    assert {sample.shape[:2] for sample in given.values()} == {(front.SIDE, front.SIDE)}
    assert given["tissue"].shape[2] == 3


@pytest.mark.slow
def test_the_picture_has_samples_results_and_the_hole(front, any_device):
    side = 40
    sheet = np.array(front.front(simdtex.open_machine(str(any_device.index)), side))
    line, wide = front.TEXT + 8, 2 * side + front.GAP
    gravel = front.samples(side)["gravel"]
    assert np.array_equal(sheet[line : line + side, :side, 0], gravel)
    below = line + side + front.GAP + 2 * side + front.GAP + line
    given, filled = (sheet[below : below + 2 * side, left : left + 2 * side, 0] for left in (0, wide))
    hole, grass = front.scribble(2 * side), data.grass()[100 : 100 + 2 * side, 60 : 60 + 2 * side]
    assert (given[hole] == 255).all()
    assert np.array_equal(filled[~hole], grass[~hole])
    assert (filled[hole] != 255).mean() > 0.9


def test_the_picture_of_the_readme_is_light():
    (name,) = re.findall(r"\]\((docs/_static/front\.\w+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert (ROOT / name).stat().st_size < 700_000


def test_the_wall_of_bricks_is_seen_from_the_front():
    wall = example("brick")
    assert wall.shape == (264, 216) and wall.dtype == np.uint8
    joints = np.argsort(wall.mean(0))[::-1][:24]  # the lightest columns are whole joints
    assert (wall[:, joints].mean(0) > wall.mean() + 10).all()
    assert example("gravel").shape == (512, 512)
