"""The types of the public names for editors and type checkers: writes ``simdtex/__init__.pyi`` from the tables.

``python docs/stubs.py`` writes the file; with ``--check``, as in ``make lint``, it exits with 1 if it would differ.
"""

import sys
from importlib import import_module
from pathlib import Path
from textwrap import fill

import simdtex
from simdtex.declared import inputs, parameter_types
from simdtex.jobs.why.job import NOT_REPLAYED
from simdtex.options import PRESET, Choice, Number, Numbers, Other, Switch, Whole, has_presets, table
from simdtex.schedules import SCHEDULES

FILE = Path(simdtex.__file__).with_name("__init__.pyi")

PAIR = "tuple[float, float]"
PICTURE, TUPLE = "NDArray[Any]", "tuple[NDArray[Any], {}]"

METHODS = {
    "Mrf": "methods.mrf",
    "Multires": "methods.multires.options",
    "Pyramid": "methods.pyramid.options",
    "Solid": "methods.pyramid.solid",
    "Classifier": "jobs.classification.options",
}
"""The tables of options, by the name of their class here."""

FUNCTIONS = (
    ("synth", "synthesize", "Mrf", "Synthesize", ("full_output", TUPLE.format("OutputWithSource"), PICTURE)),
    (
        "synth",
        "synthesize",
        "Multires",
        "SynthesizeMultires",
        ("full_output", TUPLE.format("OutputWithSource"), PICTURE),
    ),
    ("synth", "synthesize", "Pyramid", "SynthesizePyramid", ("full_output", TUPLE.format("Output"), PICTURE)),
    ("solid", "synthesize_solid", "Solid", "SynthesizeSolid", ("full_output", TUPLE.format("Output"), PICTURE)),
    ("fill", "fill", "Mrf", "Fill", ("full_output", TUPLE.format("OutputWithSource"), PICTURE)),
    ("extend", "extend", "Mrf", "Extend", ("full_output", TUPLE.format("OutputWithSource"), PICTURE)),
    ("mix", "mix", "Pyramid", "Mix", ("full_output", TUPLE.format("Output"), PICTURE)),
    ("classify", "classify", "Classifier", "Classify", ("full_output", TUPLE.format("Output"), PICTURE)),
    ("simulate", "simulate", "Mrf", "Simulate", ("source", "xarray.Dataset", "xarray.DataArray")),
    ("estimate", "estimate", "", "Estimate", ("", "", "xarray.Dataset")),
)
"""The functions: job, name, options, keywords, and the switch that decides which of two types they return."""

HEAD = '''\
# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: E501
# fmt: off
"""The types of the public names for editors and type checkers; ``python docs/stubs.py`` writes this file."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Required, TypedDict, Unpack, overload

import numpy as np
import xarray
from numpy.typing import ArrayLike, NDArray

IMPORTS

__version__: str

ScheduleName = Literal[
    SCHEDULES
]
'''


USED = """\
from simdtex.io.hard_data import HardData
from simdtex.machine import Machine
from simdtex.jobs.why.replay import Replay
from simdtex.model.explanation import Explanation
from simdtex.run import Callback, OutputWithSource
from simdtex.schedules import Schedule"""


def type_of(one):
    """The type of an option."""
    kinds = {Number: "float", Whole: "int", Switch: "bool", Numbers: "tuple[float, ...] | list[float]"}
    words = f"Literal{list(one.kind.valid)}" if isinstance(one.kind, (Choice, Other)) else ""
    found = kinds.get(type(one.kind), words)
    if isinstance(one.kind, Other):
        says = one.kind.says.replace("str or simdtex.schedules.", "ScheduleName | ").replace("array", "ArrayLike")
        says = says.replace("str or two vectors", f"{words} | tuple[{PAIR}, {PAIR}]")
        found = says.replace("tuple of int", "tuple[int, ...]").replace(" or ", " | ")
    return f"{found} | None" if one.default is None else found


def options_of(name, method):
    """The class of the options of a method."""
    found = table(import_module(f"simdtex.{method}").Options)
    known = table(import_module("simdtex.methods.pyramid.options").Options) if name == "Solid" else {}
    lines = [f"class {name}Options({'PyramidOptions' if known else 'TypedDict'}, total=False):"]
    lines += [f"    preset: {type_of(PRESET)}"] if has_presets(found) and not known else []
    return lines + [f"    {option}: {type_of(one)}" for option, one in found.items() if option not in known]


def keywords_of(job, options, name, switch):
    """The class of what a function takes by name."""
    other = name.removeprefix("Synthesize") if job == "synth" else ""
    bases = ", ".join([f"{options}Options"] * bool(options)) or "TypedDict"
    lines = [f"class {name}Keywords({bases}, total=False):"]
    for one, written in parameter_types(job).items():
        if inputs(job)[one].positional or one == switch or (other and inputs(job)[one].method):
            continue
        lines.append(f"    {one}: {written}")
        if one == "method":
            lines[-1] = f"    method: Required[Literal[{other.lower()!r}]]" if other else "    method: Literal['mrf']"
    return lines


def overloads(job, function, name, switch):
    """The signatures of a function, one for each value of the switch."""
    own = inputs(job)
    given = [
        f"{one}: {written}{'' if own[one].default is not None else ' = ...'}"
        for one, written in parameter_types(job).items()
        if own[one].positional
    ]
    by_switch, with_it, without = switch
    ways = [(f", {by_switch}: Literal[True]", with_it), (f", {by_switch}: Literal[False] = ...", without)]
    for more, found in ways if by_switch else [("", without)]:
        star = ", *" if more else ""
        if by_switch:
            yield "@overload"
        yield f"def {function}({', '.join(given)}{star}{more}, **options: Unpack[{name}Keywords]) -> {found}: ..."


def stub():
    """The text of the file."""
    public = {function for _, function, *_ in FUNCTIONS} | {"explain", "replay", "ensemble", "quality"}
    homes = {one: home for home, names in simdtex._NAMES.items() for one in names if one not in public}
    found = [f"from {home} import {one} as {one}" for one, home in homes.items()]
    found += [
        f"from simdtex.jobs.{room} import {one} as {one}"
        for room, one in (("simulation", "ensemble"), ("studies", "quality"))
    ]
    found += [*USED.splitlines()]
    found.sort(key=lambda line: (line.split()[1], " as " in line, line))
    written = fill(str(list(SCHEDULES))[1:-1], 116).replace("\n", "\n    ")
    lines = [HEAD.replace("IMPORTS", "\n".join(found)).replace("SCHEDULES", written)]
    for name, method in METHODS.items():
        lines += [*options_of(name, method), ""]
    for job, _, options, name, (switch, *_) in FUNCTIONS:
        lines += [*keywords_of(job, options, name, switch), ""]
    kept = [one for one in parameter_types("synth") if one not in NOT_REPLAYED]
    lines += ["class ReplayKeywords(MrfOptions, total=False):"]
    lines += [f"    {one}: {parameter_types('synth')[one]}" for one in kept if not inputs("synth")[one].positional]
    lines += [""]
    for job, function, _, name, switch in FUNCTIONS:
        lines += overloads(job, function, name, switch)
    shape = "sample: ArrayLike, shape: tuple[int, int]"
    lines += [
        f"def replay({shape}, **options: Unpack[ReplayKeywords]) -> Replay: ...",
        f"def explain(\n    {shape}, site: tuple[int, int], *, level: int = ..., sweep: int | None = ...,\n"
        "    **options: Unpack[ReplayKeywords],\n) -> Explanation: ...",
    ]
    return "\n".join(lines).replace("'", '"') + "\n"


def main(arguments):
    """Write the file, or check it."""
    if "--check" not in arguments:
        FILE.write_text(stub(), encoding="utf-8")
    elif not FILE.exists() or FILE.read_text(encoding="utf-8") != stub():
        sys.exit(f"{FILE.name} does not follow from the tables of options and inputs; run: python docs/stubs.py")


if __name__ == "__main__":
    main(sys.argv[1:])
