"""The equations of the paper as plain loops in Python numbers: what kernels and their NumPy twins are tested against.

Nothing here shares code with the package. A picture is indexed [channel][row, column].
"""

from math import exp, isqrt

import numpy as np


def offsets(order):
    """Equation (3), in canonical order: by distance, then row, then column."""
    reach = range(-isqrt(order), isqrt(order) + 1)
    inside = [(i * i + j * j, i, j) for i in reach for j in reach if 0 < i * i + j * j <= order]
    return [(i, j) for _, i, j in sorted(inside)]


def grid_size(shape, spacing):
    """Rows and columns of equation (10)."""
    return len(range(0, shape[0], spacing)), len(range(0, shape[1], spacing))


def neighbours(i, j, order, rows, cols, torus):
    """[(row, column) or None] on a lattice: None outside an open one and where a torus wraps onto the site itself."""
    found = []
    for di, dj in offsets(order):
        k, m = i + di, j + dj
        if torus:
            k, m = k % rows, m % cols
        inside = 0 <= k < rows and 0 <= m < cols and (k, m) != (i, j)
        found.append((k, m) if inside else None)
    return found


def whole_positions(shape, order, spacing=1, step=1):
    """Sample positions whose whole neighbourhood, spread by the spacing, lies in the sample, row by row."""
    return [
        (i, j)
        for i in range(0, shape[0], step)
        for j in range(0, shape[1], step)
        if all(0 <= i + di * spacing < shape[0] and 0 <= j + dj * spacing < shape[1] for di, dj in offsets(order))
    ]


def distance(image, temperature, site, sample, position, order, spacing=1, torus=True):
    """d_p of equation (12), summed over channels. Temperatures from 0 to 1."""
    shape = image[0].shape
    i, j = site[0] // spacing, site[1] // spacing
    total = 0.0
    near = neighbours(i, j, order, *grid_size(shape, spacing), torus)
    for (di, dj), r in zip(offsets(order), near, strict=True):
        if r is None:
            continue
        x = (r[0] * spacing, r[1] * spacing)
        y = (position[0] + di * spacing, position[1] + dj * spacing)
        for c in range(len(image)):
            total += ((float(image[c][x]) - float(sample[c][y])) * (1 - float(temperature[x]))) ** 2
    return total


def optimal_bandwidth(sample, candidates, neighbours):
    """h_opt of equation (8); sigma^2 is the mean over channels of the variance."""
    variance = float(np.mean([np.var(np.asarray(channel, np.float64)) for channel in sample]))
    d = len(sample) * (neighbours + 1)
    return variance**0.5 * (4 / (candidates * (2 * d + 1))) ** (1 / (d + 4))


def mixture(distances, values, h, levels):
    """Equations (6) and (7) for one channel: P(x) ~ sum_p exp(-d_p / 2h^2) exp(-(x - y_p)^2 / 2h^2)."""
    least = min(distances)
    p = np.zeros(levels)
    for d, y in zip(distances, values, strict=True):
        w = exp(-(d - least) / (2 * h * h))
        for x in range(levels):
            p[x] += w * exp(-((x - float(y)) ** 2) / (2 * h * h))
    return p / p.sum()


def cooled(temperature, site, order, spacing, torus, xi):
    """Equation (13) in integers of 1/1024."""
    i, j = site[0] // spacing, site[1] // spacing
    near = neighbours(i, j, order, *grid_size(temperature.shape, spacing), torus)
    here = [int(temperature[k * spacing, m * spacing]) for k, m in filter(None, near)]
    total = xi + sum(here)
    return total // len(here) if total > 0 else 0


def coherent(source, temperature, site, order, spacing, torus):
    """Sample positions that continue the source of a neighbour which a relaxation has touched."""
    i, j = site[0] // spacing, site[1] // spacing
    near = neighbours(i, j, order, *grid_size(source.shape[:2], spacing), torus)
    found = set()
    for (di, dj), r in zip(offsets(order), near, strict=True):
        if r is not None and temperature[r[0] * spacing, r[1] * spacing] < 1024:
            row, col = source[r[0] * spacing, r[1] * spacing]
            found.add((int(row) - di * spacing, int(col) - dj * spacing))
    return found
