"""The report of an ensemble says what the figures say."""

import json

import numpy as np
import pytest
from test_page import assert_needs_nothing_else, read_page

from simdtex.experiments import ensemble
from simdtex.report import ensemble as report
from simdtex.report.ensemble import write_ensemble
from simdtex.report.tables import number_text

ALWAYS = {
    "index.html",
    "results.json",
    "realisations.png",
    "maps.png",
    "entropy.png",
    "variograms.png",
}
COPIES = {"copies.png"}  # where images hold a window
OF_CATEGORIES = {"connectivity.png"}


def test_a_report_of_categories(tmp_path):
    training, hidden = ensemble.channels()
    images = np.stack([hidden[i : i + 48, :60] for i in (0, 60, 120)])
    training = training[:64, :56]
    data = [(10, 20, images[0, 20, 10]), (59, 47, images[0, 47, 59])]
    write_ensemble(tmp_path / "r", training, images, data=data, command="simdtex simulate <ti>")
    assert {path.name for path in (tmp_path / "r").iterdir()} == ALWAYS | COPIES | OF_CATEGORIES
    page = read_page(tmp_path / "r" / "index.html")
    assert_needs_nothing_else(page)
    assert "3 realisations of 60 x 48 pixels, 2 categories, and a training image of 56 x 64" in page.text
    assert "$ simdtex simulate <ti>" in page.text
    results = json.loads((tmp_path / "r" / "results.json").read_text(encoding="utf-8"))
    assert results["shape"] == [3, 48, 60] and results["training_shape"] == [64, 56]
    np.testing.assert_allclose(results["shares"][1][:3], images.mean(axis=(1, 2)))
    found = ensemble.anodi(images, training)
    assert results["anodi"]["ratio"] == pytest.approx(found.ratio) and f"{found.ratio:.3f}" in page.text
    missed = int(sum(results["misses"]))
    words = f"{missed / 6:.1%} are missed on average" if missed else "keeps the 2 hard data"
    assert words in page.text
    assert f"{training.mean():.3f}" in page.text
    copied = ensemble.copied(ensemble.copies(images, training))
    np.testing.assert_allclose(results["copied"], copied)
    assert f"{number_text(copied.mean(), copied.std(ddof=1))} stand in the training image" in page.text


def test_the_index_map_shows_each_copied_pixel_where_it_is_from():
    training = np.random.default_rng(3).integers(0, 9, (40, 50))
    image = training.max() + 1 + np.zeros((30, 35), int)
    image[2:22, 5:30] = training[11:31, 20:45]
    image[2:22, 30] = training[11:31, 45]
    image[6, 30] = 99  # in no copied window, and those right of it neither
    index = report._index_map(ensemble.copies(image[np.newaxis], training)[0], 50)
    expected = np.full(image.shape, -1)
    row, col = np.indices(image.shape)
    inside = (row >= 2) & (row < 22) & (col >= 5) & (col < 30)
    expected[inside] = ((row + 9) * 50 + col + 15)[inside]
    np.testing.assert_array_equal(index, expected)


def test_a_report_of_continuous_values(tmp_path):
    images = np.random.default_rng(1).normal(size=(2, 20, 24))
    write_ensemble(tmp_path / "r", images[0], images, data=[(3, 4, 0), (9, 1, 0)])
    assert {path.name for path in (tmp_path / "r").iterdir()} == ALWAYS | COPIES
    text = read_page(tmp_path / "r" / "index.html").text
    assert "continuous values" in text and "standard deviation of the realisations" in text
    assert "Not every realisation keeps the 2 hard data" in text


def test_a_single_small_realisation_of_many_categories_has_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "MOST_PANELS", 2)
    training = np.arange(144).reshape(12, 12) % 9
    write_ensemble(tmp_path / "r", training, training[np.newaxis, :10, :11])
    assert {path.name for path in (tmp_path / "r").iterdir()} == ALWAYS | OF_CATEGORIES
    text = read_page(tmp_path / "r" / "index.html").text
    assert "n/a" in text and "9 categories" in text and "There are no hard data." in text


def test_nothing_is_written_where_the_input_is_bad(tmp_path):
    image = np.zeros((10, 10), int)
    with pytest.raises(ValueError, match="is at no pixel"):
        write_ensemble(tmp_path / "r", image, image[np.newaxis], data=[(0.5, 0, 0)])
    assert not (tmp_path / "r").exists()
    with pytest.raises(ValueError, match="does not exist"):
        write_ensemble(tmp_path / "no" / "r", image, image[np.newaxis])
