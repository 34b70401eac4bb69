"""Heeger and Bergen (1995) as plain float64 formulas: sums of the steerable pyramid, and Match-texture itself.

Nothing here shares code with the package but the border rule of `plain_multires`, written for tests too. The steerable
pyramid is that of pyrtools.
"""

import numpy as np
from plain_multires import within
from pyrtools.pyramids import SteerablePyramidSpace


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


BINOMIAL = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]) / 256


class Steerable:
    """Make-Pyramid and Collapse-Pyramid of a steerable pyramid, by pyrtools."""

    def __init__(self, picture, levels, orientations, torus):
        edges = "circular" if torus else "reflect1"
        self._made = SteerablePyramidSpace(picture, height=levels, order=orientations - 1, edge_type=edges)
        self.subbands = self._made.pyr_coeffs

    def collapse(self):
        return self._made.recon_pyr()


class Laplacian:
    """The same of Burt and Adelson's: G_{i+1} is G_i blurred at every other pixel, L_i what that loses."""

    def __init__(self, picture, levels, orientations, torus):
        self._torus, self.subbands = torus, {}
        for level in range(levels):
            coarse = split(picture, BINOMIAL, torus, 2)
            self.subbands[level] = picture - self._expanded(coarse, picture.shape)
            picture = coarse
        self.subbands["low"] = picture

    def collapse(self):
        *bands, picture = self.subbands.values()
        for band in reversed(bands):
            picture = band + self._expanded(picture, band.shape)
        return picture

    def _expanded(self, coarse, shape):
        rows, cols = ([within(i, n, self._torus) for i in range(-1, n + 1)] for n in coarse.shape)
        around = coarse[np.ix_(rows, cols)]  # the border is that of the coarse picture
        fine = join([(around, 4 * BINOMIAL, 2)], tuple(2 * n for n in around.shape), True)
        return fine[2 : 2 + shape[0], 2 : 2 + shape[1]]


PYRAMIDS = {"steerable": Steerable, "laplacian": Laplacian}


def quantiles(target, n):
    """The target's values in the middle of each of n equal shares, smallest first."""
    target = np.sort(target, axis=None)
    return target[((2 * np.arange(n) + 1) * target.size) // (2 * n)]


def match_histogram(picture, target):
    """Match-Histogram by rank: the k-th smallest pixel becomes the k-th smallest of the target."""
    matched = np.empty(picture.size)
    matched[np.argsort(picture, axis=None, kind="stable")] = quantiles(target, picture.size)
    return matched.reshape(picture.shape)


def match_texture(noise, texture, kind, levels, orientations, iterations, torus=True):
    """Match-texture of the paper, one channel; analysis with mirrored edges."""
    analysis = PYRAMIDS[kind](texture, levels, orientations, False).subbands
    picture = match_histogram(noise, texture)
    for _ in range(iterations):
        synthesis = PYRAMIDS[kind](picture, levels, orientations, torus)
        for name, band in synthesis.subbands.items():
            synthesis.subbands[name] = match_histogram(band, analysis[name])
        picture = match_histogram(synthesis.collapse(), texture)
    return picture


def decorrelating(pixels):
    """M, its inverse and the mean of (n, C) pixels: y = M (x - mean) has unit variance and no correlation.

    The signs of rows are those that make the largest coefficient of each positive.
    """
    u, squares, _ = np.linalg.svd(np.cov(pixels.T, bias=True).reshape(pixels.shape[1], -1))
    u = u * np.sign(u[abs(u).argmax(0), np.arange(len(u))])
    deviations = np.sqrt(squares)
    return (u / deviations).T, u * deviations, pixels.mean(0)


def match_color_texture(noises, texture, kind, levels, orientations, iterations):
    """The same of every decorrelated channel, and back: (rows, cols, C)."""
    matrix, back, mean = decorrelating(texture.reshape(-1, texture.shape[-1]).astype(float))
    channels = (texture - mean) @ matrix.T
    made = [
        match_texture(noise, channel, kind, levels, orientations, iterations)
        for noise, channel in zip(noises, np.moveaxis(channels, -1, 0), strict=True)
    ]
    return np.stack(made, -1) @ back.T + mean
