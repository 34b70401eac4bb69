# SPDX-License-Identifier: BSD-3-Clause
"""De Bonet's multiresolution sampling (1997)."""

from simdtex.methods.multires.algorithm import (
    STRETCH,
    STRETCHES,
    Options,
    differences,
    make_options,
    resample,
    strain,
    suggest_alpha,
    synthesize,
    thresholds,
    tiled,
)

__all__ = [
    "STRETCH",
    "STRETCHES",
    "Options",
    "differences",
    "make_options",
    "resample",
    "strain",
    "suggest_alpha",
    "synthesize",
    "thresholds",
    "tiled",
]
