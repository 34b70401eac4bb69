# SPDX-License-Identifier: BSD-3-Clause
"""What is painted on a page, as pixels: the page sends lines of a round brush, and no picture."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
import PIL.Image
import PIL.ImageDraw
from numpy.typing import NDArray

from simdtex.options import real, whole

MOST = 2**16
"""Points of all lines together, at most."""

LABELS = 8
"""Different labels that one can paint with; 0 is what nothing is painted on."""


class Stroke(NamedTuple):
    """A line of a brush: ``label`` 0 takes away what is there, ``width`` and the ``points`` (x, y) are in pixels."""

    label: int
    width: float
    points: tuple[tuple[float, float], ...]


def parse(given: Any) -> tuple[Stroke, ...]:
    """The strokes of a message: a list of ``{"label", "width", "points": [[x, y], ...]}``.

    Raises
    ------
    ValueError, TypeError
        They are none.
    """
    if not isinstance(given, list):
        raise TypeError("what is painted is no list of strokes; paint again")
    found = []
    for one in given:
        if not isinstance(one, dict) or not isinstance(one.get("points"), list) or not one["points"]:
            raise TypeError("a stroke has no points; paint again")
        label: Any = one.get("label")
        width: Any = one.get("width")
        whole("the label of a stroke", label, 0, LABELS)
        real("the width of a stroke", width, 0, 2**14, above=True)
        found.append(Stroke(int(label), float(width), tuple(_point(point) for point in one["points"])))
    if sum(len(stroke.points) for stroke in found) > MOST:
        raise ValueError(f"more than {MOST} points are painted; paint with a wider brush")
    return tuple(found)


def _point(point: Any) -> tuple[float, float]:
    if isinstance(point, list) and len(point) == 2 and all(isinstance(one, (int, float)) for one in point):
        x, y = (float(one) for one in point)
        if isfinite(x) and isfinite(y) and max(abs(x), abs(y)) < 2**20:
            return x, y
    raise TypeError("a point of a stroke is no pair of numbers; paint again")


def painted(strokes: Sequence[Stroke], shape: tuple[int, int]) -> NDArray[np.uint8]:
    """The labels that strokes leave, (rows, cols), 0 where there is none; the last stroke over a pixel counts."""
    picture = PIL.Image.new("L", (shape[1], shape[0]))
    draw = PIL.ImageDraw.Draw(picture)
    for stroke in strokes:
        radius = stroke.width / 2
        if len(stroke.points) > 1:
            draw.line(stroke.points, fill=stroke.label, width=max(1, round(stroke.width)))
        for x, y in stroke.points:  # round ends and corners
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=stroke.label)
    return np.array(picture)
