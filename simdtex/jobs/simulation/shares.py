# SPDX-License-Identifier: BSD-3-Clause
"""The shares of categories that a realisation aims at: drawn, since windows of nature differ in their shares.

The variance of a category's share p in a block of v pixels is p (1 - p) A / v, where A is the integral range
(Lantuejoul, "Ergodicity and integral range", Journal of Microscopy 161, 1991), once v is much larger than A. A training
image of V pixels is a block itself, so its own share has the variance p (1 - p) A / V. A is measured in windows of the
image (`integral_range`). The covariance of two pixels at a distance h is taken for p (1 - p) exp(-h / a), whose
integral is p (1 - p) A; with it, simple block kriging turns data into the mean and the variance of the share
(`spread`), so that data close together count as few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from simdtex.methods.mrf.plan import MrfPlan
    from simdtex.model.given import Given
    from simdtex.model.pictures import Pictures

Floats = NDArray[np.float64]

PARTS = 1 / 4, 3 / 8, 1 / 2
"""Sides of the windows, in sides of the training image."""

MOST_DATA, MOST_CELLS = 1000, 4096
"""The most data, and cells of the output, whose covariances are computed: evenly spaced ones of more."""

WIDEST = 0.5
"""The most variance of a share, in units of p (1 - p)."""

LEAST = 1e-9
"""The least divisor."""

DIGITS = 6
"""Decimals of a drawn share, so that the last bit of a platform's functions does not matter."""


@dataclass(frozen=True)
class Spread:
    """The distribution of the shares of classes: Dirichlet for categories, for values that of their mean normal score.

    ``mean`` are the mean shares of categories (classes,), or the mean score (1,); ``ratio`` is the variance of a share
    p in units of p (1 - p), or that of the mean score; ``data`` (classes,) is the share of all cells that are data of
    each class; and ``bounds`` (classes - 1,), of values alone, are the scores between classes. The unit of scores is
    their deviation within an output.
    """

    mean: Floats
    ratio: float
    data: Floats
    bounds: Floats | None

    def draw(self, seed: int) -> Floats:
        """Return the shares of the realisation with a seed, (classes,)."""
        from scipy.special import gammaincinv, ndtr, ndtri  # loads slowly

        words = np.random.SeedSequence(seed, spawn_key=(len(self.data),)).generate_state(len(self.mean))
        shares, there, uniform = self.mean.copy(), self.mean > 0, (words + 0.5) / 2**32
        if self.bounds is not None:
            middle = self.mean + np.sqrt(self.ratio) * ndtri(uniform)
            shares = np.diff(ndtr(self.bounds - middle), prepend=0, append=1)
        elif self.ratio:
            shares[there] = gammaincinv(self.mean[there] * (1 / self.ratio - 1), uniform[there])
        shares = np.maximum(shares / shares.sum(), self.data)
        return np.asarray(np.round(shares / shares.sum(), DIGITS))

    def on(self, plan: MrfPlan, shares: Floats) -> MrfPlan:
        """Return the plan with these shares as the aim, of the cells without data."""
        free = np.maximum(shares - self.data, 0)
        free = free / max(free.sum(), LEAST)
        if plan.soft is None or plan.soft.categories is None:
            return replace(plan, options=replace(plan.options, proportions=tuple(free.tolist())))
        p = plan.soft.categories.copy()
        there = ~np.isnan(p[0])
        p[:, there] = with_shares(p[:, there], free)
        return replace(plan, soft=replace(plan.soft, categories=p))


def integral_range(of: Sequence[NDArray[np.intp]], shares: Floats, codes: Floats) -> float:
    """Return the integral range of classes in pixels, 1 or more: the greatest by windows of three sizes.

    ``of`` are the numbers of the classes in each training image, -1 where unknown; ``shares`` are those of all; and
    ``codes`` (classes, n) are the numbers that stand for a class: its indicators, or its score.
    """
    pixels, mean, found = sum(int((image >= 0).sum()) for image in of), shares @ codes, [1.0]
    variance = (shares @ codes**2 - mean**2).sum()
    for part in PARTS:
        squares = windows = area = 0.0
        for image in of:
            sides = [max(1, round(part * n)) for n in image.shape]
            total = _sums(image >= 0, sides)
            full = total >= max(1, total.max() / 2)
            for code, middle in zip(codes.T, mean, strict=True):
                squares += ((_sums(np.append(code, 0)[image], sides)[full] / total[full] - middle) ** 2).sum()
            windows, area = windows + full.sum(), area + total[full].sum()
        if variance and area < pixels * windows:
            found.append(squares / variance / (windows**2 / area - windows / pixels))
    return max(found)


def _sums(array: NDArray[Any], sides: Sequence[int]) -> Floats:
    """Return the sum of every window of these sides."""
    total: Any = array.astype(np.float64)
    for axis, side in enumerate(sides):
        running = np.insert(total.cumsum(axis), 0, 0, axis)
        n = running.shape[axis]
        total = running.take(range(side, n), axis) - running.take(range(n - side), axis)
    return np.asarray(total)


def spread(
    images: Pictures,
    distinct: Sequence[int],
    soft: Floats | None,
    shape: tuple[int, ...],
    given: Given | None,
    factor: float,
) -> Spread:
    """Return the distribution of the shares of classes in an output, given data.

    ``images`` are those of the candidates, and ``distinct`` the numbers of one copy of each training image; ``soft``
    (categories, *shape) are probabilities instead of the images' shares, ``given`` the data and the cells that take no
    part, and ``factor`` is that of the deviation of all shares.
    """
    from scipy.spatial.distance import cdist
    from scipy.special import ndtri

    classes, named, shares = images.classes, images.categories(0) is not None, images.proportions()
    shares = shares / shares.sum()
    below = shares.cumsum()
    codes = np.eye(len(classes)) if named else ndtri(below - shares / 2)[:, None]
    pairs = [(images.pixels[k][..., 0], images.taken[k]) for k in distinct]
    of = [np.where(taken, np.searchsorted(classes, image), -1) for image, taken in pairs]
    reach, axes = integral_range(of, shares, codes), len(shape)
    scale = (reach / (2 * pi if axes == 2 else 8 * pi)) ** (1 / axes)
    unsure = reach / sum(int((image >= 0).sum()) for image in of)  # of the images' shares
    cells = np.ones(shape, bool) if soft is None else ~np.isnan(soft[0])
    if given and given.outside is not None:
        cells &= ~given.outside
    size, p = max(1, int(cells.sum())), shares[:, None] if soft is None else soft[:, cells]
    ratio, mean, data = reach / size + unsure, codes.T @ p.mean(1), np.zeros(len(shares))
    within = 1 - min(factor**2 * ratio, WIDEST)
    if given and (told := np.argwhere(given.data & cells)).size:
        its = np.minimum(np.searchsorted(classes, given.values[tuple(told.T)][:, 0]), len(classes) - 1)
        data, few = np.bincount(its, minlength=len(classes)) / size, _some(np.arange(len(told)), MOST_DATA)
        near, expected = told[few], shares if soft is None else soft[(slice(None), *told[few].T)].T
        excess = codes[its[few]] - expected @ codes
        to_cells = np.exp(-cdist(near, _some(np.argwhere(cells), MOST_CELLS)) / scale).mean(1) + unsure
        weights = np.linalg.solve(np.exp(-cdist(near, near) / scale) + unsure, to_cells)
        mean, ratio = mean + weights @ excess, max(0.0, ratio - float(weights @ to_cells))
    if named:
        mean = np.maximum(mean, 0) / np.maximum(mean, 0).sum()
        ratio *= (p * (1 - p)).mean(1).sum() / max((mean * (1 - mean)).sum(), LEAST)
    ratio = min(factor**2 * ratio, WIDEST)
    if named:
        return Spread(np.round(mean, DIGITS), round(ratio, 2 * DIGITS), data, None)
    return Spread(mean / np.sqrt(within), ratio / within, data, ndtri(below[:-1]) / np.sqrt(within))


def _some(rows: NDArray[Any], most: int) -> NDArray[Any]:
    """Return evenly spaced rows, ``most`` of more."""
    return rows[np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(np.intp)]


def with_shares(p: Floats, shares: Floats) -> Floats:
    """Return probabilities (categories, n) whose odds are multiplied so that their means are ``shares``."""
    factors, some = np.ones((len(p), 1)), _some(p.T, MOST_CELLS).T
    for _ in range(100):
        mean = (some * factors / (some * factors).sum(0)).mean(1)
        factors[:, 0] *= shares / np.maximum(mean, LEAST)
    scaled = p * factors
    return np.asarray(scaled / scaled.sum(0))
