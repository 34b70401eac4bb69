"""De Bonet's pyramid and features as plain loops: what kernels and their NumPy twins are tested against.

Nothing here shares code with the package. A picture is one plane, [row, column].
"""

from math import cos, exp, pi, sin

import numpy as np

GAUSS = {-2: 1, -1: 4, 0: 6, 1: 4, 2: 1}
"""g in each direction, in 1/16."""


WEIGHTS = {-1: 1, 0: 2, 1: 1}
"""Of neighbours that fade into each other, in each direction, in 1/4."""


def within(i, n, torus):
    """Index i brought to 0 .. n-1: around a torus, or back and forth between mirrors on the outer pixels."""
    if torus or n == 1:
        return i % n
    while not 0 <= i < n:
        i = -i if i < 0 else 2 * (n - 1) - i
    return i


def rounded(numerator, denominator):
    """The closest integer to a fraction; halves go up."""
    return (2 * numerator + denominator) // (2 * denominator)


def above(shape):
    """Rows and columns of the next level."""
    return tuple(len(range(0, n, 2)) for n in shape)


def reduced(g, torus):
    """G_{i+1} = 2down(G_i * g), equation (6)."""
    rows, cols = g.shape
    coarse = np.zeros(above(g.shape), np.int64)
    for k, m in np.ndindex(coarse.shape):
        total = 0
        for a, b in ((a, b) for a in GAUSS for b in GAUSS):
            i, j = within(2 * k + a, rows, torus), within(2 * m + b, cols, torus)
            total += GAUSS[a] * GAUSS[b] * int(g[i, j])
        coarse[k, m] = rounded(total, 16 * 16)
    return coarse


def expanded(coarse, shape, tile, torus):
    """2up(G_{i+1}): zeros between the pixels, blurred by g, four times as bright. Level i is made of tiles."""
    rows, cols = coarse.shape
    fine = np.zeros(shape, np.int64)
    for i, j in np.ndindex(*shape):
        (p, q), total = (i % tile[0], j % tile[1]), 0
        begin = i // tile[0] * above(tile)[0], j // tile[1] * above(tile)[1]
        for a, b in ((a, b) for a in GAUSS for b in GAUSS):
            if (p + a) % 2 == 0 and (q + b) % 2 == 0:  # elsewhere are the zeros
                k, m = within(begin[0] + (p + a) // 2, rows, torus), within(begin[1] + (q + b) // 2, cols, torus)
                total += 4 * GAUSS[a] * GAUSS[b] * int(coarse[k, m])
        fine[i, j] = rounded(total, 16 * 16)
    return fine


def faded(band, source, torus):
    """L_i of an output where pieces that meet fade into each other; source is the number of a pixel of the band."""
    rows, cols = source.shape
    made = np.zeros(source.shape, np.int64)
    for i, j in np.ndindex(rows, cols):
        total = 0
        for p, q in ((p, q) for p in WEIGHTS for q in WEIGHTS):
            # at the border of a plane a pixel stands in for the neighbour that it lacks
            a, b = (p, q) if torus else (p * (0 <= i + p < rows), q * (0 <= j + q < cols))
            k, m = divmod(int(source[(i + a) % rows, (j + b) % cols]), band.shape[1])
            goes_on = band[within(k - a, band.shape[0], torus), within(m - b, band.shape[1], torus)]
            total += WEIGHTS[p] * WEIGHTS[q] * int(goes_on)
        made[i, j] = rounded(total, 16)
    return made


def pyramid(picture, levels, torus):
    """G_0, G_1, ... and L_0, L_1, ..., equations (5) and (6); the last L is the last G."""
    gaussian, bands = [picture.astype(np.int64)], []
    while len(gaussian) < levels:
        fine = gaussian[-1]
        gaussian.append(reduced(fine, torus))
        bands.append(fine - expanded(gaussian[-1], fine.shape, fine.shape, torus))
    return gaussian, [*bands, gaussian[-1]]


def derivative(degree, angle, sigma, side):
    """The first or second derivative of a Gaussian along a direction, and the sum of its positive part.

    The second is without its mean. The angle goes from the column axis towards the row axis. The filter is laid over a
    picture as it is: the first derivative is positive where the direction points.
    """
    reach = range(-(side // 2), side // 2 + 1)
    gauss = np.array([[exp(-(x * x + y * y) / (2 * sigma**2)) for x in reach] for y in reach])
    along = np.array([[(x * cos(angle) + y * sin(angle)) / sigma for x in reach] for y in reach])
    f = gauss * (along if degree == 1 else along**2 - 1)
    f = f - gauss * f.sum() / gauss.sum()
    return f, float(f[f > 0].sum())


def angles(orientations):
    """The directions of a bank."""
    return [pi * a / orientations for a in range(orientations)]


def response(g, taps, torus):
    """G * f of equation (7), taps in 2**-14."""
    rows, cols = g.shape
    reach = len(taps) // 2
    result = np.zeros(g.shape, np.int64)
    for i, j in np.ndindex(g.shape):
        total = 0
        for a, b in np.ndindex(taps.shape):
            k, m = within(i + a - reach, rows, torus), within(j + b - reach, cols, torus)
            total += int(taps[a, b]) * int(g[k, m])
        result[i, j] = rounded(total, 2**14)
    return result


def as_large(size, level, place):
    """Of the nodes along one axis above a level, those that stand for as much of the sample as the one above `place`.

    The last node of a level may stand for fewer of the sample's `size` pixels than the others.
    """
    side = 2 ** (level + 1)
    extents = [min(side, size - first) for first in range(0, size, side)]
    return [extent >= extents[place // 2] for extent in extents]
