"""The types of the public names for editors and type checkers: writes ``simdtex/__init__.pyi``.

The parameters are those of the functions, and the options those of the methods' tables; only here are they together.
``python docs/stubs.py`` writes the file; with ``--check``, as in ``make lint``, it exits with 1 if it would differ.
"""

import sys
from inspect import Parameter, signature
from pathlib import Path
from textwrap import fill

import simdtex
from simdtex.jobs.classification import options as classification
from simdtex.methods import mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid import solid
from simdtex.options import PRESET, Choice, Number, Numbers, Other, Switch, Whole, has_presets, table
from simdtex.schedules import SCHEDULES

FILE = Path(simdtex.__file__).with_name("__init__.pyi")

PAIR = "tuple[float, float]"

METHODS = {
    "MrfOptions": mrf.Options,
    "MultiresOptions": multires.Options,
    "PyramidOptions": pyramid.Options,
    "SolidOptions": solid.Options,
    "ClassificationOptions": classification.Options,
}
"""The tables of options, by the name of their type."""

PICTURE, ALSO = "NDArray[Any]", "tuple[NDArray[Any], {}]"
SOURCE, OUTPUT = ALSO.format("OutputWithSource"), ALSO.format("Output")
OF_MRF = ("mask", "known", "known_source", "guide", "store")
"""The parameters of `synthesize` that only the method ``mrf`` has."""

WHOLE = {"method": "Literal['mrf'] = ...", "store": "None = ..."}
TILED = {**WHOLE, "store": "TileStore", "checkpoint": "None = ...", "full_output": "Literal[False] = ..."}

FUNCTIONS = (
    ("synthesize", "MrfOptions", WHOLE, "full_output", SOURCE, PICTURE),
    ("synthesize", "MrfOptions", TILED, "", "", "dask.array.Array"),
    ("synthesize", "MultiresOptions", {"method": "Literal['multires']"}, "full_output", SOURCE, PICTURE),
    ("synthesize", "PyramidOptions", {"method": "Literal['pyramid']"}, "full_output", OUTPUT, PICTURE),
    ("synthesize_solid", "SolidOptions", {}, "full_output", OUTPUT, PICTURE),
    ("fill", "MrfOptions", {}, "full_output", SOURCE, PICTURE),
    ("extend", "MrfOptions", {}, "full_output", SOURCE, PICTURE),
    ("mix", "PyramidOptions", {}, "full_output", OUTPUT, PICTURE),
    ("classify", "ClassificationOptions", {}, "full_output", OUTPUT, PICTURE),
    ("simulate", "MrfOptions", {}, "source", "xarray.Dataset", "xarray.DataArray"),
    ("estimate", "", {}, "", "", "xarray.Dataset"),
    ("explain", "MrfOptions", {}, "", "", "Explanation"),
    ("replay", "MrfOptions", {}, "", "", "Replay"),
)
"""The functions: name, options, types of other parameters, and the switch between two types of results."""

HEAD = '''\
# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: E501
# fmt: off
"""The types of the public names for editors and type checkers; ``python docs/stubs.py`` writes this file."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict, Unpack, overload

import dask.array
import xarray
from numpy.typing import ArrayLike, NDArray

IMPORTS

__version__: str

ScheduleName = Literal[
    SCHEDULES
]
'''

USED = """\
from simdtex.driver import Device, Kept, Seed
from simdtex.io.hard_data import HardData
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


def options_type(name, options):
    """The type of the options of a method."""
    found = table(options)
    known = table(pyramid.Options) if options is solid.Options else {}
    lines = [f"class {name}({'PyramidOptions' if known else 'TypedDict'}, total=False):"]
    lines += [f"    preset: {type_of(PRESET)}"] if has_presets(found) and not known else []
    return lines + [f"    {option}: {type_of(one)}" for option, one in found.items() if option not in known]


def parameters(function, options, types, switch):
    """The parameters of a function but for the switch: those before the star, and those after it."""
    before, after = [], []
    for name, one in signature(getattr(simdtex, function)).parameters.items():
        alone = types.get("method", "mrf").find("mrf") < 0 and name in OF_MRF
        if name == switch or alone or one.kind is Parameter.VAR_KEYWORD:
            continue
        default = "" if one.default is Parameter.empty else " = ..."
        written = f"{name}: {types.get(name, f'{one.annotation}{default}')}"
        (after if one.kind is Parameter.KEYWORD_ONLY else before).append(written)
    return before, after + ([f"**options: Unpack[{options}]"] if options else [])


def overloads(function, options, types, switch, with_it, without):
    """The signatures of a function, one for each value of the switch."""
    before, after = parameters(function, options, types, switch)
    ways = [([f"{switch}: Literal[True]"], with_it), ([f"{switch}: Literal[False] = ..."], without)]
    for more, found in ways if switch else [([], without)]:
        if switch or types is TILED:
            yield "@overload"
        yield f"def {function}({', '.join([*before, '*', *more, *after])}) -> {found}: ..."


def stub():
    """The text of the file."""
    typed = {function for function, *_ in FUNCTIONS}
    homes = {one: home for home, names in simdtex._NAMES.items() for one in names if one not in typed}
    found = [f"from {home} import {one} as {one}" for one, home in homes.items()] + USED.splitlines()
    found.sort(key=lambda line: (line.split()[1], " as " in line, line))
    written = fill(str(list(SCHEDULES))[1:-1], 116).replace("\n", "\n    ")
    lines = [HEAD.replace("IMPORTS", "\n".join(found)).replace("SCHEDULES", written)]
    for name, options in METHODS.items():
        lines += [*options_type(name, options), ""]
    for one in FUNCTIONS:
        lines += overloads(*one)
    return "\n".join(lines).replace("'", '"') + "\n"


def main(arguments):
    """Write the file, or check it."""
    if "--check" not in arguments:
        FILE.write_text(stub(), encoding="utf-8")
    elif not FILE.exists() or FILE.read_text(encoding="utf-8") != stub():
        sys.exit(f"{FILE.name} does not follow from the functions and the tables of options; run: python docs/stubs.py")


if __name__ == "__main__":
    main(sys.argv[1:])
