# SPDX-License-Identifier: BSD-3-Clause
"""What a page asks to be made: settings, the call of a public function that they mean, and how to make it again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.filling import extend, fill
from simdtex.live.recipe import Names, Step, recipe
from simdtex.live.strokes import Stroke, painted, parse
from simdtex.live.words import METHODS as TOLD
from simdtex.live.words import UNDECLARED, controls
from simdtex.options import Number, one_of, shown, whole
from simdtex.options import kinds as declared
from simdtex.synthesis import METHODS, synthesize

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
        options=_options(options, job if job != "synth" else method, method),
        part=part,
        guide=(parse(guide.get("sample", [])), parse(guide.get("output", []))) if job == "synth" else ((), ()),
        hole=parse(message.get("hole", [])) if job == "fill" else (),
        of=of if job == "fill" else None,
    )


def _options(given: dict[str, Any], table: str, method: str) -> dict[str, Any]:
    """The options that differ from what they are by default; only those with a control are taken."""
    known = {one["name"]: one for one in controls(table)}
    kinds = declared(TOLD[method][1]) | UNDECLARED.get(method, {})
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name not in known:
            raise ValueError(f"there is no control for {shown(name)}; choose one of: {', '.join(known)}")
        if isinstance(kinds[name], Number) and isinstance(value, int) and not isinstance(value, bool):
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


class Job(NamedTuple):
    """What is made.

    ``call`` takes ``rng``, ``device``, ``callback`` and ``full_output``; ``sample`` is what pixels are from and
    ``maps`` its other maps, by name; ``shape`` are the output's rows and columns; ``key`` is the same for jobs that
    differ in nothing but their options, and ``step`` tells how to do it elsewhere.
    """

    call: Callable[..., Any]
    sample: NDArray[Any]
    maps: dict[str, NDArray[Any]]
    shape: tuple[int, int]
    key: Any
    step: Step


class Earlier(NamedTuple):
    """A result that is gone on from: its picture and maps, and the steps that made it."""

    image: NDArray[Any]
    maps: dict[str, NDArray[Any]]
    steps: tuple[Step, ...]


def job(
    settings: Settings, picture: Picture, maps: Mapping[str, NDArray[Any]], earlier: Earlier | None, number: int
) -> Job:
    """The job that settings mean.

    Parameters
    ----------
    settings : Settings
    picture : Picture
    maps : mapping
        Other maps of the picture, by name.
    earlier : Earlier, optional
        What is filled, where it is not the picture.
    number : int
        Of the picture, told apart by it from others of its name.

    Raises
    ------
    ValueError
        There is nothing to do.
    """
    if earlier is not None:
        pixels, carried = earlier.image, dict(earlier.maps)
    else:
        cut: Callable[[NDArray[Any]], NDArray[Any]] = settings.part.of if settings.part else (lambda one: one)
        pixels, carried = cut(picture.pixels), {name: cut(one) for name, one in maps.items()}
    names = Names(picture.name, settings.part is not None, earlier.steps if earlier else ())
    options, axis = settings.options, picture.channel_axis
    given: dict[str, Any] = {"channel_axis": axis, **options}
    key = (number, settings.job, settings.method, settings.shape, settings.seed, settings.part, settings.guide)
    if settings.job == "synth":
        guide = _guide(settings, picture)
        if guide:
            own, wanted = guide
            given |= {"guide": (own, np.where(wanted == 0, np.nan, wanted)), "labels": True}
        call: Any = partial(synthesize, pixels, settings.shape, method=settings.method, **given)
        step = recipe(settings, names, pixels, carried, guide=guide)
        return Job(call, pixels, carried, settings.shape, key, step)
    rows, cols = pixels.shape[:2]
    if settings.job == "tile":
        call = partial(extend, pixels, tile=True, **given)
        return Job(call, pixels, carried, (rows, cols), key, recipe(settings, names, pixels, carried))
    hole = painted(settings.hole, (rows, cols)) > 0
    if not hole.any():
        raise ValueError("nothing is painted, so there is nothing to fill; paint over what is to be made anew")
    if hole.all():
        raise ValueError("all of the picture is painted, so nothing of it is known; leave some of it")
    call = partial(fill, pixels, hole, **given)
    step = recipe(settings, names, pixels, carried, hole=hole)
    return Job(call, pixels, carried, (rows, cols), None, step)


def _guide(settings: Settings, picture: Picture) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
    """Labels of the sample, 0 where there is none, and of the output, 0 where it is left open; None without any."""
    of_sample, of_output = settings.guide
    if not of_output:
        return None
    own = painted(of_sample, picture.pixels.shape[:2])
    own = settings.part.of(own) if settings.part else own
    wanted = painted(of_output, settings.shape)
    if not wanted.any():
        return None
    missing = sorted(set(np.unique(wanted).tolist()) - {0} - set(np.unique(own).tolist()))
    if missing:
        raise ValueError(
            f"the result is to have label {missing[0]}, and nothing of the sample has it; paint it on the sample too"
        )
    return own, wanted


__all__ = ["JOBS", "Earlier", "Job", "Part", "Picture", "Settings", "job", "parsed"]
