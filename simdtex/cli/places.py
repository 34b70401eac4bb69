# SPDX-License-Identifier: BSD-3-Clause
"""The types of options that name files, and one check of them all: no command overwrites what it reads.

Every option or argument that is a path says by its type what is done there. `check_places` runs before a command does
anything, so that a new option needs nothing but its type.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click


class Place(click.Path):
    """A path with its role.

    ``"read"`` a file, ``"enter"`` a file or a folder that is read, ``"write"`` a file, make a ``"folder"``, or write
    ``"either"`` of these two.
    """

    def __init__(self, role: str) -> None:
        super().__init__(path_type=Path)
        self.role = role

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; raises where there is none."""
        if not os.fspath(value):
            self.fail("the path is empty; give one, or leave the option out", param, ctx)
        return super().convert(value, param, ctx)


class Pair(click.types.StringParamType):
    """A text ``A=B`` or ``A0,A1=B``: files that are read, and on the right one to ``"read"`` or to ``"write"``."""

    name = "text"

    def __init__(self, role: str) -> None:
        self.role = role

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The text itself, which its reader takes apart; raises where there is none."""
        if not value:
            self.fail("it is empty; give two files with = between them, or leave the option out", param, ctx)
        return str(value)


READ, ENTER, WRITE, FOLDER, EITHER = (Place(role) for role in ("read", "enter", "write", "folder", "either"))
READING = ("read", "enter")
READ_PAIR, WRITE_PAIR = Pair("read"), Pair("write")


class _Named(NamedTuple):
    """A path as it was given, and its role."""

    path: Path
    role: str


def check_places(context: click.Context) -> None:
    """Raise where a command would overwrite what it reads, or one of its outputs another."""
    named = list(_named(context))
    reads = [one for one in named if one.role in READING]
    writes = [one for one in named if one.role not in READING]
    for number, out in enumerate(writes):
        for one in reads:
            _check_input(out, one)
        for other in writes[:number]:
            if _same(_real(out.path), _real(other.path)):
                raise ValueError(f"{out.path} would be written twice; give each output a file of its own")
            for inner, outer in ((out, other), (other, out)):
                if outer.role != "write" and _within(_real(inner.path), outer.path):
                    raise ValueError(
                        f"{inner.path} would be written into {outer.path}, which another output has for itself; "
                        "give it another folder"
                    )


def _check_input(out: _Named, one: _Named) -> None:
    """Raise where an output would overwrite or remove an input, or change a folder that is one."""
    places = list(_places(one.path))
    if any(_same(_real(out.path), place) for place in places):
        raise ValueError(f"{out.path} is an input and would be overwritten; give the output another name")
    folder = out.role == "folder" or (out.role == "either" and os.path.isdir(out.path))
    if folder and any(_within(place, out.path) for place in places):
        raise ValueError(f"{one.path} is an input and lies in {out.path}, which is written anew; give another folder")
    if one.role == "enter" and _within(_real(out.path), one.path):
        raise ValueError(f"{out.path} would be written into {one.path}, which is an input; give another folder")


def _named(context: click.Context) -> Iterator[_Named]:
    """Every path that a command was given, or has by default."""
    for parameter in context.command.params:
        kind, value = parameter.type, context.params.get(parameter.name or "")
        for one in value if isinstance(value, tuple) else [value]:
            if one is None:
                continue
            if isinstance(kind, Place):
                yield _Named(Path(one), kind.role)
            elif isinstance(kind, Pair):
                left, _, right = str(one).partition("=")
                # how many files the left names depends on the samples; a file that is not there harms nothing
                for text in {left, *(part.strip() for part in left.split(","))}:
                    if text:
                        yield _Named(Path(text), "read")
                if right:
                    yield _Named(Path(right), kind.role)


# ---------------------------------------------------------------- where paths lead


def _real(path: Path) -> str:
    return os.path.realpath(path)


def _places(path: Path) -> Iterator[str]:
    """Where a path itself is, where the link leads that it may be, and so on to what is read."""
    here = os.fspath(path)
    for _ in range(40):  # as many links as Linux follows
        here = os.path.join(_real(Path(os.path.dirname(here) or os.curdir)), os.path.basename(here))
        yield here
        if not os.path.islink(here):
            break
        here = os.path.join(os.path.dirname(here), os.readlink(here))
    yield _real(path)


def _same(a: str, b: str) -> bool:
    """Whether two paths are one file, by name or, as hard links, by what is there."""
    if a == b:
        return True
    try:
        return os.path.samefile(a, b)
    except (OSError, ValueError):
        return a.casefold() == b.casefold() and _folds_case(os.path.dirname(a))


def _folds_case(folder: str) -> bool:
    """Whether names that differ in case alone are one there."""
    head, name = os.path.split(folder)
    try:
        return name.swapcase() != name and os.path.samefile(folder, os.path.join(head, name.swapcase()))
    except (OSError, ValueError):
        return False


def _within(place: str, folder: Path) -> bool:
    """Whether a place is somewhere inside a folder."""
    outer = _real(folder)
    here = os.path.dirname(place)
    while True:
        if _same(here, outer):
            return True
        if here == os.path.dirname(here):
            return False
        here = os.path.dirname(here)
