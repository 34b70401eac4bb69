"""The page for contributors, and the checks of built pages, of prose, and of the session that the pages play."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

import simdtex

pytestmark = pytest.mark.slow

# -- The page for contributors: its listings are written into a copy of the repository, and what it says happens there.

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "contributing.rst").read_text(encoding="utf-8")
LISTINGS = {
    caption: dedent(body).strip("\n") + "\n"
    for caption, body in re.findall(
        r"^\.\. code-block:: \w+\n   :caption: (.+)\n\n((?:(?:   .*)?\n)+)", PAGE, re.MULTILINE
    )
}
FILES = ("kernels/mrf/median.cl", "simdtex/methods/mrf/median.py", "tests/methods/mrf/test_median.py", "look.py")
TABLE = "docs/concepts/index.rst"


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of what the page's commands read, with its listings in their places."""
    root = tmp_path_factory.mktemp("clone") / "simdtex"
    for name in ("kernels", "simdtex", "tests", "fuzz", "docs", "examples"):
        shutil.copytree(
            ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "_build", "*.png", "*.jpg")
        )
    for name in ("pyproject.toml", "README.md", "Makefile"):
        shutil.copy(ROOT / name, root)
    for name in FILES:
        assert not (ROOT / name).exists(), f"{name} is in the repository, so the page needs another example"
        (root / name).write_text(LISTINGS[name], encoding="utf-8")
    table = (root / TABLE).read_text(encoding="utf-8")
    last = "     - ``tests/methods/pyramid/test_pyramid_method.py``, ``tests/methods/pyramid/test_matching.py``\n"
    assert table.count(last) == 1
    row = "".join(f"   {line}\n" for line in LISTINGS[TABLE].splitlines())
    (root / TABLE).write_text(table.replace(last, last + row), encoding="utf-8")
    return root


def python(root, *words, device):
    environment = os.environ | {
        "PYTHONPATH": str(root),
        "SIMDTEX_DEVICE": str(device.index),
    }
    environment.pop("SIMDTEX_REQUIRE_OPENCL", None)  # the tests of the house need no device
    for name in [name for name in environment if name.startswith("PYTEST_")]:
        del environment[name]
    return subprocess.run(
        [sys.executable, *words], cwd=root, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def pytest_in(root, *words, device):
    return python(root, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words, device=device)


def test_the_operation_passes_its_test_and_those_of_the_house(copy, any_device):
    assert set(LISTINGS) == {*FILES, TABLE, "what look.py prints"}
    assert "docs/contributing.rst" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    done = pytest_in(copy, "tests/methods/mrf/test_median.py", device=any_device)
    assert done.returncode == 0, done.stdout
    assert "OpenCL devices that ran tests" in done.stdout
    words = re.search(r'tests/test_house.py tests/test_docs.py -k "(.+)"', PAGE).group(1)
    done = pytest_in(copy, "tests/test_house.py", "tests/test_docs.py", "-k", words, device=any_device)
    assert done.returncode == 0, done.stdout
    done = python(copy, "look.py", device=any_device)
    assert done.stdout == LISTINGS["what look.py prints"], done.stderr


def test_its_test_can_fail(copy, any_device):
    """As the page says: the devices fail, the reference does not."""
    kernel = copy / "kernels" / "mrf" / "median.cl"
    right = kernel.read_text(encoding="utf-8")
    assert right.count("rank == 4") == 1
    assert "Write ``rank == 3`` in the kernel" in PAGE
    kernel.write_text(right.replace("rank == 4", "rank == 3"), encoding="utf-8")
    try:
        done = pytest_in(copy, "tests/methods/mrf/test_median.py", device=any_device)
    finally:
        kernel.write_text(right, encoding="utf-8")
    assert done.returncode == 1, done.stdout
    failed = re.findall(r"^FAILED tests/methods/mrf/test_median.py::(\w+)", done.stdout, re.MULTILINE)
    assert set(failed) == {"test_a_device_has_the_references_bits", "test_the_shape_of_a_launch_changes_no_bit"}


def test_its_python_is_formatted_and_clean(copy):
    ruff = shutil.which("ruff", path=str(Path(sys.executable).parent))
    if ruff is None:
        pytest.skip("ruff is of the extra dev")
    for words in (("check",), ("format", "--check")):
        names = [name for name in FILES if name.endswith(".py")]
        done = subprocess.run([ruff, *words, *names], cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


# -- The check of the built documentation finds what it is for; in a browser, too, where there is one.
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


FAULTS = [
    ("two.html#there", "two.html#nowhere", "has no place 'nowhere'"),
    ("two.html#there", "three.html", "there is no three.html"),
    ('src="picture.png"', 'src="other.png"', "there is no other.png"),
    ('src="picture.png"', 'src="//example.org/p.png"', "loads //example.org/p.png"),
    ("</head>", '<script src="http://example.org/m.js"></script></head>', "loads http://example.org/m.js"),
    ("</head>", '<link rel="stylesheet" href="https://example.org/s.css"></head>', "loads https://example.org/s"),
    ("</h1>", '</h1><img srcset="big.png 2x" src="picture.png">', "there is no big.png"),
]


def test_faults_of_pages_are_told_and_sound_pages_have_none(folder):
    assert faults(folder) == []
    page = folder / "one.html"
    page.write_text(GOOD.replace("two.html#there", "picture.png"), encoding="utf-8")
    assert faults(folder) == [], "a link may lead to a file that is no page"
    for good, bad, told in FAULTS:
        page.write_text(GOOD.replace(good, bad), encoding="utf-8")
        assert any(told in fault for fault in faults(folder)), bad
    page.write_text(GOOD, encoding="utf-8")
    (folder / "style.css").write_text("@font-face { src: url(https://example.org/f.woff2) }", encoding="utf-8")
    assert faults(folder) == ["style.css loads https://example.org/f.woff2"]


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


def test_what_is_too_wide_in_a_browser_is_told(folder, browser):
    assert check.sideways(folder) == []
    page = folder / "one.html"
    page.write_text(GOOD.replace("<h1", '<div style="width: 600px">wide</div><h1'), encoding="utf-8")
    (told,) = check.sideways(folder)
    assert "one.html is wider than 390 px" in told
    code = '<article><pre style="overflow: auto">{}</pre></article><h1'.format("x" * 300)
    for style, count in (("white-space: pre-wrap; overflow-wrap: anywhere", 0), ("", 1)):
        page.write_text(GOOD.replace("<h1", f"<style>pre {{ {style} }}</style>{code}"), encoding="utf-8")
        assert sum("runs out of its box" in told for told in check.opened(folder, words=())) == count


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
        reason = found["reasons"][found["explained"][f"{row},{col} {key}"]]["reason"]
        try:
            assert reason == replay.explain_pixel(row, col, n, sets).reason
        except ValueError as error:
            assert reason == str(error)


def test_recorded_films_are_of_the_four_schedules_and_end_in_the_result(recording):
    found, data = recording
    counted = {message["name"]: (message, places) for message, places in found["films"]}
    assert list(counted) == list(recorded.FILMED)
    _, ((begin, size),) = found["frames"]["picture null"]
    first, last = (counted["coloring"][n] for n in (0, 1))
    assert data[begin : begin + size] == data[last[-1][0] : sum(last[-1])]
    sweeps = found["inside"][0]["panes"][0]["sweeps"]
    fine = next(one for one in sweeps if one[0] == 0)
    assert [first[name] for name in ("steps", "sites", "sweeps", "together")] == [*fine[2:4], len(sweeps), 0]


def test_the_recording_is_small_and_packs(recording):
    assert recorded.FILE.stat().st_size < 700_000
    assert recorded.unpack(recorded.pack(*recording)) == recording
