"""The checks of the built documentation, of its prose, and of the session that it plays."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import simdtex

# -- The check of the built documentation finds what it is for; in a browser, too, where there is one.

ROOT = Path(__file__).resolve().parent.parent
BUILT = ROOT / "docs" / "_build" / "html"

sys.path.insert(0, str(ROOT / "docs"))
import check  # noqa: E402

GOOD = """<html><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"></head>
<body><h1 id="top">One</h1><a href="two.html#there">two</a><a href="https://example.org/x">elsewhere</a>
<img src="picture.png"></body></html>"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "one.html").write_text(GOOD, encoding="utf-8")
    (tmp_path / "two.html").write_text('<h1 id="there">Two</h1><a href="#">top</a>', encoding="utf-8")
    (tmp_path / "picture.png").write_bytes(b"")
    return tmp_path


def faults(folder):
    found = check.pages(folder)
    return [*check.broken(found), *check.elsewhere(folder, found)]


def test_sound_pages_have_no_faults(folder):
    assert faults(folder) == []


@pytest.mark.parametrize(
    ("good", "bad", "told"),
    [
        ("two.html#there", "two.html#nowhere", "has no place 'nowhere'"),
        ("two.html#there", "three.html", "there is no three.html"),
        ('src="picture.png"', 'src="other.png"', "there is no other.png"),
        ('src="picture.png"', 'src="https://example.org/p.png"', "loads https://example.org/p.png"),
        ('src="picture.png"', 'src="//example.org/p.png"', "loads //example.org/p.png"),
        ("</head>", '<script src="http://example.org/m.js"></script></head>', "loads http://example.org/m.js"),
        ("</head>", '<link rel="stylesheet" href="https://example.org/s.css"></head>', "loads https://example.org/s"),
        ("</h1>", '</h1><img srcset="big.png 2x" src="picture.png">', "there is no big.png"),
    ],
)
def test_a_fault_is_told(folder, good, bad, told):
    page = folder / "one.html"
    page.write_text(GOOD.replace(good, bad), encoding="utf-8")
    assert any(told in fault for fault in faults(folder))


def test_a_style_sheet_that_loads_from_elsewhere_is_told(folder):
    (folder / "style.css").write_text("@font-face { src: url(https://example.org/f.woff2) }", encoding="utf-8")
    assert faults(folder) == ["style.css loads https://example.org/f.woff2"]


def test_a_link_may_lead_to_a_file_that_is_no_page(folder):
    page = folder / "one.html"
    page.write_text(GOOD.replace("two.html#there", "picture.png"), encoding="utf-8")
    assert faults(folder) == []


def test_pictures_of_the_pages_are_small_and_have_a_command():
    text = (ROOT / "docs" / "pictures.py").read_text(encoding="utf-8")
    found = [*(ROOT / "docs" / "wishes").glob("*.png"), *(ROOT / "docs" / "readers").glob("*.png")]
    assert found
    for path in found:
        assert path.stat().st_size < 300_000, path.name
        assert f"def {path.stem}()" in text, path.name


@pytest.fixture
def browser():
    if check.missing():
        pytest.skip(check.missing())


@pytest.mark.slow
def test_a_page_that_is_too_wide_for_a_phone_is_told(folder, browser):
    assert check.sideways(folder) == []
    page = folder / "one.html"
    page.write_text(GOOD.replace("<h1", '<div style="width: 600px">wide</div><h1'), encoding="utf-8")
    (told,) = check.sideways(folder)
    assert "one.html is wider than 390 px" in told


@pytest.mark.slow
def test_built_pages_are_sound_in_a_browser(browser):
    if not (BUILT / "index.html").is_file():
        pytest.skip("the documentation is not built (make docs)")
    assert faults(BUILT) + check.opened(BUILT) + check.sideways(BUILT) == []


# -- docs/prose.py: words that the pages avoid are found in prose with their lines, and not in code or literals.

import prose  # noqa: E402

PAGES = {
    "page.rst": ".. autofunction:: begun\n\nTitle\n=====\n\nIt is ``begun`` here\nand :doc:`begun`.\n\n"
    "::\n\n   begun the the\n\n"
    ".. figure:: begun.png\n   :alt: what has\n      begun\n\n   64 x 64 x 64, and the\n   the end.\n",
    "page.md": "# Title\n\n![what has\nbegun](begun.png) the\n\n```console\nbegun the the\n```\n\n\nand the\nthe end\n",
    "page.py": '"""\nTitle\n=====\n\n``begun``\n"""\n\nbegun = "begun"\n\n\n'
    'def f():\n    """\n    It has begun, and\n\n    the\n    the end."""\n',
}


@pytest.mark.parametrize("name", PAGES)
def test_faults_are_found_in_prose_alone(name, tmp_path):
    page = tmp_path / name
    page.write_text(PAGES[name], encoding="utf-8")
    lines = PAGES[name].splitlines()
    found = [fault.removeprefix(f"{page}:").split(": ", 1) for fault in prose.faults(page, prose.checks())]
    assert sorted(message.rpartition("[")[2] for _, message in found) == ["lexical_illusions]", "project]"]
    for line, message in found:
        assert ("begun" if "project" in message else "the") in lines[int(line) - 1]
    (line,) = (int(line) for line, message in found if "project" in message)
    assert lines[line - 1].strip().removesuffix("](begun.png) the") in ("begun", "It has begun, and")


def test_a_clean_page_has_no_fault(tmp_path):
    (tmp_path / "page.rst").write_text("Title\n=====\n\nThe schedule chooses sites.\n", encoding="utf-8")
    assert list(prose.faults(tmp_path / "page.rst", prose.checks())) == []


# -- The session that the documentation plays is one of this version.

import recorded  # noqa: E402


@pytest.fixture(scope="module")
def recording():
    return recorded.unpack(recorded.FILE.read_text(encoding="ascii"))


def test_recorded_pictures_and_reasons_are_those_of_a_run(recording):
    found, data = recording
    shape = (recorded.SIDE, recorded.SIDE)
    rules = recorded.OPTIONS | {"rng": recorded.SEED, "device": "reference"}
    replay = simdtex.replay(recorded.sample(), shape, **rules)
    assert [list(one) for one in replay.sweeps] == found["inside"][0]["panes"][0]["sweeps"]
    for key, moment in found["moments"][1::20]:
        (n, sets), level = json.loads(key), moment[0]
        _, ((begin, size),) = found["frames"][f"picture {key}"]
        seen = np.frombuffer(data[begin : begin + size], np.uint8).reshape(*shape, 4)
        image = replay.at(n, sets).image[..., 0].repeat(2**level, 0).repeat(2**level, 1)
        np.testing.assert_array_equal(seen[..., 0], image[: shape[0], : shape[1]])
        row, col = recorded.PIXELS[0]
        reason = found["explained"][f"{row},{col} {key}"]["reason"]
        try:
            assert reason == replay.explain_pixel(row, col, n, sets).reason
        except ValueError as error:
            assert reason == str(error)


def test_the_recording_is_small_and_packs(recording):
    assert recorded.FILE.stat().st_size < 700_000
    assert recorded.unpack(recorded.pack(*recording)) == recording
