# SPDX-License-Identifier: BSD-3-Clause
"""Paget and Longstaff's nonparametric multiscale Markov random field (1998)."""

from simdtex.methods.mrf.algorithm import check_fit, synthesize
from simdtex.methods.mrf.options import PRESETS, Options, make_options

__all__ = ["PRESETS", "Options", "check_fit", "make_options", "synthesize"]
