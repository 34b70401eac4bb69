# SPDX-License-Identifier: BSD-3-Clause
"""Figures of an ensemble of realisations: its uncertainty, and its likeness to the training image.

An ensemble is an array (realisations, rows, cols). Categorical ones hold the values of categories, continuous ones
integers or floats. The training image is (rows, cols), of the same kind and of any size. Axis 0 is down, axis 1 to the
right, lags are pixels. No single figure suffices: see the page on ensembles.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simdtex.experiments.ensemble.arrays import categories_of
from simdtex.experiments.ensemble.connectivity import Connectivity, connectivity, dead_ends
from simdtex.experiments.ensemble.copies import copied, copies
from simdtex.experiments.ensemble.distance import Anodi, anodi
from simdtex.experiments.ensemble.summary import Summary, summary
from simdtex.io.image import read

__all__ = [
    "Anodi",
    "Connectivity",
    "Summary",
    "anodi",
    "categories_of",
    "channels",
    "connectivity",
    "copied",
    "copies",
    "dead_ends",
    "summary",
]


def channels() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a training image of sinuous channels, and another map of the same kind for taking hard data from it.

    Channels are about 8 pixels wide and cover 0.3 of each map. They meander from left to right, cross, part and join,
    and a few end inside. ``benchmarks/channels.py`` draws them, and more of any size.

    Returns
    -------
    training, hidden : ndarray of uint8, (256, 256)
        1 in channels, 0 elsewhere.
    """
    both = read(Path(__file__).with_name("channels.png")).pixels
    return both[:, :256], both[:, 256:]
