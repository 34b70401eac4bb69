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
        """Return the path; fail if it is empty."""
        if not os.fspath(value):
            self.fail("the path is empty; give one, or leave the option out", param, ctx)
        return super().convert(value, param, ctx)


class Pair(click.types.StringParamType):
    """A text ``A=B`` or ``A0,A1=B``: a list of files that are read, and a path to ``"read"`` or to ``"write"``.

    Or, with ``named``, ``NAME=B`` or ``NAME=B0,B1``: a name, and a list of files that are read.
    """

    def __init__(self, role: str, named: bool = False) -> None:
        self.role, self.named = role, named

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return both sides; raise ValueError if one is missing, or if it is not clear where the left one ends."""
        if not isinstance(value, str) or not isinstance(param, click.Option):
            return value
        cuts = [(value[:at], value[at + 1 :]) for at, letter in enumerate(value) if letter == "="] or [(value, "")]
        found = [] if self.named else [cut for cut in cuts if all(map(os.path.exists, files(cut[0])))]
        if len(found) > 1:
            two = f"{found[0][0]} and {found[1][0]}"
            raise ValueError(f"{param.opts[-1]} {value} has two meanings, since {two} exist: rename one of them")
        left, right = (found or cuts)[0]
        if not (left and right):
            raise ValueError(f"{param.opts[-1]} {value!r} must be {param.metavar}")
        return (left, files(right)) if self.named else (files(left), Path(right))


def files(text: str) -> list[Path]:
    """Return the files that a text names: one, or several that are separated by commas."""
    return [Path(text)] if os.path.exists(text) else [Path(part.strip()) for part in text.split(",")]


READ, ENTER, WRITE, FOLDER, EITHER = (Place(role) for role in ("read", "enter", "write", "folder", "either"))
READING = ("read", "enter")
READ_PAIR, WRITE_PAIR, READ_NAMED = Pair("read"), Pair("write"), Pair("read", named=True)


class Named(NamedTuple):
    """A path as it was given, and its role."""

    path: Path
    role: str


def check_places(context: click.Context) -> None:
    """Raise if a command would overwrite what it reads, or one of its outputs another."""
    named = list(_named(context))
    reads = [one for one in named if one.role in READING]
    writes = [one for one in named if one.role not in READING]
    for number, out in enumerate(writes):
        for one in reads:
            check_input(out, one)
        for other in writes[:number]:
            if _same(out.path, other.path):
                raise ValueError(f"{out.path} would be written twice; give each output a file of its own")
            for inner, outer in ((out, other), (other, out)):
                array = context.params.get("tiles") and inner.role == "write" and inner.path.parent == outer.path
                if outer.role != "write" and _within(inner.path, outer.path) and not array:
                    raise ValueError(
                        f"{inner.path} would be written into {outer.path}, the folder of another output; "
                        "give it another folder"
                    )


def outputs(context: click.Context) -> dict[Path, tuple[int, int]]:
    """Return the outputs of a command that exist, each with its inode and the time of its last change."""
    there = [one.path for one in _named(context) if one.role not in READING and os.path.exists(one.path)]
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in there}


def check_input(out: Named, one: Named) -> None:
    """Raise if an output would overwrite or remove an input, or change a folder that is one."""
    if _same(out.path, one.path):
        raise ValueError(f"{out.path} is an input and would be overwritten; give the output another name")
    folder = out.role == "folder" or (out.role == "either" and out.path.is_dir())
    link = _real(one.path.parent) / one.path.name  # a link in the folder would be removed
    if folder and (_within(one.path, out.path) or link.is_relative_to(_real(out.path))):
        raise ValueError(f"{one.path} is an input and is in {out.path}, which would be replaced; give another folder")
    if one.role == "enter" and _within(out.path, one.path):
        raise ValueError(f"{out.path} would be written into {one.path}, which is an input; give another folder")


def _named(context: click.Context) -> Iterator[Named]:
    """Yield every path that a command was given, or has by default."""
    for parameter in context.command.params:
        kind, value = parameter.type, context.params.get(parameter.name or "")
        if parameter.name == "preview" and value:
            yield Named(preview_of(context.params["output"]), "write")
        several = parameter.multiple or parameter.nargs < 0
        for one in (value or ()) if several else [value]:
            if one is None:
                continue
            if isinstance(kind, Place):
                yield Named(Path(one), kind.role)
            elif isinstance(kind, Pair):
                left, right = one
                yield from (Named(path, "read") for path in (right if kind.named else left))
                if not kind.named:
                    yield Named(right, kind.role)


def preview_of(output: Path) -> Path:
    """Return the file of ``--preview``, beside an output."""
    return output.with_name(f"{output.stem}-3x3.png")


def _real(path: Path) -> Path:
    """Return where a path leads by links; of links in a circle, the path itself, which its reader or writer refuses."""
    return Path(os.path.realpath(path))


def _same(a: Path, b: Path) -> bool:
    """Return whether two paths are one file, by name or as links."""
    return _real(a) == _real(b) or (a.exists() and b.exists() and a.samefile(b))


def _within(path: Path, folder: Path) -> bool:
    """Return whether a path is somewhere inside a folder."""
    return _real(path) != _real(folder) and _real(path).is_relative_to(_real(folder))
