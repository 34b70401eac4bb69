# SPDX-License-Identifier: BSD-3-Clause
"""The synthesis of a texture of any size: `simdtex.synthesize` and `simdtex.lcpdf`."""
