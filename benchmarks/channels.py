# SPDX-License-Identifier: BSD-3-Clause
"""Makes training images of sinuous channels that meet, part and now and then end.

    python benchmarks/channels.py [--shape 256,256] [--seed 1,7] [--out simdtex/jobs/simulation/channels.png]

Writes an image for each seed, side by side. All arithmetic is in whole numbers, so that no platform's library decides
on a pixel.
"""

from itertools import count

import common
import numpy as np
from scipy import ndimage

from simdtex.io import image
from simdtex.random import as_seed, philox

LEAST = 32  # pixels of a side
SHARE = 0.3  # of the channels
WIDTH = 8  # of the channels, pixels
OUTSIDE = 30  # channels begin so far to the left of the picture, pixels
TRIES = 8  # courses of which the one with most room is taken
FAR = 40  # more room than this is no better, pixels
CLEAR = 7  # ground around a dead end, pixels
LEAVING = 26  # steps that a branch takes to leave its channel
MEETING = 5  # steps into the channel that a branch meets
APART = 22  # of joints from one another, pixels
ENDS = (9, 13)  # dead ends in AREA pixels, from and to
AREA = 62500
PATIENCE = 60  # tries for one dead end, and for all branches

PIXEL = 256  # fixed point: parts of a pixel
TURN = 4096  # parts of a full turn; a heading of 0 is to the right
SINE = np.rint(PIXEL * np.sin(np.arange(TURN) * (2 * np.pi / TURN))).astype(np.int64).tolist()

# Headings h are a damped swing pushed at random, h(i) = AFTER h(i-1) - BEFORE h(i-2) + push (Ferguson, "Disturbed
# periodic model for river meanders", 1976), for meanders of about 75 pixels, in parts of 65536.
AFTER, BEFORE = 127926, 62849
FINE = 256  # parts of a heading's unit
PUSH = 19  # pushes are less than this, units of a heading; headings deviate by about 38 degrees
STEEPEST = 850  # no heading is further from the right, 75 degrees
SETTLE = 120  # steps that a swing takes to forget its start
POOL = 1024  # random numbers drawn at once


def channels(shape, rng=None):
    """Make an image (rows, cols) uint8 of channels, 1, that run from left to right: about 8 pixels wide, 0.3 of it.

    They meander, cross, part and meet again, and a few end inside: mostly 6 to 10 dead ends in 250 x 250 pixels. The
    same seed gives the same bytes on every platform. About 0.4 s for 250 x 250 pixels.
    """
    rows, cols = shape
    if min(rows, cols) < LEAST:
        raise ValueError(f"the shape is {rows} x {cols} pixels: give at least {LEAST} x {LEAST}")
    scene = Scene((rows, cols), as_seed(rng))
    wanted = int(SHARE * rows * cols)
    while scene.pixels.sum() < wanted // 2:
        scene.add_main()
    least, most = (round(number * rows * cols / AREA) for number in ENDS)
    ends = least + scene.below(most - least + 1)
    for _ in range(PATIENCE * ends):
        if len(scene.tips) == ends or scene.pixels.sum() >= wanted:
            break
        scene.add_end()
    for tried in count():
        if scene.pixels.sum() >= wanted:
            return scene.pixels
        if tried < PATIENCE:
            scene.add_branch()
        else:  # no branch has room any more
            scene.add_main()


class Scene:
    """The image so far: pixels, courses, free ends and joints of the channels, and the distance from any channel.

    A course is (n, 3): row and column in fixed point, and heading.
    """

    def __init__(self, shape, seed, width=WIDTH):
        self.pixels, self.room = np.zeros(shape, np.uint8), np.full(shape, FAR)
        self.paths, self.tips, self.joints = [], [], []
        self.words, self.width = words(seed), width

    def below(self, limit):
        """Draw a number from 0 to limit - 1."""
        return next(self.words) * limit >> 32

    def turned(self, last, now):
        """Return the heading after two others, at random."""
        push = self.below(2 * PUSH - 1) - (PUSH - 1)
        heading = (AFTER * now - BEFORE * last >> 16) + push * FINE
        return max(-STEEPEST * FINE, min(STEEPEST * FINE, heading))

    def walk(self, start, swing, steps, towards):
        """Draw a course of so many steps of a pixel, to the right (1) or to the left (-1)."""
        (last, now), (row, col) = swing, (place * PIXEL for place in start)
        path = []
        for _ in range(steps):
            heading = now // FINE
            path.append((row, col, heading * towards))
            row += SINE[heading % TURN]
            col += SINE[(heading + TURN // 4) % TURN] * towards
            last, now = now, self.turned(last, now)
        return np.array(path, dtype=np.int64)

    def add_main(self):
        """Add a channel across the whole picture, where it has most room."""
        rows, cols = self.pixels.shape
        found = []
        for _ in range(TRIES):
            start = (self.below(rows + rows // 5) - rows // 10, -OUTSIDE)
            last = now = 0
            for _ in range(SETTLE):
                last, now = now, self.turned(last, now)
            found.append(self.walk(start, (last, now), 2 * cols + 2 * OUTSIDE, 1))
        clear = [path for path in found if is_far(path, self.tips, CLEAR + WIDTH)]
        self.draw(max(clear or found, key=self.mean_room))

    def add_branch(self):
        """Add a channel that leaves another and goes on until it meets one, or out of the picture."""
        ways = []
        for _ in range(TRIES):
            path = self.leaving(1, 2 * self.pixels.shape[1])
            if path is None:
                continue
            met = np.flatnonzero(values_at(self.pixels, path)[LEAVING:])
            way = path if len(met) == 0 else path[: LEAVING + int(met[0]) + MEETING]
            if is_far(way, self.tips, CLEAR + WIDTH) and is_far(way[-1:], self.joints, APART):
                ways.append(way)
        if ways:
            way = max(ways, key=lambda way: self.mean_room(way[LEAVING // 2 :]))
            self.draw(way)
            self.joints += [way[0, :2], way[-1, :2]]

    def add_end(self):
        """Add a channel that leaves another and ends inside, or begins inside and meets another, if there is room."""
        path = self.leaving(1 if self.below(2) else -1, LEAVING + 10 + self.below(60))
        if path is None:
            return
        tip, shape = path[-1, :2] // PIXEL, np.array(self.pixels.shape)
        if not inside(path, self.pixels).all() or (tip < 2 * CLEAR).any() or (tip >= shape - 2 * CLEAR).any():
            return
        room = values_at(self.room, path)[LEAVING:] - WIDTH // 2
        if (room > CLEAR // 2).all() and room[-1] > CLEAR:
            self.draw(path)
            self.tips.append(path[-1, :2])
            self.joints.append(path[0, :2])

    def leaving(self, towards, steps):
        """Draw a course that leaves some channel at an angle; None if it would do so near a joint or an end."""
        path = self.paths[self.below(len(self.paths))]
        start = path[(at := self.below(len(path))) : at + 1]
        if not (inside(start, self.pixels).all() and is_far(start, self.joints + self.tips, APART)):
            return None
        row, col, heading = (int(part) for part in start[0])
        turn = (340 + self.below(300)) * (1 if self.below(2) else -1)
        swing = max(-STEEPEST, min(STEEPEST, heading * towards + turn)) * FINE
        return self.walk((row // PIXEL, col // PIXEL), (swing, swing), steps, towards)

    def mean_room(self, path):
        """Return the mean distance of a course from other channels, where it is inside, pixels."""
        own = int(inside(path, self.pixels).sum())
        return int(values_at(self.room, path).sum()) / max(FAR, own)  # a course that soon leaves has little

    def draw(self, path):
        """Draw a course in place, as discs of one width."""
        width = self.width - 1 + self.below(3)
        around = np.stack(np.mgrid[tuple([slice(-(width // 2) - 1, width // 2 + 2)] * 2)], -1)
        centres = path[:, np.newaxis, np.newaxis, :2]
        places = centres // PIXEL + around
        # from the middles of pixels, in parts of a half pixel
        apart = ((places * PIXEL + PIXEL // 2 - centres) ** 2).sum(-1)
        drawn = (4 * apart <= (width * PIXEL) ** 2) & ((places >= 0) & (places < self.pixels.shape)).all(-1)
        self.pixels[tuple(places[drawn].T)] = 1
        self.paths.append(path)
        self.room = np.minimum(ndimage.distance_transform_edt(self.pixels == 0).astype(np.int64), FAR)


def words(seed):
    """Yield random numbers of 32 bits, by Philox."""
    counter = np.zeros((4, POOL), np.uint32)
    counter[0] = np.arange(POOL)
    for turn in count():
        counter[1] = turn
        yield from np.stack(philox(list(counter), (seed & 0xFFFFFFFF, seed >> 32)), axis=-1).ravel().tolist()


def inside(path, picture):
    """Return which places of a course are inside of a picture."""
    places = path[:, :2] // PIXEL
    return ((places >= 0) & (places < picture.shape)).all(axis=1)


def values_at(picture, path):
    """Return the picture's values along a course, 0 outside."""
    there = inside(path, picture)
    row, col = np.where(there[:, np.newaxis], path[:, :2] // PIXEL, 0).T
    return picture[row, col] * there


def is_far(path, places, apart):
    """Return whether a course keeps so many pixels away from all of some places."""
    return all(((path[:, :2] - place) ** 2).sum(axis=1).min() > (apart * PIXEL) ** 2 for place in places)


@common.command
def main(shape=(256, 256), seed=(1, 7), out=common.DOCS.parent / "simdtex" / "experiments" / "channels.png"):
    image.write(out, np.hstack([channels(tuple(shape), each) for each in seed]))


if __name__ == "__main__":
    main()
