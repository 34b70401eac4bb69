# SPDX-License-Identifier: BSD-3-Clause
"""Sites with given values, which do not change, and soft data: the probability of categories and pictures at sites.

A given site, hard data or the known part of a picture, has the temperature 0 from the start and never relaxes. At a
coarse level, a datum between the sites is compared at its own position (`simdtex.methods.mrf.costs`). A guide's value
between the sites moves to the nearest site without a value, for that level only; of several values for a site, the
nearest, and of equally near ones the first, row by row.

A probability p of a kind (a category, or a training image) whose share of the sample's pixels is q costs its candidates

    w N C sigma^2 / 16 (m - ln(p / q)),    m the greatest ln(p / q) of the site,

in addition to their distance, where w is the option ``soft_weight``. So there is no cost where all probabilities equal
the shares. The cost of a kind with probability 0 exceeds all other costs: its candidates are taken only where a site
evaluates no others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.guide import UNKNOWN, Colocated
from simdtex.model.lattice import Grid
from simdtex.model.pictures import Pictures, halved
from simdtex.model.sample import Sample

REDUCED = 8
"""The divisor of the levels of a variable known at most sites: else it outweighs the others, which become rough."""


@dataclass(frozen=True, eq=False)
class Given:
    """The given values of an output, of the sample's type.

    A site with some variables given and others not relaxes, guided by the given ones, which the output shows. Sites
    ``outside`` take no part: they are known, nothing is compared with their values, and the output shows these.
    """

    values: NDArray[Any]  # (H, W, C)
    known: NDArray[np.bool_]  # (H, W, C)
    place: NDArray[np.int32] | None = None  # (H, W, 2 or 3), the position in the sample; -1 from elsewhere
    suggests: bool = True  # whether sites from the sample suggest candidates that continue them
    outside: NDArray[np.bool_] | None = None  # (H, W)

    @cached_property
    def whole(self) -> NDArray[np.bool_]:
        """Sites with all variables given, (H, W)."""
        return np.asarray(self.known.all(-1))

    @property
    def given_mask(self) -> NDArray[np.bool_]:
        """Mask of the given values at sites that take part, (H, W, C)."""
        return self.known if self.outside is None else self.known & ~self.outside[..., None]

    @property
    def data(self) -> NDArray[np.bool_]:
        """Sites that take part, with all variables given, (H, W)."""
        return self.whole if self.outside is None else self.whole & ~self.outside

    @cached_property
    def partly(self) -> bool:
        """Whether there are sites with some variables given and others not."""
        return bool((self.known.any(-1) & ~self.whole).any())

    def colocated(self, pictures: Pictures) -> Colocated:
        """Return the known variables of sites with unknown ones, as a guide for the unknown ones."""
        return Colocated(pictures, self.values, self.known & ~self.whole[..., None], self.reduced(pictures))

    def reduced(self, pictures: Pictures) -> int:
        """Return the divisor of the levels of variables that guide others: more than 1 for scores at most sites."""
        guiding = self.known.any(-1) & ~self.whole
        return REDUCED if pictures.scores and 2 * np.count_nonzero(guiding) > guiding.size else 1

    def halved(self) -> Given:
        """Return the given values of an output of half the size: the means of squares of 2x2 sites, all four given."""
        place = None if self.place is None else self.place[::2, ::2]
        return Given(halved(self.values, all_of_it=True), halved(self.known, all_of_it=True), place, self.suggests)

    def shown(self, picture: NDArray[Any], grid: Grid) -> NDArray[Any]:
        """Return the picture (rows, cols, C) of a level, with the known values at its sites."""
        sites = (slice(None, None, grid.step),) * len(grid.shape)
        shown: NDArray[Any] = np.where(self.known[sites], self.values[sites], picture)
        return shown


class Stand(NamedTuple):
    """Sites, and the values between the sites that move to them: ``site`` and ``datum``, (n,) pixel indices."""

    site: NDArray[np.int64]
    datum: NDArray[np.int64]


MOST_NEAR = 8
"""The most data between the sites of a level that a site is compared with: the nearest ones."""

NO_STAND_IN = Stand(np.zeros(0, np.int64), np.zeros(0, np.int64))


def stand_ins(known: NDArray[np.bool_], grid: Grid) -> Stand:
    """Return the sites of a level that receive values of the mask ``known`` from between the sites, in order."""
    step, place = grid.step, between(known, grid).astype(np.int64)
    nearest = (place + step // 2) // step
    if not grid.torus:
        nearest = np.minimum(nearest, np.array(grid.shape) - 1)
    apart = ((np.minimum(nearest * step, known.shape) - place) ** 2).sum(1)
    site = np.ravel_multi_index(tuple((nearest % grid.shape * step).T), known.shape)
    datum = np.ravel_multi_index(tuple(place.T), known.shape)
    order = np.lexsort((datum, apart, site))
    site, datum = site[order], datum[order]
    first = np.ones(site.size, bool)
    first[1:] = site[1:] != site[:-1]
    return Stand(site[first].astype(np.int64), datum[first].astype(np.int64))


def between(known: NDArray[np.bool_], grid: Grid) -> NDArray[np.int32]:
    """Return the places (n, 2 or 3) of data between the sites, none of which is known at the corners of their cell."""
    step, at_sites = grid.step, grid.decimated(known)
    place = np.argwhere(known)
    place = place[(place % step > 0).any(1)]
    represented = np.zeros(len(place), bool)
    for corner in product((0, 1), repeat=known.ndim):
        needed = (place % step >= corner).all(1)  # a datum in a site's row has none above or below
        site = place // step + corner
        site = site % at_sites.shape if grid.torus else np.minimum(site, np.array(at_sites.shape) - 1)
        represented |= needed & at_sites[tuple(site.T)]
    return place[~represented].astype(np.int32)


def nearest_data(
    place: NDArray[np.integer], grid: Grid, order: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of sites and of the `MOST_NEAR` data nearest to each, and their offsets in pixels."""
    step, reach, axes = grid.step, isqrt(order), place.shape[1]
    pieces: list[list[NDArray[np.int64]]] = [[], [], []]
    for by in product(range(-reach, reach + 2), repeat=axes):
        site = place.astype(np.int64) // step + by
        apart = place - site * step
        near = ((apart**2).sum(1) <= order * step**2) & (abs(apart).max(1) <= reach * step)
        site = (site - grid.first) % grid.whole.shape if grid.torus else np.subtract(site, grid.first)
        near &= ((site >= 0) & (site < grid.shape)).all(1)
        pieces[0].append(np.ravel_multi_index(tuple(site[near].T), grid.shape))
        pieces[1].append(np.flatnonzero(near))
        pieces[2].append(apart[near])
    site, datum, apart = (np.concatenate(parts) for parts in pieces)
    sorting = np.lexsort((datum, (apart**2).sum(1), site))
    site, datum, apart = site[sorting], datum[sorting], apart[sorting]
    rank = np.arange(site.size) - np.searchsorted(site, site)
    return site[rank < MOST_NEAR], datum[rank < MOST_NEAR], apart[rank < MOST_NEAR]


class GivenPlanes(NamedTuple):
    """The given values in the layout of a run's field; a site that takes no part is known, and `UNKNOWN` in all."""

    values: NDArray[np.uint16]  # (C, H, W), `UNKNOWN` in unknown channels
    source: NDArray[np.int32]  # (H, W), -1 without a source
    known: NDArray[np.bool_]  # (H, W)

    @property
    def data(self) -> NDArray[np.bool_]:
        """Known sites that take part, (H, W)."""
        return np.asarray(self.known & (self.values != UNKNOWN).any(0))


def planes(data: Given, sample: Sample) -> GivenPlanes:
    """Return the given values in the channels of ``sample``; a site from the sample has all of them."""
    shape = data.whole.shape
    values = np.full((sample.channels, *shape), UNKNOWN, np.uint16)
    source = np.full(shape, -1, np.int32) if data.place is None else sample.index(data.place)
    source = np.where(data.data, source, np.int32(-1))
    values[: sample.shown, data.data] = sample.scale.levels(data.values[data.data])
    values[:, source >= 0] = sample.working[: sample.channels, source[source >= 0]]
    if not data.suggests:
        source[:] = -1
    return GivenPlanes(values, source, data.whole)


EXCLUDED = np.float32(2.0**40)
"""The cost of a kind with probability 0: distances are below 2**33."""

UNIT = 1 / 16
"""The cost for w = 1 in units of N C sigma^2: the frequency of a category is then about its probability."""

STEPS = 1024
"""Steps of ln(p / q) in 1, so that the last bit of a platform's logarithm does not matter."""

ALIKE, LEAST = 16, 256
"""Steps of a probability that cells of a region have in common, and the fewest cells of a region of its own."""

LEAST_SHARE = 1e-3
"""The least fair share of the output for each training image."""


class Kind(NamedTuple):
    """Kinds of candidates."""

    of: NDArray[np.intp]  # (n,), the kind of each candidate
    shares: NDArray[np.float64]  # (kinds,), in the pixels that may be taken
    probability: NDArray[np.float64]  # (kinds, H, W), NaN where it is not given


@dataclass(frozen=True, eq=False)
class Soft:
    """Soft data of an output: probabilities that add up to 1 at a site, or are NaN. A side of 1 is repeated."""

    categories: NDArray[np.float64] | None = None  # (categories, [D,] H, W), in ascending order
    images: NDArray[np.float64] | None = None  # (training images, [D,] H, W)

    @property
    def rows(self) -> int:
        """Number of kinds."""
        return sum(len(those) for those in (self.categories, self.images) if those is not None)

    @property
    def shares(self) -> tuple[float, ...] | None:
        """The share of the output for each training image; None without probabilities of these."""
        if self.images is None:
            return None
        told = self.images[:, ~np.isnan(self.images[0])]
        return tuple(max(LEAST_SHARE, float(image.sum()) / max(1, image.size)) for image in told)

    def kinds(self, sample: Sample, source: NDArray[np.integer]) -> NDArray[np.uint16]:
        """Return the kinds of pixels (n,) of the sample as indices of rows of `costs`, (kinds of a pixel, n)."""
        rows, before = [], 0
        for kind in self._all(sample, source):
            rows.append(kind.of + before)
            before += len(kind.shares)
        return np.stack(rows).astype(np.uint16)

    def costs(self, sample: Sample, grid: Grid, rate: float) -> NDArray[np.float32]:
        """Return the cost of each kind at the sites, (kinds, *grid.shape); ``rate`` is w N C sigma^2."""
        costs = []
        for kind in self._all(sample, np.zeros(0, np.intp)):
            p = kind.probability
            p = np.broadcast_to(p, (len(p), *grid.shape)) if p[0].size == 1 else grid.cut(grid.decimated(p))
            with np.errstate(divide="ignore", invalid="ignore"):  # of 0 and of NaN
                said = np.log(p) - np.log(kind.shares).reshape(-1, *[1] * len(grid.shape))
                cost = rate * UNIT * np.rint((said.max(0) - said) * STEPS) / STEPS
            cost = np.where(p > 0, np.minimum(cost, EXCLUDED), EXCLUDED)
            costs.append(np.where(np.isnan(p), 0, cost).astype(np.float32))
        return np.concatenate(costs)

    def regions(self) -> NDArray[np.int32]:
        """Return the region of each cell, connected cells with like probabilities of categories; -1 without these."""
        from scipy.ndimage import label  # only for maps, since it loads slowly

        p = self.categories
        assert p is not None
        told, of = ~np.isnan(p[0]), np.full(p.shape[1:], -1, np.int32)
        alike = np.unique(np.rint(p[:, told] * ALIKE), axis=1, return_inverse=True)[1].ravel()
        group, first = np.full(p.shape[1:], -1), 0
        group[told] = alike
        for k in range(alike.max(initial=-1) + 1):
            parts, _ = label(group == k)
            large = np.bincount(parts.ravel()) >= LEAST
            large[0] = False
            of[group == k] = first + np.where(large, large.cumsum(), 0)[parts[group == k]]
            first += 1 + int(large.sum())
        _, of[told] = np.unique(of[told], return_inverse=True)
        return of

    def _all(self, sample: Sample, source: NDArray[np.integer]) -> Iterator[Kind]:
        """Yield the kinds by category, and those by training image, if their probabilities are given."""
        inside = np.flatnonzero(sample.inside)
        if self.categories is not None:
            shares = _shares(sample.category(inside), len(self.categories))
            yield Kind(sample.category(source), shares, self.categories)
        if self.images is not None:
            shares = _shares(sample.picture_of(inside), len(self.images))
            yield Kind(sample.picture_of(source), shares, self.images)


def _shares(of: NDArray[np.intp], kinds: int) -> NDArray[np.float64]:
    """Return the share of each kind; a kind that does not occur has the share of one pixel."""
    counts = np.maximum(np.bincount(of, minlength=kinds), 1)
    shares: NDArray[np.float64] = counts / counts.sum()
    return shares
