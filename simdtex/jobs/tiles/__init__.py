# SPDX-License-Identifier: BSD-3-Clause
"""Outputs larger than one machine, in tiles: `simdtex.TileStore`. The extra ``distributed`` brings the libraries."""
