# SPDX-License-Identifier: BSD-3-Clause
"""Courses of channels: swings of the heading that are pushed at random, in whole numbers throughout."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.random import philox

Path = NDArray[np.int64]
"""(n, 3): row and column, and heading."""

PIXEL = 256  # fixed point: parts of a pixel
TURN = 4096  # parts of a full turn; a heading of 0 is to the right
# Sines are rounded to whole numbers, so that no platform's library decides on a pixel.
SINE = np.rint(PIXEL * np.sin(np.arange(TURN) * (2 * np.pi / TURN))).astype(np.int64).tolist()

# Headings h are a damped swing pushed at random, h(i) = AFTER h(i-1) - BEFORE h(i-2) + push (Ferguson, "Disturbed
# periodic model for river meanders", 1976), for meanders of about 75 pixels, in parts of 65536.
AFTER, BEFORE = 127926, 62849
FINE = 256  # parts of a heading's unit
PUSH = 19  # pushes are less than this, units of a heading; headings deviate by about 38 degrees
STEEPEST = 850  # no heading is further from the right, 75 degrees
SETTLE = 120  # steps that a swing takes to forget its start
POOL = 1024  # blocks drawn at once


class Draws:
    """Whole numbers by Philox, one after another."""

    def __init__(self, seed: int) -> None:
        self.key, self.turn = (seed & 0xFFFFFFFF, seed >> 32), 0
        self.left: list[int] = []

    def words(self, number: int) -> list[int]:
        """So many numbers of 32 bits."""
        while len(self.left) < number:
            counter = [np.arange(POOL), np.full(POOL, self.turn), np.zeros(POOL), np.zeros(POOL)]
            words = np.stack(philox([np.asarray(c).astype(np.uint32) for c in counter], self.key), axis=-1)
            self.left += words.ravel().tolist()
            self.turn += 1
        taken, self.left = self.left[:number], self.left[number:]
        return taken

    def below(self, limit: int) -> int:
        """One number, 0 to limit - 1."""
        return self.words(1)[0] * limit >> 32


def swing_of(draws: Draws) -> tuple[int, int]:
    """The two last headings of a swing that has forgotten its start."""
    last, now = 0, 0
    for word in draws.words(SETTLE):
        last, now = now, _next(last, now, word)
    return last, now


def _next(last: int, now: int, word: int) -> int:
    push = (word * (2 * PUSH - 1) >> 32) - (PUSH - 1)
    heading = (AFTER * now - BEFORE * last >> 16) + push * FINE
    return max(-STEEPEST * FINE, min(STEEPEST * FINE, heading))


def walk(draws: Draws, start: tuple[int, int], swing: tuple[int, int], steps: int, towards: int) -> Path:
    """A course of so many steps of a pixel."""
    (last, now), (row, col) = swing, (place * PIXEL for place in start)
    path = []
    for word in draws.words(steps):
        heading = now // FINE
        path.append((row, col, heading * towards))
        row += SINE[heading % TURN]
        col += SINE[(heading + TURN // 4) % TURN] * towards
        last, now = now, _next(last, now, word)
    return np.array(path, dtype=np.int64)


def values_at(picture: NDArray[Any], path: Path) -> NDArray[Any]:
    """The picture's values along a course, 0 outside."""
    places = path[:, :2] // PIXEL
    inside = is_inside(path, picture.shape)
    row, col = np.where(inside[:, np.newaxis], places, 0).T
    return np.asarray(picture[row, col] * inside)


def is_inside(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which places of a course are inside of a picture."""
    places = path[:, :2] // PIXEL
    return np.asarray(((places >= 0) & (places < np.array(shape))).all(axis=1))


def is_far(path: Path, places: Iterable[Path], apart: int) -> bool:
    """Whether a course keeps so many pixels away from all of some places."""
    return all(int(((path[:, :2] - place) ** 2).sum(axis=1).min()) > (apart * PIXEL) ** 2 for place in places)
