# SPDX-License-Identifier: BSD-3-Clause
"""The inside of a result: its run replayed, the moment that the page shows, and the explanation of a pixel."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from simdtex.io.image import to_display
from simdtex.live import frames
from simdtex.live.job import Job
from simdtex.machine import Machine
from simdtex.model.explanation import Explanation
from simdtex.options import whole

SET_COLOURS = np.array([[0, 0, 0], [90, 110, 140], [255, 30, 155]], np.uint8)
SET_SHARES = (0.0, 0.6, 1.0)
"""Shares of the colours over sites: not relaxed, relaxed earlier in the sweep, relaxed in the last set."""

BARS = 64
"""The most bars of the LCPDF of a channel."""


class Inside:
    """The run of a result, and the moment of it that the page shows.

    Raises ValueError unless the job is one run of the method ``mrf``, on one lattice.
    """

    def __init__(self, job: Job, machine: Machine) -> None:
        self.job, self.sample = job, frames.picture(job.sample, job.sample)
        self._replay = job.replay(machine)
        self.sweeps = self._replay.sweeps
        self.moment: tuple[int, int] | None = None  # a sweep, and a number of its sets; None for the result
        self._instant: Any = None

    def seek(self, level: Any, sweep: Any, sets: Any) -> None:
        """Show the field after the first ``sets`` sets of a sweep of a level, or at the nearest existing moment."""
        for name, number in (("level", level), ("sweep", sweep), ("sets", sets)):
            whole(name, number, 0)
        level = min(level, self.sweeps[0].level)
        found = [n for n, one in enumerate(self.sweeps) if one.level == level]
        if not found:  # a level without a sweep looks like the one above
            found = [n for n, one in enumerate(self.sweeps) if one.level > level][-1:]
        n = found[min(max(sweep, 1), len(found)) - 1]
        self.moment = n, min(sets, self.sweeps[n].sets)
        self._instant = self._replay.at(*self.moment)

    def finish(self) -> None:
        """Show the result."""
        self.moment = self._instant = None

    def layers(self, result: dict[str, Callable[[], frames.Layer]]) -> dict[str, Callable[[], frames.Layer]]:
        """Return the layers of the moment, or of the result if that is shown, and the job's sample."""
        now, job = self._instant, self.job
        sample = {"sample": lambda: self.sample}
        if now is None:
            return result | sample
        image = now.image if job.sample.ndim == 3 else now.image[..., 0]
        found = job.layers(lambda: image, lambda: now.source, lambda: now.temperature)
        return found | sample | {"sets": lambda: frames.overlay(image, now.relaxed, SET_COLOURS, SET_SHARES, job.shape)}

    def describe(self) -> dict[str, Any]:
        """Return the data for the page: the sample's size, and the sweeps of the run.

        A sweep has its level and number, its numbers of sets and sites, and the mean temperature before it.
        """
        rows, cols = self.sample.shape
        return {"width": cols, "height": rows, "sweeps": [list(one) for one in self.sweeps], "moment": self.moment}

    def explain(self, row: Any, col: Any) -> dict[str, Any]:
        """Return an explanation of the shown value of an output pixel, as plain numbers."""
        for name, number, side in zip(("row", "column"), (row, col), self.job.shape, strict=True):
            whole(f"the {name} of the pixel", number, 0, side - 1)
        sweep, sets = self.moment or (-1, None)
        why = self._replay.explain_pixel(row, col, sweep, sets)
        sample = self.job.sample
        limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
        corner = [2**why.level * n + start for n, start in zip(why.site, self._replay.origin, strict=True)]
        return {"pixel": [row, col], "corner": corner, **described(why, partial(to_display, limits=limits))}


def described(why: Explanation, display: Callable[[Any], Any]) -> dict[str, Any]:
    """Return an explanation as plain numbers; ``display`` converts pixels to 8 bits.

    The fields are those of `simdtex.model.explanation.Explanation`. ``candidates`` is a list with a dict for each of
    the first candidates by rank and the taken one. ``density`` has at most `BARS` bars for each channel.
    """
    near, found, shown = why.neighbours, why.candidates, why.shown()
    costs = {"distance": found.distance, **found.costs, "total": found.total}
    candidates = [
        {
            **{"rank": int(found.rank[n]), "place": found.place[n].tolist(), "continues": int(found.continues[n])},
            "costs": {name: float(cost[n]) for name, cost in costs.items()},
            **{"probability": float(found.probability[n]), "taken": n == why.taken},
            "pixels": display(found.pixels[n]).tolist(),
        }
        for n in shown
    ]
    density = None
    if why.density is not None:
        greys = why.density.shape[1]
        starts = np.unique(np.arange(BARS) * greys // BARS)
        density = {"bars": np.add.reduceat(why.density, starts, axis=1).tolist(), "starts": starts.tolist()}
    return {
        **{"site": why.site, "level": why.level, "sweep": why.sweep, "reason": why.reason, "drawn": why.drawn},
        **{"weighed": why.weighed, "bandwidth": why.bandwidth, "density": density},
        **{"temperature": why.temperature, "cooled": why.cooled, "values": why.values.tolist()},
        **{"offsets": near.offsets.tolist(), "confidence": near.confidence.max(1).clip(0, 1).tolist()},
        **{"pixels": display(near.pixels).tolist(), "candidates": candidates},
    }
