"""The rules of the house: rooms and what they may import, their budgets of lines, and a test for each kernel."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "simdtex"
MODULES = sorted(PACKAGE.rglob("*.py"))
KERNELS = sorted((ROOT / "kernels").rglob("*.cl"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))

# A room imports from itself and from rooms above it. The number is its budget of lines; a larger one is a commit of its
# own, with a reason. Tiles stand above synthesis, since they are a way to run `synthesize`.
ROOMS = {
    ("random", "options", "machine"): 1801,
    ("io",): 3654,
    ("model",): 3657,
    ("run", "checkpoint", "driver"): 752,
    ("schedules",): 1009,
    ("methods.mrf",): 3963,
    ("methods.pyramid",): 2053,
    ("methods.multires",): 809,
    ("inputs",): 300,
    ("figures",): 850,
    ("cli",): 1632,
    ("maspar",): 1801,
    ("jobs.tiles",): 1561,
    ("jobs.synthesis",): 650,
    ("jobs.filling",): 805,
    ("jobs.why",): 444,
    ("jobs.tilesets",): 621,
    ("jobs.mixes",): 365,
    ("jobs.classification",): 1635,
    ("jobs.studies",): 2181,
    ("jobs.simulation",): 2786,
    ("live",): 1870,
    ("__init__", "__main__", "commands", "general", "methods", "jobs"): 400,
}
LINES, CODE = 35549, 21094
"""The budgets of the whole package: all lines, and those with code that is no import."""

NAMES = {name: number for number, names in enumerate(ROOMS) for name in names}


def dotted(path):
    """The name of a module within the package."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


def room(name):
    """The number of the room of a module; the package itself is ``__init__``."""
    parts = name.split(".")
    return next(NAMES[word] for n in (2, 1) if (word := ".".join(parts[:n]) or "__init__") in NAMES)


@cache
def tree(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path):
    """The modules of the package, or names in them, that a module imports anywhere, also for type checkers alone."""
    known = {dotted(one) for one in MODULES}
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            named = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in named:
            own = name.removeprefix("simdtex.") if name.startswith("simdtex.") else ""
            if name == "simdtex" or own == "__version__" or not own:
                continue
            yield own if own in known else own.rpartition(".")[0]


def libraries(path):
    """The first parts of the names of everything that a module imports."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def within(*rooms):
    return [path for path in MODULES if dotted(path).startswith(tuple(f"{name}." for name in rooms))]


def test_no_room_imports_from_one_below_it():
    wrong = [
        f"{dotted(path)} imports {name}"
        for path in MODULES
        for name in imports(path)
        if room(name) > room(dotted(path))
    ]
    assert wrong == []


def test_no_module_imports_itself_by_way_of_others():
    knows = {dotted(path): {name for name in imports(path) if name} - {dotted(path)} for path in MODULES}
    assert sum(map(len, knows.values())) > 400
    done, circles = set(), []

    def visit(name, path):
        if name in path:
            circles.append(" -> ".join([*path[path.index(name) :], name]))
        elif name not in done:
            for other in sorted(knows.get(name, ())):
                visit(other, [*path, name])
            done.add(name)

    for name in knows:
        visit(name, [])
    assert circles == []


def code(path):
    """The lines of a module that are neither blank nor comments, docstrings or imports."""
    text, skipped = path.read_text(encoding="utf-8").splitlines(), set()
    for node in ast.walk(tree(path)):
        is_text = isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
        if is_text or isinstance(node, (ast.Import, ast.ImportFrom)):
            skipped |= set(range(node.lineno, node.end_lineno + 1))
    return sum(bool(line.strip()) and line.strip()[0] != "#" for n, line in enumerate(text, 1) if n not in skipped)


def test_no_room_exceeds_its_budget():
    lines = dict.fromkeys(ROOMS, 0)
    for path in MODULES:
        lines[list(ROOMS)[room(dotted(path))]] += len(path.read_text(encoding="utf-8").splitlines())
    over = {names: (count, ROOMS[names]) for names, count in lines.items() if count > ROOMS[names]}
    assert over == {}, "lines, and the budget"
    assert sum(lines.values()) <= LINES
    assert sum(map(code, MODULES)) <= CODE


def test_tests_stand_in_folders_named_as_the_rooms():
    folders = {".".join(path.parent.relative_to(ROOT / "tests").parts) for path in TESTS if path.name[:5] == "test_"}
    assert folders - {""} <= set(NAMES)


def test_methods_and_schedules_ask_no_object_what_it_is():
    """What a schedule or a machine has is declared in its protocol."""
    asks = r"getattr\(|hasattr\(|type: ignore"
    found = within("methods", "schedules")
    assert [dotted(path) for path in found if re.search(asks, path.read_text(encoding="utf-8"))] == []


def test_methods_and_the_reference_know_nothing_of_opencl():
    found = [*within("methods", "schedules", "model"), PACKAGE / "machine" / "reference.py"]
    known = ("pyopencl", "simdtex.machine.opencl", "simdtex.machine.devices")
    assert [dotted(path) for path in found if any(name.startswith(known) for name in libraries(path))] == []


def test_every_kernel_has_one_module_of_operations_which_tests_import():
    assert {"lcpdf", "luby", "temperature"} <= {path.stem for path in KERNELS}
    texts = {path: path.read_text(encoding="utf-8") for path in within("methods", "schedules", "jobs")}
    tests = "\n".join(path.read_text(encoding="utf-8") for path in TESTS)
    wrong = []
    for path in KERNELS:
        if path.parent.name == "maspar":
            continue
        names = re.findall(r"__kernel\s+(?:[A-Z]+\s+)?void\s+(\w+)", path.read_text(encoding="utf-8"))
        wrong += [] if names and all(f"{name}_".startswith(f"{path.stem}_") for name in names) else [path.name]
        for name in names:
            homes = [home for home, text in texts.items() if f'"{name}"' in text]
            # a launcher may leave the stem to a prefix
            homes = homes or [home for home, text in texts.items() if f'"{name.removeprefix(path.stem + "_")}"' in text]
            used = any(
                re.search(
                    rf"from simdtex\.{dotted(home)} import|from simdtex\.{dotted(home.parent)} import .*{home.stem}",
                    tests,
                )
                for home in homes
            )
            wrong += [] if homes and used else [name]
    assert wrong == []


def test_every_kernel_function_of_the_array_is_launched_by_an_instruction():
    instructions = (PACKAGE / "maspar" / "instructions.py").read_text(encoding="utf-8")
    for path in (ROOT / "kernels" / "maspar").glob("*.cl"):
        names = re.findall(r"__kernel\s+void\s+(\w+)", path.read_text(encoding="utf-8"))
        assert names and all(name.startswith(f"maspar_{path.stem}") for name in names)
        assert all(f"def {name.removeprefix('maspar_')}(" in instructions for name in names)


def test_every_file_names_its_licence():
    sources = [*MODULES, *KERNELS, *(ROOT / "kernels").rglob("*.h")]
    named = "SPDX-License-Identifier: BSD-3-Clause"
    assert [str(path) for path in sources if named not in path.read_text(encoding="utf-8")[:200]] == []


def test_nothing_in_a_test_is_unseeded():
    drawn = r"default_rng\(\)|np\.random\.(rand|randn|randint|random|normal|uniform|seed)\(|^import random$"
    texts = {path: path.read_text(encoding="utf-8") for path in TESTS if path != Path(__file__)}
    assert [str(path) for path, text in texts.items() if re.search(drawn, text, re.MULTILINE)] == []
