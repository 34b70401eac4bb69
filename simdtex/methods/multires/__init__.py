# SPDX-License-Identifier: BSD-3-Clause
"""De Bonet's multiresolution sampling (1997)."""

from simdtex.methods.multires.options import Options

__all__ = ["Options"]
