"""The page for contributors: its listings are written into a copy of the repository, and what it says happens there."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "contributing.rst").read_text(encoding="utf-8")
LISTINGS = {
    caption: dedent(body).strip("\n") + "\n"
    for caption, body in re.findall(
        r"^\.\. code-block:: \w+\n   :caption: (.+)\n\n((?:(?:   .*)?\n)+)", PAGE, re.MULTILINE
    )
}
FILES = ("kernels/median.cl", "simdtex/ops/median.py", "tests/test_median.py", "look.py")
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
    last = "     - ``tests/test_pyramid_method.py``, ``tests/test_matching.py``\n"
    assert table.count(last) == 1
    row = "".join(f"   {line}\n" for line in LISTINGS[TABLE].splitlines())
    (root / TABLE).write_text(table.replace(last, last + row), encoding="utf-8")
    return root


def python(root, *words, device):
    environment = os.environ | {
        "PYTHONPATH": str(root),
        "SIMDTEX_DEVICE": str(device.index),
        "SIMDTEX_REQUIRE_OPENCL": "1",
    }
    environment.pop("SIMDTEX_REQUIRE_OPENCL", None)  # the tests of the house need no device
    for name in [name for name in environment if name.startswith("PYTEST_")]:
        del environment[name]
    return subprocess.run(
        [sys.executable, *words], cwd=root, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def pytest_in(root, *words, device):
    return python(root, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words, device=device)


def test_every_listing_has_its_place():
    assert set(LISTINGS) == {*FILES, TABLE, "what look.py prints"}


@pytest.mark.slow
def test_the_operation_passes_its_test_and_those_of_the_house(copy, any_device):
    done = pytest_in(copy, "tests/test_median.py", device=any_device)
    assert done.returncode == 0, done.stdout
    assert "OpenCL devices that ran tests" in done.stdout
    words = re.search(r'tests/test_house.py tests/test_docs.py -k "(.+)"', PAGE).group(1)
    done = pytest_in(copy, "tests/test_house.py", "tests/test_docs.py", "-k", words, device=any_device)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_it_does_what_the_page_shows(copy, any_device):
    done = python(copy, "look.py", device=any_device)
    assert done.stdout == LISTINGS["what look.py prints"], done.stderr


@pytest.mark.slow
def test_its_test_can_fail(copy, any_device):
    """As the page says: the devices fail, the reference does not."""
    kernel = copy / "kernels" / "median.cl"
    right = kernel.read_text(encoding="utf-8")
    assert right.count("rank == 4") == 1
    assert "Write ``rank == 3`` in the kernel" in PAGE
    kernel.write_text(right.replace("rank == 4", "rank == 3"), encoding="utf-8")
    try:
        done = pytest_in(copy, "tests/test_median.py", device=any_device)
    finally:
        kernel.write_text(right, encoding="utf-8")
    assert done.returncode == 1, done.stdout
    failed = re.findall(r"^FAILED tests/test_median.py::(\w+)", done.stdout, re.MULTILINE)
    assert set(failed) == {"test_a_device_has_the_references_bits", "test_the_shape_of_a_launch_changes_no_bit"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".py")])
def test_its_python_is_formatted_and_clean(copy, name):
    ruff = shutil.which("ruff", path=str(Path(sys.executable).parent))
    if ruff is None:
        pytest.skip("ruff is of the extra dev")
    for words in (("check",), ("format", "--check")):
        done = subprocess.run([ruff, *words, name], cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_root_points_there():
    assert "docs/contributing.rst" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
