# SPDX-License-Identifier: BSD-3-Clause
"""What the benchmarks share: command lines, samples, times, processes, tables and sheets."""

import ast
import csv
import inspect
import re
import subprocess
import sys
import time
from contextlib import suppress
from fnmatch import fnmatch
from pathlib import Path

import click
import PIL.Image
from skimage import data

import simdtex
from simdtex.figures.sheet import contact_sheet
from simdtex.figures.tables import Table, print_table
from simdtex.io.image import read

DOCS = Path(__file__).parent.parent / "docs"


def command(main):
    """Return a command whose options are the parameters of a function; one without a default is a path.

    A tuple is given as ``a,b``. A default that is a type is None if the option is missing; `list` may be given again.
    """

    def called(**given):
        try:
            failed = main(**given)
        except (ValueError, TypeError) as error:
            raise click.UsageError(str(error)) from None
        if failed:
            raise SystemExit(1)

    parameters = []
    for name, one in inspect.signature(main).parameters.items():
        default, words = one.default, [f"--{name.replace('_', '-')}"]
        if default is one.empty:
            parameters.append(click.Argument([name], type=Path))
        elif default is list:
            parameters.append(click.Option(words, multiple=True))
        elif isinstance(default, type):
            parameters.append(click.Option(words, type=default))
        elif isinstance(default, tuple):
            parameters.append(click.Option(words, type=several_of(type(default[0])), default=default))
        else:
            kind = Path if isinstance(default, Path) else None
            parameters.append(click.Option(words, type=kind, default=default, is_flag=default is False))
    about = "\b\n" + main.__globals__["__doc__"].replace("\n\n", "\n\n\b\n")  # the lines stay as they are
    return click.Command(main.__name__, callback=called, params=parameters, help=about)


def several_of(kind):
    """Return the function that reads values of a kind from ``"a,b"``."""

    def values(text):
        return text if isinstance(text, tuple) else tuple(kind(part) for part in text.split(","))

    return values


def chosen(known, names=()):
    """The entries of a dictionary that are named, by a list or as ``"a,b*"``; all without names."""
    wanted, found = names.split(",") if isinstance(names, str) and names else names or list(known), {}
    for name in wanted:
        some = {one: known[one] for one in known if fnmatch(one, name)}
        if not some:
            raise ValueError(f"there is no {name}: choose of {', '.join(known)}")
        found |= some
    return found


def parsed(text):
    """The options of ``"balance=0,preset=paper"``: numbers, True, False and None as Python has them, else words."""
    options = {}
    for part in filter(None, (part.strip() for part in re.split(r",(?![^(]*\))", text))):
        name, equals, value = (each.strip() for each in part.partition("="))
        if not (equals and name and value):
            raise ValueError(f"{part} is no option: give NAME=VALUE,NAME=VALUE")
        for kind in (str, float, ast.literal_eval):  # float knows inf
            with suppress(ValueError, SyntaxError):
                options[name] = kind(value)
    return options


def opened(device):
    """A machine, whose name is printed."""
    machine = simdtex.open_machine(device)
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
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, **given).stdout


# ---------------------------------------------------------------- tables and sheets


def table(title, header, rows, path=None):
    """Print a table, and write it as CSV where a path is given."""
    print_table(Table(title, [dict(zip(header, map(str, row), strict=True)) for row in rows]))
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([header, *rows])


def told(figures):
    """Figures by name as text."""
    return "  ".join(f"{name} {value:.2f}" for name, value in figures.items())


def sheet(path, cells, columns, **given):
    """Write cells of label, picture and caption as a sheet of 256 colours; ``given`` are other options of its."""
    pictures, captions = zip(*(((label, picture), caption) for label, picture, caption in cells), strict=True)
    drawn = contact_sheet(pictures, columns=columns, captions=captions if any(captions) else None, **given)
    path.parent.mkdir(parents=True, exist_ok=True)
    PIL.Image.fromarray(drawn).quantize(256, dither=PIL.Image.Dither.NONE).save(path, optimize=True)
