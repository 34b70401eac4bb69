# SPDX-License-Identifier: BSD-3-Clause
"""The states of a run at the ends of its levels, from which a run with other options goes on where it differs."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any

from simdtex.checkpoint import size
from simdtex.driver import Keep
from simdtex.methods import mrf

LARGEST = 2**27
"""Bytes of a state that is held, at most."""


class Levels:
    """The states of a run of ``mrf`` at the end of each level.

    Parameters
    ----------
    key : object
        The job without its options; None if no state may be held.
    options : simdtex.methods.mrf.Options
    before : Levels, optional
        Those of an earlier run; if it is of the same job, the run goes on from the levels that are the same.
    """

    def __init__(self, key: Any, options: mrf.Options, before: Levels | None = None) -> None:
        self.key, self.options = key, options
        self._states: dict[int, Any] = {}
        if before is not None and key is not None and before.key == key and before._states:
            first = mrf.begins(before.options, options, 1 + max(before._states))
            self._states = {level: state for level, state in before._states.items() if level > first}

    @property
    def keep(self) -> Keep:
        """The state that the run begins with, and what takes the states at the ends of levels."""
        found = deepcopy(self._states[min(self._states)]) if self._states else None
        return Keep(found, self._offer if self.key is not None else Keep().offer)

    @property
    def level(self) -> int | None:
        """The level after which the run goes on; None if it begins anew."""
        return min(self._states) if self._states else None

    def _offer(self, info: Any, tree: Callable[[], Any]) -> None:
        """Hold the state if a level ends with it."""
        if not getattr(info, "ended", False):
            return
        found = tree()
        if size(found) <= LARGEST:
            self._states[info.level] = deepcopy(found)  # the run goes on with parts of it
