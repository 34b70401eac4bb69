# SPDX-License-Identifier: BSD-3-Clause
"""Soft data: the probability of each category, and of each training image, at every site of an output.

A probability p of a kind whose share of the sample's pixels is q costs its candidates

    w N C sigma^2 / 16 (m - ln(p / q)),    m the greatest ln(p / q) of the site,

in addition to their distance, where w is the option ``soft_weight``. So there is no cost where all probabilities equal
the shares. The cost of a kind with probability 0 exceeds all other costs: its candidates are taken only where a site
evaluates no others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.sample import Sample

EXCLUDED = np.float32(2.0**40)
"""The cost of a kind with probability 0: distances are below 2**33."""

UNIT = 1 / 16
"""The cost for w = 1 in units of N C sigma^2: the frequency of a category is then about its probability."""

STEPS = 1024
"""Steps of ln(p / q) in 1, so that the last bit of a platform's logarithm does not matter."""

LEAST = 1e-3
"""The least fair share of the output for each training image."""


class Kind(NamedTuple):
    """Kinds of candidates.

    ``of`` (n,), the kind of each candidate; ``shares`` (kinds,), the share of each kind in the sample's pixels that may
    be taken; and ``probability`` (kinds, H, W) of each kind at each site, NaN where it is not given.
    """

    of: NDArray[np.intp]
    shares: NDArray[np.float64]
    probability: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Soft:
    """Soft data of an output.

    Parameters
    ----------
    categories : (categories, H, W) or (categories, D, H, W) float64 array, optional
        The probability of each category of the first variable, in ascending order.
    images : (training images, H, W) float64 array, optional
        The probability of each training image.

    The probabilities of a site add up to 1, or are NaN where they are not given.
    """

    categories: NDArray[np.float64] | None = None
    images: NDArray[np.float64] | None = None

    @property
    def rows(self) -> int:
        """Number of kinds."""
        return sum(len(one) for one in (self.categories, self.images) if one is not None)

    @property
    def shares(self) -> tuple[float, ...] | None:
        """The share of the output for each training image; None without probabilities of these."""
        if self.images is None:
            return None
        told = self.images[:, ~np.isnan(self.images[0])]
        return tuple(max(LEAST, float(one.sum()) / max(1, one.size)) for one in told)

    def kinds(self, sample: Sample, source: NDArray[np.integer]) -> NDArray[np.uint16]:
        """Return the kinds of pixels (n,) of the sample as indices of rows of `costs`, (kinds of a pixel, n)."""
        found, before = [], 0
        for kind in self._all(sample, source):
            found.append(kind.of + before)
            before += len(kind.shares)
        return np.stack(found).astype(np.uint16)

    def costs(self, sample: Sample, step: int, rate: float) -> NDArray[np.float32]:
        """Return the cost of each kind at the sites (step i, step j), (kinds, [layers of sites,] rows, columns).

        ``rate`` is w N C sigma^2. A coarse level uses the probability at the site itself.
        """
        found = []
        for kind in self._all(sample, np.zeros(0, np.intp)):
            sites = (slice(None, None, step),) * (kind.probability.ndim - 1)
            p = kind.probability[(slice(None), *sites)]
            with np.errstate(divide="ignore", invalid="ignore"):  # of 0 and of NaN
                said = np.log(p) - np.log(kind.shares).reshape(-1, *[1] * len(sites))
                cost = rate * UNIT * np.rint((said.max(0) - said) * STEPS) / STEPS
            cost = np.where(p > 0, np.minimum(cost, EXCLUDED), EXCLUDED)
            found.append(np.where(np.isnan(p), 0, cost).astype(np.float32))
        return np.concatenate(found)

    def _all(self, sample: Sample, source: NDArray[np.integer]) -> Iterator[Kind]:
        """Yield the kinds by category, and those by training image, if their probabilities are given."""
        inside = np.flatnonzero(sample.inside)
        if self.categories is not None:
            categories = sample.pictures.categories(0)
            assert categories is not None
            of = np.searchsorted(categories, sample.own(np.concatenate([source, inside]))[:, 0])
            yield Kind(of[: source.size], _shares(of[source.size :], len(categories)), self.categories)
        if self.images is not None:
            shares = _shares(sample.picture_of(inside), len(self.images))
            yield Kind(sample.picture_of(source), shares, self.images)


def _shares(of: NDArray[np.intp], kinds: int) -> NDArray[np.float64]:
    """Return the share of each kind; a kind that does not occur has the share of one pixel."""
    counts = np.maximum(np.bincount(of, minlength=kinds), 1)
    shares: NDArray[np.float64] = counts / counts.sum()
    return shares
