# SPDX-License-Identifier: BSD-3-Clause
"""A report: one self-contained page, its pictures as PNG files, and its numbers as JSON."""

from __future__ import annotations

import base64
import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex import __version__
from simdtex.io.atomic import atomic_path
from simdtex.report.folder import earlier_files
from simdtex.report.plots import figure_png
from simdtex.report.sheet import encoded
from simdtex.report.tables import Table, warns

__all__ = ["Figure", "Part", "Section", "check_folder", "write_report"]

PathLike = str | os.PathLike[str]

PAGE, RESULTS = "index.html", "results.json"
_PNG_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*\.png")


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture of a report.

    Parameters
    ----------
    file : str
        Its name beside the page, ``"energy.png"``.
    picture : matplotlib.figure.Figure, or ndarray of uint8, (rows, cols[, channels])
    caption : str
        Its first sentence describes the picture to readers who do not see it.
    """

    file: str
    picture: Plot | NDArray[np.uint8]
    caption: str

    @cached_property
    def png(self) -> bytes:
        """The picture as a PNG."""
        return figure_png(self.picture) if isinstance(self.picture, Plot) else encoded(self.picture)

    @property
    def alt(self) -> str:
        """The first sentence of the caption."""
        return re.split(r"[.:;](?:\s|$)", self.caption, maxsplit=1)[0]

    @property
    def data(self) -> str:
        """The PNG in base64."""
        return base64.b64encode(self.png).decode()


Part = str | Table | Figure
"""A text is paragraphs, separated by empty lines; one that begins with ``$`` is a command line."""


@dataclass(frozen=True)
class Section:
    """A heading, and the parts below it."""

    title: str
    parts: Sequence[Part]


def check_folder(path: PathLike) -> None:
    """Check, before long work, that a report can be written to a folder.

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
    folder: PathLike,
    title: str,
    lead: str,
    sections: Sequence[Section],
    results: Mapping[str, Any],
    command: str | None = None,
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
        Of numbers, text, lists, dicts and NumPy arrays. Numbers that are not finite become null; keys are sorted.
        ``files``, the names of all files of the report, and ``version`` are added.
    command : str, optional
        The command line, added to the page and to ``results.json``.

    Raises
    ------
    ValueError
        The folder cannot be written, or two figures have one name.

    Notes
    -----
    The page contains its pictures and its style, and runs no script. Its size is about 4/3 of the PNGs'.
    """
    target = Path(folder)
    earlier = _earlier(target)
    if command:
        sections = [*sections, Section("The command", [f"$ {command}"])]
    figures = [part for section in sections for part in section.parts if isinstance(part, Figure)]
    names = [figure.file for figure in figures]
    for name in names:
        if not _PNG_NAME.fullmatch(name) or names.count(name) > 1:
            raise ValueError(f"{name} cannot name a figure: give each its own name, as energy.png")
    page = _page(title=title, lead=lead, sections=sections, version=__version__)
    more = {"files": sorted([PAGE, RESULTS, *names]), "version": __version__} | (
        {} if command is None else {"command": command}
    )
    numbers = json.dumps(_plain({**results, **more}), indent=1, sort_keys=True, allow_nan=False)
    files = {figure.file: figure.png for figure in figures}
    files |= {PAGE: page.encode(), RESULTS: f"{numbers}\n".encode()}
    made = not target.exists()
    try:
        target.mkdir(exist_ok=True)
        with ExitStack() as all_or_none:
            for name, content in files.items():
                all_or_none.enter_context(atomic_path(target / name)).write_bytes(content)
    except BaseException as error:
        if made and target.is_dir() and not any(target.iterdir()):
            target.rmdir()
        if isinstance(error, OSError):
            raise ValueError(f"{target} could not be written ({error.strerror}): choose another folder") from None
        raise
    for path in earlier:
        if path.name not in files:
            path.unlink(missing_ok=True)


def _earlier(folder: Path) -> list[Path]:
    """Return the files of an earlier report; raise if there are others."""
    try:
        listed = [str(name) for name in json.loads((folder / RESULTS).read_bytes())["files"]]
    except (OSError, ValueError, KeyError, TypeError):
        listed = []
    names = {name for name in listed if name in (PAGE, RESULTS) or _PNG_NAME.fullmatch(name)}
    return earlier_files(folder, "the report", names.__contains__)


def _plain(value: Any) -> Any:
    """Return a value as JSON represents it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def _page(**content: Any) -> str:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("simdtex.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests |= {"table": lambda part: isinstance(part, Table), "warning": warns}
    environment.filters["paragraphs"] = lambda text: [part.strip() for part in text.split("\n\n") if part.strip()]
    return environment.get_template("page.html").render(content)
