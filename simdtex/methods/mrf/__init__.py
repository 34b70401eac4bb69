# SPDX-License-Identifier: BSD-3-Clause
"""Paget and Longstaff's nonparametric multiscale Markov random field (1998)."""

from simdtex.methods.mrf.level import check_fit, number_of_levels
from simdtex.methods.mrf.options import PRESETS, Options, begins, make_options
from simdtex.methods.mrf.plan import Plan, plan

__all__ = ["PRESETS", "Options", "Plan", "begins", "check_fit", "make_options", "number_of_levels", "plan"]
