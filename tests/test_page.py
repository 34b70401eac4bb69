"""Reports: a self-contained page, its pictures as files, valid numbers; tables of pages and terminals."""

import base64
import io
import json
import os
from html.parser import HTMLParser

import numpy as np
import PIL.Image
import pytest

import simdtex
from simdtex.report.page import Figure, Section, check_folder, figure_png, new_figure, tidy, write_report
from simdtex.report.tables import Table, duration_text, number_text, print_table


class Reader(HTMLParser):
    """Collects tags, attributes and text, and insists that every tag is closed."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self):
        super().__init__()
        self.tags, self.text, self.open = [], "", []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def read_page(path):
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    assert reader.open == []
    return reader


def assert_needs_nothing_else(reader):
    """No script, and nothing fetched from anywhere."""
    assert not {"script", "iframe", "object", "embed", "base"} & {tag for tag, _ in reader.tags}
    for _, attributes in reader.tags:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            assert (attributes.get(name) or "#").startswith(("#", "data:"))
        assert not any(name.startswith("on") for name in attributes)
    assert "@import" not in reader.text and "url(" not in reader.text


def embedded(reader):
    """The bytes of every picture of the page."""
    sources = [attributes["src"] for attributes in reader.of("img")]
    return [base64.b64decode(source.removeprefix("data:image/png;base64,"), validate=True) for source in sources]


def png(side=5):
    buffer = io.BytesIO()
    PIL.Image.fromarray(np.arange(side * 3 * 3, dtype=np.uint8).reshape(side, 3, 3)).save(buffer, "PNG")
    return buffer.getvalue()


def picture(side=5):
    return np.arange(side * 3 * 3, dtype=np.uint8).reshape(side, 3, 3)


NUMBERS = Table(
    "Numbers",
    [
        {"Name": "<a>", "Mark": "breaks (14)", "Figure": "1.5 ± 0.2"},
        {"Name": "b", "Mark": "keeps (14)", "Figure": "2"},
    ],
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
    write_report(tmp_path / "r", "A title", "A lead.", [], numbers, "simdtex ising")
    text = (tmp_path / "r" / "results.json").read_text(encoding="utf-8")

    def refuse(constant):
        raise AssertionError(constant)

    found = json.loads(text, parse_constant=refuse)
    assert found == {
        "a": [1.5, 2, True, [0, 1]],
        "b": None,
        "c": {"1": None},
        "command": "simdtex ising",
        "files": ["index.html", "results.json"],
        "version": simdtex.__version__,
    }
    assert list(found) == sorted(found)
    assert found["files"] == sorted(os.listdir(tmp_path / "r"))
    assert "$ simdtex ising" in read_page(tmp_path / "r" / "index.html").text


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


def test_plots_have_the_same_bytes_every_time():
    def drawn():
        plot = new_figure(3, 2)
        axes = plot.subplots()
        axes.plot([1, 3, 2])
        tidy(axes, "title", "x", "y")
        return figure_png(plot)

    assert drawn() == drawn()
    assert PIL.Image.open(io.BytesIO(drawn())).info.keys() == {"dpi"}


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
