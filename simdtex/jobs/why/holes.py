# SPDX-License-Identifier: BSD-3-Clause
"""The replay of a run of `simdtex.fill`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.filling.job import Filling, paste, shifted
from simdtex.jobs.why.replay import Instant, Replay
from simdtex.machine import Machine
from simdtex.model.explanation import Explanation


class HoleReplay(Replay):
    """The replay of a run that fills one hole; raises ValueError if the job has several windows.

    The arrays of `at` are those of the whole picture, with the sites of a coarse level repeated; sites are pixels of
    the window around the hole, and sources and candidates are pixels of the picture or of the sample.
    """

    def __init__(self, job: Filling, machine: Machine, seed: int) -> None:
        windows = job.windows()
        if len(windows) > 1:
            raise ValueError(
                f"{len(windows)} holes are filled by runs of their own; fill one hole to look into its run"
            )
        (window,) = windows
        sample = job.sample_of(window)
        super().__init__(job.plan(window, sample), machine, seed)
        self._at, self._hole, self._corner, self._light = window[:2], job.hole, sample.corner, job.light
        self._whole, self.origin = job.begin(), (window.rows.start, window.cols.start)

    def at(self, sweep: int, sets: int | None = None) -> Instant:
        """Return the picture after the first ``sets`` sets of a sweep; None: all."""
        now = super().at(sweep, sets)
        pasted = partial(paste, at=self._at, hole=self._hole[self._at], level=now.level)
        image, source = self._light(pasted(self._whole.image, now.image)), shifted(now.source, self._corner)
        temperature = pasted(self._whole.temperature, now.temperature)
        relaxed = pasted(np.zeros(self._hole.shape, np.uint8), now.relaxed)
        return Instant(now.level, image, pasted(self._whole.source, source), temperature, relaxed)

    def explain_pixel(self, row: int, col: int, sweep: int = -1, sets: int | None = None, **other: Any) -> Explanation:
        """Return an explanation of a pixel's value after the first ``sets`` sets of a sweep, None: all."""
        if not self._hole[row, col]:
            raise ValueError("this pixel is not in the hole: its value is given")
        return super().explain_pixel(row - self.origin[0], col - self.origin[1], sweep, sets, **other)

    def together(self, now: Instant) -> NDArray[np.bool_]:
        """Return whether each site of the last set of an instant has a neighbour in that set."""
        return super().together(replace(now, relaxed=now.relaxed[self._at][:: 2**now.level, :: 2**now.level]))

    def _explained(self, *moment: Any, **other: Any) -> Explanation:
        why = super()._explained(*moment, **other)
        near, ranked = why.neighbours, why.candidates
        near = replace(near, source=shifted(near.source, self._corner))
        return replace(why, neighbours=near, candidates=replace(ranked, place=shifted(ranked.place, self._corner)))
