# SPDX-License-Identifier: BSD-3-Clause
"""A training image made by code: sinuous channels that meet, part and now and then end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from simdtex.random import as_seed, philox

Pixels = NDArray[np.uint8]
Path = NDArray[np.int64]
"""(n, 3): row and column, and heading."""

LEAST = 32  # pixels of a side
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

OUTSIDE = 30  # channels begin so far to the left of the picture, pixels
TRIES = 8  # courses of which the one with most room is taken
FAR = 40  # more room than this is no better, pixels
CLEAR = 7  # ground around a dead end, pixels
LEAVING = 26  # steps that a branch takes to leave what it comes from
MEETING = 5  # steps into the channel that a branch meets
APART = 22  # of joints from one another, pixels
MAIN = 4  # eighths of the share, in channels across the whole picture
AREA = 62500  # pixels, for
ENDS = (9, 13)  # so many dead ends, from and to
PATIENCE = 60  # tries for one dead end, and for all branches
POOL = 1024  # blocks drawn at once


def channels(shape: tuple[int, int], rng: Any = None, *, share: float = 0.3, width: int = 8) -> Pixels:
    """Make a training image of sinuous channels that run from left to right.

    Channels meander, cross, part and meet again, and a few end inside: mostly 6 to 10 dead ends in 250 x 250 pixels.

    Parameters
    ----------
    shape : (rows, cols)
        Pixels, at least 32 each.
    rng : None, int or numpy.random.Generator
        The seed: the same integer gives the same bytes on every platform.
    share : float
        Of the channels, about, 0.1 to 0.5; smaller images deviate more.
    width : int
        Of the channels, pixels, 3 to 16; single channels are one wider or narrower.

    Returns
    -------
    ndarray of uint8, (rows, cols)
        1 in channels, 0 elsewhere.

    Raises
    ------
    ValueError
        The shape, the share or the width is out of range.

    Notes
    -----
    About 0.4 s for 250 x 250 pixels.
    """
    rows, cols = shape
    if min(rows, cols) < LEAST:
        raise ValueError(f"the shape is {rows} x {cols} pixels: give at least {LEAST} x {LEAST}")
    if not (0.1 <= share <= 0.5 and 3 <= width <= 16):
        raise ValueError(f"share {share} or width {width} is out of range: give a share of 0.1 to 0.5, a width of 3 to 16")
    scene = _Scene(np.zeros((rows, cols), np.uint8), _Draws(as_seed(rng)), width)
    wanted = int(share * rows * cols)
    while scene.pixels.sum() < wanted * MAIN // 8:
        _add_main(scene)
    least, more = (round(number * rows * cols / AREA) for number in ENDS)
    ends = least + scene.draws.below(more - least + 1)
    for _ in range(PATIENCE * ends):
        if len(scene.tips) == ends or scene.pixels.sum() >= wanted:
            break
        _add_end(scene)
    tries = 0
    while scene.pixels.sum() < wanted:
        # where no branch has room any more, channels across the picture fill it
        (_add_branch if tries < PATIENCE else _add_main)(scene)
        tries += 1
    return scene.pixels


class _Draws:
    """Whole numbers by Philox, one after another."""

    def __init__(self, seed: int) -> None:
        self.key, self.turn = (seed & 0xFFFFFFFF, seed >> 32), 0
        self.left: list[int] = []

    def words(self, number: int) -> list[int]:
        while len(self.left) < number:
            counter = [np.arange(POOL), np.full(POOL, self.turn), np.zeros(POOL), np.zeros(POOL)]
            words = np.stack(philox([np.asarray(c).astype(np.uint32) for c in counter], self.key), axis=-1)
            self.left += words.ravel().tolist()
            self.turn += 1
        taken, self.left = self.left[:number], self.left[number:]
        return taken

    def below(self, limit: int) -> int:
        return self.words(1)[0] * limit >> 32


@dataclass
class _Scene:
    """What is drawn so far: the pixels, courses, free ends and joints of the channels, and the room between them."""

    pixels: Pixels
    draws: _Draws
    width: int
    paths: list[Path] = field(default_factory=list)
    tips: list[Path] = field(default_factory=list)
    joints: list[Path] = field(default_factory=list)
    room: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.room = np.full(self.pixels.shape, FAR)


def _add_main(scene: _Scene) -> None:
    """A channel across the whole picture, where there is room."""
    rows, cols = scene.pixels.shape
    found = []
    for _ in range(TRIES):
        start = (scene.draws.below(rows + rows // 5) - rows // 10, -OUTSIDE)
        found.append(_walk(scene.draws, start, _swing(scene.draws), 2 * cols + 2 * OUTSIDE, 1))
    clear = [path for path in found if _is_far(path, scene.tips, CLEAR + scene.width)]
    _draw(scene, max(clear or found, key=lambda path: _room(scene, path)))


def _add_branch(scene: _Scene) -> None:
    """A channel that leaves another and goes on until it meets one, or out of the picture, but past no free end."""
    ways = []
    for _ in range(TRIES):
        path = _leaving(scene, 1, 2 * scene.pixels.shape[1])
        if path is None:
            continue
        met = np.flatnonzero(_at(scene.pixels, path)[LEAVING:])
        way = path if len(met) == 0 else path[: LEAVING + int(met[0]) + MEETING]
        if _is_far(way, scene.tips, CLEAR + scene.width) and _is_far(way[-1:], scene.joints, APART):
            ways.append(way)
    if ways:
        way = max(ways, key=lambda way: _room(scene, way[LEAVING // 2 :]))
        _draw(scene, way)
        scene.joints += [way[0, :2], way[-1, :2]]


def _add_end(scene: _Scene) -> None:
    """A channel that leaves another and ends inside, or begins inside and meets another, if there is room."""
    draws, shape = scene.draws, np.array(scene.pixels.shape)
    path = _leaving(scene, 1 if draws.below(2) else -1, LEAVING + 10 + draws.below(60))
    if path is None:
        return
    inside = path[:, :2] // PIXEL
    tip = inside[-1]
    if (inside < 0).any() or (inside >= shape).any() or (tip < 2 * CLEAR).any() or (tip >= shape - 2 * CLEAR).any():
        return
    room = _at(scene.room, path)[LEAVING:] - scene.width // 2
    if (room <= CLEAR // 2).any() or room[-1] <= CLEAR:
        return
    _draw(scene, path)
    scene.tips.append(path[-1, :2])
    scene.joints.append(path[0, :2])


def _leaving(scene: _Scene, towards: int, steps: int) -> Path | None:
    """A course that leaves some channel at an angle, to the right (1) or to the left (-1)."""
    draws = scene.draws
    path = scene.paths[draws.below(len(scene.paths))]
    start = path[(at := draws.below(len(path))) : at + 1]
    row, col, heading = (int(part) for part in start[0])
    rows, cols = scene.pixels.shape
    inside = 0 <= row // PIXEL < rows and 0 <= col // PIXEL < cols
    if not (inside and _is_far(start, scene.joints, APART) and _is_far(start, scene.tips, APART)):
        return None
    turn = (340 + draws.below(300)) * (1 if draws.below(2) else -1)
    swing = max(-STEEPEST, min(STEEPEST, heading * towards + turn)) * FINE
    return _walk(draws, (row // PIXEL, col // PIXEL), (swing, swing), steps, towards)


def _swing(draws: _Draws) -> tuple[int, int]:
    """The two last headings of a swing that has forgotten its start."""
    last, now = 0, 0
    for word in draws.words(SETTLE):
        last, now = now, _next(last, now, word)
    return last, now


def _next(last: int, now: int, word: int) -> int:
    push = (word * (2 * PUSH - 1) >> 32) - (PUSH - 1)
    heading = (AFTER * now - BEFORE * last >> 16) + push * FINE
    return max(-STEEPEST * FINE, min(STEEPEST * FINE, heading))


def _walk(draws: _Draws, start: tuple[int, int], swing: tuple[int, int], steps: int, towards: int) -> Path:
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


def _at(picture: NDArray[Any], path: Path) -> NDArray[Any]:
    """The picture's values along a course, 0 outside."""
    places = path[:, :2] // PIXEL
    inside = ((places >= 0) & (places < picture.shape)).all(axis=1)
    row, col = np.where(inside[:, np.newaxis], places, 0).T
    return np.asarray(picture[row, col] * inside)


def _is_far(path: Path, places: list[Path], apart: int) -> bool:
    """Whether a course keeps so many pixels away from all of some places."""
    return all(int(((path[:, :2] - place) ** 2).sum(axis=1).min()) > (apart * PIXEL) ** 2 for place in places)


def _room(scene: _Scene, path: Path) -> float:
    """Mean distance of a course from other channels, where it is inside, pixels; those further than `FAR` are so far."""
    places = path[:, :2] // PIXEL
    inside = ((places >= 0) & (places < scene.pixels.shape)).all(axis=1)
    return int(_at(scene.room, path).sum()) / max(FAR, int(inside.sum()))  # one that soon leaves has little


def _draw(scene: _Scene, path: Path) -> None:
    """Draw a course in place, as discs of one width."""
    width = scene.width - 1 + scene.draws.below(3)
    reach = width // 2 + 1
    offsets = np.arange(-reach, reach + 1)
    centres = path[:, np.newaxis, np.newaxis, :2]
    rows = centres[..., 0] // PIXEL + offsets[:, np.newaxis]
    cols = centres[..., 1] // PIXEL + offsets
    # from the middles of pixels, in parts of a half pixel
    apart = (rows * PIXEL + PIXEL // 2 - centres[..., 0]) ** 2 + (cols * PIXEL + PIXEL // 2 - centres[..., 1]) ** 2
    rows, cols = np.broadcast_arrays(rows, cols)
    height, across = scene.pixels.shape
    drawn = (4 * apart <= (width * PIXEL) ** 2) & (rows >= 0) & (rows < height) & (cols >= 0) & (cols < across)
    scene.pixels[rows[drawn], cols[drawn]] = 1
    scene.paths.append(path)
    scene.room = np.minimum(ndimage.distance_transform_edt(scene.pixels == 0).astype(np.int64), FAR)
