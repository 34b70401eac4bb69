# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: how well a synthesised texture represents its sample.

No single figure suffices. An output that repeats one patch is plausible and covers nothing; a copy of the whole sample
is perfect in both, and only its copying shows it. Pictures are arrays (rows, cols) or (rows, cols, channels) in any
one unit; "sample standard deviation" is everywhere the square root of the sample's variance averaged over its channels,
at full resolution (1 if the sample is constant).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from simdtex.experiments.quality.figures import (
    COPIED_PATCH,
    copying,
    coverage,
    histogram_distance,
    plausibility,
    seam,
)
from simdtex.experiments.quality.regular import (
    Ends,
    cut_end_places,
    cut_ends,
    lattice_fault_map,
    lattice_faults,
)
from simdtex.model.use import MostUsed, Use, effective_use

__all__ = [
    "COPIED_PATCH",
    "Ends",
    "MostUsed",
    "Quality",
    "Use",
    "copying",
    "coverage",
    "cut_end_places",
    "cut_ends",
    "effective_use",
    "histogram_distance",
    "lattice_fault_map",
    "lattice_faults",
    "measure",
    "plausibility",
    "seam",
]


@dataclass(frozen=True)
class Quality:
    """The figures of one output, see the functions of the same names.

    Attributes
    ----------
    plausibility, coverage, histogram_distance : float
        In sample standard deviations; 0 is best.
    copying : float
        Share of the output's patches, 0 to 1.
    seam : float
        Ratio; 1 is an invisible seam.
    lattice_faults : float or None
        Share of the output, 0 to 1, that is out of place on the sample's lattice; None if it has no lattice.
    cut_ends : float
        Ends of stripes in 10,000 pixels, minus those of the sample; negative if the sample has more.
    effective_share, most_used : float or None
        `effective_use`: a share above 0, to 1, and the use of the most used piece over its fair share; None without a
        source map.
    """

    plausibility: float
    coverage: float
    copying: float
    histogram_distance: float
    seam: float
    lattice_faults: float | None
    cut_ends: float
    effective_share: float | None = None
    most_used: float | None = None


def measure(sample: ArrayLike, output: ArrayLike, source: ArrayLike | None = None) -> Quality:
    """Return the figures of merit of one output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.
    source : array_like of int, (rows, cols, 2), optional
        The output's source map.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        The pictures are too small, or have different channels.

    Notes
    -----
    Cost: about 1.5 s on two CPU cores for a 128 x 128 sample and a 256 x 256 output in colour, most of it for
    plausibility and coverage.
    """
    found = Quality(
        copying=copying(sample, output),
        plausibility=plausibility(sample, output),
        coverage=coverage(sample, output),
        histogram_distance=histogram_distance(sample, output),
        seam=seam(output),
        lattice_faults=lattice_faults(sample, output),
        cut_ends=cut_ends(sample, output),
    )
    if source is None:
        return found
    rows, cols = np.shape(sample)[:2]
    use = effective_use(source, (rows, cols))
    return replace(found, effective_share=use.effective_share, most_used=use.most_used.times_fair_share)
