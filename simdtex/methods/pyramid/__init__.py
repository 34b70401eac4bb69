# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's pyramid matching (1995): pictures, solids and mixtures."""

from simdtex.methods.pyramid.algorithm import MEMORY, TIES, Options, make_options, match_texture, synthesize

__all__ = ["MEMORY", "TIES", "Options", "make_options", "match_texture", "synthesize"]
