# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's pyramid matching (1995): pictures, solids and mixtures."""

from simdtex.methods.pyramid.options import Options

__all__ = ["Options"]
