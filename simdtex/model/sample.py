# SPDX-License-Identifier: BSD-3-Clause
"""The sample in working grey levels, their variance, and the candidates of a level."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.guide import AnyGuide, Colocated
from simdtex.model.lattice import gathered, in_three_axes
from simdtex.model.pictures import NothingUsable, Pictures
from simdtex.model.regularity import WAVES, Phases
from simdtex.model.scale import Scale, highest, structure

STEPS = 1023
"""Highest level of the structure channel of 8-bit samples, which may vary more than the pixels."""

FINE = 8
"""Steps in a working level, if working levels are not the pixels themselves."""

UNSURE = 0.25
"""Share of a candidate's neighbours that may be unknown; each has the value of the nearest known pixel."""

ENOUGH_WHOLE = 0.75
"""Share of positions that must have a whole neighbourhood for ``edges="auto"`` not to reflect."""

FEW = 1000
"""Number of whole neighbourhoods below which a coarse level reflects the sample with ``edges="whole"``."""


class Places(NamedTuple):
    """The places of a level's candidates: the crossings of some rows and columns of the sample."""

    offsets: NDArray[np.int32]  # (N, 2 or 3), the neighbourhood
    spacing: int  # 2**level
    step: int  # pixels from one crossing to the next
    row: NDArray[np.int32]
    col: NDArray[np.int32]
    everywhere: NDArray[np.int32]  # (n,), the pixel index of each crossing, row by row
    allowed: NDArray[np.bool_] | None  # (n,), whether each is a candidate; None: all are
    reach: NDArray[np.int32]  # (N,), the pixel offset of each neighbour
    layers: int = 1  # of crossings; a volume has the rows of all its layers

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the crossings, (rows, cols) or (layers, rows, cols)."""
        sides = (self.row.size // self.layers, self.col.size)
        return sides if self.layers == 1 else (self.layers, *sides)

    @property
    def positions(self) -> NDArray[np.int32]:
        """Pixel index of every candidate, row by row."""
        return self.everywhere if self.allowed is None else self.everywhere[self.allowed]


class Candidates(NamedTuple):
    """The sample positions p that a site may take, at one level, as arrays of a machine."""

    pixels: Any  # (C, rows * cols) float32, the working grey levels including the margin
    positions: Any  # (n,) int32, the pixel index of each p, row by row
    size: int  # n
    reach: Any  # (N,) int32, the pixel offset of each neighbour
    index_of: Any  # (rows * cols,) int32, the index of a pixel in positions or -1
    guides: int = 0  # channels of guides, which are the last

    @property
    def plane(self) -> int:
        """Number of pixels of the sample with its margin."""
        return int(self.index_of.size)

    def number_of(self, source: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the number of the candidate at each pixel index, on the host; -1 at none, or for a negative index."""
        return gathered(self.index_of, source, -1)

    @property
    def made(self) -> int:
        """Number of channels that are not guides."""
        return int(self.pixels.shape[0]) - self.guides


class Sample:
    """A sample in working grey levels: pictures one below another, or the layers of volumes.

    A term of (12) is a square of a whole multiple of 2**-10 below 2**b, so a sum of `values` of them needs
    2 b + 20 + log2(values) bits. With 53 or fewer, float64 holds it and the NumPy twin, which rounds to float32 after
    each term, has the bits of a device's fma.

    Of its attributes, ``shown`` is the number of channels of the picture itself, and ``channels`` that of these and the
    structure channel; ``guides`` (G, H, W) and ``guided``, (G, rows, cols) of each picture, are levels of guides;
    ``known_variables`` counts the last guide channels, which are variables known at sites whose others are unknown;
    ``boxes`` are the first row (of a volume, layer), the rows and the columns of each picture; ``layer``, the rows of a
    layer of a volume with its margin, is 0 for pictures.
    """

    def __init__(
        self,
        pixels: NDArray[Any] | Pictures,
        values: int,  # of a neighbourhood: channels times neighbours
        margin: int = 0,  # pixels by which each picture is continued by reflection; they are never taken
        weight: float = 0.0,  # of the structure channel, which is matched and never shown
        step: int = 1,  # pixels from site to site at the coarsest level; every picture begins at a multiple
        guides: Sequence[AnyGuide] = (),  # whose channels come last
        apart: int = 0,  # the least distance between two pictures, if that is more than their margins
        phases: Phases | None = None,  # the guide by the sample's own lattice, which is no channel
        reduction: int = 1,  # pixels of the user's sample along a side of the square whose mean a pixel is
    ) -> None:
        self.pictures = pixels if isinstance(pixels, Pictures) else Pictures((pixels,))
        self.layout = dict(values=values, margin=margin, weight=weight, step=step, apart=apart, reduction=reduction)
        self.phases, self.reduction = phases, reduction
        self.scale = Scale(self.pictures, values)
        self.top, self.unit, self.direct = self.scale.top, self.scale.unit, self.scale.direct
        levels = [self.scale.levels(picture) for picture in self.pictures.pixels]
        self.shown, spread = len(levels[0]), variance(*levels)
        guiding = [guide.planes(self.scale, spread * self.shown, highest(values)) for guide in guides]
        if weight:
            more = structure(levels, weight, spread, max(self.top, STEPS))
            levels = [np.concatenate([here, plane[None]]) for here, plane in zip(levels, more, strict=True)]
        channels = len(levels[0])
        self.guided = [np.concatenate(those) for those in zip(*(guide.samples for guide in guiding), strict=True)]
        for guide in guiding:
            levels = [np.concatenate(pair) for pair in zip(levels, guide.samples, strict=True)]
        self.guides = np.concatenate([guide.output for guide in guiding]) if guiding else np.zeros((0, 1, 1), np.uint16)
        known = (len(part.output) for guide, part in zip(guides, guiding, strict=True) if isinstance(guide, Colocated))
        self.known_variables = sum(known)
        self.waves = phases and phases.waves(spread * self.shown, highest(values))
        self._lay(levels, margin, step, apart)
        self.channels = channels
        self.pixels = self._stacked(list(self.pictures.pixels), self.pictures.pixels[0].flat[0])

    @classmethod
    def of_levels(cls, levels: NDArray[Any], count: int) -> Sample:
        """Return a grey sample from working levels 0 .. count - 1."""
        sample = cls.__new__(cls)
        sample.pixels, sample.shown, sample.pictures = levels[..., None], 1, Pictures((levels[..., None],))
        sample.top, sample.unit, sample.direct = count - 1, 1.0, True
        sample.reduction, sample.guides, sample.waves = 1, np.zeros((0, 1, 1), np.uint16), None
        sample._lay([levels[None].astype(np.uint16)], 0)
        return sample

    def _lay(self, levels: Sequence[NDArray[np.uint16]], margin: int, step: int = 1, apart: int = 0) -> None:
        self.margin, self.channels, self.boxes, self.layer = margin, len(levels[0]), [], 0
        self._places: dict[tuple[Any, ...], Places] = {}
        self.__dict__.pop("variance", None)
        if levels[0].ndim > 3:
            self._lay_volumes(levels, margin, step)
            return
        top = 0
        for picture in levels:
            self.boxes.append((top, *picture.shape[1:]))
            top += -(-(picture.shape[1] + max(2 * margin, apart)) // step) * step
        self.height, self.width = sum(self.boxes[-1][:2]), max(cols for *_, cols in self.boxes)
        self.rows, self.cols = self.height + 2 * margin, self.width + 2 * margin
        canvas = np.zeros((len(levels[0]), self.rows, self.cols), np.uint16)
        for (first, rows, cols), picture in zip(self.boxes, levels, strict=True):
            around = ((0, 0), (margin, margin), (margin, margin))
            padded = np.pad(picture, around, mode="reflect" if min(rows, cols) > 1 else "edge")
            canvas[:, first : first + rows + 2 * margin, : cols + 2 * margin] = padded
        self.levels = [
            canvas[:, margin + first : margin + first + rows, margin : margin + cols]
            for first, rows, cols in self.boxes
        ]
        self.working = canvas.reshape(len(canvas), -1)

    def _lay_volumes(self, levels: Sequence[NDArray[np.uint16]], margin: int, step: int) -> None:
        self.height, self.width = (max(volume.shape[axis] for volume in levels) for axis in (2, 3))
        self.layer, self.cols, self.levels = self.height + 2 * margin, self.width + 2 * margin, [*levels]
        high, parts = 0, []
        for volume in levels:
            self.boxes.append((high, *volume.shape[2:]))
            parts.append(np.pad(volume, ((0, 0), *[(margin, margin)] * 3), mode="reflect"))
            high += -(-parts[-1].shape[1] // step) * step
        self.depth = self.boxes[-1][0] + levels[-1].shape[1]
        canvas = np.zeros((len(levels[0]), self.depth + 2 * margin, self.layer, self.cols), np.uint16)
        for (first, *_), volume in zip(self.boxes, parts, strict=True):
            canvas[:, first : first + volume.shape[1], : volume.shape[2], : volume.shape[3]] = volume
        self.rows, self.working = canvas.shape[1] * self.layer, canvas.reshape(len(canvas), -1)

    def _stacked(self, pictures: Sequence[NDArray[Any]], between: Any) -> NDArray[Any]:
        """Return arrays ([layers,] rows, cols, ...), one for each picture, stacked without the margin."""
        if len(pictures) == 1:
            return pictures[0]
        sides = (self.depth, self.height, self.width) if self.layer else (self.height, self.width)
        stacked = np.full((*sides, *pictures[0].shape[len(sides) :]), between, pictures[0].dtype)
        for (first, *_), picture in zip(self.boxes, pictures, strict=True):
            stacked[(slice(first, first + len(picture)), *map(slice, picture.shape[1 : len(sides)]))] = picture
        return stacked

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Mask (rows, cols), margins included, of the sample's pixels that are known and may be taken."""
        here = [np.ones(planes.shape[1:], bool) for planes in self.levels]
        for masks in (self.pictures.known, self.pictures.usable):
            here = [a & b for a, b in zip(here, masks, strict=True)] if masks else here
        return self._framed(here)

    def _framed(self, masks: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """Return the masks of all pictures as one mask of the sample with its margin, (rows, cols)."""
        return np.pad(self._stacked(masks, False), self.margin).reshape(self.rows, self.cols)

    @cached_property
    def variance(self) -> float:
        """sigma^2 of equation (8): the variance of the working levels, averaged over the matched channels."""
        return variance(*(planes[: self.channels] for planes in self.levels))

    def _in_pixels(self, offsets: NDArray[np.int32], spacing: int) -> NDArray[np.int32]:
        """Return offsets from sites of a level in rows and columns of the sample with its margin, (N, 2)."""
        layer, row, col = in_three_axes(offsets).T
        return np.stack([layer * self.layer + row, col], 1) * np.int32(spacing)

    def _crossings(self, radius: int, step: int) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.bool_]]:
        """Return rows and columns of places, without the margin, and the mask of those with a whole neighbourhood."""

        def whole(at: NDArray[np.int32], first: int, size: int) -> NDArray[np.bool_]:
            inside: NDArray[np.bool_] = (at - radius >= first) & (at + radius < first + size)
            return inside

        row, col = (np.arange(0, n, step, dtype=np.int32) for n in (self.height, self.width))
        layer = np.arange(0, self.depth if self.layer else 1, step, dtype=np.int32)
        mask = np.zeros((layer.size, row.size, col.size), bool)
        for (top, rows, cols), levels in zip(self.boxes, self.levels, strict=True):
            down = whole(row, 0 if self.layer else top, rows)
            deep = whole(layer, top, levels.shape[1]) if self.layer else np.ones(1, bool)
            mask |= deep[:, None, None] & down[:, None] & whole(col, 0, cols)
        if self.layer:
            row = ((layer + self.margin)[:, None] * np.int32(self.layer) + row).ravel()
        return row, col, mask.reshape(-1, col.size)

    def places(self, offsets: NDArray[np.int32], spacing: int, phases: int = 1, edges: str = "whole") -> Places:
        """Return the places of the candidates of a level, whose neighbourhood has the ``spacing`` 2**level.

        Places outside the pictures, unknown or unusable ones, and those with too large a share of unknown neighbours
        (`UNSURE`) are no candidates. ``phases``, rounded down to a power of 2, is the number of decimations along each
        axis, equation (10), whose pixels are places; from `spacing` on, every pixel is one. ``edges`` says whether
        neighbourhoods must be whole, equation (4); a coarse level with fewer than `FEW` such places reflects, too.
        """
        key = (offsets.tobytes(), spacing, phases, edges)
        if key in self._places:
            return self._places[key]
        step, margin = max(1, spacing >> (phases.bit_length() - 1)), self.margin
        row, col, whole = self._crossings(int(offsets.max()) * spacing, step)
        usable: NDArray[np.bool_] = self.inside[np.ix_(row + margin, col + margin)]
        apart = self._in_pixels(offsets, spacing)
        of_all, of_whole = np.count_nonzero(usable), np.count_nonzero(usable & whole)
        reflects = {
            "auto": spacing > 1 or of_whole < ENOUGH_WHOLE * of_all,
            "whole": spacing > 1 and of_whole < FEW,
            "reflect": True,
        }
        if not reflects[edges]:
            usable &= whole
        if self.pictures.clean:
            row, col, allowed = row[usable.any(1)], col[usable.any(0)], None
        else:
            if self.pictures.known:
                usable &= self._sure(apart, row + margin, col + margin)
            if not usable.any():
                raise NothingUsable(
                    "nothing of the sample is usable at a level; give more of it, order=1 or 2, or fewer levels"
                )
            allowed = usable.ravel()
        everywhere = ((row + margin)[:, None] * np.int32(self.cols) + (col + margin)[None, :]).astype(np.int32).ravel()
        reach = apart @ np.array([self.cols, 1], np.int32)
        layers = len(set(((row + margin) // self.layer).tolist())) if self.layer else 1
        self._places[key] = Places(offsets, spacing, step, row, col, everywhere, allowed, reach, layers)
        return self._places[key]

    def _sure(self, offsets: NDArray[np.int32], row: NDArray[np.int32], col: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return the mask of crossings with few unknown neighbours; ``row`` and ``col`` include the margin."""
        assert self.pictures.known is not None
        missing = self._framed([~known for known in self.pictures.known])
        lines = np.flatnonzero(missing.any(1))
        near = (row + offsets[:, 0].max() >= lines[0]) & (row + offsets[:, 0].min() <= lines[-1])  # with one in reach
        count = np.zeros((int(near.sum()), col.size), np.int16)
        for a, b in offsets:
            count += missing[np.ix_(row[near] + a, col + b)]
        sure = np.ones((row.size, col.size), bool)
        sure[near] = count <= UNSURE * len(offsets)
        return sure

    def fair(self, places: Places) -> NDArray[np.int64] | None:
        """Return the fair use of each place, (n,) integers in one unit; None if it is the same for all."""
        allowed = places.allowed
        if allowed is None:
            return None
        if not self.pictures.shares:
            return allowed.astype(np.int64)
        picture = self.picture_of(places.everywhere)
        counts = np.bincount(picture[allowed], minlength=len(self.boxes))
        total, fair = sum(self.pictures.shares), np.zeros(allowed.size, np.int64)
        for index, share in enumerate(self.pictures.shares):
            each = round(2**16 * share / total * int(counts.sum()) / max(1, int(counts[index])))
            fair[allowed & (picture == index)] = each
        return fair

    def picture_of(self, source: NDArray[np.integer]) -> NDArray[np.intp]:
        """Return the number of the picture of each pixel index: the last one that begins at or above it."""
        tops = np.array([top for top, *_ in self.boxes]) * (self.layer or 1)
        row = np.asarray(source) // self.cols - self.margin * ((self.layer or 0) + 1)
        picture: NDArray[np.intp] = np.maximum(np.searchsorted(tops, row, "right") - 1, 0)
        return picture

    def phases_at(self, source: NDArray[np.integer]) -> NDArray[np.uint16]:
        """Return the phases (waves, n) of pixels (n,) of a regular sample."""
        assert self.waves
        phases = np.empty((WAVES, source.size), np.uint16)
        for picture, there, row, col in self._in_pictures(source):
            phases[:, there] = self.waves.sample(picture, row, col)
        return phases

    def phase_numbers_at(self, source: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the numbers (n,) of the phases of pixels (n,) of a regular sample."""
        assert self.waves
        phases = np.empty(source.size, np.int32)
        for picture, there, row, col in self._in_pictures(source):
            phases[there] = self.waves.phase(picture, row, col)
        return phases

    def _in_pictures(self, source: NDArray[np.integer]) -> Iterator[tuple[int, NDArray[np.bool_], Any, Any]]:
        """Yield the number of each picture, which of the pixels (n,) are in it, and their rows and columns there."""
        row, col = np.divmod(source, self.cols) - np.full(2, self.margin)[:, None]
        pictures = self.picture_of(source)
        for picture, (top, *_) in enumerate(self.boxes):
            there = pictures == picture
            yield picture, there, row[there] - top, col[there]

    @property
    def hot(self) -> int:
        """Number of channels of the first variable, if that is one channel for each category; else 0."""
        categories = self.pictures.categories(0)
        return len(categories) if categories is not None and len(categories) > 2 else 0

    @cached_property
    def changes(self) -> tuple[float, ...]:
        """The `_change` of pixels 1, 2, 4, ... apart, up to the spacing of the coarsest level."""
        return tuple(self._change(1 << k) for k in range(int(self.layout["step"]).bit_length()))

    def _change(self, spacing: int) -> float:
        """Return the mean squared difference of pixels so far apart, in units of the pixels' variance, at most 1."""
        squares = pairs = 0
        for levels in self.levels:
            made = levels[: self.shown].astype(np.int64)
            for axis in range(1, made.ndim):
                along = made.swapaxes(0, axis)
                apart = along[spacing:] - along[:-spacing]
                squares, pairs = squares + int((apart * apart).sum()), pairs + apart.size
        spread = variance(*(levels[: self.shown] for levels in self.levels))
        return min(1.0, squares / max(1, pairs) / spread) if squares else 1.0

    def planes(self, machine: Any) -> Any:
        """Return the working levels on a machine, (C, rows * cols) float32."""
        return machine.put(self.working.astype(np.float32))

    def candidates(self, machine: Any, places: Places, planes: Any | None = None, every: bool = False) -> Candidates:
        """Return the candidates of a level, or ``every`` place in the list; ``planes`` are levels on the machine."""
        positions = places.positions
        index_of = np.full(self.rows * self.cols, -1, np.int32)
        index_of[positions] = np.arange(positions.size, dtype=np.int32)
        if every and places.allowed is not None:
            index_of[positions] = np.flatnonzero(places.allowed)
            positions = places.everywhere
        return Candidates(
            self.planes(machine) if planes is None else planes,
            machine.put(positions),
            positions.size,
            machine.put(np.pad(places.reach, (0, bool(len(self.guides))))),  # the site itself, for guides
            machine.put(index_of),
            len(self.guides),
        )

    @property
    def first(self) -> int:
        """Pixel index of the first pixel outside the margin."""
        return int(self.margin * ((self.layer + 1) * self.cols + 1))

    def _coordinates(self, source: NDArray[np.int32]) -> tuple[NDArray[np.int32], ...]:
        """Return row and column of pixel indices, without the margin; for a volume, layer, row and column."""
        row, col = np.divmod(source, np.int32(self.cols))
        lines = (*np.divmod(row, np.int32(self.layer)), col) if self.layer else (row, col)
        return tuple(line - np.int32(self.margin) for line in lines)

    def place(self, source: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return [layer,] row, column[, picture] in the user's sample of pixel indices; -1 without a source."""
        place = np.stack(self._coordinates(source), -1)
        if len(self.boxes) > 1:
            picture = self.picture_of(source).astype(np.int32)
            place[..., 0] -= np.array([top for top, *_ in self.boxes], np.int32)[picture]
            place = np.concatenate([place * np.int32(self.reduction), picture[..., None]], -1)
        else:
            place *= self.reduction
        return np.where((source < 0)[..., None], np.int32(-1), place)

    def index(self, place: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return the pixel index of places as `place` returns them; -1 if the first number is below 0."""
        row, col = (place[..., axis + (self.layer > 0)] for axis in (0, 1))
        boxes: Any = np.array(self.boxes).T
        first, rows, cols = gathered(boxes, place[..., -1], 0) if len(self.boxes) > 1 else boxes[:, 0]
        if self.reduction > 1:
            row, col = np.minimum(row // self.reduction, rows - 1), np.minimum(col // self.reduction, cols - 1)
        row = row + ((place[..., 0] + first + self.margin) * self.layer if self.layer else first)
        index = (row + self.margin) * self.cols + col + self.margin
        return np.where(place[..., 0] < 0, -1, index).astype(np.int32)

    def picture(self, values: NDArray[Any], source: NDArray[Any]) -> NDArray[Any]:
        """Return the picture (rows, cols, C) of working levels (C, rows, cols) and pixel indices (rows, cols).

        A pixel is its source pixel plus the difference of the working level from that of the source.
        """
        source = np.maximum(source, self.first)  # without a source: the difference from the first pixel
        pixels, usual = self.own(source), self.working[: self.shown, source]
        if not self.direct or (values[: self.shown] == usual).all():
            return np.ascontiguousarray(pixels)
        step = np.moveaxis(values[: self.shown].astype(np.int64) - usual, 0, -1)
        return moved(pixels, step, self.unit, self.pixels)

    def own(self, source: NDArray[np.int32]) -> NDArray[Any]:
        """Return the pixels (..., C) at pixel indices, in the sample's own type."""
        pixels: NDArray[Any] = self.pixels[self._coordinates(np.maximum(source, self.first))]
        return pixels

    def category(self, source: NDArray[Any]) -> NDArray[np.intp]:
        """Return the number of the class of the first variable of pixels (n,), for example its category."""
        return np.searchsorted(self.pictures.classes, self.own(source)[:, 0])

    def around(self, position: NDArray[np.int32], reach: NDArray[np.int32]) -> NDArray[Any]:
        """Return the pixels (n, N, C) at pixel offsets (N,) from pixels (n,); pixels of the margin are reflections."""
        lines = np.stack(self._coordinates(position[:, None] + reach))
        picture = self.picture_of(position)
        sides = np.array([planes.shape[1:] for planes in self.levels])[picture].T[..., None]
        top = np.array([top for top, *_ in self.boxes])[picture, None]
        lines[0] -= top
        period = np.maximum(2 * sides - 2, 1)
        lines = abs(lines) % period
        lines = np.minimum(lines, period - lines)
        lines[0] += top
        pixels: NDArray[Any] = self.pixels[tuple(lines)]
        return pixels

    def moved(self, source: NDArray[Any], by: NDArray[np.int16]) -> NDArray[Any]:
        """Return the pixels (rows, cols, C) at indices, plus the differences ``by`` (C, rows, cols) of the finish."""
        pixels, change = self.own(source), np.moveaxis(by, 0, -1)
        if self.pixels.dtype == np.uint8 and self.direct:
            exact: NDArray[Any] = np.clip(pixels.astype(np.int32) + change, 0, 255).astype(np.uint8)
            return exact
        units = self.scale.units if not self.direct else self.unit
        return moved(pixels, change, units / self.fine, self.pixels)

    @property
    def fine(self) -> int:
        """Steps in a working level by which a finished picture differs from its sources."""
        return 1 if self.top == 255 else FINE


def variance(*pictures: NDArray[np.integer]) -> float:
    """Return the variance of working levels (C, rows, cols) of one or several pictures, averaged over channels."""
    n, total, channels = sum(levels[0].size for levels in pictures), 0.0, len(pictures[0])
    for c in range(channels):  # integers: the same sum on every machine
        planes = [levels[c].astype(np.int64) for levels in pictures]
        squares, values = sum(int((plane * plane).sum()) for plane in planes), sum(int(p.sum()) for p in planes)
        total += (n * squares - values * values) / n**2
    return float(total / channels)


def moved(values: NDArray[Any], by: NDArray[Any], unit: Any, pixels: NDArray[Any]) -> NDArray[Any]:
    """Return pixels plus a difference in units, as the closest of 0 to 255 for 8 bits, else of the sample's range."""
    with np.errstate(over="ignore"):  # half values beyond the largest double are clipped
        half = values.astype(np.float64) / 2 + by * (unit / 2)
    if pixels.dtype == np.bool_:
        legal: NDArray[Any] = half > 0.25
    elif pixels.dtype.kind == "f":
        with np.errstate(over="ignore"):
            legal = np.clip(2 * half, float(pixels.min()), float(pixels.max())).astype(pixels.dtype)
    else:
        bounds = np.iinfo(pixels.dtype)
        most = float(bounds.max)  # may be one above the range of the type
        most = most if int(most) <= bounds.max else float(np.nextafter(most, 0))
        legal = np.clip(np.rint(2 * half), bounds.min, most).astype(pixels.dtype)
        legal = legal if pixels.dtype == np.uint8 else np.clip(legal, pixels.min(), pixels.max())
    return np.where(by == 0, values, legal)
