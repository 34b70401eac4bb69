# SPDX-License-Identifier: BSD-3-Clause
"""The replay of a run of `fill`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from simdtex.jobs.filling import Filling, paste, shifted
from simdtex.machine import Machine
from simdtex.methods.mrf.replay import Instant, Replay, Sweep
from simdtex.model.explanation import Explanation


class HoleReplay:
    """The replay of a run that fills one hole, with the methods of `simdtex.methods.mrf.replay.Replay`.

    The arrays of `at` are those of the whole picture, with the sites of a coarse level repeated; sites are pixels of
    the window around the hole, and sources and candidates are pixels of the picture or of the sample. Raises ValueError
    if the job has several windows.
    """

    def __init__(self, job: Filling, machine: Machine, seed: int) -> None:
        parts = job.windows()
        if len(parts) > 1:
            raise ValueError(f"{len(parts)} holes are filled by runs of their own; fill one hole to look into its run")
        (window,) = parts
        sample = job.around(window)
        self._replay = Replay(job.plan(window, sample), machine, seed)
        self._at, self._hole, self._corner = (window.rows, window.cols), job.hole, sample.corner
        self._whole = job.begin()
        self.origin = window.rows.start, window.cols.start

    @property
    def sweeps(self) -> list[Sweep]:
        """All sweeps of the run, in order."""
        return self._replay.sweeps

    def at(self, sweep: int, sets: int | None = None) -> Instant:
        """Return the picture after the first ``sets`` sets of a sweep; None: all."""
        now = self._replay.at(sweep, sets)
        pasted = partial(paste, at=self._at, hole=self._hole[self._at], level=now.level)
        return Instant(
            now.level,
            pasted(self._whole.image, now.image),
            pasted(self._whole.source, shifted(now.source, self._corner)),
            pasted(self._whole.temperature, now.temperature),
            pasted(np.zeros(self._hole.shape, np.uint8), now.relaxed),
        )

    def explain_pixel(self, row: int, col: int, sweep: int = -1, sets: int | None = None) -> Explanation:
        """Return an explanation of a pixel's value after the first ``sets`` sets of a sweep, None: all.

        Raises ValueError if the pixel has not relaxed.
        """
        if not self._hole[row, col]:
            raise ValueError("this pixel is not in the hole: its value is given")
        why = self._replay.explain_pixel(row - self.origin[0], col - self.origin[1], sweep, sets)
        near, found = why.neighbours, why.candidates
        return replace(
            why,
            neighbours=replace(near, source=shifted(near.source, self._corner)),
            candidates=replace(found, place=shifted(found.place, self._corner)),
        )
