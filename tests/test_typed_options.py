"""An option is declared once, and a function shows its parameters: in Python, on the command line, and in the types."""

import ast
import re
import runpy
import subprocess
import sys
from dataclasses import dataclass
from inspect import Parameter, getsource, signature
from pathlib import Path
from textwrap import dedent

import click
import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli.job import job
from simdtex.commands import load
from simdtex.methods.pyramid import options as pyramid
from simdtex.options import Number, documented, option, resolve

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


def test_a_misspelt_parameter_is_answered():
    with pytest.raises(TypeError, match=r"unknown option 'seamles' of the method 'mrf' \(did you mean 'seamless'\?\)"):
        simdtex.extend([[1, 2], [3, 4]], right=1, seamles=True)


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


def test_an_option_that_is_declared_is_everywhere(monkeypatch):
    """In Python with its default, check and preset, in the docstring, on the command line and on the live page."""
    from simdtex.live import job as page

    how = {"jobs": {"mix": 0.75}, "shown": ("mix",), "group": "Appearance", "slider": (0, 1, 0.1)}

    @documented
    @dataclass(frozen=True)
    class Options(pyramid.Options):
        """The options of the method ``pyramid``."""

        glitter: float = option(0.5, Number(0), "Make it glitter", paper=0.25, **how)

    Options.__module__ = "simdtex.methods.pyramid.options"
    monkeypatch.setitem(page.TABLES, "pyramid", (Options, "mix"))
    for options, glitter in (
        ({}, 0.75),
        ({"glitter": 1}, 1),
        ({"preset": "paper"}, 0.25),
        ({"preset": "paper", "glitter": 2}, 2),
    ):
        assert resolve(Options, "mix", options).glitter == glitter
    assert resolve(Options, "synth", {}).glitter == 0.5
    with pytest.raises(ValueError, match="glitter is -1; give a number of at least 0"):
        resolve(Options, "synth", {"glitter": -1})
    assert "glitter : float, 0 or more, default 0.5\n" in Options.__doc__ and "Make it glitter." in Options.__doc__
    assert {"name": "glitter", "default": 0.75}.items() <= page.controls("pyramid")[-1].items()

    made = []

    @job(methods=[Options])
    def mix(**options):
        """Mix."""
        made.append(options)

    assert isinstance(mix, click.Command)
    assert CliRunner().invoke(mix, ["--glitter", "0.3"]).exit_code == 0
    assert made[0]["glitter"] == 0.3
    assert "--glitter FLOAT" in CliRunner().invoke(mix, ["--help"]).output
