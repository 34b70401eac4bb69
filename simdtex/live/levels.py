# SPDX-License-Identifier: BSD-3-Clause
"""The states of a run at the ends of its levels, from which a run with other options can start."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any

from simdtex.checkpoint import Checkpointing, pack
from simdtex.methods import mrf

MAX_BYTES = 2**27
"""The most bytes of a kept state."""


class Levels:
    """The states of a run of ``mrf`` at the end of each level.

    ``key`` is the job without its options; None keeps no state. If an earlier run, ``before``, has the same key, this
    run starts after the last level that is the same in both.
    """

    def __init__(self, key: Any, options: mrf.Options, before: Levels | None = None) -> None:
        self._key, self._options = key, options
        self._states: dict[int, Any] = {}
        if before is not None and key is not None and before._key == key and before._states:
            first = mrf.begins(before._options, options, 1 + max(before._states))
            self._states = {level: state for level, state in before._states.items() if level > first}

    @property
    def level(self) -> int | None:
        """The level after which the run starts; None if it starts from the beginning."""
        return min(self._states, default=None)

    @property
    def checkpointing(self) -> Checkpointing:
        """The state that the run starts from, and the function that receives its states."""
        found = None if self.level is None else deepcopy(self._states[self.level])
        return Checkpointing(found, self._offer)

    def _offer(self, info: Any, tree: Callable[[], Any]) -> None:
        """Keep the state at the end of a level."""
        if self._key is None or not getattr(info, "ended", False):
            return
        state = tree()
        if sum(array.nbytes for array in pack(state)[1]) <= MAX_BYTES:
            self._states[info.level] = deepcopy(state)  # the run changes parts of it
