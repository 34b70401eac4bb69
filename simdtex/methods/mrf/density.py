# SPDX-License-Identifier: BSD-3-Clause
"""The local conditional probability density function at single sites, equations (4) to (8)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Machine
from simdtex.methods.mrf import lcpdf
from simdtex.methods.mrf.conditioning import Data
from simdtex.methods.mrf.costs import Costs, ScatteredData
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.relax import AllCandidates, Relaxation
from simdtex.methods.mrf.square import TAIL, square_of
from simdtex.model.lattice import Grid
from simdtex.model.sample import Places, Sample

AT_ONCE = 4096
"""The most sites whose tables are made together."""

PAIRS = 2**22
"""The most pairs of sites and data, or of sites and kinds, that are processed together."""


def lcpdf_at(
    machine: Machine,
    field: Field,
    sample: Sample,
    sites: NDArray[np.int32],
    offsets: NDArray[np.int32],
    grid: Grid,
    bandwidth: float,
    estimator: str,
) -> NDArray[np.float64]:
    """Return P(x_s | x_r, r in N_s) at ``sites``, (S, greys) float64; every row adds up to 1.

    ``field`` holds the image in working grey levels and its temperatures, and its sources are not read; the sample
    has one channel; ``sites`` are their numbers, and ``bandwidth`` is h in units of h_opt, equation (8). ``estimator``
    is ``"parzen"``, equations (6) to (8), or ``"histogram"``, counts of exact matches, (4) and (5). Raises ValueError
    if no neighbourhood of the sample matches that of a site.
    """
    greys, places = sample.top + 1, sample.places(offsets, 1)
    h = bandwidth * lcpdf.optimal_bandwidth(sample.variance, places.positions.size, len(offsets) + 1)
    relaxation = _all(machine, sample, places, grid, lcpdf.window(h, sample.top))
    rows = [np.zeros((0, greys))]
    step = min(machine.chunk(3 * places.positions.size, len(offsets), 1, 12 * greys), AT_ONCE)
    for first in range(0, len(sites), step):
        here = machine.put(sites[first : first + step])
        if estimator == "parzen":
            density = machine.get(lcpdf.density(machine, here, field, relaxation)).astype(np.float64)
            rows.append(density / np.cumsum(density, 1)[:, -1:])
        else:
            counts = machine.get(lcpdf.histogram(machine, here, field, relaxation, greys))
            rows.append(_shares(counts, sites[first : first + step], grid))
    return np.concatenate(rows)


def _all(machine: Machine, sample: Sample, places: Places, grid: Grid, window: lcpdf.ParzenWindow) -> Relaxation:
    """Return the relaxation whose density is the LCPDF of all candidates, without costs."""
    candidates = sample.candidates(machine, places)
    free = Costs(machine.put(np.zeros(candidates.size + TAIL, np.float32)))
    proposal = AllCandidates(candidates, square_of(machine, sample, places))
    choice = lcpdf.SiteChoice(False, True, window)
    return Relaxation(grid, machine.put(places.offsets), proposal, free, choice, xi=-1, seed=0, level=0)


def _shares(counts: NDArray[np.uint32], sites: NDArray[np.int32], grid: Grid) -> NDArray[np.float64]:
    total = counts.sum(1, keepdims=True)
    if not total.all():
        row, col = divmod(int(sites[(total[:, 0] == 0).argmax()]), grid.cols)
        raise ValueError(
            f"no neighbourhood of the sample equals that of site ({row}, {col}); "
            'use fewer grey levels, a smaller order, or estimator="parzen"'
        )
    shares: NDArray[np.float64] = counts / total
    return shares


def near(
    sites: NDArray[np.integer], place: NDArray[np.integer], most: int, reach: int
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the nearest data of sites (S, axes): indices (S, m) into ``place`` (n, axes), and the counts, (S,).

    A site has at most ``most`` data, none farther away than ``reach``; of equally far data, the first. Indices beyond
    the count of a site are meaningless.
    """
    squared = ((sites[:, None] - place[None]).astype(np.int64) ** 2).sum(-1)
    key = squared * len(place) + np.arange(len(place))
    most = min(most, len(place))
    nearest = np.argpartition(key, range(most), 1)[:, :most] if most else np.zeros((len(sites), 0), np.intp)
    return nearest, (np.take_along_axis(squared, nearest, 1) <= reach**2).sum(1)


def given_data(
    machine: Machine,
    sample: Sample,
    of: NDArray[np.integer],
    data: Data,
    sites: NDArray[np.integer],
    nearest: int,
    bandwidth: float,
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.float64]]]:
    """Yield the LCPDF of sites given data alone, equations (6), (7) and (12): indices of sites, and a row for each.

    A neighbour without a datum has t = 1, and no weight. Each datum is compared at its own offset, so the margin of
    ``sample`` limits the distance of data. ``of`` (n,) is the kind of each candidate, from 0; a row holds the
    probability of each kind and adds up to 1. ``sites`` (S, axes) are [layers,] rows and columns; ``bandwidth`` is
    h in units of h_opt, equation (8), for the number of data of the site.
    """
    places = sample.places(np.zeros((1, sites.shape[1]), np.int32), 1)  # the offset of no neighbour
    strides = np.array([sample.layer * sample.cols, sample.cols, 1])[-sites.shape[1] :]
    line = (1,) * (sites.shape[1] - 1)
    kinds, size = int(of.max()) + 1, places.positions.size
    window = lcpdf.window(1, sample.top)._replace(gauss=np.ones(1, np.float32), radius=0, top=kinds - 1)
    relaxation = _all(machine, sample, places, Grid((*line, 1)), window)
    square = relaxation.proposal.square
    kind = np.zeros(square.levels.shape[1], np.float32)
    kind[machine.get(square.at)] = of
    category = machine.put(kind[None])
    step = max(1, min(machine.chunk(3 * size, 1, sample.channels, 12 * kinds), AT_ONCE, PAIRS // kinds))
    together = max(1, PAIRS // max(1, len(data.place)))
    for first in range(0, len(sites), together):
        part = sites[first : first + together]
        numbers, counts = near(part, data.place, nearest, sample.margin)
        for count in np.unique(counts).tolist():
            h = bandwidth * lcpdf.optimal_bandwidth(sample.variance, size, sample.channels * (count + 1))
            scale = lcpdf.window(h, sample.top).scale
            those = np.flatnonzero(counts == count)
            for begin in range(0, those.size, step):
                here = those[begin : begin + step]
                told = numbers[here, :count]
                apart = (data.place[told] - part[here][:, None]) @ strides
                scattered = ScatteredData(
                    machine.put(np.arange(here.size + 1, dtype=np.int32) * np.int32(count)),
                    machine.put(np.append(apart.ravel(), 0).astype(np.int32)),
                    machine.put(np.append(data.values[told.ravel()], data.values[:1], 0)),
                    np.float32(1),
                )
                shape = (*line, here.size)
                planes = ((sample.channels, *shape), 0, np.uint16), (shape, -1, np.int32), (shape, 1024, np.uint16)
                field = Field(*(machine.put(np.full(*plane)) for plane in planes))
                rule = relaxation._replace(
                    grid=Grid(shape, torus=False),
                    costs=relaxation.costs._replace(scattered=scattered),
                    choice=relaxation.choice._replace(window=window._replace(scale=scale)),
                )
                numbered = machine.put(np.arange(here.size, dtype=np.int32))
                mass = machine.get(lcpdf.density(machine, numbered, field, rule, category)).astype(np.float64)
                yield first + here, mass / np.cumsum(mass, 1)[:, -1:]
