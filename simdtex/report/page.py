# SPDX-License-Identifier: BSD-3-Clause
"""A report: one page that needs nothing beside itself, its plots as files, and the numbers to reckon with."""

from __future__ import annotations

import base64
import json
import math
import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from simdtex import __version__
from simdtex.io.atomic import atomic_path
from simdtex.report.folder import earlier_files

__all__ = ["Figure", "Section", "Table", "Text", "check_folder", "write_report"]

PathLike = str | os.PathLike[str]

PAGE, RESULTS = "index.html", "results.json"
_PNG_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*\.png")
_NUMBER = re.compile(r"[-+\u2212]?[\d.,]+(e[-+]?\d+)?(\s?(±|%|s\b|ms\b|of\b).*)?|\u2013|n/a|inf")


@dataclass(frozen=True)
class Text:
    """Paragraphs, parted by empty lines; one that begins with ``$`` is a command line."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows of text under a header.

    The first cell of a row names it. Columns of numbers are set to the right, and a cell that begins with
    ``breaks`` as a warning.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Figure:
    """A picture: ``png`` its bytes, ``alt`` what it shows in words, ``file`` its name beside the page."""

    caption: str
    png: bytes
    alt: str
    file: str


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it."""

    title: str
    parts: Sequence[Text | Table | Figure]


def check_folder(path: PathLike) -> None:
    """Find out before long work whether a report can be written to a folder.

    Parameters
    ----------
    path : path
        Made when the report is written. It may exist if it is empty or holds an earlier report and nothing else.

    Raises
    ------
    ValueError
        It is a file, holds other files, or its parent is missing or not writable.
    """
    _earlier(Path(path))


def write_report(
    folder: PathLike, title: str, lead: str, sections: Sequence[Section], results: Mapping[str, Any]
) -> None:
    """Write ``index.html``, every figure's PNG and ``results.json``, all of them or none.

    Parameters
    ----------
    folder : path
        See `check_folder`; the files of an earlier report there are replaced.
    title, lead : str
        Heading and first paragraphs of the page.
    sections : sequence of Section
    results : dict
        Of numbers, text, lists, dicts and NumPy arrays. What is not finite becomes null; keys are sorted. ``files``
        is added, the names of all files of the report.

    Raises
    ------
    ValueError
        The folder cannot be written, or two figures have one name.

    Notes
    -----
    The page carries its pictures and its style in itself and runs no script. Its memory is about 4/3 of the PNGs'.
    """
    target = Path(folder)
    earlier = _earlier(target)
    figures = [part for section in sections for part in section.parts if isinstance(part, Figure)]
    names = [figure.file for figure in figures]
    for name in names:
        if not _PNG_NAME.fullmatch(name) or names.count(name) > 1:
            raise ValueError(f"{name} cannot name a figure: give each its own name, as energy.png")
    page = _template().render(
        title=title, lead=_paragraphs(lead), sections=[_shown(section) for section in sections], version=__version__
    )
    listed = sorted([PAGE, RESULTS, *names])
    numbers = json.dumps(_plain({**results, "files": listed}), indent=1, sort_keys=True, allow_nan=False)
    files = {figure.file: figure.png for figure in figures}
    files |= {PAGE: page.encode(), RESULTS: f"{numbers}\n".encode()}
    with _folder(target), ExitStack() as all_or_none:
        for name, content in files.items():
            all_or_none.enter_context(atomic_path(target / name)).write_bytes(content)
    for path in earlier:
        if path.name not in files:
            path.unlink(missing_ok=True)


@contextmanager
def _folder(folder: Path) -> Iterator[None]:
    """The folder, which is gone again if it was made for nothing."""
    made = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
        yield
    except BaseException as error:
        if made and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        if isinstance(error, OSError):
            raise ValueError(f"{folder} could not be written ({error.strerror}): choose another folder") from None
        raise


def _earlier(folder: Path) -> list[Path]:
    """Files of the report that is there already; raises where others are."""
    return earlier_files(folder, "the report", lambda folder: _listed(folder / RESULTS))


def _listed(results: Path) -> list[str]:
    """The names that an earlier report gives to its files."""
    try:
        names = [str(name) for name in json.loads(results.read_bytes())["files"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [name for name in names if name in (PAGE, RESULTS) or _PNG_NAME.fullmatch(name)]


def _plain(value: Any) -> Any:
    """The same as JSON knows it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


# ---------------------------------------------------------------- the page


@cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("simdtex.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html")


def _paragraphs(text: str) -> list[str]:
    return [part.strip() for part in text.split("\n\n") if part.strip()]


def _shown(section: Section) -> dict[str, Any]:
    parts: list[dict[str, Any]] = []
    for part in section.parts:
        if isinstance(part, Text):
            parts.append({"kind": "text", "paragraphs": _paragraphs(part.text)})
        elif isinstance(part, Table):
            columns = list(zip(*part.rows, strict=True)) or [()] * len(part.header)
            right = [any(cells) and all(_NUMBER.fullmatch(cell.strip()) for cell in cells) for cells in columns]
            parts.append({"kind": "table", "table": part, "right": right})
        else:
            width, height = struct.unpack(">II", part.png[16:24])  # of the PNG's header
            data = base64.b64encode(part.png).decode()
            parts.append({"kind": "figure", "figure": part, "data": data, "width": width, "height": height})
    return {"title": section.title, "parts": parts}
