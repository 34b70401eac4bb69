# SPDX-License-Identifier: BSD-3-Clause
"""Which texture is where: nearest whole neighbourhoods, a Potts field, and a test for what is none of them."""

from simdtex.methods.classifier.options import Options

__all__ = ["Options"]
