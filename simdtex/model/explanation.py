# SPDX-License-Identifier: BSD-3-Clause
"""The explanation of a site's choice: its neighbourhood, its candidates with all their costs, and the choice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.options import Brief

SHOWN = 8
"""Number of candidates that a table or a notebook shows, in addition to the taken one."""


@dataclass(frozen=True, eq=False, repr=False)
class Neighbours(Brief):
    """The neighbourhood of a site: N neighbours in canonical order, with guides also the site itself.

    Attributes
    ----------
    offsets : (N, 2) or, of a volume, (N, 3) int32 array
        r - s, equation (3), (row, column) or (layer, row, column) in sites of the level's lattice; (0, 0) is the site
        itself, at which guides count, too.
    values : (N, C) uint16 array
        x_r, working grey levels of the picture's channels, of the structure channel, if any, and of guides. 0 where
        there is no neighbour, and 65535 where a value is unknown.
    confidence : (N, C) float32 array
        1 - t_r of equation (12), the factor of x_r - y_r: 0 for a neighbour that no relaxation has touched, or that is
        outside an open lattice or unknown, and 1 at temperature 0. Hard data count more; a guide's does not depend on
        temperature.
    source : (N, 2 or 3) int32 array
        The position in the sample of each neighbour's source, as in `simdtex.Output.source`; -1 for neighbours without
        a source, or that no relaxation has touched.
    pixels : (N, channels) array of the sample's type
        The pixel of the picture at each neighbour; 0 where there is no neighbour.
    """

    offsets: NDArray[np.int32]
    values: NDArray[np.uint16]
    confidence: NDArray[np.float32]
    source: NDArray[np.int32]
    pixels: NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class Ranked(Brief):
    """The candidates of a site with the least total costs, and the taken one.

    Attributes
    ----------
    rank : (n,) int array
        Rank of the total cost among all candidates, 0 the least; equal costs are in the order of the sample.
    place : (n, 2 or 3) int32 array
        p, the position of the candidate in the sample, as in `simdtex.Output.source`.
    values : (n, C) uint16 array
        y_p, working grey levels, as in `Neighbours`.
    around : (n, N, C) uint16 array
        y_r, working grey levels of the candidate's own neighbourhood, in the order of `Neighbours`.
    continues : (n,) int array
        The number of neighbours whose source it continues: its offset from that source is the offset of the site from
        the neighbour. The coherent search uses the 12 nearest neighbours, the exact search all.
    distance : (n,) float32 array
        d_p of equation (12), the sum over neighbours and channels of ((x_r - y_r)(1 - t_r))^2, guides left out; squared
        working grey levels, as all costs are.
    costs : dict of str to (n,) float32 arrays
        The terms added to ``distance``, in this order, if the run has them: ``guide``, equation (12) over the guides'
        channels; ``coherence``, the discount of candidates that continue a neighbour's source, 0 or less; ``use``, the
        penalty of candidates that are used too often; ``lattice``, the distance of the phases of a regular sample;
        ``data``, the distance from data between the sites; ``soft``, the cost of the candidate's kind, by its
        probability and by how often it is taken; and ``novelty``.
    total : (n,) float32 array
        The sum of ``distance`` and all costs, which the relaxation compares.
    probability : (n,) float64 array
        The LCPDF of equations (6) and (7) over all candidates of the site: exp(-(total - least total) / 2h^2), divided
        by its sum; with a density, times the share of the kernel around y_p on legal grey levels.
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
    """One relaxation of one site of the method ``mrf``, step 6.2.2 of Algorithm 1: the candidates and the choice.

    Attributes
    ----------
    site : tuple of int
        (row, column) or (layer, row, column) on the level's lattice; times 2**level, the pixel of the output.
    level, sweep : int
        0 is the finest level; sweeps of a level count from 1.
    drawn : bool
        Whether the site draws from the LCPDF (``relaxation="gibbs"``, and every coarsest level) or takes its mode, the
        candidate of least total cost or, with a density, the grey level of greatest probability (``"icm"``).
    exact : bool
        Whether all candidates of the level are evaluated, and not only the list of the coherent search.
    weighed : int
        The number of candidates evaluated.
    bandwidth : float
        h of equations (7) and (8), working grey levels.
    temperature, cooled : float
        t_s before the relaxation, and after it by equation (13), 0 to 1.
    neighbours : Neighbours
    candidates : Ranked
        In ascending order of their rank.
    taken : int
        The index in `candidates` of the taken one, or of the one that gives most to the mode of a density.
    values : (channels,) uint16 array
        x_s, the working grey levels that the site takes, of all channels but guides: those of the candidate or, with a
        density, its mode, or drawn from the kernel around the candidate's.
    channels : tuple of C str
        What each channel of working grey levels is: ``"picture"``, ``"structure"`` or ``"guide"``.
    totals : (weighed,) float32 array
        The total costs of all evaluated candidates, in ascending order.
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
    channels: tuple[str, ...]
    totals: NDArray[np.float32]
    density: NDArray[np.float64] | None = None

    @property
    def terms(self) -> NDArray[np.float64]:
        """The terms of equation (12), ((x_r - y_r)(1 - t_r))^2, of each candidate, neighbour and channel: (n, N, C).

        Those of all neighbours add up to the candidate's ``distance`` and, in channels of guides, to its ``guide``.
        """
        near = self.neighbours
        difference = near.values.astype(np.float64) - self.candidates.around
        terms: NDArray[np.float64] = (difference * near.confidence) ** 2
        return terms

    @property
    def reason(self) -> str:
        """The choice, in a sentence."""
        listed, at = self.candidates, self.taken
        search = f"the {self.weighed} candidates of the level" if self.exact else f"{self.weighed} listed candidates"
        if self.drawn:
            how = f"draws from the LCPDF of {search}; it has drawn one of probability {listed.probability[at]:.4g}"
        else:
            mode = "candidate of least total cost" if self.density is None else "grey level of greatest density"
            how = f"takes the mode, the {mode} of {search}"
        return f"Site {self.site} of level {self.level}, sweep {self.sweep}, {how}: rank {listed.rank[at]}."

    def table(self) -> str:
        """Return the choice in a sentence, and the first candidates in lines of text; a star marks the taken one."""
        listed = self.candidates
        names = ["", "rank", "place", "continues", "distance", *listed.costs, "total", "probability"]
        lines = [names]
        for n in self.shown():
            costs = [listed.distance[n], *(cost[n] for cost in listed.costs.values()), listed.total[n]]
            place = ",".join(map(str, listed.place[n].tolist()))
            numbers = [str(listed.rank[n]), place, str(listed.continues[n]), *(f"{cost:.1f}" for cost in costs)]
            lines.append(["*" if n == self.taken else "", *numbers, f"{listed.probability[n]:.4g}"])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        rows = ["  ".join(map(str.rjust, line, widths)).rstrip() for line in lines]
        return "\n".join([self.reason, *rows])

    def __repr__(self) -> str:
        """Return the choice in a sentence, since the arrays would fill pages."""
        return f"<{self.reason}>"

    def _repr_html_(self) -> str:
        """Return HTML for a notebook: the neighbourhood and the first candidates as pictures, and the table."""
        from simdtex.model.display import choice_html

        listed, shown = self.candidates, self.shown()
        captions = [
            f"{'taken: ' if n == self.taken else ''}rank {listed.rank[n]}, at {tuple(listed.place[n].tolist())}, "
            f"total {listed.total[n]:.1f}, probability {listed.probability[n]:.4g}"
            for n in shown
        ]
        return choice_html(
            self.neighbours.offsets,
            self.neighbours.pixels,
            self.neighbours.confidence.max(1),
            listed.pixels[shown],
            listed.probability[shown],
            captions,
            self.table(),
        )

    def shown(self) -> list[int]:
        """Return the indices of the candidates to show: the first by rank, and the taken one."""
        return sorted({*range(min(SHOWN, len(self.candidates.rank))), self.taken})
