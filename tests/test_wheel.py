"""What goes to the package index: it has what belongs there and nothing else, and works in a clean environment.

The files of the folder that SIMDTEX_DIST names, which `make dist` has built, or else files that are built here.
"""

import email
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from PIL import Image
from skimage import data

from simdtex.machine.devices import _copy_icd_files, devices, intel_library

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

ROOT = Path(__file__).resolve().parent.parent
DATA = {".html", ".css", ".js", ".svg", ".png", ".ico", ".json", ".pyi"}
"""Kinds of files that the package may read beside its modules and kernels."""
QUIET = ("-q", "--disable-pip-version-check")


def run(*command, cwd, **more):
    """Run a command without this process's own paths and with ``more`` variables; return what it printed."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")} | more
    done = subprocess.run([str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def environment(folder):
    """Make an empty environment; return the folder of its commands."""
    run(sys.executable, "-m", "venv", folder, cwd=folder.parent)
    return folder / ("Scripts" if os.name == "nt" else "bin")


def extra():
    """Return the extras: of reports, and of the CPU runtime if the tests use the one of the package index."""
    return "[cpu,reports]" if intel_library() else "[reports]"


@pytest.fixture(scope="module")
def dist(tmp_path_factory):
    """The folder with the source distribution, and the wheel that was built from it."""
    if made := os.environ.get("SIMDTEX_DIST"):
        return ROOT / made
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def wheel(dist):
    (built,) = dist.glob("simdtex-*.whl")
    return built


@pytest.fixture(scope="module")
def sdist(dist):
    (built,) = dist.glob("simdtex-*.tar.gz")
    return built


def test_the_wheel_carries_the_kernels_and_nothing_else(wheel):
    """Each file of the package, each kernel, and the metadata: no test, no cache, nothing that lay about."""
    names = set(zipfile.ZipFile(wheel).namelist())
    package, kernels = ROOT / "simdtex", ROOT / "kernels"
    wanted = {f"simdtex/{path.relative_to(package).as_posix()}" for path in package.rglob("*.py")}
    wanted |= {f"simdtex/kernels/{p.relative_to(kernels).as_posix()}" for p in kernels.rglob("*") if p.is_file()}
    wanted |= {
        f"simdtex/{path.relative_to(package).as_posix()}"
        for path in package.rglob("*")
        if path.is_file() and path.suffix in DATA
    }
    wanted.add("simdtex/py.typed")
    assert any(name.endswith(".cl") for name in wanted)
    info = {name for name in names if name.partition("/")[0].endswith(".dist-info")}
    assert names - info == wanted
    assert {name.partition("/")[2] for name in info} == {
        *("METADATA", "WHEEL", "RECORD", "entry_points.txt", "licenses/LICENSE")
    }


def test_the_source_distribution_has_tests_and_documentation(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {
        *("pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "Makefile", "CONTRIBUTING.md"),
        *("simdtex/py.typed", "kernels/mrf/relax.h", "tests/test_wheel.py", "docs/index.rst", "docs/contributing.rst"),
    }
    assert wanted <= names
    assert not [name for name in names if "__pycache__" in name or name.startswith((".venv", "docs/_build", "dist"))]


def test_the_metadata_are_those_of_the_project(wheel):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        found = email.message_from_bytes(archive.read(name))
    assert (found["Name"], found["Version"]) == ("simdtex", project["version"])
    assert (found["License-Expression"], found["Requires-Python"]) == (project["license"], project["requires-python"])
    assert found["Description-Content-Type"] == "text/markdown"
    assert set(found.get_all("Provides-Extra")) == set(project["optional-dependencies"])
    needed = {line for line in found.get_all("Requires-Dist") if "extra ==" not in line}
    assert needed == set(project["dependencies"])
    assert len(found.get_all("Project-URL", [])) == len(project.get("urls", {}))


def test_the_package_index_would_take_both(wheel, sdist):
    run(sys.executable, "-m", "twine", "check", "--strict", wheel, sdist, cwd=wheel.parent)
    checker = shutil.which("check-wheel-contents", path=str(Path(sys.executable).parent))
    assert checker, "install the extra release"
    run(checker, wheel, cwd=wheel.parent)


def test_synthesis_with_what_is_installed(wheel, sdist, tmp_path, any_device):
    """The wheel in an empty environment, then the source distribution in its place: they make the same bytes."""
    venv = tmp_path / "venv"
    scripts = environment(venv)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    Image.fromarray(data.brick()[:48, :56]).save(elsewhere / "sample.png")
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    for name, file, words in (("wheel", f"{wheel}{extra()}", ()), ("sdist", sdist, ("--force-reinstall", "--no-deps"))):
        run(scripts / "python", "-m", "pip", "install", *QUIET, *words, file, cwd=tmp_path)
        where = run(scripts / "python", "-c", "import simdtex; print(simdtex.__file__)", cwd=elsewhere)
        assert Path(where.strip()).is_relative_to(venv)
        assert run(scripts / "simdtex", "--version", cwd=elsewhere).startswith(f"simdtex {version}\n")
        run(
            scripts / "simdtex",
            *("synth", "sample.png", "-o", "out.png", "--size", "24x20", "--order", "2", "--seed", 1),
            *("--levels", "1", "--device", any_device.index),
            cwd=elsewhere,
        )
        with Image.open(elsewhere / "out.png") as picture:
            assert picture.size == (24, 20)  # width x height
        assert sorted(path.name for path in elsewhere.iterdir()) == ["out.png", "sample.png"]
        (elsewhere / "out.png").rename(tmp_path / f"{name}.png")
    assert (tmp_path / "wheel.png").read_bytes() == (tmp_path / "sdist.png").read_bytes()
    run(
        scripts / "simdtex",
        *("schedules", "sample.png", "--schedule", "coloring,synchronous", "--seeds", 1, "--size", 20, "--order", 2),
        *("-o", "report", "--device", any_device.index),
        cwd=elsewhere,
    )
    assert "breaks (14)" in (elsewhere / "report" / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["a space", "\u00fc"])
def test_it_runs_from_a_folder_of_any_name(wheel, tmp_path, name, any_device):
    """The package, its kernels and pyopencl are all in the folder; each runtime gives the bytes of the reference.

    Intel's runtime, which cuts its own path at a space, stays where it is, and is named when it is in the folder.
    """
    (tmp_path / name).mkdir()
    scripts = environment(tmp_path / name / "venv")
    run(scripts / "python", "-m", "pip", "install", *QUIET, wheel, cwd=tmp_path)
    Image.fromarray(data.brick()[:24, :28]).save(tmp_path / "sample.png")
    words = ("synth", "sample.png", "--size", "16x12", "--order", "2", "--seed", 1, "--levels", "1")
    (tmp_path / "icd").mkdir()
    _copy_icd_files(tmp_path / "icd")
    if library := intel_library():
        (tmp_path / "icd" / "intel.icd").write_text(f"{library}\n")
    loader = {"OCL_ICD_VENDORS": str(tmp_path / "icd")}
    found = [info for info in devices(probe=False) if info.name and not info.simulated]
    assert any_device.index in [info.index for info in found]
    for info in found:
        made = tmp_path / f"{info.index}.png"
        run(scripts / "simdtex", *words, "-o", made, "--device", info.platform, cwd=tmp_path, **loader)
    run(scripts / "simdtex", *words, "-o", "reference.png", "--device", "reference", cwd=tmp_path)
    assert len({path.read_bytes() for path in tmp_path.glob("[0-9r]*.png")}) == 1
