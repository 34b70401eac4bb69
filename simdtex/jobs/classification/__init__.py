# SPDX-License-Identifier: BSD-3-Clause
"""The classification of a picture by textures: `simdtex.classify`."""
