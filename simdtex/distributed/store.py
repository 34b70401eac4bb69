# SPDX-License-Identifier: BSD-3-Clause
"""The Zarr store of an output in tiles: what is made, how far it is, and what a worker needs to go on with it.

    image, source    the output, written tile by tile at the end
    work/            removed at the end
        input/       the plan's arrays (`simdtex.distributed.description`)
        given/       values of the output and which are known; held0, held1, ... the conditioning data of each level
        level0/0, 1  values, source, temperature: before a sweep and after it, in turn
        penalty7     of each candidate during turn 7
        tally7       a row for each tile that has finished turn 7: 1, active, sum of temperatures, use of each candidate

A turn is one thing done to every tile: begin a level, a sweep, write the picture. Nothing that is written in a turn is
read in it, so an interrupted turn is completed by its missing tiles. The attribute ``turn`` of ``work`` changes when a
turn is complete, in one write.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, NamedTuple, cast

import numpy as np
import zarr
import zarr.codecs
from numpy.typing import NDArray

from simdtex.checkpoint import pack, unpack
from simdtex.distributed.description import described, restored
from simdtex.distributed.layout import Layout, LevelLayout, planned
from simdtex.methods.mrf.conditioning import Conditioning, Conditions, Data, Held
from simdtex.methods.mrf.plan import Plan
from simdtex.methods.mrf.tiles import Tally, Tile
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Confidences, Field

FORMAT = 5
"""Format of the store; another one is refused."""

TOGETHER = 2**22
"""Numbers of tallies that are read at a time."""

PLANES = ("values", "source", "temperature")


class Turn(NamedTuple):
    """What is to be done to every tile.

    ``number`` from 1; ``phase`` ``"begin"``, ``"whole"`` (a level of one tile), ``"sweep"``, ``"show"`` or ``"done"``;
    ``level``; ``read``, ``write`` 0 or 1, the state before and after; the level's ``cooling`` and ``free`` sweeps so
    far; its ``active`` sites now, and their ``temperature_sum``.
    """

    number: int
    phase: str
    level: int
    read: int = 0
    write: int = 0
    cooling: int = 0
    free: int = 0
    active: int = 0
    temperature_sum: int = 0


class Work(NamedTuple):
    """The ``plan`` of a store, without conditioning data, its ``seed``, and the ``layout`` of its tiles.

    ``confidences``: which channels are guides; ``held``: whether there are conditioning data or guides; ``given``:
    whether there are data.
    """

    plan: Plan
    seed: int
    layout: Layout
    confidences: Confidences
    held: bool
    given: bool


class Store:
    """A store: ``where`` is a folder that all workers reach."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.root: Any = zarr.open_group(where, mode="r+")
        self._arrays: dict[str, Any] = {}

    @staticmethod
    def create(where: str, plan: Plan, seed: int, layout: Layout, *, channels: bool, source: bool) -> Store:
        """Make a store, ready for its first turn.

        ``channels``: whether the image has a channel axis; ``source``: whether the source map is written too.
        """
        root, own = zarr.open_group(where, mode="w"), version("simdtex")
        work = root.create_group("work")
        tree, arrays = pack(described(plan))
        for number, array in enumerate(arrays):
            work.create_array(f"input/{number}", data=np.ascontiguousarray(array))
        options, given = plan.options, plan.given
        conditions = Conditioning(plan)
        store, held = Store(where), False
        for level in layout.levels:
            grid = Grid.of(plan.shape, 2**level.number, options.boundary == "torus")
            if (here := conditions.at(level.number, grid)) is not None:
                held = True
                for name, plane in here._asdict().items():
                    store._planes(f"given/held{level.number}/{name}", level, plane.shape[:-2], plane.dtype)[:] = plane
            if (data := conditions.scattered(level.number)) is not None:
                for name, array in data._asdict().items():
                    work.create_array(f"scattered{level.number}/{name}", data=array)
        sample, finest = plan.sample, layout.levels[0]
        if given is not None:
            for name, array in (("values", given.values), ("known", given.known)):
                store._pixels(f"work/given/{name}", finest, array.shape[2:], array.dtype)[:] = array
        store._pixels("image", finest, (sample.shown,) if channels else (), sample.pixels.dtype)
        if source:
            store._pixels("source", finest, (2 + (len(sample.boxes) > 1),), np.dtype(np.int32))
        work.attrs["about"] = {
            **{"format": FORMAT, "version": own, "name": secrets.token_hex(8), "run": tree, "seed": seed},
            **{"tile": layout.levels[0].side, "confidences": [float(one) for one in conditions.confidences]},
            **{"held": held, "given": given is not None},
        }
        store.save(first_turn(layout))
        root.attrs["simdtex"] = {"version": own, "seed": seed, "options": asdict(options)}
        return store

    @property
    def about(self) -> dict[str, Any]:
        """The description of the run, as JSON holds it."""
        return cast(dict[str, Any], self.root["work"].attrs["about"])

    @property
    def name(self) -> str:
        """The store's own name: no other has it."""
        return str(self.about.get("name")) if "work" in self.root else ""

    def work(self) -> Work:
        """Return the plan and all that belongs to it."""
        about, inputs = self.about, self.root["work/input"]
        arrays = [inputs[str(number)][...] for number in range(len(inputs))]
        plan, seed = restored(unpack(about["run"], arrays)), about["seed"]
        guides, own, centre, hard = about["confidences"]
        confidences = Confidences(int(guides), bool(own), np.float32(centre), np.float32(hard))
        layout = planned(plan, seed, about["tile"])
        return Work(plan, seed, layout, confidences, about["held"], about["given"])

    @property
    def turn(self) -> Turn:
        """The present turn, as the store has it."""
        if "work" not in self.root:
            return Turn(0, "done", 0)
        work: Any = zarr.open_group(self.where, path="work", mode="r")
        return Turn(*work.attrs["turn"])

    def save(self, turn: Turn, penalty: NDArray[np.float32] | None = None) -> Turn:
        """Go on to a turn, and return it."""
        work = self.root["work"]
        if penalty is not None:
            work.create_array(f"penalty{turn.number}", data=penalty, overwrite=True)
        work.attrs["turn"] = list(turn)
        for name in (f"penalty{turn.number - 1}", f"tally{turn.number - 1}"):
            if name in work:
                del work[name]
        return turn

    def prepare(self, turn: Turn, level: LevelLayout, channels: int, candidates: int) -> bool:
        """Make the arrays that a turn writes to, if they are missing; return whether the turn is new."""
        work = self.root["work"]
        if turn.phase != "show" and f"level{level.number}/{turn.write}/temperature" not in work:
            for name, kind in zip(PLANES, ("uint16", "int32", "uint16"), strict=True):
                before = (channels,) if name == "values" else ()
                self._planes(f"level{level.number}/{turn.write}/{name}", level, before, np.dtype(kind))
        if f"tally{turn.number}" in work:
            return False
        shape = (level.count, 3 + candidates)
        work.create_array(f"tally{turn.number}", shape=shape, chunks=(1, shape[1]), dtype=np.int64, fill_value=0)
        return True

    def forget(self, level: int) -> None:
        """Remove the state of a level."""
        work = self.root["work"]
        if f"level{level}" in work:
            del work[f"level{level}"]

    def finish(self) -> None:
        """Remove the working state."""
        if "work" in self.root:
            del self.root["work"]

    def penalty(self, turn: Turn) -> NDArray[np.float32]:
        """Return the penalty of each candidate during a turn."""
        return np.asarray(self.root[f"work/penalty{turn.number}"][...])

    def note(self, turn: Turn, number: int, tally: Tally) -> None:
        """Note that a tile has finished a turn."""
        row = np.concatenate([np.array([1, tally.active, tally.temperature_sum], np.int64), tally.counts])
        self._at(f"tally{turn.number}")[number] = row

    def tally(self, turn: Turn, number: int) -> Tally | None:
        """Return what was noted of a tile, None before it has finished the turn."""
        there, active, temperature_sum, *_ = row = self._at(f"tally{turn.number}")[number]
        return Tally(row[3:], int(active), int(temperature_sum)) if there else None

    def done(self, turn: Turn, count: int) -> NDArray[np.bool_]:
        """Return which of the tiles have finished a turn."""
        return np.concatenate([rows[:, 0] > 0 for rows in self._rows(turn, count)])

    def total(self, turn: Turn, count: int) -> Tally:
        """Return the sum of what was noted of all tiles."""
        _, active, temperature_sum, *counts = sum(rows.sum(0) for rows in self._rows(turn, count))
        return Tally(np.array(counts, np.int64), int(active), int(temperature_sum))

    def _rows(self, turn: Turn, count: int) -> Iterator[NDArray[np.int64]]:
        """Yield what was noted, many tiles at a time: one by one they take longer."""
        tally = self._at(f"tally{turn.number}")
        some = max(1, TOGETHER // tally.shape[1])
        for first in range(0, count, some):
            yield tally[first : first + some]

    def read(self, level: LevelLayout, which: int, window: Tile) -> Field:
        """Return the state of a level's sites in a window, which may cross the seam."""
        here = f"level{level.number}/{which}"
        return Field(*(cut(self._at(f"{here}/{name}"), level, window) for name in PLANES))

    def write(self, level: LevelLayout, which: int, tile: Tile, field: Field) -> None:
        """Write the state of a tile's sites."""
        here = f"level{level.number}/{which}"
        for name, plane in zip(PLANES, field, strict=True):
            self._at(f"{here}/{name}")[..., *spans(tile)] = plane

    def held(self, level: LevelLayout, window: Tile) -> Held:
        """Return the conditioning data of a level's sites in a window."""
        here = f"given/held{level.number}"
        return Held(*(cut(self._at(f"{here}/{name}"), level, window) for name in Held._fields))

    def given(self, tile: Tile) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the known values of the output in a tile, and where they are known."""
        values, known = (self._at(f"given/{name}")[spans(tile)] for name in ("values", "known"))
        return values, known

    def show(self, tile: Tile, picture: NDArray[Any], place: NDArray[np.int32]) -> None:
        """Write a tile of the output."""
        image = self.root["image"]
        image[spans(tile)] = picture[..., 0] if image.ndim == 2 else picture
        if "source" in self.root:
            self.root["source"][spans(tile)] = place

    def _at(self, name: str) -> Any:
        """Return an array of ``work``, opened once."""
        if name not in self._arrays:
            if len(self._arrays) >= 64:  # of turns that are complete
                self._arrays.clear()
            self._arrays[name] = self.root[f"work/{name}"]
        return self._arrays[name]

    def _planes(self, name: str, level: LevelLayout, before: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
        shape, chunks = (*before, level.rows, level.cols), (*before, level.chunk, level.chunk)
        return self._array(f"work/{name}", shape, chunks, dtype, (*("channel",) * len(before), "y", "x"))

    def _pixels(self, name: str, level: LevelLayout, after: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
        shape, chunks = (level.rows, level.cols, *after), (level.chunk, level.chunk, *after)
        return self._array(name, shape, chunks, dtype, ("y", "x", *("channel",) * len(after)))

    def _array(
        self, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], dtype: np.dtype[Any], axes: tuple[str, ...]
    ) -> Any:
        fast = zarr.codecs.BloscCodec(cname="lz4", clevel=1, shuffle="shuffle")
        chunks = tuple(max(1, min(pair)) for pair in zip(chunks, shape, strict=True))
        return self.root.create_array(
            name, shape=shape, chunks=chunks, dtype=dtype, compressors=fast, dimension_names=axes, overwrite=True
        )


class Stored(Conditions):
    """Conditioning data and guides of an output, window by window out of a store."""

    def __init__(self, store: Store, work: Work) -> None:
        super().__init__(work.confidences)
        self._store, self._work = store, work

    def at(self, number: int, grid: Grid) -> Held | None:
        """Return the data and guides of a level's sites in a window; None if there are none."""
        if not self._work.held or grid.part is None:
            return None
        window = Tile(*grid.within[:2], grid.rows, grid.cols)
        return self._store.held(self._work.layout.levels[number], window)

    def scattered(self, number: int) -> Data | None:
        """Return the conditioning data between the sites of a level; None if there are none."""
        work, name = self._store.root["work"], f"scattered{number}"
        return Data(*(work[name][field][...] for field in Data._fields)) if name in work else None


def first_turn(layout: Layout) -> Turn:
    """Return the turn that begins the coarsest level."""
    return Turn(1, phase_of(layout.levels[-1]), len(layout.levels) - 1)


def phase_of(level: LevelLayout) -> str:
    """Return the phase that begins a level: a level of one tile does all its sweeps in one turn."""
    return "whole" if level.count == 1 else "begin"


def spans(tile: Tile) -> tuple[slice, slice]:
    """Return the rows and columns of a tile."""
    return slice(tile.top, tile.top + tile.rows), slice(tile.left, tile.left + tile.cols)


def cut(array: Any, level: LevelLayout, window: Tile) -> NDArray[Any]:
    """Return a window of a stored array (..., rows, cols), which may cross the seam."""

    def parts(first: int, size: int, whole: int) -> Iterator[tuple[slice, slice]]:
        at = 0
        while at < size:
            begin = (first + at) % whole
            end = min(whole, begin + size - at)
            yield slice(begin, end), slice(at, at + end - begin)
            at += end - begin

    found = np.empty((*array.shape[:-2], window.rows, window.cols), array.dtype)
    for rows, down in parts(window.top, window.rows, level.rows):
        for cols, right in parts(window.left, window.cols, level.cols):
            found[..., down, right] = array[..., rows, cols]
    return found
