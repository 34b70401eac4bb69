# SPDX-License-Identifier: BSD-3-Clause
"""Why a site takes what it takes: its neighbourhood, its candidates with all their costs, and the choice among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHOWN = 8
"""Candidates that a table or a notebook shows, beside the one that is taken."""


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The neighbourhood of a site, N neighbours in canonical order; with guides, the site itself is one more.

    Attributes
    ----------
    offsets : (N, 2) or, of a volume, (N, 3) int32 array
        r - s, equation (3), (row, column) or (layer, row, column) in sites of the level's lattice; (0, 0) is the site
        itself, where guides count too.
    values : (N, C) uint16 array
        x_r, working grey levels: of the picture's channels, of the structure channel if there is one, and of guides.
        0 where there is no neighbour, and 65535 where a value is unknown.
    confidence : (N, C) float32 array
        1 - t_r of equation (12), the factor of x_r - y_r: 0 for a neighbour that no relaxation has touched, or that is
        outside an open lattice or unknown, and 1 at temperature 0. Hard data count more; a guide's does not depend on
        temperature.
    source : (N, 2 or 3) int32 array
        Where in the sample each neighbour is from, as in `simdtex.Output.source`; -1 of those that are from nowhere, or
        that no relaxation has touched.
    pixels : (N, channels) array of the sample's type
        The picture's pixel at each neighbour; 0 where there is no neighbour.
    """

    offsets: NDArray[np.int32]
    values: NDArray[np.uint16]
    confidence: NDArray[np.float32]
    source: NDArray[np.int32]
    pixels: NDArray[Any]


@dataclass(frozen=True, eq=False)
class Ranked:
    """Candidates of a site, the first of all by total cost, and the one that is taken.

    Attributes
    ----------
    rank : (n,) int array
        Of the total cost among all candidates, 0 the least; of equals the first in the sample comes first.
    place : (n, 2 or 3) int32 array
        p: where it lies in the sample, as in `simdtex.Output.source`.
    values : (n, C) uint16 array
        y_p, working grey levels, as of `Neighbours`.
    around : (n, N, C) uint16 array
        y_r, working grey levels of the candidate's own neighbourhood, in the order of `Neighbours`.
    continues : (n,) int array
        Of how many neighbours it continues the source: it stands in the sample to that source as the site stands to the
        neighbour. The coherent search looks at the 12 nearest neighbours, the exact one at all.
    distance : (n,) float32 array
        d_p of equation (12), the sum over neighbours and channels of ((x_r - y_r)(1 - t_r))^2, guides left out; squared
        working grey levels, as all costs are.
    costs : dict of str to (n,) float32 arrays
        What is added to it, in this order, where the run has it: ``guide``, equation (12) over the guides' channels;
        ``coherence``, the discount of candidates that continue a neighbour's source, 0 or less; ``use``, the penalty of
        what is used too often, or of a category that is; ``lattice``, the distance from the phases of a regular sample;
        ``data``, that from data between the sites; ``soft``, what the candidate's kind costs; and ``novelty``.
    total : (n,) float32 array
        The sum, as the relaxation compares it.
    probability : (n,) float64 array
        The LCPDF of equations (6) and (7) over all candidates of the site: exp(-(total - least total) / 2h^2) over the
        sum of these; of a density, times the share of the kernel around y_p that lies on legal grey levels.
    pixels : (n, 1 + N, channels) array of the sample's type
        The sample's pixels at the candidate and at its neighbours.
    """

    rank: NDArray[np.intp]
    place: NDArray[np.int32]
    values: NDArray[np.uint16]
    around: NDArray[np.uint16]
    continues: NDArray[np.intp]
    distance: NDArray[np.float32]
    costs: dict[str, NDArray[np.float32]]
    total: NDArray[np.float32]
    probability: NDArray[np.float64]
    pixels: NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class Explanation:
    """One relaxation of one site of the method ``mrf``, step 6.2.2 of Algorithm 1: what was chosen, of what, and why.

    Attributes
    ----------
    site : tuple of int
        (row, column) on the level's lattice, or (layer, row, column): pixel 2**level times as far in the output.
    level, sweep : int
        0 is the finest level; sweeps of a level count from 1.
    drawn : bool
        Whether the site draws from the LCPDF (``relaxation="gibbs"``, and every coarsest level) or takes its mode, the
        candidate of least total cost (``"icm"``).
    exact : bool
        Whether all candidates of the level are weighed, or the list of the coherent search.
    weighed : int
        How many candidates are weighed.
    bandwidth : float
        h of equations (7) and (8), working grey levels.
    temperature, cooled : float
        t_s before the relaxation, and after it by equation (13), 0 to 1.
    neighbours : Neighbours
    candidates : Ranked
        In ascending order of their rank.
    taken : int
        Which of `candidates` is taken.
    values : (channels,) uint16 array
        x_s: working grey levels that the site takes, of all channels but guides. Those of the candidate or, of a
        density, drawn from the kernel around them.
    density : (channels, greys) float64 array or None
        With ``pixel="density"``, the LCPDF of each channel over the legal working grey levels; every row adds up to 1.
    """

    site: tuple[int, ...]
    level: int
    sweep: int
    drawn: bool
    exact: bool
    weighed: int
    bandwidth: float
    temperature: float
    cooled: float
    neighbours: Neighbours
    candidates: Ranked
    taken: int
    values: NDArray[np.uint16]
    density: NDArray[np.float64] | None = None

    @property
    def reason(self) -> str:
        """The choice in a sentence."""
        found, at = self.candidates, self.taken
        search = f"the {self.weighed} candidates of the level" if self.exact else f"{self.weighed} listed candidates"
        if self.drawn:
            how = f"draws from the LCPDF of {search}; it has drawn one of probability {found.probability[at]:.4g}"
        else:
            how = f"takes the mode, the candidate of least total cost of {search}"
        return f"Site {self.site} of level {self.level}, sweep {self.sweep}, {how}: rank {found.rank[at]}."

    def table(self) -> str:
        """Return the choice in a sentence and the first candidates in lines of text; a star marks the taken one."""
        found = self.candidates
        names = ["", "rank", "place", "continues", "distance", *found.costs, "total", "probability"]
        lines = [names]
        for n in self.shown():
            costs = [found.distance[n], *(cost[n] for cost in found.costs.values()), found.total[n]]
            place = ",".join(map(str, found.place[n].tolist()))
            numbers = [str(found.rank[n]), place, str(found.continues[n]), *(f"{cost:.1f}" for cost in costs)]
            lines.append(["*" if n == self.taken else "", *numbers, f"{found.probability[n]:.4g}"])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        rows = ["  ".join(map(str.rjust, line, widths)).rstrip() for line in lines]
        return "\n".join([self.reason, *rows])

    def __repr__(self) -> str:
        """Return the choice in a sentence; arrays would fill pages."""
        return f"<{self.reason}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the neighbourhood and the first candidates as pictures, and the table."""
        from simdtex.model.display import choice_html

        found, shown = self.candidates, self.shown()
        captions = [
            f"{'taken: ' if n == self.taken else ''}rank {found.rank[n]}, at {tuple(found.place[n].tolist())}, "
            f"total {found.total[n]:.1f}, probability {found.probability[n]:.4g}"
            for n in shown
        ]
        return choice_html(
            self.neighbours.offsets,
            self.neighbours.pixels,
            self.neighbours.confidence.max(1),
            found.pixels[shown],
            found.probability[shown],
            captions,
            self.table(),
        )

    def shown(self) -> list[int]:
        """Return which candidates a table or a picture shows: the first by rank, and the one that is taken."""
        return sorted({*range(min(SHOWN, len(self.candidates.rank))), self.taken})
