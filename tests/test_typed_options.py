"""The types of ``**options`` follow from the tables; run this file to write them anew. An option is declared once."""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli.job import Task, job
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
    quoted,
    resolve,
    table,
)
from simdtex.schedules import SCHEDULES

FILE = Path(simdtex.__file__).with_name("methods") / "typed_options.py"
OVERLOADED = {"full_output", "source"}

TABLES = {
    "MrfOptions": ("mrf", "TypedDict"),
    "MultiresOptions": ("multires", "TypedDict"),
    "PyramidOptions": ("pyramid", "TypedDict"),
    "SolidOptions": ("pyramid.solid", "Common, PyramidOptions"),
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
    NAMES,
]
"""The names of schedules without a parameter."""


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
    "MultiresSynth": (simdtex.synthesize, "Common, MultiresOptions"),
    "PyramidSynth": (simdtex.synthesize, "Common, PyramidOptions"),
    "FillOptions": (simdtex.fill, "Common, MrfOptions"),
    "ExtendOptions": (simdtex.extend, "Common, MrfOptions"),
    "SimulateOptions": (simdtex.simulate, "MrfOptions"),
    "MixOptions": (simdtex.mix, "Common, PyramidOptions"),
    "ClassifyOptions": (simdtex.classify, "Common, ClassifierOptions"),
}
"""The functions that have further arguments, which are given by name, and the options that they take."""


def words(valid):
    return f"Literal[{', '.join(map(quoted, valid))}]"


def type_of(one):
    kinds = {Whole: "int", Switch: "bool", Numbers: "tuple[float, ...] | list[float]"}
    if isinstance(one.kind, Number):
        found = "float"
    elif isinstance(one.kind, Choice):
        found = words(one.kind.valid)
    elif isinstance(one.kind, Other):
        says = one.kind.says.replace("str or simdtex.schedules.", "ScheduleName | ").replace(
            "tuple of int", "tuple[int, ...]"
        )
        vectors = f"{words(one.kind.valid)} | tuple[tuple[float, float], tuple[float, float]]"
        says = says.replace("str or two vectors", vectors)
        found = says.replace("array", "ArrayLike").replace(" or ", " | ")
    else:
        found = kinds[type(one.kind)]
    return f"{found} | None" if one.default is None else found


def typed():
    lines = [HEAD.replace("NAMES", ",\n    ".join(map(quoted, SCHEDULES)))]
    for name, (method, base) in TABLES.items():
        found = table(import_module(f"simdtex.methods.{method}").Options)
        known = table(import_module("simdtex.methods.pyramid").Options) if "PyramidOptions" in base else {}
        lines += [f"\nclass {name}({base}, total=False):", f'    """The options of the method ``{method}``."""', ""]
        lines += [f"    preset: {type_of(PRESET)}"] if has_presets(found) and not known else []
        lines += [f"    {option}: {type_of(one)}" for option, one in found.items() if option not in known] + [""]
    for name, (function, bases) in FUNCTIONS.items():
        known = OVERLOADED | Common.__annotations__.keys() if "Common" in bases else OVERLOADED
        own = {one: function.__annotations__[one] for one in function.__kwdefaults__ if one not in known}
        if name == "MrfSynth":
            own["method"] = words(["mrf"])
        elif "method" in own:
            own = {"method": f"Required[{words([name.removesuffix('Synth').lower()])}]"}
        lines += [
            f"\nclass {name}({bases}, total=False):",
            f'    """The options of `simdtex.{function.__name__}`."""',
            "",
        ]
        lines += [f"    {one}: {written}".replace("'", '"') for one, written in own.items()] + [""]
    return "\n".join(lines)


def test_the_types_follow_from_the_tables():
    assert FILE.read_text(encoding="utf-8") == typed(), "run: python tests/test_typed_options.py"


def test_an_option_that_is_declared_is_everywhere(monkeypatch):
    """In Python with its default, check and preset, in the docstring, on the command line and on the live page."""
    from simdtex.live import words
    from simdtex.methods import pyramid

    @documented
    @dataclass(frozen=True)
    class Options(pyramid.Options):
        """The options of the method ``pyramid``."""

        glitter: float = option(
            0.5,
            Number(0),
            "Make it glitter",
            paper=0.25,
            jobs={"mix": 0.75},
            shown=("mix",),
            group="Appearance",
            slider=(0, 1, 0.1),
        )

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
    assert isinstance(mix, click.Command)


if __name__ == "__main__":
    FILE.write_text(typed(), encoding="utf-8")
