"""The picture that comes of sources, step 7 of Algorithm 1, in plain loops: see `plain_mrf`."""

from itertools import product
from math import ceil, exp

import numpy as np
from plain_sample import NOWHERE


def picture(Y, X):
    """Each pixel that of its source, moved by what the grey level differs; what is from nowhere is shown elsewhere."""
    image = np.zeros((*X.t.shape, len(Y.variables)), Y.pictures[0].dtype)
    for i, j, c in np.ndindex(image.shape):
        n, k, m = X.source[i, j].tolist()
        if n >= 0:
            step = int(X.x[c][i, j] - Y.planes[n][c][k, m]) if Y.direct else 0
            image[i, j, c] = moved(Y, (n, k, m, c), step, Y.unit[c])
    return image


def finished(Y, X, o):
    """Each pixel the weighted mean of what its neighbours' sources say of it: Y[p_r + s - r], r up to 2.5 sd from s.

    Weights are whole 1/1024. The mean is rounded, halves up, to a grey level of 8 bits and to 1/8 of one of others. A
    neighbour that is given, and whose source says nothing, says by how much the site's own source misses it.
    """
    (rows, cols), radius = X.t.shape, ceil(2.5 * o.finish)
    image = np.zeros((rows, cols, len(Y.variables)), Y.pictures[0].dtype)
    fine = 1 if Y.top == 255 else 8
    for i, j in np.ndindex(rows, cols):
        own, total, sums = tuple(X.source[i, j].tolist()), 0, [0] * len(Y.variables)
        if own == NOWHERE:
            continue
        for a, b in product(range(-radius, radius + 1), repeat=2):
            r = ((i + a) % rows, (j + b) % cols) if o.boundary == "torus" else (i + a, j + b)
            far, outside = a * a + b * b > (2.5 * o.finish) ** 2, not (0 <= r[0] < rows and 0 <= r[1] < cols)
            if far or outside or (r == (i, j) and (a, b) != (0, 0)):
                continue
            weight = round(1024 * exp(-(a * a + b * b) / (2 * o.finish**2)))
            said, missed = usable(Y, X.source[r], (-a, -b)), usable(Y, own, (a, b)) if gives(Y, r) else None
            for c in range(len(Y.variables)) if said or missed else []:  # not the structure channel
                if said:
                    sums[c] += weight * (level_at(Y, c, said) - level_at(Y, c, own))
                else:
                    sums[c] += weight * (int(X.x[c][r]) - level_at(Y, c, missed))
            total += weight if said or missed else 0
        for c in range(len(Y.variables)):
            step = (2 * fine * sums[c] + total) // max(1, 2 * total)
            image[i, j, c] = moved(Y, (*own, c), step, Y.unit[c] / fine)
    return image


def gives(Y, r):
    """Whether a pixel is given, and takes part."""
    return r in Y.given and r not in Y.outside


def usable(Y, place, by):
    """The place that is so much further on, if it may be used; there is none beside what is nowhere."""
    n, i, j = (int(x) for x in place)
    i, j = i + by[0], j + by[1]
    inside = n >= 0 and 0 <= i < Y.usable[n].shape[0] and 0 <= j < Y.usable[n].shape[1]
    return (n, i, j) if inside and Y.usable[n][i, j] else None


def level_at(Y, c, place):
    """The grey level of a place."""
    return int(Y.planes[place[0]][c][place[1:]])


def moved(Y, at, step, unit):
    """A value of the sample moved by so many steps, within the legal range."""
    pixels, whole = Y.pictures, Y.pictures[0].dtype.kind != "f"
    low, high = min(y.min() for y in pixels).item(), max(y.max() for y in pixels).item()
    if pixels[0].dtype == np.uint8:
        low, high = 0, 255
    own = pixels[at[0]][at[1:]].item()
    if not step:
        return own
    value = own + step * unit
    if pixels[0].dtype == np.bool_:
        return value > 0.5
    return min(max(round(value) if whole else value, low), high)
