# SPDX-License-Identifier: BSD-3-Clause
"""The call of a public function that settings mean, and how to make it again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.filling import extend, fill
from simdtex.live.recipe import Names, Step, recipe
from simdtex.live.settings import Picture, Settings
from simdtex.live.strokes import painted
from simdtex.synthesis import synthesize


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
        call = partial(extend, pixels, seamless=True, **given)
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


__all__ = ["Earlier", "Job", "job"]
