# SPDX-License-Identifier: BSD-3-Clause
"""Paget and Longstaff's nonparametric multiscale Markov random field (1998)."""

from simdtex.methods.mrf.conditioning import Data
from simdtex.methods.mrf.level import check_fit, number_of_levels
from simdtex.methods.mrf.options import Options, begins
from simdtex.methods.mrf.plan import MrfPlan, check_categories, plan

__all__ = ["Data", "MrfPlan", "Options", "begins", "check_categories", "check_fit", "number_of_levels", "plan"]
