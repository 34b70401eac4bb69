"""The steerable pyramid's sums as plain float64 formulas: what the operations' NumPy twins are tested against.

Nothing here shares code with the package but the border rule of `plain_multires`, written for tests too.
"""

import numpy as np
from plain_multires import within


def matrix(n, side, tap_row, step, torus):
    """Which of n pixels of a line each tap meets: (ceil(n / step), n) of 0 and 1, for output pixels 0, step, ..."""
    met = np.zeros((-(-n // step), n))
    for k in range(len(met)):
        met[k, within(step * k + tap_row - side // 2, n, torus)] = 1
    return met


def split(picture, taps, torus, step):
    """Correlation of one plane with one filter at every step-th pixel, in float64."""
    rows, cols = picture.shape
    total = 0
    for (a, b), tap in np.ndenumerate(taps):
        down, across = (matrix(n, len(taps), t, step, torus) for n, t in ((rows, a), (cols, b)))
        total = total + float(tap) * (down @ picture @ across.T)
    return total


def spread(band, shape):
    """Zeros between the pixels of a band, to rows and columns of a level twice as fine."""
    fine = np.zeros(shape)
    for (i, j), value in np.ndenumerate(band):
        fine[2 * i, 2 * j] = value
    return fine


def join(terms, shape, torus):
    """The sum over bands, each (plane, taps, step): spread, and laid out with its filter turned by 180 degrees."""
    total = np.zeros(shape)
    for band, taps, step in terms:
        fine = spread(band, shape) if step == 2 else band
        total += split(fine, np.rot90(taps, 2), torus, 1)
    return total
