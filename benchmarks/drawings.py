# SPDX-License-Identifier: BSD-3-Clause
"""Samples drawn by code, 128x128: mesh, canvas, gingham, reptile skin, cells; in colour marble, granite and stucco."""

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

SIDE = 128
"""Rows and columns of a drawing."""

THREAD = np.arange(-2, SIDE // 8 + 3)
"""Numbers of the threads of the finest cloth, those beyond the edges too."""


def grained(levels, grain, seed):
    """8-bit pixels of levels, with noise of a standard deviation."""
    noise = np.random.default_rng(seed).normal(0, grain, levels.shape)
    return np.rint(np.clip(levels + noise, 0, 255)).astype(np.uint8)


def threads(period, width, uneven, rng, up):
    """Height, shade and deviation of tone of threads that run down, first above (1) or below (-1) those across.

    A pixel without a thread has the height -9. ``uneven`` scales the deviations of place, width, course and tone.
    """
    place, wide, tone = rng.normal(0, uneven, (3, len(THREAD)))
    place, wide = (THREAD + 0.08 * place) * period, width * (1 + 0.1 * wide)
    row = np.arange(SIDE)
    phase = rng.uniform(0, 2 * np.pi, len(THREAD))
    course = place + 0.05 * uneven * period * np.sin(2 * np.pi * row[:, None] / SIDE + phase)  # row, thread
    apart = np.abs(row[:, None] - course[:, None, :])  # row, column, thread
    thread = apart.argmin(-1)
    away = apart.min(-1) / (wide[thread] / 2)
    round_ = np.sqrt(np.clip(1 - away**2, 0, 1))
    over = up * np.cos(np.pi * (row[:, None] / period + thread))
    return np.where(away < 1, round_ + 0.8 * over, -9), (0.55 + 0.45 * round_) * (0.86 + 0.14 * over), 14 * tone[thread]


def woven(period, width, tone, gap, uneven, seed):
    """Grey levels of threads of a tone that cross, before a gap."""
    rng = np.random.default_rng(seed)
    down = threads(period, width, uneven, rng, 1)
    across = [part.T for part in threads(period, width, uneven, rng, -1)]
    height = np.maximum(down[0], across[0])
    shade, own = (np.where(down[0] > across[0], *pair) for pair in zip(down[1:], across[1:], strict=True))
    return np.where(height > -9, tone * shade + own, gap)


def mesh():
    """Wire mesh: bright wires, dark between them."""
    return grained(woven(16, 7, 225, 30, 0.5, 1), 6, 2)


def canvas():
    """Canvas of threads that are close together."""
    return grained(woven(8, 7.4, 190, 50, 1, 3), 7, 4)


def gingham():
    """White and dark bands that cross, of threads that show."""
    row, col = np.indices((SIDE, SIDE))
    down, across = ((place + 4) // 16 % 2 for place in (row, col))
    twill = np.where((row + col) % 3 == 0, 100, 150)
    cloth = np.where(down == across, np.where(down == 1, 45, 235), twill)
    return grained(ndimage.gaussian_filter(cloth.astype(float), 0.5), 7, 5)


def nearest(centres, stretch=1.0):
    """The cell of every pixel, its distance from the centre, and how much further the second centre is."""
    places = np.stack(np.indices((SIDE, SIDE)), -1) * (stretch, 1)
    (first, second), cell = (np.moveaxis(part, -1, 0) for part in cKDTree(centres * (stretch, 1)).query(places, k=2))
    return cell[0], first, second - first


def reptile():
    """Scales in rows, every one a little different, lit from above."""
    rng = np.random.default_rng(6)
    row, col = np.meshgrid(np.arange(-2, 20) * 8.0, np.arange(-2, 16) * 11.0, indexing="ij")
    col = col + np.arange(len(row))[:, None] % 2 * 5.5
    centres = np.stack([row.ravel(), col.ravel()], -1) + rng.normal(0, 0.7, (row.size, 2))
    cell, _, further = nearest(centres, 1.3)
    above = np.indices((SIDE, SIDE))[0] - centres[cell, 0]
    shade = 120 - 9 * above + rng.normal(0, 12, row.size)[cell]
    return grained(40 + np.clip(further / 3.5, 0, 1) ** 0.7 * shade, 6, 7)


def cells():
    """Cells of different sizes and tones with dark walls."""
    rng = np.random.default_rng(8)
    centres = []
    for place in rng.uniform(-20, SIDE + 20, (4000, 2)):
        if all(np.hypot(*(place - other)) > 13 for other in centres):
            centres.append(place)
    cell, middle, further = nearest(np.array(centres))
    shade = rng.uniform(90, 190, len(centres))[cell] - 2 * middle
    return grained(35 + np.clip(further / 4, 0, 1) * shade, 6, 9)


def cloud(smooth, rng):
    """Smooth noise of unit variance."""
    found = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), smooth, mode="wrap")
    return found / found.std()


def marble():
    """Green marble with light veins, in colour."""
    rng = np.random.default_rng(10)
    stone = 0.5 * cloud(5, rng) + 0.35 * cloud(2, rng) + 0.25 * cloud(1, rng)
    vein = 0.5 * np.exp(-((cloud(7, rng) + 0.3 * cloud(2, rng)) ** 2) / 0.08)[..., None]
    colour = np.array([40, 92, 62]) + stone[..., None] * (22, 30, 24)
    return grained(colour * (1 - vein) + vein * (190, 210, 190), 4, 11)


def granite():
    """Grains of four minerals, in colour."""
    rng = np.random.default_rng(12)
    cell, middle, _ = nearest(rng.uniform(-5, SIDE + 5, (2600, 2)))
    minerals = np.array([[196, 150, 136], [205, 200, 192], [128, 122, 120], [44, 40, 44]])
    colour = minerals[rng.choice(4, 2600, p=[0.4, 0.3, 0.18, 0.12])] + rng.normal(0, 10, (2600, 1))
    return grained(colour[cell] - 4 * middle[..., None], 6, 13)


def stucco():
    """Rough plaster, lit from the upper left, in colour."""
    height = cloud(2, rng := np.random.default_rng(14)) + 0.3 * cloud(1, rng)
    down, right = np.gradient(height)
    return grained(np.array([205, 178, 140]) - (55 * (down + right))[..., None] * (1, 0.95, 0.85), 4, 15)
