# SPDX-License-Identifier: BSD-3-Clause
"""The replay of a run of `simdtex.fill`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from simdtex.jobs.filling.job import Filling, paste, shifted
from simdtex.jobs.why.replay import Instant, Replay, Sweep
from simdtex.machine import Machine
from simdtex.model.explanation import Explanation


class HoleReplay:
    """The replay of a run that fills one hole, with the methods of `simdtex.jobs.why.replay.Replay`.

    The arrays of `at` are those of the whole picture, with the sites of a coarse level repeated; sites are pixels of
    the window around the hole, and sources and candidates are pixels of the picture or of the sample. Raises ValueError
    if the job has several windows.
    """

    def __init__(self, job: Filling, machine: Machine, seed: int) -> None:
        parts = job.windows()
        if len(parts) > 1:
            raise ValueError(f"{len(parts)} holes are filled by runs of their own; fill one hole to look into its run")
        (window,) = parts
        sample = job.sample_of(window)
        self._replay = Replay(job.plan(window, sample), machine, seed)
        self._at, self._hole, self._corner, self._light = window.at, job.hole, sample.corner, job.light
        self._whole = job.begin()
        self.origin, self.largest_order = (window.rows.start, window.cols.start), self._replay.largest_order

    @property
    def sweeps(self) -> list[Sweep]:
        """All sweeps of the run, in order."""
        return self._replay.sweeps

    def at(self, sweep: int, sets: int | None = None) -> Instant:
        """Return the picture after the first ``sets`` sets of a sweep; None: all."""
        now = self._replay.at(sweep, sets)
        pasted = partial(paste, at=self._at, hole=self._hole[self._at], level=now.level)
        image = pasted(self._whole.image, now.image)
        return Instant(
            now.level,
            self._light(image),
            pasted(self._whole.source, shifted(now.source, self._corner)),
            pasted(self._whole.temperature, now.temperature),
            pasted(np.zeros(self._hole.shape, np.uint8), now.relaxed),
        )

    def explain_pixel(self, row: int, col: int, sweep: int = -1, sets: int | None = None, **other: Any) -> Explanation:
        """Return an explanation of a pixel's value after the first ``sets`` sets of a sweep, None: all.

        ``other`` are ``order`` and ``trust`` of `simdtex.jobs.why.replay.Replay.explain`. Raises ValueError if the
        pixel has not relaxed.
        """
        if not self._hole[row, col]:
            raise ValueError("this pixel is not in the hole: its value is given")
        why = self._replay.explain_pixel(row - self.origin[0], col - self.origin[1], sweep, sets, **other)
        near, found = why.neighbours, why.candidates
        return replace(
            why,
            neighbours=replace(near, source=shifted(near.source, self._corner)),
            candidates=replace(found, place=shifted(found.place, self._corner)),
        )
