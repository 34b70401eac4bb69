# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's pyramid matching (1995): pictures, solids and mixtures."""

from simdtex.methods.pyramid.algorithm import MEMORY, match_texture, synthesize
from simdtex.methods.pyramid.matcher import TIES
from simdtex.methods.pyramid.options import Options, make_options

__all__ = ["MEMORY", "TIES", "Options", "make_options", "match_texture", "synthesize"]
