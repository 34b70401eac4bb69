# SPDX-License-Identifier: BSD-3-Clause
"""Classification of textures: nearest whole neighbourhoods, a Potts field, and a test for unknown textures."""

from simdtex.methods.classifier.options import Options

__all__ = ["Options"]
