"""Reports: the page, its tables and pictures, sheets, stages, and the pages of a synthesis, an ensemble and a solid."""

import io
import json
import os

import numpy as np
import PIL.Image
import pytest
from cases import texture
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
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
from simdtex.model import display
from simdtex.model.display import source_colours, temperature_colours, use_colours
from simdtex.model.regularity import lattice_sentence
from simdtex.model.source_map import counts, effective_use
from simdtex.run import Progress

# -- Reports: a self-contained page, its pictures as files, valid numbers; tables of pages and terminals.


def picture(side=5):
    return np.arange(side * 3 * 3, dtype=np.uint8).reshape(side, 3, 3)


NUMBERS = Table(
    "Numbers",
    [{"Name": "<a>", "Mark": "breaks (14)", "Figure": "1.5 ± 0.2"}, {"Name": "b", "Mark": "keeps (14)", "Figure": "2"}],
    "note",
)


def report(folder, **results):
    figures = [Figure("picture.png", picture(), 'What "it" shows: more.'), Figure("more.png", picture(9), "Another.")]
    text = "First & <b>last</b>.\n\n$ simdtex schedules -o <there>"
    sections = [Section("One <i>", [text, NUMBERS, figures[0]]), Section("Two", figures[1:])]
    write_report(folder, "A title", "A lead.", sections, results)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page") / "r"
    report(folder)
    return read_page(folder / "index.html"), folder


def test_the_page_is_well_formed_and_self_contained(page):
    reader, _ = page
    assert_needs_nothing_else(reader)
    assert [a["charset"] for a in reader.of("meta") if "charset" in a] == ["utf-8"]
    assert any(a.get("name") == "viewport" for a in reader.of("meta"))
    assert "prefers-color-scheme: dark" in reader.text
    anchors = [a["href"][1:] for a in reader.of("a")]
    assert anchors == [a["id"] for a in reader.of("section")]


def test_pictures_are_in_the_page_and_beside_it(page):
    reader, folder = page
    beside = [(folder / name).read_bytes() for name in ("picture.png", "more.png")]
    assert embedded(reader) == beside
    for data, expected in zip(beside, (picture(), picture(9)), strict=True):
        np.testing.assert_array_equal(np.asarray(PIL.Image.open(io.BytesIO(data))), expected)
    assert [a["alt"] for a in reader.of("img")] == ['What "it" shows', "Another"]


def test_text_is_escaped(page):
    reader, _ = page
    for text in ("First & <b>last</b>.", "<a>", "simdtex schedules -o <there>", "note", "A lead."):
        assert text in reader.text
    assert not {"b", "i", "there"} & {tag for tag, _ in reader.tags}


def test_tables(page):
    reader, _ = page
    assert [a.get("class") for a in reader.of("td")] == ["warn", "right", None, "right"]
    assert [a["scope"] for a in reader.of("th")] == ["col"] * 3 + ["row"] * 2


def test_a_table_is_printed(capsys):
    print_table(NUMBERS, 200)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == "Numbers" and lines[1].split() == ["Name", "Mark", "Figure"]
    assert lines[2].split("  ")[0] == "<a>" and lines[3].rstrip().endswith("        2")
    print_table(NUMBERS, 20)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 20


def test_results_are_valid_json(tmp_path):
    numbers = {"b": float("nan"), "a": [np.float32(1.5), np.int64(2), np.bool_(True), np.arange(2)], "c": {1: None}}
    write_report(tmp_path / "r", "A title", "A lead.", [], numbers, "simdtex schedules")
    text = (tmp_path / "r" / "results.json").read_text(encoding="utf-8")

    def refuse(constant):
        raise AssertionError(constant)

    found = json.loads(text, parse_constant=refuse)
    assert found == {
        "a": [1.5, 2, True, [0, 1]],
        "b": None,
        "c": {"1": None},
        "command": "simdtex schedules",
        "files": ["index.html", "results.json"],
        "version": simdtex.__version__,
    }
    assert list(found) == sorted(found)
    assert found["files"] == sorted(os.listdir(tmp_path / "r"))
    assert "$ simdtex schedules" in read_page(tmp_path / "r" / "index.html").text


def test_a_report_replaces_an_earlier_one_and_nothing_else(tmp_path):
    report(tmp_path)
    write_report(tmp_path, "Smaller", "", [], {})
    assert sorted(os.listdir(tmp_path)) == ["index.html", "results.json"]
    (tmp_path / "holiday.png").write_bytes(b"mine")
    with pytest.raises(ValueError, match=r"other files \(holiday.png\)"):
        report(tmp_path)
    assert (tmp_path / "holiday.png").read_bytes() == b"mine" and not (tmp_path / "picture.png").exists()


@pytest.mark.parametrize("listed", ["", "[]", '{"files": 3}', '{"files": ["mine.txt", "../up.png"]}'])
def test_files_of_others_are_never_taken_for_a_report(tmp_path, listed):
    (tmp_path / "results.json").write_text(listed)
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="other files"):
        check_folder(tmp_path)


def test_folders_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for folder, words in (
        (tmp_path / "file", "is a file"),
        (tmp_path / "file" / "r", "file"),
        (tmp_path / "none" / "r", "does not exist"),
        (tmp_path / ("x" * 300), "cannot be written"),
    ):
        with pytest.raises(ValueError, match=words):
            check_folder(folder)
        with pytest.raises(ValueError, match=words):
            report(folder)
    assert os.listdir(tmp_path) == ["file"]


def test_nothing_is_left_of_a_report_that_fails(tmp_path, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(ValueError, match="No space left"):
        report(tmp_path / "r")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ((None,), "n/a"),
        ((1234567.0,), "1,234,567"),
        ((5.0,), "5"),
        ((5.0, 0.25), "5.00 ± 0.25"),
        ((0.0, 0.25), "0.00 ± 0.25"),
        ((0.012345,), "0.0123"),
        ((123.45, 1.0), "123 ± 1"),
        ((12.345, None, " %"), "12.3 %"),
    ],
)
def test_numbers_have_three_significant_digits(given, text):
    assert number_text(*given) == text


def test_durations():
    durations = {0.3: "0.3 s", 150: "2.5 min", 9.6 * 3600: "9.6 h", 12 * 86400: "12.0 d"}
    assert {seconds: duration_text(seconds) for seconds in durations} == durations


# -- Sheets, false colours and stages are whole files of the right pictures.


def contains(picture, part):
    rows, cols = part.shape[:2]
    corners = np.argwhere((picture == part[0, 0]).all(axis=-1))
    return any(np.array_equal(picture[i : i + rows, j : j + cols], part) for i, j in corners)


def test_contact_sheet_shows_every_picture_at_its_own_size(tmp_path):
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (100, 120), dtype=np.uint8)
    colour = rng.integers(0, 256, (130, 96, 3), dtype=np.uint8)
    tiny = rng.integers(0, 256, (20, 30, 4), dtype=np.uint8)
    deep = rng.integers(0, 65536, (110, 110), dtype=np.uint16)
    pictures = [("grey", grey), ("a long label, longer than the picture", colour), ("tiny", tiny),
                ("deep", deep)]  # fmt: skip
    laid = sheet.contact_sheet(pictures, tmp_path / "sheet.png", columns=3)
    np.testing.assert_array_equal(image.read(tmp_path / "sheet.png").pixels, laid)
    assert contains(laid, np.stack([grey] * 3, axis=-1))
    assert contains(laid, colour)
    assert contains(laid, tiny[..., :3].repeat(4, axis=0).repeat(4, axis=1))
    assert contains(laid, np.stack([image.to_display(deep)] * 3, axis=-1))
    assert sheet.contact_sheet(pictures, columns=1).shape[0] > laid.shape[0]
    assert os.listdir(tmp_path) == ["sheet.png"]


def test_a_row_of_a_sheet_is_as_high_as_its_pictures():
    low, high = (np.full((rows, 200), rows, np.uint8) for rows in (100, 150))
    laid = sheet.contact_sheet([("a", low), ("b", high), ("c", low)], columns=1)
    assert len(laid) == sheet.GAP + 3 * (sheet.STRIP + sheet.GAP) + 350
    assert contains(laid, sheet.rgb(high))
    assert len(sheet.contact_sheet([("a", low), ("b", high)], columns=2)) == 2 * sheet.GAP + sheet.STRIP + 150


def test_contact_sheet_errors(tmp_path):
    picture = np.zeros((4, 4), np.uint8)
    with pytest.raises(ValueError, match="no pictures"):
        sheet.contact_sheet([])
    with pytest.raises(ValueError, match="does not exist"):
        sheet.contact_sheet([("a", picture)], tmp_path / "none" / "a.png")


@given(st.integers(1, 60), st.integers(1, 60), st.integers(1, 20))
def test_fitted_keeps_the_bound_and_the_flat(rows, cols, side):
    flat = np.full((rows, cols, 3), 77, np.uint8)
    reduced = sheet.fitted(flat, side)
    assert max(reduced.shape[:2]) <= side
    assert (reduced == 77).all()


def test_heat_grows_in_lightness():
    found = display.temperature_colours(np.linspace(0, 1, 256)).astype(float)
    assert found.shape == (256, 3)
    grey = found @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(grey) > -1.0).all()  # rounding to 8 bits
    assert grey[0] < 30
    assert grey[-1] > 220
    np.testing.assert_array_equal(display.temperature_colours([-1.0, 2.0]), display.temperature_colours([0.0, 1.0]))


def test_source_colours_tell_positions_apart():
    source = np.stack(np.indices((16, 24)), axis=-1)
    found = display.source_colours(source, (16, 24))
    assert len(np.unique(found.reshape(-1, 3), axis=0)) == 16 * 24
    steps = np.abs(np.diff(found.astype(int), axis=1))
    assert steps.max() < 40
    source[3, 4] = -1
    assert (display.source_colours(source, (16, 24))[3, 4] == 0).all()


def told(name, level, full, ended=True, **maps):
    """What a run would tell its callback."""
    picture, stage = full[:: 2**level, :: 2**level], f"level{level}{name}" if ended else None
    return Progress(fraction=0.5, doing="", stage=stage, image=lambda: picture, maps=maps)


@pytest.mark.parametrize(("dtype", "channels"), [("uint8", (3,)), ("uint16", ()), ("float32", (5,))])
def test_stages(tmp_path, dtype, channels):
    folder = tmp_path / "stages"
    full = (np.random.default_rng(0).random((101, 130, *channels)) * 255).astype(dtype)
    writer = StageWriter(folder, limits=(0.0, 255.0))
    assert not folder.exists()
    for level in (2, 1, 0):
        for sweep in (1, 2):
            for ended in (False, True):
                half = np.full(full[:: 2**level, :: 2**level].shape[:2], 0.5)
                writer(told(f"-sweep{sweep:02d}", level, full, ended, temperature=lambda half=half: half))
    names = {f"{kind}level{level}-sweep{sweep:02d}.png" for kind in ("", "temperature-")
             for level in range(3) for sweep in (1, 2)}  # fmt: skip
    assert set(os.listdir(folder)) == names
    shown = image.read(folder / "level1-sweep02.png").pixels
    np.testing.assert_array_equal(shown[..., :3] if channels else shown,
                                  image.to_display(full, (0, 255))[::2, ::2][..., :3] if channels
                                  else image.to_display(full, (0, 255))[::2, ::2])  # fmt: skip
    assert image.read(folder / "temperature-level2-sweep01.png").pixels.shape == (26, 33, 3)


def test_stages_of_levels_without_sweeps(tmp_path):
    folder = tmp_path / "stages"
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    writer = StageWriter(folder)
    for level in (1, 0):
        counts = np.ones((20 >> level, 24 >> level), np.int32)
        counts[0, :3] = 1, 10, 100
        for ended in (False, True):
            writer(told("", level, full, ended, candidates=lambda counts=counts: counts))
    names = {f"{kind}level{level}.png" for kind in ("", "candidates-") for level in (0, 1)}
    assert set(os.listdir(folder)) == names
    np.testing.assert_array_equal(image.read(folder / "level1.png").pixels, full[::2, ::2])
    few, some, most = image.read(folder / "candidates-level0.png").pixels[0, :3]
    np.testing.assert_array_equal([few, some, most], display.temperature_colours([0, 0.5, 1]))
    StageWriter(folder)  # an earlier run's files may be replaced


def test_a_resumed_run_keeps_the_stages_before(tmp_path):
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    for resumed, sweep in ((False, 1), (True, 2), (False, 3)):
        writer = StageWriter(tmp_path / "a", resumed=lambda resumed=resumed: resumed)
        writer(told(f"-sweep{sweep:02d}", 0, full))
        left = sorted(path.name for path in (tmp_path / "a").glob("level*"))
        assert left == [f"level0-sweep{number:02d}.png" for number in {1: (1,), 2: (1, 2), 3: (3,)}[sweep]]


def test_stage_folder_is_checked_and_cleared(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="is a file"):
        StageWriter(tmp_path / "file")
    with pytest.raises(ValueError, match="does not exist"):
        StageWriter(tmp_path / "none" / "stages")
    with pytest.raises(ValueError, match="holds other files"):
        StageWriter(tmp_path)
    folder = tmp_path / "stages"
    folder.mkdir()
    for name in ("level3-sweep01.png", "temperature-level3-sweep120.png", "iteration02.png"):
        (folder / name).touch()
    writer = StageWriter(folder)
    assert len(os.listdir(folder)) == 3
    writer(told("-sweep01", 0, np.zeros((4, 4), bool), temperature=lambda: np.ones((4, 4))))
    assert sorted(os.listdir(folder)) == ["level0-sweep01.png", "temperature-level0-sweep01.png"]
    (folder / "notes.txt").touch()
    with pytest.raises(ValueError, match=r"notes\.txt"):
        StageWriter(folder)


# -- The report of one synthesis: what it says of the use of the sample is what the source map says.

OPTIONS = {"mrf": {"order": 1, "lattice": "9,0,0,9"}, "multires": {"alpha": 0.5}}


def colours_synthesis(part):
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
    corners = np.argwhere((colours_synthesis(used) == FRAME).all(axis=-1))
    size = corners.max(axis=0) - corners.min(axis=0) + 1
    assert tuple(size) == use.most_used[3:]
    assert len(corners) == 2 * sum(size) - 4

    def stands_in(part, picture):
        whole = np.lib.stride_tricks.sliding_window_view(colours_synthesis(part), (3, 3), axis=(0, 1))
        places = np.argwhere((whole == np.moveaxis(picture[:3, :3], 2, 0)).all(axis=(2, 3, 4)))
        rows, cols = picture.shape[:2]
        return any(np.array_equal(colours_synthesis(part)[i : i + rows, j : j + cols], picture) for i, j in places)

    assert stands_in(arranged, source_colours(source, (130, 132)))
    assert stands_in(arranged, np.stack([made] * 3, axis=-1))
    assert stands_in(used, use_colours(counts(source, (130, 132)))[20:])  # below the frame


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


# -- The report of an ensemble says what the figures say.

ALWAYS = {"index.html", "results.json", "realisations.png", "maps.png", "entropy.png", "variograms.png"}
SEVERAL, WELLS = {"error.png"}, {"volumes.png"}
COPIES = {"copies.png"}  # where images hold a window
OF_CATEGORIES = {"connectivity.png"}


def test_a_report_of_categories(tmp_path):
    training, hidden = ensemble.channels()
    images = np.stack([hidden[i : i + 48, :60] for i in (0, 60, 120)])
    training = training[:64, :56]
    data = [(10, 20, images[0, 20, 10]), (59, 47, images[0, 47, 59])]
    write_ensemble(tmp_path / "r", training, images, data=data, command="simdtex simulate <ti>")
    assert {path.name for path in (tmp_path / "r").iterdir()} == ALWAYS | COPIES | OF_CATEGORIES | SEVERAL | WELLS
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
    index = report_ensemble._index_map(ensemble.copies(image[np.newaxis], training)[0], 50)
    expected = np.full(image.shape, -1)
    row, col = np.indices(image.shape)
    inside = (row >= 2) & (row < 22) & (col >= 5) & (col < 30)
    expected[inside] = ((row + 9) * 50 + col + 15)[inside]
    np.testing.assert_array_equal(index, expected)


def test_a_report_of_continuous_values(tmp_path):
    images = np.random.default_rng(1).normal(size=(2, 20, 24))
    write_ensemble(tmp_path / "r", images[0], images, data=[(3, 4, 0), (9, 1, 0)])
    assert {path.name for path in (tmp_path / "r").iterdir()} == ALWAYS | COPIES | SEVERAL
    text = read_page(tmp_path / "r" / "index.html").text
    assert "continuous values" in text and "standard deviation of the realisations" in text
    assert "Not every realisation keeps the 2 hard data" in text


def test_a_single_small_realisation_of_many_categories_has_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(report_ensemble, "MOST_PANELS", 2)
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


# -- The picture of a solid: the faces of the block and its middle slices, in one scale, of every type.

SIZE = 96
TOP = GAP + STRIP


def cells(sheet):
    """The pictures of a sheet, with the white around them: the block and three slices."""
    return np.split(sheet[TOP:, GAP:], 4, axis=1)


def noise(shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize("shape", [(8, 8, 8), (3, 9, 6), (1, 5, 12)])
def test_faces_are_those_of_the_block(shape):
    block = noise((*shape, 3))
    depth, rows, cols = shape
    behind = (depth - 1) // 2
    factor = SIZE // max(behind + rows, behind + cols, depth)
    cube = cells(view(block, size=SIZE))[0][::factor, ::factor].astype(int)
    np.testing.assert_array_equal(cube[behind : behind + rows, :cols], block[0])
    for away in range(1, behind + 1):  # of two slices that share a pixel the nearer is in front
        z = 2 * away
        above, right = (
            cube[behind - away, away : away + cols],
            cube[behind - away : rows + behind - away, cols + away - 1],
        )
        np.testing.assert_array_equal(above, block[z, 0] // 4 * 3)
        np.testing.assert_array_equal(right, block[z, :, -1] // 4 * 3)
    if behind:
        assert (cube[: behind - 1, 0] == 255).all() and (cube[rows + 1 : behind + rows, cols + behind - 1] == 255).all()


@pytest.mark.parametrize("size", [96, 250])
def test_slices_have_the_scale_of_the_block_in_whole_pixels(size):
    block = noise((6, 5, 8, 3))
    factor = size // 10  # the block is 8 + 2 pixels wide
    shown = cells(view(block, size=size))[1:]
    for cell, picture in zip(shown, (block[3], block[:, 2], block[:, :, 4]), strict=True):
        large = picture.repeat(factor, 0).repeat(factor, 1)
        rows, cols = large.shape[:2]
        np.testing.assert_array_equal(cell[:rows, :cols], large)
        assert (cell[rows:] == 255).all() and (cell[:rows, cols:] == 255).all()


def test_a_large_block_is_reduced():
    sheet = view(np.full((3, 250, 150), 90, np.uint8), size=100)
    cell = cells(sheet)[1]
    assert (cell == 90).all(-1).sum() == 84 * 50  # a third of each side


@pytest.mark.parametrize("channels", [1, 2, 3, 5])
def test_the_first_channel_is_grey_and_the_first_three_are_colours(channels):
    block = noise((4, 5, 6, channels))
    shown = block[..., :3] if channels >= 3 else block[..., 0]
    np.testing.assert_array_equal(view(block, size=SIZE), view(shown, size=SIZE))
    sheet = view(block, size=SIZE)
    assert (sheet == sheet[..., :1]).all() == (channels < 3)


def test_the_sheet_is_written(tmp_path):
    sheet = view(noise((4, 4, 4, 3)), tmp_path / "a.png", size=SIZE)
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, sheet, strict=True)


def test_what_cannot_be_shown(tmp_path):
    for shape in [(4, 4), (0, 4, 4), (1, 1, 1, 1, 1)]:
        with pytest.raises(ValueError, match="the shape"):
            view(np.zeros(shape))
    for size in (95, 1025):
        with pytest.raises(ValueError, match="give 96 to 1024 pixels"):
            view(np.zeros((2, 2, 2)), size=size)
    with pytest.raises(ValueError, match="does not exist"):
        view(np.zeros((2, 2, 2)), tmp_path / "none" / "a.png")
