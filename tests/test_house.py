"""The rules of the house: one name for a kernel, its operation and its test; imports go one way."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "simdtex"
KERNELS = sorted(path.stem for path in (ROOT / "kernels").glob("*.cl"))
MODULES = sorted(PACKAGE.rglob("*.py"))


def imports(path):
    """Every module that a file imports when it runs, as a dotted name; what only type checkers see is left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    hidden = {
        id(inside)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for statement in node.body
        for inside in ast.walk(statement)
    }
    found = set()
    for node in ast.walk(tree):
        if id(node) in hidden:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def within(part):
    return [path for path in MODULES if path.is_relative_to(PACKAGE / part)]


def test_there_are_kernels():
    assert {"coloring", "lcpdf", "temperature"} <= set(KERNELS)


@pytest.mark.parametrize("stem", KERNELS)
def test_every_kernel_has_an_operation_and_a_test_of_its_name(stem):
    assert (PACKAGE / "ops" / f"{stem}.py").is_file()
    assert (ROOT / "tests" / f"test_{stem}.py").is_file()


@pytest.mark.parametrize("stem", KERNELS)
def test_every_kernel_function_is_launched_by_its_operation(stem):
    source = (ROOT / "kernels" / f"{stem}.cl").read_text()
    operation = (PACKAGE / "ops" / f"{stem}.py").read_text()
    names = re.findall(r"__kernel\s+void\s+(\w+)", source)
    assert names
    for name in names:
        assert name == stem or name.startswith(f"{stem}_")
        short = name.removeprefix(f"{stem}_")
        assert f'"{name}"' in operation or f'"{short}"' in operation


def test_every_file_names_its_licence():
    sources = [*MODULES, *(ROOT / "kernels").rglob("*.cl"), *(ROOT / "kernels").rglob("*.h")]
    assert [str(p) for p in sources if "SPDX-License-Identifier: BSD-3-Clause" not in p.read_text()[:200]] == []


# Imports go one way: a part of the package may know of those to its right.
ONE_WAY = [
    *("cli", "report", "bench", "comparison", "series", "mixtures", "synthesis", "methods", "recorder", "schedules"),
    *("analysis", "histograms", "pyramids", "palette", "machine", "ops", "device"),
]


@pytest.mark.parametrize("part", ONE_WAY)
def test_imports_go_one_way(part):
    earlier = ONE_WAY[: ONE_WAY.index(part)]
    files = [p for p in MODULES if p.is_relative_to(PACKAGE / part) or p == PACKAGE / f"{part}.py"]
    assert files or part == "cli"
    for path in files:
        for name in imports(path):
            assert not any(name == f"simdtex.{up}" or name.startswith(f"simdtex.{up}.") for up in earlier), (
                f"{path.relative_to(ROOT)} imports {name}"
            )


def test_methods_and_schedules_know_nothing_of_opencl():
    for path in within("methods") + within("schedules"):
        for name in imports(path):
            assert not name.startswith(("pyopencl", "simdtex.machine.opencl", "simdtex.device")), (
                f"{path.relative_to(ROOT)} imports {name}"
            )


def test_operations_and_the_reference_need_no_opencl_to_be_imported():
    for path in [*within("ops"), PACKAGE / "machine" / "reference.py", PACKAGE / "lattice.py"]:
        assert not [name for name in imports(path) if name.startswith("pyopencl")]


@pytest.mark.parametrize("path", sorted((ROOT / "tests").glob("test_*.py")), ids=lambda path: path.stem)
def test_nothing_in_a_test_is_unseeded(path):
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"default_rng\(\)|np\.random\.(rand|randn|randint|random|normal|uniform|seed)\(", text)
    assert not re.search(r"^import random$|^from random import", text, re.MULTILINE)
