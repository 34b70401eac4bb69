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
from simdtex.live.job import PageJob
from simdtex.machine import Machine
from simdtex.model.display import write_labels
from simdtex.model.explanation import Explanation
from simdtex.model.light import sample_sentences
from simdtex.model.source_map import apply_source_map, save_source_map
from simdtex.options import one_of, whole
from simdtex.run import Output

MAX_RESULTS = 24  # that are kept
MAX_BYTES = 2**29  # of their arrays; the latest result is kept whatever its size
THUMBNAIL = 96  # longest side, pixels
MOST_TOTALS = 1024  # total costs of candidates that the page gets, the least ones
BARS = 64  # the most bars of the LCPDF of a channel
ARRANGEMENT = "arrangement.npz"

FAULT_COLOURS = np.array([[0, 0, 0], [255, 30, 155]], np.uint8)
"""Colours over pixels that keep the lattice, and over faults."""

SET_COLOURS = np.array([[0, 0, 0], [90, 110, 140], [255, 30, 155]], np.uint8)
SET_SHARES = (0.0, 0.6, 1.0)
"""Shares of the colours over sites: not relaxed, relaxed earlier in the sweep, relaxed in the last set."""

FILM_SHARES, FILM_FRAMES, FILM_SIDE = (0.0, 0.2, 0.7), 24, 64
"""Of a film: shares of these colours, the most sets of sites, and the longest side of its output and its sample."""


class Result:
    """A result: its ``number``, from 1, its job, the job's output, and the duration of the run with its frames."""

    def __init__(self, number: int, job: PageJob, image: NDArray[Any], output: Output, seconds: float) -> None:
        self.number, self.job, self.image, self.seconds = number, job, image, seconds
        self.source, self.temperature = output.source, output.temperature
        self.lattice, self.note = output.statistics.get("lattice"), sample_sentences(output.statistics)
        complete = self.source is not None and bool((self.source[..., 0] >= 0).all())  # every pixel has a source
        source: Any = self.source if complete else None
        self.maps = {name: apply_source_map(source, values) for name, values in job.maps.items() if complete}
        arrays = [None if array is None else partial(np.asarray, array) for array in (source, self.temperature)]
        self.layers = job.layers(lambda: image, *arrays)
        if self.lattice:
            self.layers["faults"] = self._faults
        self.archive = f"{Path(job.output).stem}.zip"
        for name, values in self.maps.items():
            self.layers[f"map {name}"] = partial(frames.picture, values, values)

    def _faults(self) -> frames.Layer:
        """Return the layer of the picture with marks where its pattern leaves its lattice."""
        return frames.overlay(self.image, self._fault_map, FAULT_COLOURS, (0.0, 0.5))

    @cached_property
    def _fault_map(self) -> NDArray[np.uint8]:
        from simdtex.jobs.studies.quality import lattice_fault_map

        faults = lattice_fault_map(self.job.sample, self.image)
        return np.zeros(self.job.shape, np.uint8) if faults is None else faults.astype(np.uint8)

    @property
    def arrays(self) -> list[NDArray[Any]]:
        """All arrays of the result; those of its material are shared with other results."""
        picture, maps = self.job.material
        made = [self.image, self.source, self.temperature, *self.maps.values()]
        return [array for array in [*made, picture.pixels, *maps.values()] if array is not None]

    @cached_property
    def thumbnail(self) -> frames.ViewFrame:
        """The thumbnail of the picture."""
        return frames.thumbnail(next(iter(self.layers.values()))(), THUMBNAIL)

    def describe(self) -> dict[str, Any]:
        """Return the message to the page."""
        return {
            **{"result": self.number, "width": self.job.shape[1], "height": self.job.shape[0]},
            **{"seconds": self.seconds, "settings": self.job.message},
            **{"picture": self.job.material[0].name},
            **{"note": self.note, "lattice": self.lattice, "shares": self.job.shares(self.image)},
            **{"layers": ["sample", *self.layers], "files": self.files},
            **{"command": self.job.command, "thumbnail": [self.thumbnail.width, self.thumbnail.height]},
        }

    @property
    def _pictures(self) -> dict[str, NDArray[Any]]:
        """The picture and the maps, by file name."""
        return {self.job.output: self.image} | {self.job.carried[name]: values for name, values in self.maps.items()}

    @property
    def files(self) -> list[str]:
        """The names of its files; the last is an archive of all others, the job's input files, and its command."""
        names = dict.fromkeys([*self._pictures, *self.job.labelled])
        return [*names, *[ARRANGEMENT] * (self.source is not None), self.archive]

    def file(self, name: str) -> bytes:
        """Return the bytes of the file ``name``; raise ValueError if there is no such file."""
        one_of("file", name, self.files)
        with TemporaryDirectory() as temporary:
            folder = Path(temporary) / "files"
            folder.mkdir()
            wanted = self._pictures | self.job.files
            coloured = (self.job.output, next(iter(self.job.files)))  # the picture and its sample
            for file in wanted if name == self.archive else wanted.keys() & {name}:
                if file in self.job.labelled:
                    write_labels(folder / file, wanted[file])
                else:
                    write(folder / file, wanted[file], self.job.metadata if file in coloured else None)
            if self.source is not None and name in (ARRANGEMENT, self.archive):
                save_source_map(folder / ARRANGEMENT, self.source)
            if name != self.archive:
                return (folder / name).read_bytes()
            (folder / "again.txt").write_text(self.job.command, encoding="utf-8")
            return Path(make_archive(str(folder), "zip", folder)).read_bytes()


class PageResults(dict[int, Result]):
    """The results of a page by number; the oldest are dropped when they are many or large."""

    def __init__(self) -> None:
        super().__init__()
        self.dropped: list[int] = []

    def add(self, job: PageJob, image: NDArray[Any], output: Output, seconds: float) -> Result:
        """Add a result, and return it."""
        key = 1 + max(self, default=0)
        result = self[key] = Result(key, job, image, output, seconds)
        while len(self) > MAX_RESULTS or (len(self) > 1 and self.nbytes > MAX_BYTES):
            self.dropped.append(min(self))
            del self[self.dropped[-1]]
        return result

    @property
    def nbytes(self) -> int:
        """Number of bytes of all arrays."""
        return sum({id(array): array.nbytes for result in self.values() for array in result.arrays}.values())

    def find(self, number: Any) -> Result:
        """Return the result ``number``; raise ValueError or TypeError if there is none."""
        whole("the result", number, 1)
        if number not in self:
            raise ValueError(f"result {number} is no longer kept; make it again with its command line")
        return self[number]


class Inside:
    """The run of a result, and the moment of it that the page shows; ValueError unless it is one run of ``mrf``."""

    def __init__(self, job: PageJob, machine: Machine) -> None:
        self.job, self.sample = job, frames.picture(job.sample, job.sample)
        self._replay = job.replay(machine)
        self.sweeps = self._replay.sweeps
        self.moment: tuple[int, int] | None = None  # a sweep, and a number of its sets; None for the result
        self._instant: Any = None

    def seek(self, level: Any, sweep: Any, sets: Any) -> None:
        """Show the field after ``sets`` sets of a sweep, or the nearest moment; without a ``level``, the result."""
        if level is None:
            self.moment = self._instant = None
            return
        for name, value in (("level", level), ("sweep", sweep), ("sets", sets)):
            whole(name, value, 0)
        level = min(level, self.sweeps[0].level)
        places = [n for n, entry in enumerate(self.sweeps) if entry.level == level]
        if not places:  # a level without a sweep looks like the one above
            places = [n for n, entry in enumerate(self.sweeps) if entry.level > level][-1:]
        n = places[min(max(sweep, 1), len(places)) - 1]
        self.moment = n, min(sets, self.sweeps[n].sets)
        self._instant = self._replay.at(*self.moment)

    def layers(self, result: dict[str, Callable[[], frames.Layer]]) -> dict[str, Callable[[], frames.Layer]]:
        """Return the layers of the moment, or of the result if that is shown, and the job's sample."""
        now, job = self._instant, self.job
        sample = {"sample": lambda: self.sample}
        if now is None:
            return result | sample
        image = now.image if job.sample.ndim == 3 else now.image[..., 0]
        shown = job.layers(lambda: image, lambda: now.source, lambda: now.temperature)
        return shown | sample | {"sets": lambda: frames.overlay(image, now.relaxed, SET_COLOURS, SET_SHARES, job.shape)}

    def describe(self) -> dict[str, Any]:
        """Return the data for the page: the sample's size, the sweeps of the run, and the moment."""
        rows, cols = self.sample.shape
        return {"width": cols, "height": rows, "sweeps": [list(sweep) for sweep in self.sweeps], "moment": self.moment}

    def explain(self, row: Any, col: Any, **other: Any) -> dict[str, Any]:
        """Return an explanation of the shown value of an output pixel, with another ``order`` or ``trust``."""
        for name, index, side in zip(("row", "column"), (row, col), self.job.shape, strict=True):
            whole(f"the {name} of the pixel", index, 0, side - 1)
        sweep, sets = self.moment or (-1, None)
        why = self._replay.explain_pixel(row, col, sweep, sets, **other)
        sample = self.job.sample
        limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
        corner = [2**why.level * n + start for n, start in zip(why.site, self._replay.origin, strict=True)]
        order, orders = int((why.neighbours.offsets**2).sum(1).max()), self._replay.largest_order(why.level)
        place = {"pixel": [row, col], "corner": corner, "order": order, "orders": orders}
        return place | described(why, partial(to_display, limits=limits))


def film(job: PageJob, machine: Machine) -> tuple[dict[str, Any], list[bytes]]:
    """Return the counts of a small run, and RGBA pictures of its finest level: sets, of many only some, and the end."""
    if max(*job.shape, *job.sample.shape[:2]) > FILM_SIDE:
        raise ValueError(f"a film has an output and a sample of at most {FILM_SIDE} x {FILM_SIDE} pixels; give fewer")
    replay = job.replay(machine)
    finest = [(n, sweep) for n, sweep in enumerate(replay.sweeps) if sweep.level == 0]
    if not isinstance(replay, Replay) or not finest:
        raise ValueError("a film shows sweeps of a texture at its full size, and this run has none; give another one")
    first = finest[0][1]
    moments = [(n, k) for n, sweep in finest for k in range(1, sweep.sets + 1)]
    moments = moments[:: -(-first.sets // FILM_FRAMES)][:FILM_FRAMES]
    instants = [replay.at(*moment) for moment in moments]
    together = np.mean(np.concatenate([replay.together(instant) for instant in instants]))
    end = replay.at(-1)
    instants.append(replace(end, relaxed=np.zeros_like(end.relaxed)))
    layers = [frames.overlay(shot.image, shot.relaxed, SET_COLOURS, FILM_SHARES) for shot in instants]
    counted = {"steps": first.sets, "sites": first.sites, "sweeps": len(replay.sweeps), "together": float(together)}
    shown = [frames.thumbnail(layer, FILM_SIDE).pixels for layer in layers]
    return {"width": job.shape[1], "height": job.shape[0], **counted}, shown


def described(why: Explanation, display: Callable[[Any], Any]) -> dict[str, Any]:
    """Return an explanation as plain numbers, of the first candidates and the taken one; ``display`` makes 8 bits."""
    near, ranked, shown = why.neighbours, why.candidates, why.shown()
    costs = {"distance": ranked.distance, **ranked.costs, "total": ranked.total}
    candidates = [
        {
            **{"rank": int(ranked.rank[n]), "place": ranked.place[n].tolist(), "continues": int(ranked.continues[n])},
            "costs": {name: float(cost[n]) for name, cost in costs.items()},
            **{"probability": float(ranked.probability[n]), "taken": n == why.taken},
            "pixels": display(ranked.pixels[n]).tolist(),
            "values": np.concatenate([ranked.values[n][None], ranked.around[n]]).tolist(),
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
