# SPDX-License-Identifier: BSD-3-Clause
"""A look inside a run of the method ``mrf``: `simdtex.explain` and `simdtex.replay`."""
