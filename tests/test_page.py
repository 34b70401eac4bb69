"""A report is one page that needs nothing beside itself, its pictures as files, and valid numbers."""

import base64
import io
import json
import os
from html.parser import HTMLParser

import numpy as np
import PIL.Image
import pytest

from simdtex.report.page import Figure, Section, Table, Text, check_folder, write_report
from simdtex.report.plots import figure_png, new_figure, styles, tidy


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


def report(folder, **results):
    parts = [
        Text("First & <b>last</b>.\n\n$ simdtex schedules -o <there>"),
        Table(
            "Numbers",
            ["Name", "Mark", "Figure"],
            [["<a>", "breaks (14)", "1.5 ± 0.2"], ["b", "keeps (14)", "2"]],
            "note",
        ),
        Figure("A picture.", png(), 'what "it" shows', "picture.png"),
    ]
    sections = [Section("One <i>", parts), Section("Two", [Figure("Another.", png(9), "more", "more.png")])]
    write_report(folder, "A title", "A lead.", sections, results)


def test_the_page_is_well_formed_and_stands_alone(tmp_path):
    report(tmp_path / "r")
    reader = read_page(tmp_path / "r" / "index.html")
    assert_needs_nothing_else(reader)
    assert [a["charset"] for a in reader.of("meta") if "charset" in a] == ["utf-8"]
    assert any(a.get("name") == "viewport" for a in reader.of("meta"))
    assert "prefers-color-scheme: dark" in reader.text
    anchors = [a["href"][1:] for a in reader.of("a")]
    assert anchors == [a["id"] for a in reader.of("section")]


def test_pictures_are_in_the_page_and_beside_it(tmp_path):
    report(tmp_path / "r")
    reader = read_page(tmp_path / "r" / "index.html")
    beside = [(tmp_path / "r" / name).read_bytes() for name in ("picture.png", "more.png")]
    assert embedded(reader) == beside == [png(), png(9)]
    sizes = [PIL.Image.open(io.BytesIO(data)).size for data in embedded(reader)]
    assert sizes == [(int(a["width"]), int(a["height"])) for a in reader.of("img")]
    assert [a["alt"] for a in reader.of("img")] == ['what "it" shows', "more"]


def test_text_is_text(tmp_path):
    report(tmp_path / "r")
    reader = read_page(tmp_path / "r" / "index.html")
    assert (
        "First & <b>last</b>." in reader.text and "<a>" in reader.text and "simdtex schedules -o <there>" in reader.text
    )
    assert not {"b", "i", "there"} & {tag for tag, _ in reader.tags}


def test_tables(tmp_path):
    report(tmp_path / "r")
    reader = read_page(tmp_path / "r" / "index.html")
    assert [a.get("class") for a in reader.of("td")] == ["warn", "right", None, "right"]
    assert [a["scope"] for a in reader.of("th")] == ["col"] * 3 + ["row"] * 2


def test_results_are_valid_json(tmp_path):
    report(tmp_path / "r", b=float("nan"), a=[np.float32(1.5), np.int64(2), np.bool_(True), np.arange(2)], c={1: None})
    text = (tmp_path / "r" / "results.json").read_text(encoding="utf-8")

    def refuse(constant):
        raise AssertionError(constant)

    found = json.loads(text, parse_constant=refuse)
    assert found == {
        "a": [1.5, 2, True, [0, 1]],
        "b": None,
        "c": {"1": None},
        "files": ["index.html", "more.png", "picture.png", "results.json"],
    }
    assert list(found) == sorted(found)
    assert found["files"] == sorted(os.listdir(tmp_path / "r"))


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
        (tmp_path / ("x" * 300), "cannot be used"),
    ):
        with pytest.raises(ValueError, match=words):
            check_folder(folder)
        with pytest.raises(ValueError, match=words):
            report(folder)
    assert os.listdir(tmp_path) == ["file"]


def test_a_folder_without_permission(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *args: False)
    with pytest.raises(ValueError, match="not writable"):
        check_folder(tmp_path / "r")


def test_nothing_is_left_of_a_report_that_fails(tmp_path, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(ValueError, match="No space left"):
        report(tmp_path / "r")
    assert os.listdir(tmp_path) == []


def test_names_of_figures(tmp_path):
    for names in (["a.png", "a.png"], ["../a.png"], ["a.jpg"]):
        with pytest.raises(ValueError, match="cannot name a figure"):
            write_report(tmp_path / "r", "", "", [Section("", [Figure("", png(), "", name) for name in names])], {})
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


def test_a_schedule_looks_the_same_wherever_it_appears():
    few, many = styles({"luby": True}), styles({"own": True, "block:8x8": False, "coloring": True, "luby": True})
    assert few["luby"] == many["luby"]
    assert len({look[:2] for look in many.values()}) == 4
    assert [look.line for look in many.values()] == ["-", "--", "-", "-"]
