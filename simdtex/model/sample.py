# SPDX-License-Identifier: BSD-3-Clause
"""The sample as the model sees it: working grey levels, their variance, and the candidates of a level."""

from __future__ import annotations

from math import log2
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.structure import structure

BLOCK = 64
"""Candidates to a block (kernels/lcpdf.cl); lists of candidates are padded to whole blocks."""

STEPS = 1023
"""Highest level of the structure channel of 8-bit samples, which may vary more than they do."""

FINE = 8
"""Steps to a working level, where that is no pixel of its own."""

ENOUGH_WHOLE = 0.75
"""Share of positions that must have a whole neighbourhood for ``edges="auto"`` not to reflect."""


class Candidates(NamedTuple):
    """The sample positions p that a site may be taken from, at one level.

    ``pixels`` (C, rows * cols) float32 working grey levels, margin and all; ``positions`` (n rounded up to
    blocks,) int32 pixel index of each p, row by row; ``size`` n; ``reach`` (N,) int32 pixel offset of each
    neighbour; ``index_of`` (rows * cols,) int32 place of a pixel in ``positions`` or -1; ``rows``, ``cols`` of the
    sample with its margin.
    """

    pixels: Any
    positions: Any
    size: int
    reach: Any
    index_of: Any
    rows: int
    cols: int


class Sample:
    """A sample image in working grey levels.

    Eight-bit pixels are their own working levels. Other types are mapped onto 0..top, `top` being 4095 or, for
    neighbourhoods of more than 512 values, the largest 2**b - 1 for which the distance of equation (12) is exact
    (see `Notes`). Pixels of the output are taken from the sample itself, so nothing is lost there.

    Parameters
    ----------
    pixels : (height, width, channels) array
        As given by the user; any real type, finite.
    values : int
        Values to a neighbourhood: channels times neighbours.
    margin : int
        Pixels by which the sample is continued, by reflection, on every side for the sake of the neighbourhoods of
        its outer pixels. Nothing is ever taken from the margin itself.
    weight : float
        Of the structure channel (`simdtex.model.structure`), which is matched like the others and never shown; 0: none.
    spread : bool
        Whether grey levels are drawn from a kernel that knows 0..top alone; the structure channel then keeps to it.

    Attributes
    ----------
    shown : int
        Channels of a picture.
    channels : int
        Channels that are matched: those, and the structure channel.

    Notes
    -----
    A term of (12) is a square of a whole multiple of 2**-10 below 2**b, so a sum of `values` of them needs
    2 b + 20 + log2(values) bits. With 53 or fewer, float64 holds it and the NumPy twin, which rounds to float32 after
    each term, has the bits of a device's fma.
    """

    def __init__(
        self, pixels: NDArray[Any], values: int, margin: int = 0, weight: float = 0.0, spread: bool = False
    ) -> None:
        self.pixels, self.shown = pixels, pixels.shape[-1]
        planes = np.moveaxis(pixels, -1, 0)
        if pixels.dtype in (np.bool_, np.uint8):
            self.top, self.unit = 255, 1.0
            levels = planes.astype(np.uint16)
        else:
            self.top = 2 ** min(12, int((33 - log2(values)) / 2)) - 1
            stretched, self.unit = stretch(planes, self.top)
            levels = stretched.astype(np.uint16)
        if weight:
            most = self.top if spread else max(self.top, STEPS)
            levels = np.concatenate([levels, structure(levels, weight, variance(levels), most)[None]])
        self._lay(levels, margin)

    @classmethod
    def of_levels(cls, levels: NDArray[Any], count: int) -> Sample:
        """A grey sample that is given in working levels 0 .. count - 1 already."""
        sample = cls.__new__(cls)
        sample.pixels, sample.shown = levels[..., None], 1
        sample.top, sample.unit = count - 1, 1.0
        sample._lay(levels[None].astype(np.uint16), 0)
        return sample

    def _lay(self, levels: NDArray[np.uint16], margin: int) -> None:
        self.levels, self.margin, self.channels = levels, margin, len(levels)
        self.height, self.width = levels.shape[1:]
        around = ((0, 0), (margin, margin), (margin, margin))
        padded = np.pad(levels, around, mode="reflect" if min(levels.shape[1:]) > 1 else "edge")
        self.rows, self.cols = padded.shape[1:]
        self.working = np.ascontiguousarray(padded).reshape(self.channels, -1)

    @property
    def variance(self) -> float:
        """sigma^2 of equation (8): the mean over channels of the variance of the working levels."""
        return variance(self.levels)

    def positions(
        self,
        offsets: NDArray[np.int32],
        spacing: int,
        phases: str = "decimated",
        edges: str = "whole",
    ) -> NDArray[np.int32]:
        """Pixel index of every candidate of a level, row by row.

        Parameters
        ----------
        offsets : (N, 2) int32 array
            The neighbourhood.
        spacing : int
            2**level, by which the neighbourhood is spread.
        phases : {"decimated", "all"}
            The pixels of the decimated sample, equation (10), or every pixel.
        edges : {"whole", "reflect", "auto"}
            Those whose neighbourhood lies in the sample, equation (4); all, where the margin is wide enough; or
            the former at the finest level, where they are three quarters of all or more, else the latter.
        """
        row, col = self.lines(offsets, spacing, phases, edges)
        row, col = row + np.int32(self.margin), col + np.int32(self.margin)
        positions: NDArray[np.int32] = (row[:, None] * np.int32(self.cols) + col[None, :]).ravel()
        return positions

    def lines(
        self, offsets: NDArray[np.int32], spacing: int, phases: str = "decimated", edges: str = "whole"
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Rows and columns of the user's sample at whose crossings the candidates of a level lie; see `positions`."""
        (top, left), (bottom, right) = offsets.min(0) * spacing, offsets.max(0) * spacing
        step = 1 if phases == "all" else spacing
        row = np.arange(0, self.height, step, dtype=np.int32)
        col = np.arange(0, self.width, step, dtype=np.int32)
        whole_row = row[(row + top >= 0) & (row + bottom < self.height)]
        whole_col = col[(col + left >= 0) & (col + right < self.width)]
        few = whole_row.size * whole_col.size < ENOUGH_WHOLE * row.size * col.size
        if not (edges == "reflect" or (edges == "auto" and (spacing > 1 or few))):
            row, col = whole_row, whole_col
        return row, col

    def reach(self, offsets: NDArray[np.int32], spacing: int) -> NDArray[np.int32]:
        """Pixel offset of each neighbour, (N,), at a level whose sites are `spacing` pixels apart."""
        reach: NDArray[np.int32] = (offsets @ np.array([self.cols, 1], np.int32) * np.int32(spacing)).astype(np.int32)
        return reach

    def planes(self, machine: Any) -> Any:
        """The working levels as an array (C, rows * cols) of a machine, float32."""
        return machine.put(self.working.astype(np.float32))

    def candidates(
        self,
        machine: Any,
        offsets: NDArray[np.int32],
        spacing: int,
        phases: str = "decimated",
        edges: str = "whole",
        planes: Any | None = None,
    ) -> Candidates:
        """The candidates of a level (see `positions`) as arrays of a machine, which may have the planes already."""
        positions = self.positions(offsets, spacing, phases, edges)
        index_of = np.full(self.rows * self.cols, -1, np.int32)
        index_of[positions] = np.arange(positions.size, dtype=np.int32)
        padding = np.full(-positions.size % BLOCK, positions[0], np.int32)
        return Candidates(
            self.planes(machine) if planes is None else planes,
            machine.put(np.concatenate([positions, padding])),
            positions.size,
            machine.put(self.reach(offsets, spacing)),
            machine.put(index_of),
            self.rows,
            self.cols,
        )

    def place(self, source: NDArray[np.int32]) -> NDArray[np.int32]:
        """(row, column) in the user's sample of pixel indices, on a last axis."""
        return np.stack(np.divmod(source, np.int32(self.cols)), -1) - np.int32(self.margin)

    def picture(self, values: NDArray[Any], source: NDArray[Any]) -> NDArray[Any]:
        """The picture that working levels and sources stand for, in the sample's own type.

        Parameters
        ----------
        values : (C, rows, cols) array
            Working levels; the structure channel does not show.
        source : (rows, cols) array
            Pixel index in the sample.

        Returns
        -------
        (rows, cols, C) array
            The source's pixel, plus what the working level differs from the source's own.
        """
        row, col = np.divmod(source, np.int32(self.cols))
        own = self.pixels[row - np.int32(self.margin), col - np.int32(self.margin)]
        usual = self.working[: self.shown, source]
        if (values[: self.shown] == usual).all():
            return np.ascontiguousarray(own)
        step = np.moveaxis(values[: self.shown].astype(np.int64) - usual, 0, -1)
        return moved(own, step * self.unit, self.pixels)

    def moved(self, source: NDArray[Any], by: NDArray[np.int16]) -> NDArray[Any]:
        """The pixels of some sources, moved by what `simdtex.ops.finish` says.

        Parameters
        ----------
        source : (rows, cols) array
            Pixel index in the sample.
        by : (C, rows, cols) array
            Working levels of 8-bit samples; `FINE`-ths of a working level of others.

        Returns
        -------
        (rows, cols, C) array
            In the sample's own type.
        """
        row, col = np.divmod(source, np.int32(self.cols))
        own, change = self.pixels[row - np.int32(self.margin), col - np.int32(self.margin)], np.moveaxis(by, 0, -1)
        if self.pixels.dtype == np.uint8:
            exact: NDArray[Any] = (own + change).astype(np.uint8)  # a mean of pixels is one
            return exact
        return moved(own, change * (self.unit / self.fine), self.pixels)

    @property
    def fine(self) -> int:
        """Steps to a working level in which a finished picture differs from its sources."""
        return 1 if self.top == 255 else FINE


def variance(levels: NDArray[np.integer]) -> float:
    """The mean over channels of the variance of working levels (C, rows, cols)."""
    n, total = levels[0].size, 0.0
    for channel in levels.astype(np.int64):  # integers: the same sum on every machine
        squares, values = int((channel * channel).sum()), int(channel.sum())
        total += (n * squares - values * values) / n**2
    return float(total / len(levels))


def stretch(pixels: NDArray[Any], top: int) -> tuple[NDArray[np.int64], float]:
    """Pixels of any real type stretched over the integers 0..top, and the size of 1 in their own unit."""
    if pixels.dtype.kind in "iu":
        whole = pixels.astype(np.uint64)  # modulo 2**64, so a difference from the least is exact
        half = (whole - pixels.min().astype(np.uint64)) / np.float64(2)
    else:
        half = pixels.astype(np.float64) / 2  # so that no difference overflows
        half = half - half.min()
    half_unit = float(half.max()) / top or 0.5
    return np.rint(half / half_unit).astype(np.int64), 2 * half_unit


def moved(own: NDArray[Any], by: NDArray[np.floating[Any]], pixels: NDArray[Any]) -> NDArray[Any]:
    """Pixels of a sample moved by a difference and projected onto the closest legal ones; others stay as they are.

    Legal are 0 to 255 for 8 bits, and what lies between the sample's smallest and largest pixel otherwise.
    """
    with np.errstate(over="ignore"):  # what is beyond the largest double is brought back
        values = own.astype(np.float64) + by
    if pixels.dtype == np.bool_:
        legal: NDArray[Any] = values > 0.5
    elif pixels.dtype.kind == "f":
        legal = np.clip(values, float(pixels.min()), float(pixels.max())).astype(pixels.dtype)
    else:
        bounds = np.iinfo(pixels.dtype)
        most = float(bounds.max)  # which may be one more than the type holds
        most = most if int(most) <= bounds.max else float(np.nextafter(most, 0))
        legal = np.clip(np.rint(values), bounds.min, most).astype(pixels.dtype)
        legal = legal if pixels.dtype == np.uint8 else np.clip(legal, pixels.min(), pixels.max())
    return np.where(by == 0, own, legal)
