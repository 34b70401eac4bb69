"""Reports: the page, its tables and pictures, sheets, stages, and the pages of a synthesis, an ensemble and a solid."""

import io
import json
import os

import numpy as np
import PIL.Image
import pytest
import xarray
from cases import texture
from click.testing import CliRunner
from pages import assert_needs_nothing_else, embedded, read_page

import simdtex
from simdtex.commands import main
from simdtex.figures import sheet
from simdtex.figures.page import Figure, Section, check_folder, write_report
from simdtex.figures.sheet import GAP, STRIP, StageWriter, view
from simdtex.figures.tables import Table, duration_text, number_text, print_table
from simdtex.io import image
from simdtex.jobs.simulation import ensemble
from simdtex.jobs.simulation import report as report_ensemble
from simdtex.jobs.simulation.report import write_ensemble
from simdtex.jobs.synthesis.report import FRAME, _use, use_sentences
from simdtex.model.display import source_colours, temperature_colours, use_colours
from simdtex.model.regularity import lattice_sentence
from simdtex.model.source_map import counts, effective_use
from simdtex.run import Progress

# -- The page, its files, and tables.

NUMBERS = Table(
    "Numbers",
    [{"Name": "<a>", "Mark": "breaks (14)", "Figure": "1.5 ± 0.2"}, {"Name": "b", "Mark": "keeps (14)", "Figure": "2"}],
    "note",
)


def picture(side=5):
    return np.arange(side * 3 * 3, dtype=np.uint8).reshape(side, 3, 3)


def report(folder, results=(), command=""):
    figures = [Figure("picture.png", picture(), 'What "it" shows: more.'), Figure("more.png", picture(9), "Another.")]
    text = "First & <b>last</b>.\n\n$ simdtex schedules -o <there>"
    sections = [Section("One <i>", [text, NUMBERS, figures[0]]), Section("Two", figures[1:])]
    write_report(folder, "A title", "A lead.", sections, dict(results), command)


def test_the_page_is_well_formed_escaped_and_self_contained(tmp_path):
    report(tmp_path / "r")
    page = read_page(tmp_path / "r" / "index.html")
    assert_needs_nothing_else(page)
    assert [a["charset"] for a in page.of("meta") if "charset" in a] == ["utf-8"]
    assert [a["href"][1:] for a in page.of("a")] == [a["id"] for a in page.of("section")]
    beside = [(tmp_path / "r" / name).read_bytes() for name in ("picture.png", "more.png")]
    assert embedded(page) == beside
    for data, expected in zip(beside, (picture(), picture(9)), strict=True):
        np.testing.assert_array_equal(np.asarray(PIL.Image.open(io.BytesIO(data))), expected)
    assert [a["alt"] for a in page.of("img")] == ['What "it" shows', "Another"]
    for text in ("First & <b>last</b>.", "<a>", "simdtex schedules -o <there>", "note", "A lead."):
        assert text in page.text
    assert not {"b", "i", "there"} & {tag for tag, _ in page.tags}
    assert [a.get("class") for a in page.of("td")] == ["warn", "right", None, "right"]
    assert [a["scope"] for a in page.of("th")] == ["col"] * 3 + ["row"] * 2


def test_a_table_is_printed(capsys):
    print_table(NUMBERS, 200)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == "Numbers" and lines[1].split() == ["Name", "Mark", "Figure"]
    assert lines[2].split("  ")[0] == "<a>" and lines[3].rstrip().endswith("        2")
    print_table(NUMBERS, 20)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 20


def test_results_are_valid_json(tmp_path):
    numbers = {"b": float("nan"), "a": [np.float32(1.5), np.int64(2), np.bool_(True), np.arange(2)], "c": {1: None}}
    report(tmp_path, numbers, "simdtex schedules")
    results = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)
    files = {"files": ["index.html", "more.png", "picture.png", "results.json"]}
    values = {"a": [1.5, 2, True, [0, 1]], "b": None, "c": {"1": None}}
    assert results == {**values, **files, "command": "simdtex schedules", "version": simdtex.__version__}
    assert list(results) == sorted(results)
    assert "$ simdtex schedules" in read_page(tmp_path / "index.html").text


def test_a_report_replaces_an_earlier_one_and_nothing_else(tmp_path):
    report(tmp_path)
    write_report(tmp_path, "Smaller", "", [], {})
    assert sorted(os.listdir(tmp_path)) == ["index.html", "results.json"]
    (tmp_path / "mine.txt").write_bytes(b"mine")
    for listed in ("", "[]", '{"files": 3}', '{"files": ["mine.txt", "../up.png"]}'):
        (tmp_path / "results.json").write_text(listed)
        with pytest.raises(ValueError, match=r"other files \("):
            check_folder(tmp_path)
    with pytest.raises(ValueError, match="cannot be written"):
        report(tmp_path / ("x" * 300))
    assert (tmp_path / "mine.txt").read_bytes() == b"mine"


def test_numbers_have_three_significant_digits():
    texts = {
        (None,): "n/a",
        (1234567.0,): "1,234,567",
        (5.0,): "5",
        (5.0, 0.25): "5.00 ± 0.25",
        (0.0, 0.25): "0.00 ± 0.25",
        (0.012345,): "0.0123",
        (123.45, 1.0): "123 ± 1",
        (12.345, None, " %"): "12.3 %",
    }
    assert {values: number_text(*values) for values in texts} == texts
    durations = {0.3: "0.3 s", 150: "2.5 min", 9.6 * 3600: "9.6 h", 12 * 86400: "12.0 d"}
    assert {seconds: duration_text(seconds) for seconds in durations} == durations


# -- Sheets, false colours and stages.


def contains(picture, part):
    rows, cols = part.shape[:2]
    corners = np.argwhere((picture == part[0, 0]).all(axis=-1))
    return any(np.array_equal(picture[i : i + rows, j : j + cols], part) for i, j in corners)


def test_a_contact_sheet_shows_every_picture_at_its_own_size(tmp_path):
    rng = np.random.default_rng(0)
    colour, tiny = (rng.integers(0, 256, shape, np.uint8) for shape in ((130, 96, 3), (20, 30, 4)))
    deep = rng.integers(0, 65536, (110, 110), dtype=np.uint16)
    pictures = [("a long label, longer than the picture", colour), ("tiny", tiny), ("deep", deep)]
    laid = sheet.contact_sheet(pictures, tmp_path / "sheet.png", columns=2)
    np.testing.assert_array_equal(image.read(tmp_path / "sheet.png").pixels, laid)
    assert contains(laid, colour)
    assert contains(laid, tiny[..., :3].repeat(4, axis=0).repeat(4, axis=1))
    assert contains(laid, np.stack([image.to_display(deep)] * 3, axis=-1))
    low, high = (np.full((rows, 200), rows, np.uint8) for rows in (100, 150))
    assert len(sheet.contact_sheet([("a", low), ("b", high)], columns=2)) == 2 * GAP + STRIP + 150
    with pytest.raises(ValueError, match="no pictures"):
        sheet.contact_sheet([])


def test_heat_grows_in_lightness_and_source_colours_tell_positions_apart():
    heat = temperature_colours(np.linspace(0, 1, 256)).astype(float)
    grey = heat @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(grey) > -1.0).all()  # rounding to 8 bits
    assert grey[0] < 30 and grey[-1] > 220
    np.testing.assert_array_equal(temperature_colours([-1.0, 2.0]), temperature_colours([0.0, 1.0]))
    source = np.stack(np.indices((16, 24)), axis=-1)
    colours = source_colours(source, (16, 24))
    assert len(np.unique(colours.reshape(-1, 3), axis=0)) == 16 * 24
    assert np.abs(np.diff(colours.astype(int), axis=1)).max() < 40
    source[3, 4] = -1
    assert (source_colours(source, (16, 24))[3, 4] == 0).all()


def told(name, level, full, ended=True, **maps):
    picture, stage = full[:: 2**level, :: 2**level], f"level{level}{name}" if ended else None
    return Progress(fraction=0.5, doing="", stage=stage, image=lambda: picture, maps=maps)


@pytest.mark.parametrize(("dtype", "channels"), [("uint8", (3,)), ("uint16", ()), ("float32", (5,))])
def test_stages(tmp_path, dtype, channels):
    full = (np.random.default_rng(0).random((21, 30, *channels)) * 255).astype(dtype)
    writer = StageWriter(tmp_path / "a", limits=(0.0, 255.0))
    assert not (tmp_path / "a").exists()
    for level, sweep in ((1, 1), (1, 2), (0, 1)):
        for ended in (False, True):
            half = np.full(full[:: 2**level, :: 2**level].shape[:2], 0.5)
            writer(told(f"-sweep{sweep:02d}", level, full, ended, temperature=lambda half=half: half))
    names = ("level0-sweep01.png", "level1-sweep01.png", "level1-sweep02.png")
    assert set(os.listdir(tmp_path / "a")) == {f"{kind}{name}" for kind in ("", "temperature-") for name in names}
    shown, expected = image.read(tmp_path / "a" / names[2]).pixels, image.to_display(full, (0, 255))[::2, ::2]
    np.testing.assert_array_equal(*((shown[..., :3], expected[..., :3]) if channels else (shown, expected)))
    assert image.read(tmp_path / "a" / f"temperature-{names[1]}").pixels.shape == (11, 15, 3)


def test_stages_have_the_limits_of_the_first_picture(tmp_path):
    writer, values = StageWriter(tmp_path / "a"), np.linspace(0, 1, 480).reshape(20, 24)
    writer(told("-sweep01", 0, values))
    writer(told("-sweep02", 0, values / 2))
    assert image.read(tmp_path / "a" / "level0-sweep02.png").pixels.max() in (127, 128)


def test_stages_of_counts_and_of_a_resumed_run(tmp_path):
    full, candidates = np.random.default_rng(0).integers(0, 256, (20, 24), np.uint8), np.ones((20, 24), np.int32)
    candidates[0, :3] = 1, 10, 100
    StageWriter(tmp_path / "a")(told("", 0, full, candidates=lambda: candidates))
    few, some, most = image.read(tmp_path / "a" / "candidates-level0.png").pixels[0, :3]
    np.testing.assert_array_equal([few, some, most], temperature_colours([0, 0.5, 1]))
    for resumed, sweep, left in ((False, 1, (1,)), (True, 2, (1, 2)), (False, 3, (3,))):
        writer = StageWriter(tmp_path / "a", resumed=lambda resumed=resumed: resumed)
        writer(told(f"-sweep{sweep:02d}", 0, full))
        assert sorted(os.listdir(tmp_path / "a")) == [f"level0-sweep{number:02d}.png" for number in left]


def test_a_folder_of_stages_is_checked_and_cleared(tmp_path):
    (tmp_path / "file").touch()
    for folder, words in (("file", "is a file"), ("none/stages", "does not exist"), (".", "holds other files")):
        with pytest.raises(ValueError, match=words):
            StageWriter(tmp_path / folder)
    folder = tmp_path / "stages"
    folder.mkdir()
    for name in ("level3-sweep01.png", "temperature-level3-sweep120.png", "iteration02.png"):
        (folder / name).touch()
    writer = StageWriter(folder)
    assert len(os.listdir(folder)) == 3
    writer(told("-sweep01", 0, np.zeros((4, 4), bool), temperature=lambda: np.ones((4, 4))))
    assert sorted(os.listdir(folder)) == ["level0-sweep01.png", "temperature-level0-sweep01.png"]


# -- The report of one synthesis: what it says of the use of the sample is what the source map says.


def pixels_of(part):
    return np.asarray(PIL.Image.open(io.BytesIO(part.png)).convert("RGB"))


def test_the_map_of_use_and_its_words():
    source = np.array([[[0, 0], [0, 0], [0, 0]], [[1, 2], [0, 0], [0, 0]], [[0, 0], [0, 0], [0, 1]]])
    expected = np.log1p([[7, 1, 0], [0, 0, 1]]) / np.log(8)
    np.testing.assert_array_equal(use_colours(counts(source, (2, 3))), temperature_colours(expected))
    with pytest.raises(ValueError, match="outside a sample of 2 x 2"):
        counts(source, (2, 2))
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
    assert f"to {int(counts(source, (130, 132)).max())} times" in used.caption
    corners = np.argwhere((pixels_of(used) == FRAME).all(axis=-1))
    size = corners.max(axis=0) - corners.min(axis=0) + 1
    assert tuple(size) == use.most_used[3:] and len(corners) == 2 * sum(size) - 4
    assert contains(pixels_of(arranged), source_colours(source, (130, 132)))
    assert contains(pixels_of(arranged), np.stack([made] * 3, axis=-1))
    assert contains(pixels_of(used), use_colours(counts(source, (130, 132)))[20:])  # below the frame


@pytest.mark.parametrize("method", ["mrf", "pyramid"])
def test_a_report_of_a_synthesis(tmp_path, method):
    image.write(tmp_path / "deep.png", texture((24, 20), 3, np.uint16))
    options = {"mrf": ["--order", "1", "--lattice", "9,0,0,9"], "pyramid": ["--iterations", "1"]}[method]
    words = ["synth", str(tmp_path / "deep.png"), "-o", str(tmp_path / "out.png"), "--seed", "5"]
    words += ["--device", "reference", "--method", method, *options, "--report", str(tmp_path / "r")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    files = ["arrangement.png", "index.html", "picture.png", "results.json", "use.png"]
    assert sorted(os.listdir(tmp_path / "r")) == (files if method == "mrf" else files[1:4])
    page = read_page(tmp_path / "r" / "index.html")
    assert_needs_nothing_else(page)
    results = json.loads((tmp_path / "r" / "results.json").read_text(encoding="utf-8"))
    assert results["shape"] == [48, 40] and results["sample_shape"] == [24, 20, 3]
    assert results["command"] in page.text and f"--method {method}" in results["command"]
    assert ("effective share" in page.text) == (method == "mrf")
    if method == "mrf":
        assert use_sentences(results["statistics"]["use"]) in page.text
        assert f"{results['taken']:.0%} of the sample's pixels" in page.text
        assert f"windows of 16 x 16 pixels, {results['copied']:.1%} are one piece" in page.text
        note = lattice_sentence(results["statistics"]["lattice"])
        assert note and note in page.text and note in done.output


# -- The report of an ensemble says what the figures say.

ALWAYS = {"index.html", "results.json", "realisations.png", "maps.png", "entropy.png", "variograms.png"}


def test_a_report_of_categories(tmp_path):
    training, hidden = ensemble.channels()
    images = np.stack([hidden[i : i + 40, :44] for i in (0, 60, 120)])
    training = training[:48, :44]
    data = [(10, 20, images[0, 20, 10]), (43, 39, images[0, 39, 43])]
    write_ensemble(tmp_path / "r", training, images, data=data, command="simdtex simulate <ti>")
    files = {"error.png", "volumes.png", "copies.png", "connectivity.png", "shares.png"}
    assert set(os.listdir(tmp_path / "r")) == ALWAYS | files
    page = read_page(tmp_path / "r" / "index.html")
    assert_needs_nothing_else(page)
    assert "3 realisations of 44 x 40 pixels, 2 categories, and a training image of 44 x 48" in page.text
    assert "$ simdtex simulate <ti>" in page.text
    results = json.loads((tmp_path / "r" / "results.json").read_text(encoding="utf-8"))
    assert results["shape"] == [3, 40, 44] and results["training_shape"] == [48, 44]
    np.testing.assert_allclose(results["shares"][1][:3], images.mean(axis=(1, 2)))
    ratio = ensemble.anodi(images, training).ratio
    assert results["anodi"]["ratio"] == pytest.approx(ratio) and f"{ratio:.3f}" in page.text
    missed = int(sum(results["misses"]))
    assert (f"{missed / 6:.1%} are missed on average" if missed else "keeps the 2 hard data") in page.text
    copied = ensemble.copied(ensemble.copies(images, training))
    np.testing.assert_allclose(results["copied"], copied)
    assert f"{number_text(copied.mean(), copied.std(ddof=1))} stand in the training image" in page.text


def test_shares_of_all_realisations_beside_those_that_they_aim_at():
    shares = np.array([[0.6, 0.8, 0.7], [0.4, 0.2, 0.3]])  # of two realisations and the training image
    numbers = {"realisation": [4, 5], "share_2": ("realisation", [0.45, 0.25])}
    made = xarray.DataArray(np.zeros((2, 3, 3)), dims=("realisation", "y", "x"), coords=numbers)
    for asked, drawn in (("", 2), ("0.7 0.3", 3)):
        figure = report_ensemble._reached(made.assign_attrs(shares_asked=asked), np.array([1, 2]), shares).picture
        first, second = figure.axes
        assert len(first.lines) == drawn
        aimed, reached, own = (line.get_xydata().tolist() for line in second.lines)
        assert aimed == [[4, 0.45], [5, 0.25]] and reached == [[4, 0.4], [5, 0.2]] and own[0][1] == 0.3
    assert first.lines[0].get_ydata().tolist() == [0.7, 0.7]


def test_the_index_map_shows_each_copied_pixel_where_it_is_from():
    training = np.random.default_rng(3).integers(0, 9, (40, 50))
    made = np.full((30, 35), training.max() + 1)
    made[2:22, 5:30] = training[11:31, 20:45]
    made[2:22, 30] = training[11:31, 45]
    made[6, 30] = 99  # in no copied window, and those right of it neither
    index = report_ensemble._index_map(ensemble.copies(made[np.newaxis], training)[0], 50)
    row, col = np.indices(made.shape)
    inside = (row >= 2) & (row < 22) & (col >= 5) & (col < 30)
    np.testing.assert_array_equal(index, np.where(inside, (row + 9) * 50 + col + 15, -1))


def test_reports_of_continuous_values_and_of_a_single_realisation_of_many_categories(tmp_path, monkeypatch):
    images = np.random.default_rng(1).normal(size=(2, 20, 24))
    write_ensemble(tmp_path / "r", images[0], images, data=[(3, 4, 0), (9, 1, 0)])
    assert set(os.listdir(tmp_path / "r")) == ALWAYS | {"copies.png", "error.png", "histograms.png"}
    text = read_page(tmp_path / "r" / "index.html").text
    assert "continuous values" in text and "standard deviation of the realisations" in text
    assert "Not every realisation keeps the 2 hard data" in text
    monkeypatch.setattr(report_ensemble, "MOST_PANELS", 2)
    training = np.arange(144).reshape(12, 12) % 9
    write_ensemble(tmp_path / "s", training, training[np.newaxis, :10, :11])
    assert set(os.listdir(tmp_path / "s")) == ALWAYS | {"connectivity.png", "shares.png"}
    text = read_page(tmp_path / "s" / "index.html").text
    assert "n/a" in text and "9 categories" in text and "There are no hard data." in text
    with pytest.raises(ValueError, match="is at no pixel"):
        write_ensemble(tmp_path / "t", training, training[np.newaxis], data=[(0.5, 0, 0)])
    assert not (tmp_path / "t").exists()


# -- The picture of a solid: the faces of the block and its middle slices, in one scale, of every type.


def cells(sheet):
    """The pictures of a sheet, with the white around them: the block and three slices."""
    return np.split(sheet[GAP + STRIP :, GAP:], 4, axis=1)


def noise(*shape):
    return np.random.default_rng(0).integers(0, 256, shape, np.uint8)


def test_faces_are_those_of_the_block():
    for depth, rows, cols in ((8, 8, 8), (3, 9, 6), (1, 5, 12)):
        block, behind = noise(depth, rows, cols, 3), (depth - 1) // 2
        factor = 96 // max(behind + rows, behind + cols, depth)
        cube = cells(view(block, size=96))[0][::factor, ::factor].astype(int)
        np.testing.assert_array_equal(cube[behind : behind + rows, :cols], block[0])
        for away in range(1, behind + 1):  # of two slices that share a pixel the nearer is in front
            above = cube[behind - away, away : away + cols]
            right = cube[behind - away : rows + behind - away, cols + away - 1]
            np.testing.assert_array_equal(above, block[2 * away, 0] // 4 * 3)
            np.testing.assert_array_equal(right, block[2 * away, :, -1] // 4 * 3)
        white = [*cube[: behind - 1, 0], *cube[rows + 1 : behind + rows, cols + behind - 1]] if behind else []
        assert all((pixel == 255).all() for pixel in white)


def test_slices_have_the_scale_of_the_block_in_whole_pixels_and_are_written(tmp_path):
    block = noise(6, 5, 8, 3)
    for size in (96, 250):
        factor = size // 10  # the block is 8 + 2 pixels wide
        laid = view(block, tmp_path / "a.png", size=size)
        np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, laid, strict=True)
        for cell, part in zip(cells(laid)[1:], (block[3], block[:, 2], block[:, :, 4]), strict=True):
            large = part.repeat(factor, 0).repeat(factor, 1)
            rows, cols = large.shape[:2]
            np.testing.assert_array_equal(cell[:rows, :cols], large)
            assert (cell[rows:] == 255).all() and (cell[:rows, cols:] == 255).all()
    reduced = cells(view(np.full((3, 250, 150), 90, np.uint8), size=100))[1]
    assert (reduced == 90).all(-1).sum() == 84 * 50  # a third of each side
    for channels in (2, 5):
        block = noise(4, 5, 6, channels)
        shown = block[..., :3] if channels >= 3 else block[..., 0]
        np.testing.assert_array_equal(view(block, size=96), view(shown, size=96))


def test_what_cannot_be_shown():
    for shape in [(4, 4), (0, 4, 4), (1, 1, 1, 1, 1)]:
        with pytest.raises(ValueError, match="the shape"):
            view(np.zeros(shape))
    for size in (95, 1025):
        with pytest.raises(ValueError, match="give 96 to 1024 pixels"):
            view(np.zeros((2, 2, 2)), size=size)
    with pytest.raises(ValueError, match="does not exist"):
        view(np.zeros((2, 2, 2)), "none/a.png")
