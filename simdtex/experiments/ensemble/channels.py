# SPDX-License-Identifier: BSD-3-Clause
"""A training image made by code: sinuous channels that meet, part and now and then end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from simdtex.experiments.ensemble.courses import (
    FINE,
    PIXEL,
    STEEPEST,
    Draws,
    Path,
    is_far,
    is_inside,
    swing_of,
    values_at,
    walk,
)
from simdtex.random import as_seed

Pixels = NDArray[np.uint8]

LEAST = 32  # pixels of a side
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
        raise ValueError(
            f"share {share} or width {width} is out of range: give a share of 0.1 to 0.5, a width of 3 to 16"
        )
    scene = _Scene(np.zeros((rows, cols), np.uint8), Draws(as_seed(rng)), width)
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


@dataclass
class _Scene:
    """What is drawn so far: the pixels, courses, free ends and joints of the channels, and the room between them."""

    pixels: Pixels
    draws: Draws
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
        found.append(walk(scene.draws, start, swing_of(scene.draws), 2 * cols + 2 * OUTSIDE, 1))
    clear = [path for path in found if is_far(path, scene.tips, CLEAR + scene.width)]
    _draw(scene, max(clear or found, key=lambda path: _room(scene, path)))


def _add_branch(scene: _Scene) -> None:
    """A channel that leaves another and goes on until it meets one, or out of the picture, but past no free end."""
    ways = []
    for _ in range(TRIES):
        path = _leaving(scene, 1, 2 * scene.pixels.shape[1])
        if path is None:
            continue
        met = np.flatnonzero(values_at(scene.pixels, path)[LEAVING:])
        way = path if len(met) == 0 else path[: LEAVING + int(met[0]) + MEETING]
        if is_far(way, scene.tips, CLEAR + scene.width) and is_far(way[-1:], scene.joints, APART):
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
    room = values_at(scene.room, path)[LEAVING:] - scene.width // 2
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
    if not (inside and is_far(start, scene.joints, APART) and is_far(start, scene.tips, APART)):
        return None
    turn = (340 + draws.below(300)) * (1 if draws.below(2) else -1)
    swing = max(-STEEPEST, min(STEEPEST, heading * towards + turn)) * FINE
    return walk(draws, (row // PIXEL, col // PIXEL), (swing, swing), steps, towards)


def _room(scene: _Scene, path: Path) -> float:
    """Mean distance of a course from other channels, where it is inside, pixels; more than `FAR` is so much."""
    inside = int(is_inside(path, scene.pixels.shape).sum())
    return int(values_at(scene.room, path).sum()) / max(FAR, inside)  # one that soon leaves has little


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
