# SPDX-License-Identifier: BSD-3-Clause
"""The states of a run at the ends of its levels, from which a run with other options goes on where it differs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.checkpoints.keeper import CURRENT
from simdtex.checkpoints.tree import size
from simdtex.methods import mrf

LARGEST = 2**27
"""Bytes of a state that is held, at most."""


class Levels(Keep):
    """Holds the state of a run of ``mrf`` at the end of each level.

    Parameters
    ----------
    key : object
        What the run is of, but for its options; None where nothing may be held.
    options : simdtex.methods.mrf.Options
    before : Levels, optional
        Those of an earlier run, which this one goes on from where that is of the same.
    """

    running = False

    def __init__(self, key: Any, options: mrf.Options, before: Levels | None = None) -> None:
        self.key, self.options = key, options
        self._states: dict[int, Any] = {}
        if before is not None and key is not None and before.key == key and before._states:
            first = mrf.begins(before.options, options, 1 + max(before._states))
            self._states = {level: state for level, state in before._states.items() if level > first}

    def begin(self, job: str, seed: int | None, fresh: Callable[[], int], inputs: dict[str, Any]) -> int:
        """Give the seed of a job."""
        return fresh() if seed is None else seed

    def on(self, device: str) -> Keep:
        """Itself, or nothing where nothing is held."""
        return NOTHING if self.key is None else self

    @property
    def found(self) -> Any:
        """The state of the finest level that is the same."""
        return deepcopy(self._states[min(self._states)]) if self._states else None

    @property
    def level(self) -> int | None:
        """The level after which the run goes on; None where it begins anew."""
        return min(self._states) if self._states else None

    def offer(self, state: Callable[[], Any], ended: int | None = None) -> bool:
        """Hold it where a level ends."""
        if ended is None:
            return False
        found = state()
        if size(found) > LARGEST:
            return False
        self._states[ended] = deepcopy(found)  # the run goes on with parts of it
        return True

    def within(self, around: Callable[[], Any], found: Any) -> Keep:
        """Nothing is held of a part of a run."""
        return NOTHING

    @contextmanager
    def around(self) -> Iterator[None]:
        """Have the run in this block go on from here, and its states held."""
        token = CURRENT.set(self)
        try:
            yield
        finally:
            CURRENT.reset(token)
