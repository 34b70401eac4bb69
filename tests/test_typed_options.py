"""The types of ``**options`` follow from the tables; run this file to write them anew. An option is declared once."""

import re
import subprocess
import sys
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path
from textwrap import fill

import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli.job import Task, job
from simdtex.methods import classifier, mrf, pyramid
from simdtex.methods.typed_options import Common
from simdtex.options import (
    PRESET,
    Choice,
    Number,
    Numbers,
    Other,
    Switch,
    Whole,
    documented,
    has_presets,
    option,
    resolve,
    table,
)
from simdtex.schedules import SCHEDULES

FILE = Path(simdtex.__file__).with_name("methods") / "typed_options.py"
OVERLOADED = {"full_output", "source"}
PAIR = "tuple[float, float]"

TABLES = {
    "MrfOptions": ("mrf", "TypedDict"),
    "MultiresSynth": ("multires", "Common"),
    "PyramidOptions": ("pyramid", "TypedDict"),
    "PyramidSynth": ("pyramid", "Common, PyramidOptions"),
    "SolidSynth": ("pyramid.solid", "Common, PyramidOptions"),
    "ClassifierOptions": ("classifier", "TypedDict"),
}
"""The method and the base of each class."""

HEAD = '''# SPDX-License-Identifier: BSD-3-Clause
"""The types of ``**options`` for editors and type checkers (PEP 692), from the tables of options.

``python tests/test_typed_options.py`` writes this file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Required, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint
from simdtex.io.hard_data import HardData
from simdtex.machine import Machine
from simdtex.run import Callback
from simdtex.schedules import Schedule

ScheduleName = Literal[
    NAMES
]  # fmt: skip


class Common(TypedDict, total=False):
    """What the public functions have in common."""

    channel_axis: int | None
    rng: int | np.random.Generator | None
    device: str | Machine | None
    callback: Callback | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None
'''
FUNCTIONS = {
    "MrfSynth": (simdtex.synthesize, "Common, MrfOptions"),
    "FillOptions": (simdtex.fill, "Common, MrfOptions"),
    "ExtendOptions": (simdtex.extend, "Common, MrfOptions"),
    "SimulateOptions": (simdtex.simulate, "MrfOptions"),
    "MixOptions": (simdtex.mix, "Common, PyramidOptions"),
    "ClassifyOptions": (simdtex.classify, "Common, ClassifierOptions"),
}
"""The functions that have further arguments, which are given by name, and the options that they take."""


def type_of(one):
    kinds = {Number: "float", Whole: "int", Switch: "bool", Numbers: "tuple[float, ...] | list[float]"}
    words = f"Literal{list(one.kind.valid)}" if isinstance(one.kind, (Choice, Other)) else ""
    found = kinds.get(type(one.kind), words)
    if isinstance(one.kind, Other):
        says = one.kind.says.replace("str or simdtex.schedules.", "ScheduleName | ").replace("array", "ArrayLike")
        says = says.replace("str or two vectors", f"{words} | tuple[{PAIR}, {PAIR}]")
        found = says.replace("tuple of int", "tuple[int, ...]").replace(" or ", " | ")
    return f"{found} | None" if one.default is None else found


def typed():
    lines = [HEAD.replace("NAMES", fill(str(list(SCHEDULES))[1:-1], 116).replace("\n", "\n    "))]
    for name, (method, base) in TABLES.items():
        found = table(import_module(f"simdtex.methods.{method}").Options)
        known = table(import_module("simdtex.methods.pyramid").Options) if "PyramidOptions" in base else {}
        lines += [f"\nclass {name}({base}, total=False):", f'    """The options of the method ``{method}``."""', ""]
        lines += [f"    method: Required[Literal[{method!r}]]"] if name in ("MultiresSynth", "PyramidSynth") else []
        lines += [f"    preset: {type_of(PRESET)}"] if has_presets(found) and not known else []
        lines += [f"    {option}: {type_of(one)}" for option, one in found.items() if option not in known] + [""]
    for name, (func, bases) in FUNCTIONS.items():
        known = OVERLOADED | Common.__annotations__.keys() if "Common" in bases else OVERLOADED
        own = {one: func.__annotations__[one] for one in func.__kwdefaults__ if one not in known}
        own |= {"method": 'Literal["mrf"]'} if "method" in own else {}
        lines += [f"\nclass {name}({bases}, total=False):", f'    """The options of `simdtex.{func.__name__}`."""', ""]
        lines += [f"    {one}: {written}" for one, written in own.items()] + [""]
    return "\n".join(lines).replace("'", '"')


def test_the_types_follow_from_the_tables():
    assert FILE.read_text(encoding="utf-8") == typed(), "run: python tests/test_typed_options.py"


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
    said = subprocess.run(command, cwd=FILE.parents[2], capture_output=True, text=True).stdout
    wrong = [str(number) for number, line in enumerate(USES.splitlines(), 1) if "wrong" in line]
    assert re.findall(r"uses.py:(\d+): error", said) == wrong, said


def test_signatures_list_options_with_the_defaults_of_the_job():
    for name, method in {"fill": mrf, "extend": mrf, "simulate": mrf, "mix": pyramid, "classify": classifier}.items():
        shown = {one.name: one.default for one in signature(getattr(simdtex, name)).parameters.values()}
        assert vars(resolve(method.Options, name, {})).items() - shown.items() <= {("boundary", "torus")}
    first, of_lcpdf = signature(simdtex.synthesize).parameters, signature(simdtex.lcpdf).parameters
    assert (first["edges"].default, of_lcpdf["order"].default) == ("auto", first["order"].default)


def test_an_option_that_is_declared_is_everywhere(monkeypatch):
    """In Python with its default, check and preset, in the docstring, on the command line and on the live page."""
    from simdtex.live import words

    how = {"jobs": {"mix": 0.75}, "shown": ("mix",), "group": "Appearance", "slider": (0, 1, 0.1)}

    @documented
    @dataclass(frozen=True)
    class Options(pyramid.Options):
        """The options of the method ``pyramid``."""

        glitter: float = option(0.5, Number(0), "Make it glitter", paper=0.25, **how)

    Options.__module__ = "simdtex.methods.pyramid"
    monkeypatch.setattr(pyramid, "Options", Options)
    monkeypatch.setitem(words.TABLES, "pyramid", (Options, "mix"))
    given = [
        resolve(Options, job, values).glitter for job, values in [("synth", {}), ("mix", {}), ("mix", {"glitter": 1})]
    ]
    assert given == [0.5, 0.75, 1]
    assert [resolve(Options, "mix", {"preset": "paper", **more}).glitter for more in ({}, {"glitter": 2})] == [0.25, 2]
    with pytest.raises(ValueError, match="glitter is -1; give a number of at least 0"):
        resolve(Options, "synth", {"glitter": -1})
    assert "glitter : float, 0 or more, default 0.5\n" in Options.__doc__ and "Make it glitter." in Options.__doc__
    assert {"name": "glitter", "default": 0.75}.items() <= words.controls("pyramid")[-1].items()

    made = []

    @job()
    def mix(**options):
        """Mix."""
        made.append(options)

    assert CliRunner().invoke(mix, ["--glitter", "0.3"]).exit_code == 0
    assert made[0]["glitter"] == 0.3 and Task
    assert "--glitter FLOAT" in CliRunner().invoke(mix, ["--help"]).output


if __name__ == "__main__":
    FILE.write_text(typed(), encoding="utf-8")
