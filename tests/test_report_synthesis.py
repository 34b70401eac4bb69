"""The report of one synthesis: what it says of the use of the sample is what the source map says."""

import io
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
from simdtex.model.display import source_colours, temperature_colours, use_colours
from simdtex.model.regularity import lattice_sentence
from simdtex.model.source_map import counts, effective_use
from simdtex.report import sheet, synthesis
from simdtex.report.page import Figure
from simdtex.report.synthesis import FRAME, _frame, _use, use_sentences

OPTIONS = {"mrf": {"order": 2, "lattice": "9,0,0,9"}, "multires": {"alpha": 0.5}}


def colours(part):
    with PIL.Image.open(io.BytesIO(part.png)) as picture:
        return np.asarray(picture.convert("RGB"))


@pytest.fixture
def folder(tmp_path):
    image.write(tmp_path / "sample.png", texture((24, 20)))
    image.write(tmp_path / "deep.png", texture((24, 20), 3, np.uint16))
    return tmp_path


def synth(folder, *args, sample="sample.png"):
    words = ["synth", folder / sample, "-o", folder / "out.png", "--seed", 5, "--device", "reference", *args]
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.mark.parametrize("method", OPTIONS)
def test_statistics_tell_the_use(method):
    sample = texture((24, 20))
    _, output = simdtex.synthesize(
        sample, (30, 33), method=method, rng=1, device="reference", full_output=True, **OPTIONS[method]
    )
    use = output.statistics["use"]
    assert use == effective_use(output.source, sample.shape).as_dict()
    assert 0 < use["effective_share"] <= 1 <= use["most_used"]["times_fair_share"]
    most = use["most_used"]
    inside = counts(output.source, sample.shape)[most["row"] :, most["col"] :][: most["rows"], : most["cols"]]
    fair = 30 * 33 * most["rows"] * most["cols"] / (24 * 20)
    assert inside.sum() / fair == pytest.approx(most["times_fair_share"])


def test_the_map_of_use():
    source = np.array([[[0, 0], [0, 0], [0, 0]], [[1, 2], [0, 0], [0, 0]], [[0, 0], [0, 0], [0, 1]]])
    expected = np.log1p([[7, 1, 0], [0, 0, 1]]) / np.log(8)
    np.testing.assert_array_equal(use_colours(counts(source, (2, 3))), temperature_colours(expected))
    assert expected[0, 0] == pytest.approx(1) and expected[1, 0] == 0
    with pytest.raises(ValueError, match="outside a sample of 2 x 2"):
        counts(source, (2, 2))


def test_use_in_words():
    most = {"times_fair_share": 7.26, "row": 16, "col": 40, "rows": 8, "cols": 9}
    words = use_sentences({"effective_share": 0.434, "most_used": most})
    assert "effective share of the sample is 0.43" in words and "43% of it would do" in words
    assert "9 x 8 pixels from row 16 and column 40 on, is taken 7.3 times as often" in words


def test_pictures_of_use_show_the_map_the_frame_and_the_arrangement():
    rng = np.random.default_rng(1)
    source = rng.integers(0, (130, 132), (150, 160, 2)) ** 2 // (130, 132)
    use = effective_use(source, (130, 132))
    sample, made = (rng.integers(0, 256, shape).astype(np.uint8) for shape in ((130, 132), (150, 160)))
    results = {"statistics": {"use": use.as_dict()}}
    text, used, arranged = _use(sample, counts(source, (130, 132)), [("the output", made)], source, results)
    assert text == use_sentences(use.as_dict())
    assert isinstance(used, Figure) and used.file == "use.png" and arranged.file == "arrangement.png"
    most = int(counts(source, (130, 132)).max())
    assert f"to {most} times" in used.caption
    corners = np.argwhere((colours(used) == FRAME).all(axis=-1))
    size = corners.max(axis=0) - corners.min(axis=0) + 1
    assert tuple(size) == use.most_used[3:]
    assert len(corners) == 2 * sum(size) - 4

    def stands_in(part, picture):
        whole = np.lib.stride_tricks.sliding_window_view(colours(part), (3, 3), axis=(0, 1))
        places = np.argwhere((whole == np.moveaxis(picture[:3, :3], 2, 0)).all(axis=(2, 3, 4)))
        rows, cols = picture.shape[:2]
        return any(np.array_equal(colours(part)[i : i + rows, j : j + cols], picture) for i, j in places)

    assert stands_in(arranged, source_colours(source, (130, 132)))
    assert stands_in(arranged, np.stack([made] * 3, axis=-1))
    assert stands_in(used, use_colours(counts(source, (130, 132)))[20:])  # below the frame


def test_what_is_counted_part_by_part_is_that_of_the_whole(monkeypatch):
    """A map of 40 x 37 windows: those that cross from one piece into the other are no piece of the sample."""
    source = np.moveaxis(np.indices((55, 52)), 0, -1).astype(np.int32)
    source[:, 30:] += 3, 5
    whole = {}
    for part in (1024, 20, 7):
        monkeypatch.setattr(sheet, "PART", part)
        whole[part] = synthesis._counted(source, (60, 60))
        assert whole[part][0].tolist() == counts(source, (60, 60)).tolist()
    assert {copied for _, copied in whole.values()} == {(37 - 15) / 37}
    assert synthesis._counted(source[:15], (60, 60))[1] is None


@pytest.mark.parametrize(("rows", "cols"), [(50, 61), (20, 9), (3, 128)])
def test_a_picture_that_is_read_part_by_part_is_reduced_as_a_whole(monkeypatch, rows, cols):
    monkeypatch.setattr(sheet, "MOST_SIDE", 20)
    monkeypatch.setattr(sheet, "PART", 16)
    picture = np.random.default_rng(1).integers(0, 256, (rows, cols, 3)).astype(np.uint8)
    sizes = []

    def show(part):
        sizes.append(max(part.shape[:2]))
        return part

    np.testing.assert_array_equal(sheet.read_fitted(picture, show), sheet.fitted(picture, 20))
    assert max(sizes) <= 16


def test_the_frame_is_around_the_piece():
    picture = np.zeros((40, 60, 3), np.uint8)
    _frame(picture, {"row": 2, "col": 5, "rows": 3, "cols": 4}, 4)
    framed = (picture == FRAME).all(axis=-1)
    expected = np.zeros((40, 60), bool)
    expected[8:20, 20:36] = True
    expected[9:19, 21:35] = False
    np.testing.assert_array_equal(framed, expected)


@pytest.mark.parametrize("method", OPTIONS)
def test_a_report(folder, method):
    options = [word for name, value in OPTIONS[method].items() for word in (f"--{name}", value)]
    result = synth(folder, "--method", method, *options, "--report", folder / "r", sample="deep.png")
    assert result.exit_code == 0, result.output
    files = ["arrangement.png", "index.html", "picture.png", "results.json", "use.png"]
    assert sorted(path.name for path in (folder / "r").iterdir()) == files
    page = read_page(folder / "r" / "index.html")
    assert_needs_nothing_else(page)
    results = json.loads((folder / "r" / "results.json").read_text(encoding="utf-8"))
    assert results["shape"] == [48, 40] and results["sample_shape"] == [24, 20, 3]
    assert use_sentences(results["statistics"]["use"]) in page.text
    assert f"{results['taken']:.0%} of the sample's pixels" in page.text
    assert f"windows of 16 x 16 pixels, {results['copied']:.1%} are one piece" in page.text
    note = lattice_sentence(results["statistics"].get("lattice"))
    assert (note != "") == (method == "mrf") and note in page.text and note in result.output
    assert results["command"] in page.text and f"--method {method}" in results["command"]
    assert results["statistics"]["seed"] == 5
    again = synth(folder, "--method", method, *options, "--report", folder / "r", "-q", sample="deep.png")
    assert again.exit_code == 0 and again.output == ""


def test_a_method_without_sources_has_a_report_without_them(folder):
    result = synth(folder, "--method", "pyramid", "--iterations", 1, "--report", folder / "r")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (folder / "r").iterdir()) == ["index.html", "picture.png", "results.json"]
    assert "effective share" not in read_page(folder / "r" / "index.html").text
