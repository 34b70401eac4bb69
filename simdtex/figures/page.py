# SPDX-License-Identifier: BSD-3-Clause
"""A report: one self-contained page, its pictures as PNG files, and its numbers as JSON."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import PIL.Image
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex import __version__
from simdtex.figures.tables import Table, warns
from simdtex.io.files import atomic_folder, earlier_files
from simdtex.io.image import pillow_bytes
from simdtex.model.display import OKABE_ITO

INK, FAINT, GRID = "#22262b", "#5c6570", "#e4e2dc"
DPI = 140
MARKERS = "os^DvP<>X*hpd8H"
PAGE, RESULTS = "index.html", "results.json"

PathLike = str | os.PathLike[str]


def styles(schedules: Mapping[str, bool]) -> dict[str, dict[str, Any]]:
    """Return the keywords of a plot for each schedule: dashed and hollow unless it keeps equation (14)."""
    keywords = {}
    for index, (name, keeps) in enumerate(schedules.items()):
        colour = "#" + bytes(OKABE_ITO[-1 - index % len(OKABE_ITO)]).hex()
        line, inside = ("-", colour) if keeps else ("--", "white")
        marker = MARKERS[index % len(MARKERS)]
        keywords[name] = {"color": colour, "marker": marker, "linestyle": line, "markerfacecolor": inside}
    return keywords


def new_figure(width: float, height: float) -> Plot:
    """Return an empty figure of ``width`` x ``height`` inches, without any global state."""
    figure = Plot(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Set labels and a faint grid below the data, and remove the box."""
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.grid(True, which="major", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=FAINT, labelcolor=INK, labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)


def legend(figure: Plot, axes: Axes, place: Any = "outside upper center", columns: int = 3) -> None:
    """Add a legend of the labels of some axes, each once, outside the plots."""
    handles, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    more: dict[str, Any] = {"ncols": columns, "frameon": False, "fontsize": 9, "labelcolor": INK}
    figure.legend(list(entries.values()), list(entries), loc=place, **more)


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture of a report: a plot, (rows, cols[, channels]) uint8, or a PNG; ``file`` is its name beside the page.

    The first sentence of the caption describes the picture to readers who do not see it.
    """

    file: str
    picture: Plot | NDArray[np.uint8] | bytes
    caption: str

    @cached_property
    def png(self) -> bytes:
        """The picture as a PNG, the same bytes every time."""
        if isinstance(self.picture, bytes):
            return self.picture
        if not isinstance(self.picture, Plot):
            return pillow_bytes(PIL.Image.fromarray(self.picture), "PNG")
        buffer = io.BytesIO()
        self.picture.savefig(buffer, format="png", metadata={"Software": None})
        return buffer.getvalue()

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
    """Raise ValueError before long work unless a folder is new, or is empty but for an earlier report."""
    folder = Path(path)
    try:
        listed = {str(name) for name in json.loads((folder / RESULTS).read_bytes())["files"]}
    except (OSError, ValueError, KeyError, TypeError):
        listed = set()
    ours = {name for name in listed if name in (PAGE, RESULTS) or name.endswith(".png")}
    earlier_files(folder, "the report", ours.__contains__)


def write_report(
    folder: PathLike,
    title: str,
    lead: str,
    sections: Sequence[Section],
    results: Mapping[str, Any],
    command: str = "",
) -> None:
    """Write ``index.html``, the PNG of every figure and ``results.json``, either all of them or none.

    ``results`` becomes JSON with sorted keys and null for numbers that are not finite; the names of all files, the
    version and the command line are added. The files of an earlier report are replaced.
    """
    check_folder(folder)
    if command:
        sections = [*sections, Section("The command", [f"$ {command}"])]
    figures = [part for section in sections for part in section.parts if isinstance(part, Figure)]
    files = {figure.file: figure.png for figure in figures}
    files[PAGE] = _page(title=title, lead=lead, sections=sections, version=__version__).encode()
    about = {"files": sorted([*files, RESULTS]), "version": __version__, "command": command}
    numbers = json.dumps(_plain({**results, **about}), indent=1, sort_keys=True, allow_nan=False)
    with atomic_folder(folder) as temporary:
        for name, content in {**files, RESULTS: f"{numbers}\n".encode()}.items():
            (temporary / name).write_bytes(content)


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
        loader=jinja2.PackageLoader("simdtex.figures"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests |= {"table": lambda part: isinstance(part, Table), "warning": warns}
    environment.filters["paragraphs"] = lambda text: [part.strip() for part in text.split("\n\n") if part.strip()]
    return environment.get_template("page.html").render(content)
