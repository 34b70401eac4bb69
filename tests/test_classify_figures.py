"""The figures of benchmarks/classify.py, on labels whose fault is known, and its tables at a tiny size."""

import csv
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cases import texture

from simdtex.io.image import write

NAMES = ("brick", "grass", "gravel")
BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture
def classify(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import classify

    return classify


@pytest.fixture
def mosaics(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import mosaics

    return mosaics


@pytest.fixture
def folder(tmp_path):
    """Two coloured pictures of 64x64 and a grey one."""
    for name, seed in (("red", 3), ("blue", 4)):
        write(tmp_path / f"{name}.png", texture((64, 64), 3, seed=seed))
    write(tmp_path / "grey.png", texture((64, 64), seed=5))
    return tmp_path


def test_the_distance_to_a_border_is_that_to_the_nearest_pixel_of_another_label(mosaics):
    truth = np.ones((40, 44), int)
    truth[:, 20:] = 2
    col = np.arange(44)
    expected = np.where(col < 20, 20 - col, col - 19)
    assert (mosaics.border_distance(truth) == expected).all()
    assert np.isinf(mosaics.border_distance(np.ones((4, 5), int))).all()


def test_accuracy_of_a_perfect_labelling_and_of_swapped_and_shifted_labels(mosaics):
    truth = mosaics.regions(128, np.random.default_rng(1), curved=False)
    assert sorted(np.unique(truth)) == [1, 2, 3, 4, 5] and (truth == 5).mean() == 1 / 4
    assert mosaics.accuracy(truth, truth) == (1, 1)
    swapped = np.choose(truth, [0, 2, 1, 3, 4, 5])
    assert mosaics.accuracy(swapped, truth)[1] == 1 - ((truth == 1) | (truth == 2)).mean()
    away, everywhere = mosaics.accuracy(np.roll(truth, 3, 1), truth)  # 3 pixels are within 16 of a border
    assert everywhere < 1 and away > everywhere


def test_parts_of_a_picture_lie_apart(mosaics):
    for side in (128, 512):
        rows, cols = np.indices((side, side))
        place = np.stack([rows // 2, cols // 2, rows % 2 + 2 * (cols % 2)], -1).astype(np.uint8)
        parts = [{tuple(pixel) for pixel in one.reshape(-1, 3).tolist()} for one in mosaics.parted(place)]
        training, test, further, rest = parts
        assert not training & test and not training & further and not further & rest and rest <= test


def test_a_mosaic_shows_the_test_part_of_its_label(mosaics):
    known = {str(n): mosaics.parted(np.full((64, 64), n, np.uint8)) for n in range(7)}
    for mosaic in mosaics.drawn(known, 1, 96):
        names = np.array([int(name) for name in mosaic.textures])
        assert len(set(names)) == 5
        assert (mosaics.grey(mosaic.picture) == names[mosaic.truth - 1]).all()


def test_auroc_of_scores_that_part_and_of_equal_ones(mosaics):
    assert mosaics.auroc([0.1, 0.2], [0.3, 0.4, 0.5]) == 1
    assert mosaics.auroc([0.5, 0.5], [0.5, 0.5]) == 0.5
    assert mosaics.auroc([0.1, 0.4], [0.3, 0.2]) == 0.5


def test_the_field_removes_a_spot(classify):
    evidence = np.zeros((2, 30, 40), np.float32)
    evidence[0] = 1
    evidence[:, 14:17, 20:23] = [[[0]], [[1]]]
    from simdtex.machine import open_machine

    machine = open_machine("reference")
    assert (classify.field(machine, evidence, 4, 7) == 1).all()
    assert (classify.field(machine, evidence, 4, 0) == 2).sum() == 9


def test_the_tables(classify, mosaics, folder, monkeypatch, capsys):
    small = SimpleNamespace(**{name: lambda n=n: texture((128, 128), seed=n) for n, name in enumerate(NAMES)})
    monkeypatch.setattr(mosaics, "data", small)
    monkeypatch.setattr(classify, "data", small)
    monkeypatch.setattr(mosaics, "SHOWN", 100)
    parts = [part for part in classify.PARTS if part != "accuracy" or find_spec("sklearn")]
    for name, values in (("ORDERS", (2,)), ("FIELDS", [(8, 2)]), ("DEFAULTS", {"typical": (0.0,)})):
        monkeypatch.setattr(classify, name, values)
    words = ["classify.py", folder, "--only", "*.png", "--draws", "1", "--side", "64", "--out", folder]
    monkeypatch.setattr(sys, "argv", [*map(str, words), "--parts", ",".join(parts)])
    classify.main()
    assert "textures: 6" in capsys.readouterr().out
    for part in parts:
        with open(folder / f"{part}.csv", encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        assert rows and all(len(row) == len(header) for row in rows), part


def test_missing_baselines_are_told(mosaics, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    with pytest.raises(SystemExit, match="pip install"):
        mosaics.probabilities([], [], mosaics.patterns, 4)
