# SPDX-License-Identifier: BSD-3-Clause
"""The results of a page: their layers, data and files, and the inside of one: its run replayed, a pixel explained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from shutil import make_archive
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import to_display, write
from simdtex.jobs.why.replay import Replay
from simdtex.live import frames
from simdtex.live.job import Job
from simdtex.machine import Machine
from simdtex.model.display import write_labels
from simdtex.model.explanation import Explanation
from simdtex.model.light import sample_sentences
from simdtex.model.source_map import apply_source_map, save_source_map
from simdtex.options import one_of, whole
from simdtex.run import Output

MAX_RESULTS = 24
"""The most results that are kept."""

MAX_BYTES = 2**29
"""The most bytes of their arrays; the latest result is kept whatever its size."""

THUMBNAIL = 96
"""The longest side of a thumbnail, pixels."""

FAULT_COLOURS = np.array([[0, 0, 0], [255, 30, 155]], np.uint8)
"""Colours over pixels that keep the lattice, and over faults."""

ARRANGEMENT = "arrangement.npz"

SET_COLOURS = np.array([[0, 0, 0], [90, 110, 140], [255, 30, 155]], np.uint8)
SET_SHARES = (0.0, 0.6, 1.0)
"""Shares of the colours over sites: not relaxed, relaxed earlier in the sweep, relaxed in the last set."""

MOST_TOTALS = 1024
"""The most total costs of candidates that the page gets, the least ones."""

FILM_SHARES, FILM_FRAMES, FILM_SIDE = (0.0, 0.2, 0.7), 24, 64
"""Of a film: shares of these colours, the most sets of sites, and the longest side of its output and its sample."""

BARS = 64
"""The most bars of the LCPDF of a channel."""


class Result:
    """A result: its ``number``, from 1, its job, the job's output, and the duration of the run with its frames."""

    def __init__(self, number: int, job: Job, image: NDArray[Any], output: Output, seconds: float) -> None:
        self.number, self.job, self.image, self.seconds = number, job, image, seconds
        self.source, self.temperature = output.source, output.temperature
        self.lattice, self.note = output.statistics.get("lattice"), sample_sentences(output.statistics)
        complete = self.source is not None and bool((self.source[..., 0] >= 0).all())  # every pixel has a source
        source: Any = self.source if complete else None
        self.maps = {name: apply_source_map(source, one) for name, one in job.maps.items() if complete}
        arrays = [None if one is None else partial(np.asarray, one) for one in (source, self.temperature)]
        self.layers = job.layers(lambda: image, *arrays)
        if self.lattice:
            self.layers["faults"] = self._faults
        self.archive = f"{Path(job.output).stem}.zip"
        for name, one in self.maps.items():
            self.layers[f"map {name}"] = partial(frames.picture, one, one)

    def _faults(self) -> frames.Layer:
        """Return the layer of the picture with marks where its pattern leaves its lattice."""
        return frames.overlay(self.image, self._fault_map, FAULT_COLOURS, (0.0, 0.5))

    @cached_property
    def _fault_map(self) -> NDArray[np.uint8]:
        from simdtex.jobs.studies.quality import lattice_fault_map

        found = lattice_fault_map(self.job.sample, self.image)
        return np.zeros(self.job.shape, np.uint8) if found is None else found.astype(np.uint8)

    @property
    def arrays(self) -> list[NDArray[Any]]:
        """All arrays of the result; those of the given picture are shared with other results."""
        picture, maps = self.job.given
        own = [self.image, self.source, self.temperature, *self.maps.values()]
        return [one for one in [*own, picture.pixels, *maps.values()] if one is not None]

    @cached_property
    def thumbnail(self) -> frames.Frame:
        """The thumbnail of the picture."""
        return frames.thumbnail(next(iter(self.layers.values()))(), THUMBNAIL)

    def describe(self) -> dict[str, Any]:
        """Return the message to the page."""
        return {
            **{"result": self.number, "width": self.job.shape[1], "height": self.job.shape[0]},
            **{"seconds": self.seconds, "settings": self.job.message},
            **{"picture": self.job.given[0].name},
            **{"note": self.note, "lattice": self.lattice, "shares": self.job.shares(self.image)},
            **{"layers": ["sample", *self.layers], "files": self.files},
            **{"command": self.job.command, "thumbnail": [self.thumbnail.width, self.thumbnail.height]},
        }

    @property
    def _pictures(self) -> dict[str, NDArray[Any]]:
        """The picture and the maps, by file name."""
        return {self.job.output: self.image} | {self.job.carried[name]: one for name, one in self.maps.items()}

    @property
    def files(self) -> list[str]:
        """The names of its files; the last is an archive of all others, the job's input files, and its command."""
        own = dict.fromkeys([*self._pictures, *self.job.labelled])
        return [*own, *[ARRANGEMENT] * (self.source is not None), self.archive]

    def file(self, name: str) -> bytes:
        """Return the bytes of the file ``name``; raise ValueError if there is no such file."""
        one_of("file", name, self.files)
        with TemporaryDirectory() as temporary:
            folder = Path(temporary) / "files"
            folder.mkdir()
            wanted = self._pictures | self.job.files
            coloured = (self.job.output, next(iter(self.job.files)))  # the picture and its sample
            for each in wanted if name == self.archive else wanted.keys() & {name}:
                if each in self.job.labelled:
                    write_labels(folder / each, wanted[each])
                else:
                    write(folder / each, wanted[each], self.job.metadata if each in coloured else None)
            if self.source is not None and name in (ARRANGEMENT, self.archive):
                save_source_map(folder / ARRANGEMENT, self.source)
            if name != self.archive:
                return (folder / name).read_bytes()
            (folder / "again.txt").write_text(self.job.command, encoding="utf-8")
            return Path(make_archive(str(folder), "zip", folder)).read_bytes()


class Results(dict[int, Result]):
    """The results of a page by number; the oldest are dropped when they are many or large."""

    def __init__(self) -> None:
        super().__init__()
        self.dropped: list[int] = []

    def add(self, job: Job, image: NDArray[Any], output: Output, seconds: float) -> Result:
        """Add a result, and return it."""
        number = 1 + max(self, default=0)
        result = self[number] = Result(number, job, image, output, seconds)
        while len(self) > MAX_RESULTS or (len(self) > 1 and self.nbytes > MAX_BYTES):
            self.dropped.append(min(self))
            del self[self.dropped[-1]]
        return result

    @property
    def nbytes(self) -> int:
        """Number of bytes of all arrays."""
        return sum({id(one): one.nbytes for result in self.values() for one in result.arrays}.values())

    def find(self, number: Any) -> Result:
        """Return the result ``number``; raise ValueError or TypeError if there is none."""
        whole("the result", number, 1)
        if number not in self:
            raise ValueError(f"result {number} is no longer kept; make it again with its command line")
        return self[number]


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

    def explain(self, row: Any, col: Any, **other: Any) -> dict[str, Any]:
        """Return an explanation of the shown value of an output pixel, as plain numbers.

        ``other`` are ``order`` and ``trust`` of `simdtex.jobs.why.replay.Replay.explain`. ``orders`` is the largest
        order, 0 if no other one can be given.
        """
        for name, number, side in zip(("row", "column"), (row, col), self.job.shape, strict=True):
            whole(f"the {name} of the pixel", number, 0, side - 1)
        sweep, sets = self.moment or (-1, None)
        why = self._replay.explain_pixel(row, col, sweep, sets, **other)
        sample = self.job.sample
        limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
        corner = [2**why.level * n + start for n, start in zip(why.site, self._replay.origin, strict=True)]
        order, orders = int((why.neighbours.offsets**2).sum(1).max()), self._replay.largest_order(why.level)
        found = {"pixel": [row, col], "corner": corner, "order": order, "orders": orders}
        return found | described(why, partial(to_display, limits=limits))


def film(job: Job, machine: Machine) -> tuple[dict[str, Any], list[bytes]]:
    """Return what is counted in a small run, and RGBA pictures of its finest level: its sets, one by one, and its end.

    ``steps`` and ``sites`` are those of the level's first sweep, ``sweeps`` those of the run, and ``together`` is the
    share of the sites in the sets shown that relax together with a neighbour. A sweep of many sets is shown in part.
    """
    if max(*job.shape, *job.sample.shape[:2]) > FILM_SIDE:
        raise ValueError(f"a film has an output and a sample of at most {FILM_SIDE} x {FILM_SIDE} pixels; give fewer")
    replay = job.replay(machine)
    own = [(n, one) for n, one in enumerate(replay.sweeps) if one.level == 0]
    if not isinstance(replay, Replay) or not own:
        raise ValueError("a film shows sweeps of a texture at its full size, and this run has none; give another one")
    first = own[0][1]
    moments = [(n, k) for n, one in own for k in range(1, one.sets + 1)]
    moments = moments[:: -(-first.sets // FILM_FRAMES)][:FILM_FRAMES]
    instants = [replay.at(*moment) for moment in moments]
    together = np.mean(np.concatenate([replay.together(one) for one in instants]))
    end = replay.at(-1)
    instants.append(replace(end, relaxed=np.zeros_like(end.relaxed)))
    layers = [frames.overlay(one.image, one.relaxed, SET_COLOURS, FILM_SHARES) for one in instants]
    counted = {"steps": first.sets, "sites": first.sites, "sweeps": len(replay.sweeps), "together": float(together)}
    shown = [frames.thumbnail(one, FILM_SIDE).pixels for one in layers]
    return {"width": job.shape[1], "height": job.shape[0], **counted}, shown


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
            "values": np.concatenate([found.values[n][None], found.around[n]]).tolist(),
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
        **{"channels": why.channels, "levels": near.values.tolist(), "trust": near.confidence.round(4).tolist()},
        "totals": why.totals[:MOST_TOTALS].astype(np.float64).round(1).tolist(),
        **{"offsets": near.offsets.tolist(), "pixels": display(near.pixels).tolist(), "candidates": candidates},
    }
