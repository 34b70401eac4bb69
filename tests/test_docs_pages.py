# SPDX-License-Identifier: BSD-3-Clause
"""The check of the built documentation finds what it is for; in a browser, too, where there is one."""

import sys
from pathlib import Path

import pytest

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
