# SPDX-License-Identifier: BSD-3-Clause
"""The Zarr store of an output in tiles: the output, the state of the run, and the input of a worker.

    image, source    the output and its source map, and further maps by their names, written tile by tile at the end
    checksums        the checksum of each chunk of those, in the order of the attribute ``arrays`` of ``simdtex``
    work/            removed at the end
        run          the plan (`described`), conditioning data between sites of levels, and maps
        turn         the current turn, and the penalties during it
        begun0       the turn that began level 0; likewise for each coarser level
        given/       values of the output and which are known; held0, held1, ... the conditioning data of each level
        level0/7     values, source, temperature after turn 7: of each level the last state, and the one being written
        tally7       a row for each task that has finished turn 7, see `Tally`

A turn is one operation on every tile: begin a level, a sweep, write the picture. It reads the state that the turn
before it wrote, and no data that it writes itself, so its missing tasks complete an interrupted turn. The file ``turn``
changes when a turn is complete, in one write.

Every chunk that is read must exist and have its checksum, and the three files have checksums, too; a chunk is on the
disk before its task has a row. A file of an array of ``work`` ends with a checksum of its content, its place, which
includes the turn, and the random name of the store, so a chunk of another turn, place or store is damage. What a turn
writes is determined by the plan and the seed. A chunk of another array has the checksum of Zarr, of its content alone;
``checksums`` combines that with the name for each place. A level whose state is damaged restarts from the state of the
level above.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
import zarr
import zarr.codecs
import zarr.storage
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.checkpoint import read_state, write_state
from simdtex.io.files import Damaged, write_durable
from simdtex.jobs.tiles.layout import LevelLayout, Outputs, Tile, TilePlan, planned
from simdtex.methods.mrf.conditioning import Conditioning, Conditions, Data, Held
from simdtex.methods.mrf.neighbourhood import Confidences, Field
from simdtex.methods.mrf.options import Options
from simdtex.methods.mrf.plan import MrfPlan
from simdtex.methods.mrf.problem import Input
from simdtex.model.guide import GuidePlanes
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, Phases
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale
from simdtex.options import resolve


@dataclass(frozen=True)
class Ready:
    """The planes of a guide for the sample, in working levels (G, rows, cols) for each picture."""

    samples: list[NDArray[np.uint16]]

    @property
    def channels(self) -> int:
        """Number of planes."""
        return len(self.samples[0])

    def planes(self, scale: Scale, spread: float, top: int) -> GuidePlanes:
        """Return the planes unchanged, and no planes of the output."""
        return GuidePlanes(self.samples, np.zeros((self.channels, 1, 1), np.uint16))


def described(plan: Input) -> dict[str, Any]:
    """Return a plan as a tree for `simdtex.checkpoint.pack`, without conditioning data of the output."""
    pictures = plan.sample.pictures
    arrays = {"pixels": pictures.pixels, "unknown": pictures.unknown, "usable": pictures.usable}
    sample = {"layout": plan.sample.layout, "guides": list(plan.sample.guided), "phases": plan.sample.phases}
    coarser = plan.coarser and described(plan.coarser)
    about = {"shape": plan.shape, "levels": plan.levels, "reduction": plan.reduction, "coarser": coarser}
    return {**about, "options": asdict(plan.options), **arrays, **sample}


def restored(tree: dict[str, Any]) -> MrfPlan:
    """Return the plan of a tree from `described`, without conditioning data of the output."""
    options = resolve(Options, "synth", tree["options"])
    unknown, usable = ((one and tuple(one)) for one in (tree["unknown"], tree["usable"]))
    pictures = options.of(Pictures(tuple(tree["pixels"]), unknown, usable))
    guides: list[Any] = [Ready(tree["guides"])] if tree["guides"] else []
    phases = tree["phases"] and Phases(tuple(Lattice(*one) for one in tree["phases"][0]), Lattice(*tree["phases"][1]))
    sample = Sample(pictures, **tree["layout"], guides=guides, phases=phases)
    schedule, offsets = schedules.get(options.schedule), neighbourhood_offsets(options.neighbourhood)
    size = {"reduction": tree["reduction"], "coarser": tree["coarser"] and restored(tree["coarser"])}
    return MrfPlan(sample, tuple(tree["shape"]), offsets, options, schedule, tree["levels"], **size)


FORMAT = 12
"""Format of the store; all other formats are rejected."""

TALLIES_AT_ONCE = 2**22
"""The most numbers of tallies that are read together."""

NODES = ("zarr.json", ".zarray", ".zgroup", ".zattrs", ".zmetadata")
"""The metadata files of Zarr; every other file is a chunk."""


Tally = NDArray[np.int64]
"""Counts of sites, which add up over tiles: active sites, the sum of temperatures in units of 1/1024, and the uses of
each candidate and the sites of each kind in each region."""


class Turn(NamedTuple):
    """An operation on every tile, ``number`` from 1: begin a level, all of a level of one tile, sweep, or show."""

    number: int
    phase: str  # "begin", "whole", "sweep", "show" or "done"
    level: int
    cooling: int = 0  # sweeps of the level so far
    free: int = 0
    active: int = 0  # sites of the level
    temperature_sum: int = 0  # of these

    @property
    def reads(self) -> int:
        """The level whose state, written by the turn before, the turn reads."""
        return self.level + (self.phase in ("begin", "whole"))


@dataclass(frozen=True, eq=False)
class Work(TilePlan):
    """The plan of a store, without the data and guides of the output, and what it needs of these."""

    confidences: Confidences
    held: bool  # there are data or guides
    given: bool  # there are data
    scattered: dict[str, Data]  # between the sites, for each level that has such


class Files(zarr.storage.LocalStore):
    """The files of a store: a written file is on the disk, and a chunk that is read exists and is the right one."""

    @cached_property
    def name(self) -> str:
        """The random name of the store, a part of each checksum."""
        return str(read_state(self.root / "work" / "run")[0]["name"])

    def placed(self, key: str, data: Any) -> bytes:
        """Return a checksum of the content of a file, of its place, and of the store."""
        return crc32(data, crc32(f"{self.name}/{key}".encode())).to_bytes(4, "little")

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        """Return the content of a file; if it is missing or damaged, None, but Damaged for a chunk."""
        chunk = await super().get(key, prototype, byte_range)
        if chunk is not None and key.startswith("work/"):
            chunk, end = chunk[:-4], chunk[-4:]
            if end.to_bytes() != self.placed(key, chunk.as_buffer_like()):
                chunk = None
        if chunk is None and key.rpartition("/")[2] not in NODES:
            raise Damaged(key)
        return chunk

    async def set(self, key: str, value: Any) -> None:
        """Write a file; raise Damaged if the store is gone."""
        if key != "zarr.json" and not (self.root / "zarr.json").exists():
            raise Damaged("zarr.json")
        data = value.as_buffer_like()
        if key.startswith("work/"):
            data = b"".join((data, self.placed(key, data)))
        await asyncio.to_thread(write_durable, self.root / key, data)

    async def set_if_not_exists(self, key: str, value: Any) -> None:
        """Write a file that does not exist."""
        if not (self.root / key).exists():
            await self.set(key, value)


class CheckedArray:
    """An array of a store, which raises Damaged with the name of a chunk, or of the array, that cannot be read."""

    def __init__(self, array: Any, name: str) -> None:
        self._array, self._name = array, name
        self.shape, self.dtype = array.shape, array.dtype
        self.chunks, self.counts = array.chunks, array.cdata_shape

    def __getitem__(self, where: Any) -> NDArray[Any]:
        try:
            return np.asarray(self._array[where])
        except Damaged:
            raise
        except Exception:  # each codec has errors of its own
            raise Damaged(self._name) from None

    def __setitem__(self, where: Any, values: Any) -> None:
        self._array[where] = values


class Sources:
    """The source map of a state, (rows, cols, 2 or 3); slicing it reads a part."""

    def __init__(self, array: CheckedArray, sample: Sample) -> None:
        self._array, self._sample = array, sample
        self.shape = (*array.shape, 2 + (len(sample.boxes) > 1))

    def __getitem__(self, where: Any) -> NDArray[np.int32]:
        return self._sample.place(self._array[where])


class Store:
    """A store: ``where`` is a folder that all workers reach. Methods raise Damaged with the name of a damaged part."""

    def __init__(self, where: str) -> None:
        self.where = where
        self._arrays: dict[str, CheckedArray] = {}
        self._files = Files(where)
        try:
            self.root: Any = zarr.open_group(self._files, mode="r+")
        except Exception:  # of JSON, of its members, of the files
            if not self._file("run").exists():
                raise Damaged("zarr.json") from None
            Path(where, "zarr.json").unlink(missing_ok=True)
            self.root = zarr.open_group(self._files, mode="a")

    @staticmethod
    def create(where: str, tiles: TilePlan, **about: Any) -> Store:
        """Make a store, ready for its first turn, and return it; ``about`` are JSON types that it keeps."""
        zarr.open_group(Files(where), mode="w-")
        store, held, scattered = Store(where), False, {}
        store._files.name = secrets.token_hex(8)
        store.root.create_group("work")
        plan, layout, fixed = tiles.plan, tiles.layout, tiles.plan.given
        conditions = Conditioning(plan)
        for level in layout.levels:
            part = plan.of(level.number)
            if part is not conditions.plan:
                conditions = conditions.coarser(part)
            if (here := conditions.at(level.number, part.grid(level.number))) is not None:
                held = True
                for name, plane in here._asdict().items():
                    place = f"work/given/held{level.number}/{name}"
                    store._sites(place, level, plane.dtype, before=plane.shape[:-2])[:] = plane
            if (data := conditions.scattered(level.number)) is not None:
                scattered[str(level.number)] = data
        if fixed is not None:
            for name, array in (("values", fixed.values), ("known", fixed.known)):
                store._sites(f"work/given/{name}", layout.levels[0], array.dtype, after=array.shape[2:])[:] = array
        about |= {"format": FORMAT, "version": version("simdtex"), "seed": tiles.seed}
        conditioned = list(conditions.confidences), held, fixed is not None, scattered
        store._keep("run", about, [described(plan), list(tiles.outputs), layout.levels[0].side, *conditioned])
        store.save(Turn(1, phase_of(layout.levels[-1]), len(layout.levels) - 1))
        return store

    @property
    def about(self) -> dict[str, Any]:
        """The description of the run, as JSON types."""
        return self._state("run")[0]

    @cached_property
    def work(self) -> Work:
        """The plan and its data."""
        about, (tree, outputs, side, confidences, held, given, scattered) = self._state("run")
        between = {number: Data(*data) for number, data in scattered.items()}
        tiles = planned(restored(tree), about["seed"], side, Outputs(*outputs))
        return Work(**vars(tiles), confidences=Confidences(*confidences), held=held, given=given, scattered=between)

    @property
    def finished(self) -> bool:
        """Whether the output is complete."""
        return "simdtex" in self.root.attrs

    @property
    def turn(self) -> Turn:
        """The current turn."""
        return Turn(*self._state("turn")[1][0])

    def penalty(self, turn: Turn) -> NDArray[np.float32] | None:
        """Return the penalties during the current turn, of kinds alone if it begins a level; None at the first."""
        present, penalty = self._state("turn")[1]
        if Turn(*present) != turn:
            raise Damaged("work/turn")
        return None if penalty is None else np.asarray(penalty)

    def save(self, turn: Turn, penalty: NDArray[np.float32] | None = None) -> Turn:
        """Make a turn the current one, and return it; what no later turn reads is removed."""
        state = [list(turn), penalty]
        if turn.phase in ("begin", "whole"):
            self._keep(f"begun{turn.level}", {}, state)
        self._keep("turn", {}, state)
        before = f"level{turn.reads}/{turn.number - 1}"
        for pattern in (f"level{turn.reads}/[0-9]*", "tally*"):
            for path in self._file("").glob(pattern):
                if (name := path.relative_to(self._file("")).as_posix()) != before:
                    self._remove(f"{name}/")
        return turn

    def prepare(self, turn: Turn, candidates: int) -> None:
        """Make the arrays that a turn writes to; for existing ones only the description is rewritten."""
        level = self.work.layout.levels[turn.level]
        if turn.phase == "show":
            arrays = self.work.outputs.arrays(self.work.plan)
            for name, (after, dtype) in arrays.items():
                self._sites(name, level, dtype, after=after)
            count, side = len(arrays), -(-level.side // level.chunk)
            self._array("checksums", (count, *self._at("image").counts[:2]), (count, side, side), np.uint32)
        else:
            for name, kind in zip(Field._fields, ("uint16", "int32", "uint16"), strict=True):
                before = (self.work.layout.channels,) if name == "values" else ()
                self._sites(f"work/level{level.number}/{turn.number}/{name}", level, kind, before)
        row = 2 + candidates
        self._array(f"work/tally{turn.number}", (level.tasks, row), (1, row), np.int64)

    def picture(self, turn: Turn) -> tuple[Any, Any]:
        """Return the picture of a written output, and its source map, even if that is not written."""
        return self._at("image"), Sources(self._at(f"work/level0/{turn.number - 1}/source"), self.work.plan.sample)

    def samples(self) -> list[NDArray[Any]]:
        """Return the pictures of the sample, with a channel axis if the image has one."""
        pixels = self.work.plan.sample.pictures.pixels
        return [picture if self.work.outputs.channels else picture[..., 0] for picture in pixels]

    def finish(self) -> None:
        """Note that the output is complete, with its description."""
        about, plan = self.about, self.work.plan
        kept = {name: about[name] for name in ("format", "version", "name", "seed")}
        arrays = {name: self._description(name) for name in self.work.outputs.arrays(plan)}
        more = {"light": about["light"]["light"], "options": asdict(plan.options), "arrays": arrays}
        self.root.attrs["simdtex"] = kept | more

    def check(self) -> None:
        """Raise Damaged if a chunk of a complete output is missing or in the wrong place; its content is not read."""
        try:
            about = dict(self.root.attrs["simdtex"])
            arrays, self._files.name = dict(about["arrays"]), str(about.get("name"))
        except (KeyError, TypeError, ValueError):
            raise Damaged("zarr.json") from None
        if about.get("format") != FORMAT:
            raise ValueError(f"{self.where} is of another format or damaged: read its image by zarr, or begin anew")
        every = self._at("checksums")[:]
        if len(every) != len(arrays):
            raise Damaged("checksums/zarr.json")
        for (name, description), noted in zip(arrays.items(), every, strict=True):
            if self._description(name) != description:
                raise Damaged(f"{name}/zarr.json")
            for place in np.ndindex(noted.shape):
                if self._checksum(name, *place) != noted[place]:
                    raise Damaged(self._chunk(name, *place))

    def clean(self) -> None:
        """Remove the working state of a complete output."""
        self._remove("")
        for path in Path(self.where).glob("*/c/**/.simdtex-*"):  # of processes that were killed
            path.unlink(missing_ok=True)

    def back(self, part: str) -> str | None:
        """Go back to the turn that makes a damaged part; return the consequence in words, None if there is no turn."""
        if self.finished or part == "work/run" or part.startswith("work/given/"):
            return None
        level = re.match(r"work/level(\d+)/", part)
        if not (level or part == "work/turn"):  # the current turn finds the missing parts
            return "it is made again"
        first = int(level[1]) if level else 0
        for index in range(first, len(self.work.layout.levels)):
            try:
                turn = Turn(*self._state(f"begun{index}")[1][0])
            except Damaged:
                continue
            for finer in range(index + 1):
                self._remove(f"level{finer}/")
            self.save(turn)
            return f"level {index} begins again"
        return None

    def note(self, turn: Turn, task: int, tally: Tally) -> None:
        """Note that a task has finished a turn."""
        self._at(f"work/tally{turn.number}")[task] = tally

    def done(self, turn: Turn, task: int) -> bool:
        """Return whether a task has finished a turn, and everything that it wrote can be read."""
        level, names = self.work.layout.levels[turn.level], list(self.work.outputs.arrays(self.work.plan))
        try:
            self._at(f"work/tally{turn.number}")[task]
            for tile in level.task(task):
                if turn.phase != "show":
                    self.read(turn.level, turn.number, tile)
                    continue
                for name in names:
                    self._at(name)[spans(tile)]
                where, sums = self._checksums(names, tile)
                if not np.array_equal(self._at("checksums")[where], sums):
                    return False
        except Damaged:
            return False
        return True

    def total(self, turn: Turn) -> Tally:
        """Return the sum of the tallies of all tasks; many rows are read together, which is faster."""
        tally = self._at(f"work/tally{turn.number}")
        some = max(1, TALLIES_AT_ONCE // tally.shape[1])
        rows = (tally[first : first + some] for first in range(0, tally.shape[0], some))
        return np.asarray(sum(part.sum(0) for part in rows))

    def read(self, number: int, turn: int, window: Tile) -> Field:
        """Return the state of a level's sites after the turn of a number, in a window, which may cross the seam."""
        return Field(*(self._cut(f"work/level{number}/{turn}/{name}", number, window) for name in Field._fields))

    def held(self, number: int, window: Tile) -> Held | None:
        """Return the data and guides of a level's sites in a window; None if there are none."""
        if not self.work.held:
            return None
        return Held(*(self._cut(f"work/given/held{number}/{name}", number, window) for name in Held._fields))

    def write(self, turn: Turn, tile: Tile, field: Field) -> None:
        """Write the state of a tile's sites after a turn."""
        here = f"work/level{turn.level}/{turn.number}"
        for name, plane in field._asdict().items():
            self._at(f"{here}/{name}")[..., *spans(tile)] = plane

    def given(self, tile: Tile) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the known values of the output in a tile, and their mask."""
        values, known = (self._at(f"work/given/{name}")[spans(tile)] for name in ("values", "known"))
        return values, known

    def show(self, tile: Tile, arrays: dict[str, NDArray[Any]]) -> None:
        """Write a tile of the arrays of the output."""
        for name, array in arrays.items():
            self._at(name)[spans(tile)] = array
        where, sums = self._checksums(list(arrays), tile)
        self._at("checksums")[where] = sums

    def _checksums(self, names: list[str], tile: Tile) -> tuple[tuple[slice, ...], NDArray[np.uint32]]:
        """Return the position of the checksums of an output tile, and the checksums in its chunks."""
        sides = self._at("image").chunks
        rows, cols = (
            slice(span.start // side, -(-span.stop // side)) for span, side in zip(spans(tile), sides, strict=False)
        )
        places = [(row, col) for row in range(rows.start, rows.stop) for col in range(cols.start, cols.stop)]
        sums = np.array([[self._checksum(name, *place) for place in places] for name in names], np.uint32)
        return (slice(None), rows, cols), sums.reshape(len(names), rows.stop - rows.start, -1)

    def _checksum(self, name: str, row: int, col: int) -> int:
        """Return the checksum of a chunk of the output, its last four bytes, combined with the store's name."""
        part = self._chunk(name, row, col)
        try:
            with open(Path(self.where, part), "rb") as file:
                file.seek(-4, os.SEEK_END)
                return int.from_bytes(file.read(), "little") ^ crc32(self._files.name.encode())
        except OSError:
            raise Damaged(part) from None

    def _description(self, name: str) -> int:
        """Return a checksum of an array's description without the parts that do not concern its pixels."""
        try:
            about = json.loads(Path(self.where, name, "zarr.json").read_bytes())
            parts = {key: about[key] for key in about.keys() - {"attributes", "dimension_names"}}
        except (OSError, ValueError, AttributeError, TypeError):
            raise Damaged(f"{name}/zarr.json") from None
        return crc32(json.dumps(parts, sort_keys=True).encode())

    def _chunk(self, name: str, row: int, col: int) -> str:
        return "/".join((name, "c", str(row), str(col), *("0" for _ in self._at(name).shape[2:])))

    def _cut(self, name: str, number: int, window: Tile) -> NDArray[Any]:
        """Return a window of an array (..., rows, cols) over the sites of a level, which may cross the seam."""
        array, level = self._at(name), self.work.layout.levels[number]
        plane = np.empty((*array.shape[:-2], window.rows, window.cols), array.dtype)
        for rows, down in _parts(window.top, window.rows, level.rows):
            for cols, right in _parts(window.left, window.cols, level.cols):
                plane[..., down, right] = array[..., rows, cols]
        return plane

    def _file(self, name: str) -> Path:
        return Path(self.where, "work", name)

    def _keep(self, name: str, about: dict[str, Any], state: Any) -> None:
        """Write a checked file of ``work``, which contains its name and that of the store."""
        write_state(self._file(name), {"file": name, "name": self._files.name, **about}, state)

    def _state(self, name: str) -> tuple[dict[str, Any], Any]:
        """Return the content of a checked file of ``work``."""
        try:
            about, state = read_state(self._file(name))
        except (Damaged, OSError):
            raise Damaged(f"work/{name}") from None
        if about.get("file", name) != name or about.get("name") != self._files.name:  # an older format has none
            raise Damaged(f"work/{name}")
        return about, state

    def _remove(self, name: str) -> None:
        """Remove arrays of ``work``, complete or not."""
        shutil.rmtree(self._file(name), ignore_errors=True)
        self._arrays = {path: array for path, array in self._arrays.items() if not path.startswith(f"work/{name}")}

    def _at(self, name: str) -> CheckedArray:
        """Return an array, opened once."""
        if name not in self._arrays:
            if len(self._arrays) >= 64:  # of turns that are complete
                self._arrays.clear()
            try:
                with zarr.config.set({"array.write_empty_chunks": True}):  # a missing chunk is damage
                    self._arrays[name] = CheckedArray(self.root[name], name)
            except Exception:  # of JSON, of its members, of the files
                raise Damaged(f"{name}/zarr.json") from None
        return self._arrays[name]

    def _sites(
        self, name: str, level: LevelLayout, dtype: Any, before: tuple[int, ...] = (), after: tuple[int, ...] = ()
    ) -> CheckedArray:
        """Return an array with rows and columns of sites, and further axes ``before`` and ``after`` these."""
        shape, chunks = ((*before, *sides, *after) for sides in ((level.rows, level.cols), (level.chunk, level.chunk)))
        axes = (*("channel",) * len(before), "y", "x", *("channel",) * len(after))
        return self._array(name, shape, chunks, dtype, axes)

    def _array(
        self, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], dtype: Any, axes: Any = None
    ) -> CheckedArray:
        """Return an array; unless this process has it open, make it or rewrite its description."""
        if name in self._arrays:
            return self._arrays[name]
        fast = zarr.codecs.BloscCodec(cname="lz4", clevel=1, shuffle="shuffle")
        Path(self.where, name, "zarr.json").unlink(missing_ok=True)
        self.root.create_array(
            name,
            shape=shape,
            chunks=tuple(max(1, min(pair)) for pair in zip(chunks, shape, strict=True)),
            dtype=dtype,
            compressors=(fast,) if name.startswith("work/") else (fast, zarr.codecs.Crc32cCodec()),
            dimension_names=axes,
        )
        return self._at(name)


class Stored(Conditions):
    """Conditioning data and guides of an output, read from a store window by window."""

    def __init__(self, store: Store) -> None:
        super().__init__(store.work.confidences)
        self._store = store

    def at(self, number: int, grid: Grid) -> Held | None:
        """Return the data and guides of a level's sites in a window; None if there are none."""
        return self._store.held(number, Tile(*grid.first, *grid.shape))

    def coarser(self, plan: Input) -> Stored:
        """Return the conditions of the levels that have a reduced input: the store has those of all levels."""
        return self

    def scattered(self, number: int) -> Data | None:
        """Return the conditioning data between the sites of a level; None if there are none."""
        return self._store.work.scattered.get(str(number))


def phase_of(level: LevelLayout) -> str:
    """Return the phase that begins a level: a level of one tile does all its sweeps in one turn."""
    return "whole" if level.count == 1 else "begin"


def spans(tile: Tile) -> tuple[slice, slice]:
    """Return the rows and columns of a tile."""
    return slice(tile.top, tile.top + tile.rows), slice(tile.left, tile.left + tile.cols)


def _parts(first: int, size: int, whole: int) -> Iterator[tuple[slice, slice]]:
    """Yield the parts of a window of a line of ``whole`` sites, from ``first`` on, and their places in the window."""
    at = 0
    while at < size:
        begin = (first + at) % whole
        end = min(whole, begin + size - at)
        yield slice(begin, end), slice(at, at + end - begin)
        at += end - begin
