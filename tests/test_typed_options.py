"""An option is declared once, and a function shows its parameters: in Python, on the command line, and in the types."""

import ast
import re
import runpy
import subprocess
import sys
from inspect import Parameter, getsource, signature
from pathlib import Path
from textwrap import dedent

import pytest

import simdtex
from simdtex.commands import load

ROOT = Path(simdtex.__file__).parents[1]

FUNCTIONS = {
    **{"synth": "synthesize", "solid": "synthesize_solid", "tile": "extend"},
    **{name: name for name in ("fill", "extend", "simulate", "estimate", "classify", "mix", "tileset")},
}
"""The functions of commands."""

FIRST = {"sample", "samples", "image", "training", "picture", "textures"}
"""Parameters that are arguments of a command, or files that it names in its own way."""

ELSEWHERE = {
    "callback": "the command shows the progress",
    "full_output": "the command writes what it is asked for",
    "channel_axis": "a file says which axis holds channels",
    "known_source": "no file holds both known values and their sources",
    "masks": "transparent pixels of the samples are not used",
    "split": "half of the levels, which is what people want",
    "store": "--tiles and the name of the output",
    "categorical": "an option of the method elsewhere",
    "seamless": "what `tile` does; it has --direction",
}
"""Parameters that a command has not, and why."""

NAMES = {"rng": "seed", "shape": "size", "n": "number", "mask": "sample_mask", "textures": "textures"}
"""Parameters whose option has another name."""


def test_a_public_function_is_what_its_source_says():
    for name in (*FUNCTIONS.values(), "lcpdf", "explain", "replay"):
        function = getattr(simdtex, name)
        (node,) = ast.parse(dedent(getsource(function))).body
        assert (node.name, vars(function)) == (name, {})
        told = [*node.args.args, *node.args.kwonlyargs, *filter(None, [node.args.kwarg])]
        assert [one.arg for one in told] == [*signature(function).parameters]
        section = re.search(r"Parameters\n-+\n(.*?)\n\n", dedent(f"    {function.__doc__}"), re.DOTALL)[1]
        entries = re.findall(r"^([*\w][^:\n]*)(?: :.*)?$", section, re.MULTILINE)
        written = [name.strip("* ") for entry in entries for name in entry.split(",")]
        assert sorted(written) == sorted(one.arg for one in told)


def test_a_command_has_the_parameters_and_the_defaults_of_its_function():
    wrong = []
    for command, function in FUNCTIONS.items():
        options = {name: one for one in load(command).params for name in (one.name, max(one.opts, key=len).strip("-"))}
        options = {name.replace("-", "_"): one for name, one in options.items()}
        own = FIRST | (ELSEWHERE.keys() - {*options})
        own |= {"left", "right", "top", "bottom"} if command == "tile" else set()
        for one in signature(getattr(simdtex, function)).parameters.values():
            if one.kind is Parameter.VAR_KEYWORD or one.name in own:
                continue
            option = options.get(one.name) or options.get(NAMES.get(one.name, one.name))
            default = one.default if isinstance(one.default, (str, int, float)) else None
            told = f"[{default:g}]" if isinstance(default, float) else f"[{default}]"
            if option is None or (default and told not in option.help and option.default != default):
                wrong.append(f"{command}: {one.name}")
    assert wrong == []


def test_the_types_follow_from_functions_and_tables():
    written = (ROOT / "simdtex" / "__init__.pyi").read_text(encoding="utf-8")
    assert written == runpy.run_path(str(ROOT / "docs" / "stubs.py"))["stub"](), "run: python docs/stubs.py"


USES = """\
import numpy as np, simdtex.schedules
sample, size = np.zeros((64, 64)), (256, 256)
simdtex.synthesize(sample, size, full_output=True)[1].source.shape
simdtex.synthesize(sample, size, method="multires", edges="mend", full_output=True)[1].source.shape
simdtex.synthesize(sample, size, method="pyramid", full_output=True)[1].source.shape  # wrong
simdtex.fill(sample, full_output=True)[1].source.shape
simdtex.extend(sample, seamless="x", full_output=True)[1].source.shape
simdtex.synthesize(sample, size, schedule=simdtex.schedules.get("block:8x8"))
simdtex.synthesize(sample, size, schedule="lubi")  # wrong
simdtex.synthesize(sample, size, relaxation="icn")  # wrong
simdtex.synthesize(sample, size, method="mrff")  # wrong
simdtex.synthesize(sample, size, preset="papr")  # wrong
simdtex.simulate(sample, 3, several="meen")  # wrong
simdtex.replay(sample, size, relaxation="icn")  # wrong
"""


@pytest.mark.slow
def test_type_checkers_find_wrong_uses(tmp_path):
    (tmp_path / "uses.py").write_text(USES)
    command = [sys.executable, "-m", "mypy", "--strict", tmp_path / "uses.py"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    wrong = [str(number) for number, line in enumerate(USES.splitlines(), 1) if "wrong" in line]
    assert re.findall(r"uses.py:(\d+): error", said) == wrong, said
