# SPDX-License-Identifier: BSD-3-Clause
"""Mixtures of textures and solid textures, by the method ``pyramid``: `simdtex.mix`, `simdtex.synthesize_solid`."""
