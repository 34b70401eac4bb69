"""The rules of the house: a kernel has its operation and a test; imports go one way."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "simdtex"
KERNELS = {path.stem: path for path in sorted((ROOT / "kernels").rglob("*.cl")) if path.parent.name != "maspar"}
MODULES = sorted(PACKAGE.rglob("*.py"))
TESTS = sorted((ROOT / "tests").glob("test_*.py"))


def imports(path, everything=False):
    """Every module that a file imports, as a dotted name; what only type checkers see is left out, unless asked for."""
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
        if id(node) in hidden and not everything:
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
    assert {"lcpdf", "luby", "temperature"} <= KERNELS.keys()


@pytest.mark.parametrize("stem", KERNELS)
def test_every_kernel_has_one_module_of_operations_which_tests_import(stem):
    source = KERNELS[stem].read_text()
    names = re.findall(r"__kernel\s+(?:[A-Z]+\s+)?void\s+(\w+)", source)
    assert names and all(name == stem or name.startswith(f"{stem}_") for name in names)
    operations = {path.stem: path.read_text() for path in (PACKAGE / "ops").glob("*.py")}
    for name in names:
        homes = [home for home, text in operations.items() if f'"{name}"' in text]
        # a launcher may leave the stem to a prefix
        homes = homes or [home for home in operations if f'"{name.removeprefix(stem + "_")}"' in operations[home]]
        assert homes and (len(homes) == 1 or stem in homes)
        named = rf"\bsimdtex\.ops\.({'|'.join(homes)})\b|from simdtex\.ops import .*\b({'|'.join(homes)})\b"
        assert any(re.search(named, path.read_text(encoding="utf-8")) for path in (ROOT / "tests").glob("*.py"))


def test_every_kernel_function_of_the_array_is_launched_by_an_instruction():
    instructions = (PACKAGE / "maspar" / "instructions.py").read_text()
    for path in (ROOT / "kernels" / "maspar").glob("*.cl"):
        names = re.findall(r"__kernel\s+void\s+(\w+)", path.read_text())
        assert names and all(name.startswith(f"maspar_{path.stem}") for name in names)
        assert all(f"def {name.removeprefix('maspar_')}(" in instructions for name in names)


def test_every_file_names_its_licence():
    sources = [*MODULES, *(ROOT / "kernels").rglob("*.cl"), *(ROOT / "kernels").rglob("*.h")]
    assert [str(p) for p in sources if "SPDX-License-Identifier: BSD-3-Clause" not in p.read_text()[:200]] == []


# The rooms of the house; imports go one way: a room may know of those after it.
ROOMS = [
    *("__main__", "cli", "report", "__init__", "live", "experiments", "distributed", "jobs"),
    *("methods", "inputs", "driver", "checkpoint", "schedules", "maspar", "ops", "machine", "run", "model", "io"),
    *("options", "random"),
]


def room(module):
    """The first part of a dotted name within the package; the package itself is ``__init__``."""
    _, _, rest = module.partition(".")
    return rest.partition(".")[0] or "__init__"


def graph():
    """Module -> the modules of the package that it imports anywhere, also for type checkers alone."""
    names = {dotted(path): path for path in MODULES}
    found = {}
    for name, path in names.items():
        told = imports(path, everything=True)
        packages = {n for n in told if n in names and not any(other.startswith(f"{n}.") for other in told & set(names))}
        found[name] = packages - {name}
    return found


def dotted(path):
    """The dotted name of a module."""
    parts = ("simdtex", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts).removesuffix(".__init__")


def test_every_module_stands_in_a_room():
    assert {room(dotted(path)) for path in MODULES} == set(ROOMS)


def test_few_modules_stand_at_the_top():
    assert len([path for path in PACKAGE.glob("*.py") if not path.name.startswith("__")]) <= 6


@pytest.mark.parametrize("path", MODULES, ids=dotted)
def test_imports_go_one_way(path):
    here = ROOMS.index(room(dotted(path)))
    for name in imports(path, everything=True):
        if name == "simdtex.__version__" or not name.startswith("simdtex."):
            continue
        there = room(name) if room(name) in ROOMS else "__init__"
        assert ROOMS.index(there) >= here, f"{path.relative_to(ROOT)} imports {name}"


def test_no_module_imports_itself_by_way_of_others():
    knows = graph()
    assert sum(map(len, knows.values())) > 200

    def reached(start):
        seen, todo = set(), [start]
        while todo:
            new = knows[todo.pop()] - seen
            seen |= new
            todo += new
        return seen

    assert [name for name in knows if name in reached(name)] == []


def test_methods_and_schedules_ask_no_object_what_it_is():
    """What a schedule or a machine has is declared in its protocol."""
    for path in within("methods") + within("schedules"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"getattr\(|hasattr\(|type: ignore", text), path.relative_to(ROOT)


def test_methods_and_schedules_know_nothing_of_opencl():
    for path in within("methods") + within("schedules"):
        for name in imports(path):
            assert not name.startswith(("pyopencl", "simdtex.machine.opencl", "simdtex.machine.devices")), (
                f"{path.relative_to(ROOT)} imports {name}"
            )


def test_operations_and_the_reference_need_no_opencl_to_be_imported():
    for path in [*within("ops"), PACKAGE / "machine" / "reference.py", *within("model")]:
        assert not [name for name in imports(path) if name.startswith("pyopencl")]


@pytest.mark.parametrize("path", TESTS, ids=lambda path: path.stem)
def test_nothing_in_a_test_is_unseeded(path):
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"default_rng\(\)|np\.random\.(rand|randn|randint|random|normal|uniform|seed)\(", text)
    assert not re.search(r"^import random$|^from random import", text, re.MULTILINE)
