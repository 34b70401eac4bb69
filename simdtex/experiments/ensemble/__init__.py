# SPDX-License-Identifier: BSD-3-Clause
"""Judging an ensemble of realisations: what it leaves open, and whether it is like its training image.

An ensemble is an array (realisations, rows, cols). Categorical ones hold the values of categories, continuous ones
integers or floats. The training image is (rows, cols), of the same kind and of any size. Axis 0 is down, axis 1 to the
right, lags are pixels. No figure is enough alone: see the page on ensembles.
"""

from __future__ import annotations

from simdtex.experiments.ensemble.arrays import categories_of
from simdtex.experiments.ensemble.channels import channels
from simdtex.experiments.ensemble.connectivity import Connectivity, connectivity, dead_ends
from simdtex.experiments.ensemble.distance import Anodi, anodi
from simdtex.experiments.ensemble.summary import Summary, summary

__all__ = [
    "Anodi",
    "Connectivity",
    "Summary",
    "anodi",
    "categories_of",
    "channels",
    "connectivity",
    "dead_ends",
    "summary",
]
