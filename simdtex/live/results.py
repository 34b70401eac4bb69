# SPDX-License-Identifier: BSD-3-Clause
"""The results of a page: their layers and data for the page, and their files."""

from __future__ import annotations

from functools import cached_property, partial
from pathlib import Path
from shutil import make_archive
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import write
from simdtex.live import frames
from simdtex.live.job import Job
from simdtex.model.display import write_labels
from simdtex.model.regularity import lattice_sentence
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


class Result:
    """A result: its ``number``, from 1, its job, the job's output, and the duration of the run with its frames."""

    def __init__(self, number: int, job: Job, image: NDArray[Any], output: Output, seconds: float) -> None:
        self.number, self.job, self.image, self.seconds = number, job, image, seconds
        self.source, self.temperature = output.source, output.temperature
        self.lattice = output.statistics.get("lattice")
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
        from simdtex.experiments.quality import lattice_fault_map

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
            **{"note": lattice_sentence(self.lattice), "lattice": self.lattice, "shares": self.job.shares(self.image)},
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
