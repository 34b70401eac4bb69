# SPDX-License-Identifier: BSD-3-Clause
"""The processor array of the 1998 paper: the machine, its programs, and what they cost."""

from __future__ import annotations

from typing import Any

EXECUTED = (
    *("order", "levels", "overview", "boundary", "edges", "phases", "bandwidth", "xi", "relaxation", "pixel"),
    *("free_sweeps", "free_sites"),
)
"""The options that `synthesize` executes; all others have the paper's values."""


def __getattr__(name: str) -> Any:
    if name == "synthesize":  # checks its input as other jobs do, and so is one of them
        from importlib import import_module

        return import_module("simdtex.maspar.job").synthesize
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
