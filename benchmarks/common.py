# SPDX-License-Identifier: BSD-3-Clause
"""What the benchmarks share: command lines, samples, times, processes, tables and sheets."""

import argparse
import ast
import csv
import inspect
import subprocess
import sys
import time
from contextlib import suppress
from fnmatch import fnmatch
from functools import wraps
from io import BytesIO
from pathlib import Path

import numpy as np
import PIL.Image
from skimage import data

import simdtex
from simdtex.io.image import read
from simdtex.report.sheet import contact_sheet
from simdtex.report.tables import Table, print_table

DOCS = Path(__file__).parent.parent / "docs"


def command(main):
    """Give a function a command line: its parameters are the options.

    A parameter without a default is an argument. A default of a tuple takes one or more values, and a type takes one of
    that type, or several in turn (list), and is None if it is not given.
    """

    @wraps(main)
    def called(words=None):
        form = argparse.RawDescriptionHelpFormatter
        parser = argparse.ArgumentParser(description=main.__globals__["__doc__"], formatter_class=form)
        for name, one in inspect.signature(main).parameters.items():
            default, given = one.default, {}
            if default is one.empty:
                parser.add_argument(name, type=Path)
                continue
            if isinstance(default, bool):
                given = {"action": "store_true"}
            elif isinstance(default, tuple):
                given = {"nargs": "+", "type": type(default[0])}
            elif default is list:
                given, default = {"action": "append"}, None
            elif callable(default):
                given, default = {"type": default}, None
            elif default is not None:
                given = {"type": type(default)}
            dashes = "-" if len(name) == 1 else "--"
            parser.add_argument(dashes + name.replace("_", "-"), default=default, **given)
        try:
            return main(**vars(parser.parse_args(words)))
        except (ValueError, TypeError) as error:
            parser.error(str(error))

    return called


def chosen(known, names=""):
    """The entries of a dictionary that are named, by a list or as ``"a,b"``; all without names."""
    wanted = names.split(",") if isinstance(names, str) and names else names or list(known)
    for name in wanted:
        if name not in known:
            raise ValueError(f"there is no {name}: choose of {', '.join(known)}")
    return {name: known[name] for name in wanted}


def parsed(text):
    """The options of ``"balance=0,preset=paper"``: numbers, True, False and None as Python has them, else words."""
    options = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = (each.strip() for each in part.partition("="))
        if not (equals and name and value):
            raise ValueError(f"{part} is no option: give NAME=VALUE,NAME=VALUE")
        for kind in (str, float, ast.literal_eval):  # float knows inf
            with suppress(ValueError, SyntaxError):
                options[name] = kind(value)
    return options


def opened(device, **given):
    """A machine, whose name is printed."""
    machine = simdtex.open_machine(device, **given)
    print(f"device: {machine.name}")
    return machine


# ---------------------------------------------------------------- samples


def grey():
    """Brick, grass and gravel, 128x128."""
    return {name: getattr(data, name)()[:128, :128] for name in ("brick", "grass", "gravel")}


def colour():
    """Tissue, wood and stars, 96x96."""
    return {
        "tissue": data.immunohistochemistry()[76:172, 126:222],
        "wood": data.coffee()[266:362, 486:582],
        "stars": data.hubble_deep_field()[346:442, 166:262],
    }


def folder(path, only=""):
    """Every picture of a folder, by its name without the suffix; `only` are names or patterns, as ``*.png``."""
    found = {}
    for file in sorted(path.iterdir()) if path.is_dir() else ():
        if only and not any(fnmatch(name, each) for each in only.split(",") for name in (file.name, file.stem)):
            continue
        try:
            pixels = read(file).pixels
        except ValueError as error:
            print(f"left out: {error}")
            continue
        if file.stem in found:
            raise ValueError(f"two pictures in {path} are called {file.stem}: rename one, or leave it out by --only")
        found[file.stem] = pixels
    if not found:
        raise ValueError(f"there is no picture in {path}: give a folder of samples")
    return found


def samples(path, only=""):
    """The pictures of a folder, or where there is none those of `grey` and `colour`."""
    return folder(path, only) if path else chosen(grey() | colour(), only)


def axis(picture):
    """The axis of a picture's channels."""
    return -1 if picture.ndim == 3 else None


# ---------------------------------------------------------------- times and processes


def timed(function, *args, **given):
    """What a function returns, and the seconds that it takes."""
    began = time.perf_counter()
    found = function(*args, **given)
    return found, time.perf_counter() - began


def in_turns(runs, jobs):
    """What functions return, in lists by name: they are called in turn, and the first call of each does not count."""
    found = {name: [] for name in jobs}
    for _ in range(runs + 1):
        for name, job in jobs.items():
            found[name].append(job())
    return {name: those[1:] for name, those in found.items()}


def python(*words, **given):
    """What a Python process prints."""
    command = [sys.executable, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **given)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout


# ---------------------------------------------------------------- tables and sheets


def write(path, header, rows):
    """Write a table as CSV, and make the folder that it lies in; a path of None is standard output."""
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    with open(sys.stdout.fileno() if path is None else path, "w", newline="", closefd=path is not None) as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def show(title, header, rows):
    """Print a table."""
    print_table(Table(title, [dict(zip(header, map(str, row), strict=True)) for row in rows]))


def told(figures):
    """Figures by name as text."""
    return "  ".join(f"{name} {value:.2f}" for name, value in figures.items())


def sheet(path, cells, columns):
    """Write cells of label, picture and caption as a sheet, each picture at 1:1."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures, captions = [cell[:2] for cell in cells], [caption for *_, caption in cells]
    contact_sheet(pictures, path, columns=columns, captions=captions, scale=1)


def png(picture):
    """A picture as a PNG: in shades of grey where it has no colours, else of 256 colours."""
    found = PIL.Image.fromarray(picture)
    if (picture == picture[..., :1]).all():
        found = found.convert("L")
    elif len(np.unique(picture.reshape(-1, 3), axis=0)) > 256:
        found = found.quantize(256, PIL.Image.Quantize.MEDIANCUT, dither=PIL.Image.Dither.NONE)
    buffer = BytesIO()
    found.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()
