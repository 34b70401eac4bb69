# SPDX-License-Identifier: BSD-3-Clause
"""De Bonet's multiresolution sampling (1997)."""

from simdtex.methods.multires.algorithm import Plan, Run, tiled
from simdtex.methods.multires.alpha import strain, suggest_alpha
from simdtex.methods.multires.levels import differences, thresholds
from simdtex.methods.multires.options import Options

__all__ = [
    "Options",
    "Plan",
    "Run",
    "differences",
    "strain",
    "suggest_alpha",
    "thresholds",
    "tiled",
]
