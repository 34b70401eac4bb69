"""The built wheel, installed in a clean environment, synthesises from another directory."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from PIL import Image
from skimage import data

from simdtex.machine import runtimes

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

ROOT = Path(__file__).resolve().parent.parent


def run(*command, cwd):
    """Run a command without this process's own paths; return what it printed."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run([str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, ROOT, cwd=folder)
    (built,) = folder.glob("simdtex-*.whl")
    return built


def test_the_wheel_carries_the_kernels_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert "simdtex/report/templates/page.html" in names
    kernels = ROOT / "kernels"
    sources = [path for path in kernels.rglob("*") if path.suffix in (".cl", ".h")]
    assert sources
    for path in sources:
        assert f"simdtex/kernels/{path.relative_to(kernels).as_posix()}" in names
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"simdtex"}


def test_synthesis_with_the_installed_wheel(wheel, tmp_path, any_device):
    venv = tmp_path / "venv"
    run(sys.executable, "-m", "venv", venv, cwd=tmp_path)
    scripts = venv / ("Scripts" if os.name == "nt" else "bin")
    # Where the tests themselves stand on the CPU runtime of the package index, so must this.
    extra = "[cpu]" if runtimes.intel_library() else ""
    quiet = ("-q", "--disable-pip-version-check")
    run(scripts / "python", "-m", "pip", "install", *quiet, f"{wheel}{extra}", cwd=tmp_path)

    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    Image.fromarray(data.brick()[:48, :56]).save(elsewhere / "sample.png")
    where = run(scripts / "python", "-c", "import simdtex; print(simdtex.__file__)", cwd=elsewhere)
    assert Path(where.strip()).is_relative_to(venv)
    run(
        scripts / "simdtex",
        *("synth", "sample.png", "-o", "out.png", "--size", "24x20", "--order", "2"),
        *("--levels", "1", "--device", any_device.index),
        cwd=elsewhere,
    )
    with Image.open(elsewhere / "out.png") as picture:
        assert picture.size == (24, 20)  # width x height
    assert sorted(path.name for path in elsewhere.iterdir()) == ["out.png", "sample.png"]
    run(
        scripts / "simdtex",
        *("schedules", "sample.png", "--schedules", "coloring,synchronous", "--seeds", 1, "--size", 20, "--order", 2),
        *("-o", "report", "--device", any_device.index),
        cwd=elsewhere,
    )
    assert "breaks (14)" in (elsewhere / "report" / "index.html").read_text(encoding="utf-8")
