# SPDX-License-Identifier: BSD-3-Clause
"""Sets of corner tiles: `simdtex.tileset`."""
