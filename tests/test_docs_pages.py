"""The page for contributors, the built pages, and the session that the pages play."""

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


# -- The built documentation, where it is built and there is a browser.
BUILT = ROOT / "docs" / "_build" / "html"

sys.path.insert(0, str(ROOT / "docs"))
import check  # noqa: E402


def test_pictures_of_the_pages_are_small_and_have_a_command():
    text = (ROOT / "docs" / "pictures.py").read_text(encoding="utf-8")
    found = [*(ROOT / "docs" / "wishes").glob("*.png"), *(ROOT / "docs" / "readers").glob("*.png")]
    assert found
    for path in found:
        assert path.stat().st_size < 300_000, path.name
        assert f"def {path.stem}()" in text, path.name


def test_built_pages_are_sound_in_a_browser():
    if check.missing() or not (BUILT / "index.html").is_file():
        pytest.skip(check.missing() or "the documentation is not built (make docs)")
    found = check.pages(BUILT)
    assert [*check.broken(found), *check.elsewhere(BUILT, found)] == []
    assert check.opened(BUILT) + check.sideways(BUILT) == []


# -- The session that the documentation plays is one of this version.
import recorded  # noqa: E402


def test_recorded_pictures_and_reasons_are_those_of_a_run():
    found, data = recorded.unpack(recorded.FILE.read_text(encoding="ascii"))
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
