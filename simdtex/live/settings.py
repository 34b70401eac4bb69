# SPDX-License-Identifier: BSD-3-Clause
"""What a page asks to be made, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.live.strokes import Stroke, parse
from simdtex.live.words import controls
from simdtex.options import one_of, shown, whole
from simdtex.synthesis import METHODS

JOBS = ("synth", "tile", "fill")
"""More of a texture, a picture without a seam, a hole that is filled."""

SIDE = 2**14
"""Rows or columns of what is made, at most."""

SEEDS = 2**32
"""Seeds that a page gives."""

SHORTEST = 8
"""Rows and columns of a part of the picture, at least."""


class Picture(NamedTuple):
    """A picture that was given: its file's name, its pixels, and which of their axes has the channels."""

    name: str
    pixels: NDArray[Any]
    channel_axis: int | None


class Part(NamedTuple):
    """A part of a picture, pixels."""

    left: int
    top: int
    width: int
    height: int

    def of(self, pixels: NDArray[Any]) -> NDArray[Any]:
        """The part of these pixels."""
        return np.ascontiguousarray(pixels[self.top : self.top + self.height, self.left : self.left + self.width])


@dataclass(frozen=True)
class Settings:
    """What is asked for, checked.

    Attributes
    ----------
    job, method : str
    shape : (int, int)
        Rows and columns of what is made, where the job leaves them open.
    seed : int
    options : dict
        Of the method, those that are not as by default.
    part : Part or None
        Of the picture: what the sample is; None for all of it.
    guide : (strokes, strokes)
        Labels painted on the sample and on the output; of the picture's and of the output's pixels.
    hole : strokes
        Of what is filled.
    of : int or None
        The result that is filled; None for the picture.
    """

    job: str = "synth"
    method: str = "mrf"
    shape: tuple[int, int] = (256, 256)
    seed: int = 1
    options: dict[str, Any] = field(default_factory=dict)
    part: Part | None = None
    guide: tuple[tuple[Stroke, ...], tuple[Stroke, ...]] = ((), ())
    hole: tuple[Stroke, ...] = ()
    of: int | None = None


def parsed(message: Mapping[str, Any], picture: Picture) -> Settings:
    """The settings of a message.

    Raises
    ------
    ValueError, TypeError
        What is wrong, in one sentence.
    """
    job, method = message.get("job", "synth"), message.get("method", "mrf")
    one_of("job", job, JOBS)
    one_of("method", method, METHODS)
    method = method if job == "synth" else "mrf"
    width, height, seed = (message.get(name) for name in ("width", "height", "seed"))
    whole("width", width, 1, SIDE)
    whole("height", height, 1, SIDE)
    whole("seed", seed, 0, SEEDS - 1)
    options = message.get("options", {})
    if not isinstance(options, dict):
        raise TypeError(f"options must be names and values, not {shown(options)}")
    guide = message.get("guide") or {}
    if not isinstance(guide, dict):
        raise TypeError("a guide is painted on the sample and on the result; paint both")
    of = message.get("of")
    if of is not None:
        whole("of", of, 1)
    part = _part(message.get("part"), picture) if job != "fill" else None  # a photo is filled as a whole
    return Settings(
        job=job,
        method=method,
        shape=(int(height), int(width)),  # type: ignore[arg-type]  # checked above
        seed=int(seed),  # type: ignore[arg-type]
        options=_options(options, job if job != "synth" else method),
        part=part,
        guide=(parse(guide.get("sample", [])), parse(guide.get("output", []))) if job == "synth" else ((), ()),
        hole=parse(message.get("hole", [])) if job == "fill" else (),
        of=of if job == "fill" else None,
    )


def _options(given: dict[str, Any], table: str) -> dict[str, Any]:
    """The options that differ from what they are by default; only those with a control are taken."""
    known = {one["name"]: one for one in controls(table)}
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name not in known:
            raise ValueError(f"there is no control for {shown(name)}; choose one of: {', '.join(known)}")
        if known[name]["kind"] == "number" and isinstance(value, int) and not isinstance(value, bool):
            value = float(value) if abs(value) < 2**53 else value
        if value is not None and value != known[name]["default"]:
            found[name] = value
    return found


def _part(given: Any, picture: Picture) -> Part | None:
    if given is None:
        return None
    if not isinstance(given, list) or len(given) != 4:
        raise TypeError("a part of the picture is four numbers: left, top, width and height")
    rows, cols = picture.pixels.shape[:2]
    for name, value, most in zip(("left", "top", "width", "height"), given, (cols, rows, cols, rows), strict=True):
        least = min(SHORTEST, most) if name in ("width", "height") else 0
        whole(f"the {name} of the part", value, least, most)
    part = Part(*(int(one) for one in given))
    if part.left + part.width > cols or part.top + part.height > rows:
        raise ValueError(f"the part reaches beyond the picture of {cols}x{rows}; choose one within it")
    return None if part == Part(0, 0, cols, rows) else part
