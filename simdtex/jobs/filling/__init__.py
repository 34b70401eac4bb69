# SPDX-License-Identifier: BSD-3-Clause
"""Filling the holes of a picture, extending it, and making it tile: `simdtex.fill` and `simdtex.extend`."""
