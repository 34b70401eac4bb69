# SPDX-License-Identifier: BSD-3-Clause
"""The processor array of the 1998 paper: the machine, its programs, and what they cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simdtex.run import Observer


def observers(array: str | None) -> list[Callable[[Any], Observer]]:
    """Return what makes the observer that the option ``array`` asks for, see `simdtex.driver.drive`."""
    if not array:
        return []
    from functools import partial

    from simdtex.maspar.accounting import Accounting  # loads the emulator

    return [partial(Accounting, array)]


def __getattr__(name: str) -> Any:
    if name == "synthesize":  # loads the emulator, too
        from simdtex.maspar import job

        return job.synthesize
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
