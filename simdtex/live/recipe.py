# SPDX-License-Identifier: BSD-3-Clause
"""How to make a result elsewhere: the files that it needs, a command line, and lines of Python; the same bytes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import suitable_suffix
from simdtex.live.settings import Settings

FUNCTIONS = {"synth": "synthesize", "tile": "extend", "fill": "fill"}
COMMANDS = {"synth": "synth", "tile": "extend", "fill": "fill"}

OPENED = """own = image.read({own!r}).pixels
wanted, left_open = image.split_alpha(image.read({wanted!r}).pixels)
guide = own, np.where(left_open, np.nan, wanted)
"""
"""How a guide is read that is open where it is transparent."""


class Step(NamedTuple):
    """A job as one does it elsewhere.

    ``files`` what it reads and no earlier step writes, by name; ``command`` and ``python`` the lines; ``output`` the
    file that it writes, and ``maps`` those of the other maps, by the maps' names.
    """

    files: dict[str, NDArray[Any]]
    command: str
    python: str
    output: str
    maps: dict[str, str]


class Names:
    """The names of files: of the picture, or of what earlier steps have written.

    Parameters
    ----------
    picture : str
        The name of its file, as it was given.
    cut : bool
        Whether it is a part of that.
    steps : sequence of Step
        Those before.
    """

    def __init__(self, picture: str, cut: bool, steps: tuple[Step, ...]) -> None:
        self._stem = f"{stem(picture, 'sample')}-part" if cut else stem(picture, "sample")
        self._before = steps[-1] if steps else None
        self._number = len(steps) + 1

    def own(self, pixels: NDArray[Any]) -> str:
        """Of what is read."""
        return self._before.output if self._before else f"{self._stem}{suffix(pixels)}"

    def map(self, name: str, pixels: NDArray[Any]) -> str:
        """Of another map of that."""
        return self._before.maps[name] if self._before else f"{self._stem}-{name}{suffix(pixels)}"

    def made(self, pixels: NDArray[Any], name: str = "") -> str:
        """Of what is written, or of another map of that."""
        number = "" if self._number == 1 else f"-{self._number}"
        return f"texture{number}{'-' if name else ''}{name}{suffix(pixels)}"

    def painted(self, what: str) -> str:
        """Of what is painted."""
        return f"{what}.png" if self._number == 1 else f"{what}-{self._number}.png"

    @property
    def first(self) -> bool:
        """Whether nothing comes before."""
        return self._before is None


def stem(name: str, otherwise: str) -> str:
    """What a file is called, without its ending and in letters that every system takes."""
    found = re.sub(r"[^a-z0-9]+", "-", name.rpartition(".")[0].lower() or name.lower()).strip("-")[:40]
    return otherwise if found in ("", "texture") else found


def suffix(pixels: NDArray[Any]) -> str:
    """The ending of a file that holds these pixels without loss."""
    return suitable_suffix(pixels.dtype, 1 if pixels.ndim == 2 else pixels.shape[2])


def recipe(
    settings: Settings,
    names: Names,
    pixels: NDArray[Any],
    maps: Mapping[str, NDArray[Any]],
    *,
    guide: tuple[NDArray[np.uint8], NDArray[np.uint8]] | None = None,
    hole: NDArray[np.bool_] | None = None,
) -> Step:
    """How the job of some settings is done elsewhere, on these pixels and maps."""
    own, made = names.own(pixels), names.made(pixels)
    written = {name: names.made(one, name) for name, one in maps.items()}
    read = {name: names.map(name, one) for name, one in maps.items()}
    files = {own: pixels, **{read[name]: one for name, one in maps.items()}} if names.first else {}
    words = ["simdtex", COMMANDS[settings.job], own, "-o", made]
    arguments, before = ["picture.pixels"], ""
    if settings.job == "synth":
        rows, cols = settings.shape
        words += ["--size", f"{cols}x{rows}"]
        words += ["--method", settings.method] if settings.method != "mrf" else []
        arguments += [f"({rows}, {cols})"] + ([f"method={settings.method!r}"] if settings.method != "mrf" else [])
    if settings.job == "tile":
        words += ["--seamless"]
        arguments += ["seamless=True"]
    if guide:
        of_own, of_output = names.painted("guide-sample"), names.painted("guide-texture")
        files |= {of_own: guide[0], of_output: _open(guide[1])}
        words += ["--guide", f"{of_own}={of_output}"]
        before = OPENED.format(own=of_own, wanted=of_output)
        arguments += ["guide=guide", "labels=True"]
    if hole is not None:
        mask = names.painted("hole")
        files[mask] = hole * np.uint8(255)
        words += ["--mask", mask]
        arguments += [f"image.read_mask({mask!r}, picture.pixels.shape)"]
    words += ["--seed", str(settings.seed), *_flags(settings.options)]
    words += [word for name in maps for word in ("--also", f"{read[name]}={written[name]}")]
    arguments += ["channel_axis=picture.channel_axis", f"rng={settings.seed}"]
    arguments += [f"{name}={value!r}" for name, value in settings.options.items()]
    python = _python(
        FUNCTIONS[settings.job], own, made, arguments, before, [(read[name], written[name]) for name in maps]
    )
    return Step(files, shlex.join(words), python, made, written)


def _open(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Labels as grey, transparent where there is none: what is left open."""
    return np.stack([labels, np.where(labels > 0, 255, 0)], -1).astype(np.uint8)


def _flags(options: Mapping[str, Any]) -> list[str]:
    words: list[str] = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        words += [flag] if value is True else [flag, str(value)]
    return words


def _python(function: str, own: str, made: str, arguments: list[str], before: str, maps: list[tuple[str, str]]) -> str:
    lines = [f"picture = image.read({own!r})", *before.splitlines()]
    arguments = [*arguments, "full_output=True"] if maps else arguments
    call = f"simdtex.{function}({', '.join(arguments)})"
    lines += [f"texture{', output' if maps else ''} = {call}", f"image.write({made!r}, texture)"]
    for read, written in maps:
        lines.append(f"image.write({written!r}, apply_source_map(output.source, image.read({read!r}).pixels))")
    return "\n".join(lines)


def script(steps: Iterable[Step]) -> str:
    """Lines of Python for one step after another."""
    text = "\n\n".join(step.python for step in steps)
    heads = ["import numpy as np\n"] if "np." in text else []
    heads += ["import simdtex", "from simdtex.io import image"]
    heads += ["from simdtex.model.source_map import apply_source_map"] if "apply_source_map" in text else []
    return "\n".join(heads) + "\n\n" + text + "\n"


def shell(steps: Iterable[Step]) -> str:
    """Command lines for one step after another."""
    return "\n".join(step.command for step in steps) + "\n"
