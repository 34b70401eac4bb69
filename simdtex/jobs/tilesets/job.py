# SPDX-License-Identifier: BSD-3-Clause
"""Sets of corner tiles: `tileset`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from simdtex import random
from simdtex.checkpoint import Checkpointing
from simdtex.driver import Device, Kept, Seed, drive, run
from simdtex.inputs import check_samples, check_shape, with_channels_last
from simdtex.jobs.tilesets.corners import CYCLE, TORUS, corners_of, torus
from simdtex.machine import Machine
from simdtex.maspar import observers
from simdtex.methods import mrf
from simdtex.methods.mrf.options import Options
from simdtex.model.given import Given
from simdtex.model.lattice import sums_around
from simdtex.model.light import Light, in_light
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, Phases, parse_lattice, phases, plain, regular
from simdtex.options import DataWarning, resolve, whole
from simdtex.run import Callback, Output, OutputWithSource, Progress

USUAL = 4
"""A colour is one of the positions around which the mean squared deviation from the sample's mean differs least from
that of the sample, one of so many: no part of it is conspicuous."""

NEAR = 0.75
"""Pixels from a point of one phase within which a whole pixel has it."""

APART = 8
"""Pixels by which the square around a corner is wider than borders on each side, so that these fit where they meet."""

FREE = 0.25
"""Share of a side, on each side of its middle, in which either of the textures of its two corners may be."""


def tileset(
    sample: ArrayLike | Sequence[ArrayLike],
    size: int | tuple[int, int] = 256,
    *,
    colours: int | None = None,
    light: Literal["keep", "even"] = "keep",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Return a set of corner tiles, from which planes of any size are laid without a period.

    Tiles fit wherever the colours of their four corners agree. The set has one tile for each combination of colours, 16
    for two colours and 81 for three, so that corners of a plane may be coloured at random.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array; or a list of such
        The texture, or a list of two or three of one type, such as grass and sand: those of the corners.
    size : int or (int, int)
        Rows and columns of a tile, 16 or more; one number for both. Whole cells of a regular texture should fit.
    colours : int, 2 to 3, optional
        Make tiles with so many colours of corners: 2 for 16 tiles, 3 for 81. None: 2; with several samples their
        number.
    light : {"keep", "even"}
        Keep the light of the sample, or make it even: remove a quadratic of row and column from each channel.
    channel_axis : int, optional
        The axis of pictures that holds channels; None for grey pictures.
    rng : int or numpy.random.Generator, optional
        The seed: the same one gives the same bytes on every device. None draws one at random.
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.
    callback : callable, optional
        Called several times a second with a `simdtex.run.Progress`; an error that it raises ends the run.
    checkpoint : path or simdtex.Checkpoint, optional
        Keep the state of the run in this file, from which the same call continues it; removed when the run has ended.
    full_output : bool
        Return a `simdtex.run.Output` too.
    **options
        Those of the method, see `simdtex.methods.mrf.Options`.

    Returns
    -------
    image : array of the sample's type
        The set, packed into a torus of 4 x 4 or 9 x 9 tiles that fit their neighbours, also across the borders of the
        picture. `simdtex.jobs.tilesets.corners.plane` lays planes of it.
    output : simdtex.run.OutputWithSource
        Only with ``full_output=True``; ``source`` is in pixels of the sample. ``statistics["corners"]`` has the colour
        of the top left corner of each tile.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Around each corner of a colour is one piece of the sample. Two runs make the borders between the corners, and a
    third all tiles together, with the borders as known pixels that have a source. The lattice of a regular sample has
    the same phase at all corners. Cost: that of `simdtex.synthesize` for 24 tiles, or for 99 with three colours.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> tiles = simdtex.tileset(data.gravel()[:64, :64], 32, order=2, rng=1)
    >>> tiles.shape
    (128, 128)
    """
    pictures, tile = check_samples(sample, channel_axis), check_shape(size if np.ndim(size) else (size, size), 16)
    several = len(pictures.pixels)
    if colours is not None:
        whole("colours", colours, 2, 3)
    colours = colours or max(2, several)
    if colours not in TORUS or several not in (1, colours):
        counts = f"{colours} colours and {several} sample{'s' * (several > 1)}"
        raise ValueError(f"a set has 2 or 3 colours, of one sample or each of one sample, and not {counts}; give such")
    if "boundary" in options:
        raise ValueError("tiles are made on a torus; leave boundary out")
    chosen = resolve(Options, "tileset", with_channels_last(options, channel_axis), tileset)
    if chosen.pixel == "density":
        raise ValueError('tiles continue the sources of their borders, and a density has none; give pixel="source"')
    pictures, lit = in_light(pictures, light, chosen.categorical)
    job = Tileset(pictures, tile, colours, replace(chosen, labels=True), lit, channel_axis)
    picture, output = run("tileset", job, rng, device, callback, checkpoint)
    return (picture, output) if full_output else picture


class Canvas(NamedTuple):
    """Pixels (rows, cols, C) on a torus, and their places in the sample (rows, cols, 2 or 3), -1 where unknown."""

    values: NDArray[Any]
    place: NDArray[np.int32]

    def at(self, row: int, col: int, rows: int, cols: int) -> Any:
        """Return the indices of a part, which may wrap around."""
        height, width = self.place.shape[:2]
        return np.ix_(np.arange(row, row + rows) % height, np.arange(col, col + cols) % width)

    def cut(self, *part: int) -> Canvas:
        """Return the part from a row and a column on, of so many rows and columns."""
        return Canvas(self.values[self.at(*part)], self.place[self.at(*part)])

    def paste(self, row: int, col: int, part: Canvas) -> None:
        """Set a part."""
        at = self.at(row, col, *part.place.shape[:2])
        self.values[at], self.place[at] = part


@dataclass(frozen=True)
class Tileset:
    """The job of `tileset`: three runs, which make the horizontal borders, the vertical ones, and all tiles."""

    pictures: Pictures
    tile: tuple[int, int]
    colours: int
    options: Options
    light: Light
    channel_axis: int | None = field(compare=False)

    @property
    def narrow(self) -> int:
        """Pixels on each side of a border that are the same in all tiles with it."""
        return max(2, min(self.tile) // 10)

    @property
    def wide(self) -> int:
        """Pixels on each side of a corner, in rows and in columns, that are the same in all tiles with it."""
        return self.narrow + min(APART, self.narrow)

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Make the borders and then the tiles; the state is the finished runs, and the state of the current one."""
        (rows, cols), regular = self.tile, self.regular()
        pieces, packed = self.pieces(regular and regular.pictures, seed), torus(self.colours)
        cycle = np.array([[int(letter) for letter in CYCLE[self.colours]]])
        saved, inside = checkpointing.found or ([], None)
        finished = [(Canvas(*made), about) for made, about in saved]
        jobs = {"borders from left to right": cycle, "borders from top to bottom": cycle.T, "tiles": packed}
        begin, every = 0, sum(grid.size for grid in jobs.values())
        for n, (job, grid) in enumerate(jobs.items()):
            if n >= len(finished):
                canvas = self.blank((grid.shape[0] * rows, grid.shape[1] * cols))
                if n == 2:
                    self.draw_borders(canvas, cycle[0].tolist(), *(made for made, _ in finished))
                for (row, col), colour in np.ndenumerate(grid):
                    canvas.paste(row * rows - self.wide, col * cols - self.wide, pieces[colour])
                seen = callback and partial(_show, callback, job, begin / every, grid.size / every)
                now = Checkpointing(inside, lambda info, tree: checkpointing.offer(info, lambda: (finished, tree())))
                plan, account = self.plan(canvas, grid, begin * rows * cols), observers(self.options.array)
                made, output = drive(plan, machine, seed, seen, now, account)
                finished.append((Canvas(made, np.asarray(output.source)), output.statistics | {"job": job}))
                inside = None
                if n < 2:
                    checkpointing.offer(None, lambda: (finished, None))
            begin += grid.size
        runs = [about for _, about in finished]
        seconds = [run["device_seconds"] for run in runs]
        statistics = runs[-1] | {"runs": runs, "seconds": sum(run["seconds"] for run in runs)}
        statistics["device_seconds"] = None if None in seconds else sum(seconds)
        statistics |= {"corners": packed.tolist(), "lattice": regular and regular.statistics(self.tile)}
        assert output.source is not None
        return made, OutputWithSource(output.source, output.temperature, output.stages, statistics)

    def blank(self, shape: tuple[int, int]) -> Canvas:
        """Return a torus of unknown pixels."""
        pixels = self.pictures.pixels
        values = np.zeros((*shape, pixels[0].shape[-1]), pixels[0].dtype)
        return Canvas(values, np.full((*shape, 2 if len(pixels) == 1 else 3), -1, np.int32))

    def regular(self) -> Phases | None:
        """Return the lattice of a regular sample, also deformed so that it repeats after a tile, if it can."""
        options = self.options.resolved(self.options.of(self.pictures))
        lattice = parse_lattice(options.lattice)
        planes, masks = plain(self.pictures)
        pattern = regular(planes[0], masks[0]) if isinstance(lattice, str) else lattice
        if pattern and pattern.fitted(self.tile) is None:
            (rows, cols), (high, wide) = pattern.fitting(self.tile), self.tile
            if pattern is lattice:
                raise ValueError(f"no cells of the lattice fit tiles of {wide}x{high}; make tiles of {cols}x{rows}")
            message = f"no whole cells of the sample's pattern fit tiles of {wide}x{high}; {cols}x{rows} fit better"
            warnings.warn(message, DataWarning, stacklevel=2)
        return None if lattice is None else phases(self.pictures, self.tile, True, lattice)

    def pieces(self, lattices: tuple[Lattice, ...] | None, seed: int) -> list[Canvas]:
        """Return the piece of the sample around a corner of each colour: on a lattice with one phase, else apart."""
        planes, masks = plain(self.pictures)
        reach, pieces, several = self.wide, [], len(planes) > 1
        phase: Any = None
        taken = np.zeros(masks[0].shape, bool)
        for colour in range(self.colours):
            sample = colour if several else 0
            usable = ndimage.minimum_filter(masks[sample], 2 * reach, mode="constant", cval=0)  # of -reach..reach - 1
            if phase is not None and lattices:
                apart = np.moveaxis(lattices[sample].phases(*np.indices(usable.shape)), 0, -1) - phase
                away = np.hypot(*np.moveaxis((apart - np.rint(apart)) @ lattices[sample].basis, -1, 0))
                usable &= away <= max(NEAR, away.min(initial=np.inf, where=usable))
            elif not several and (usable & ~taken).any():
                usable &= ~taken
            if not usable.any():
                size, remedy = f"{2 * reach}x{2 * reach}", "give smaller tiles or a larger sample"
                raise ValueError(f"a corner needs {size} known pixels, which the sample has nowhere; {remedy}")
            squares = (planes[sample] - round(planes[sample].mean())) ** 2
            off = np.abs(sums_around(squares, reach) - round(squares.mean() * (2 * reach + 1) ** 2))
            places = np.argwhere(usable)[np.argsort(off[usable], kind="stable")[: -(-usable.sum() // USUAL)]]
            bits = random.draw4(seed, 0, 0, np.array([colour]), random.START)
            row, col = places[int(random.below(bits[0], bits[1], len(places))[0])].tolist()
            taken[max(0, row - 2 * reach) : row + 2 * reach, max(0, col - 2 * reach) : col + 2 * reach] = True
            phase = lattices[sample].phases(row, col) if lattices and phase is None else phase
            at = np.mgrid[row - reach : row + reach, col - reach : col + reach]
            place = np.stack([*at, np.full_like(at[0], sample)], -1)[..., : 3 if several else 2]
            pieces.append(Canvas(self.pictures.pixels[sample][tuple(at)], place.astype(np.int32)))
        return pieces

    def draw_borders(self, canvas: Canvas, cycle: list[int], across: Canvas, down: Canvas) -> None:
        """Set the borders of all tiles from those between the colours of a cycle."""
        (rows, cols), half = self.tile, self.narrow
        pairs = {pair: n for n, pair in enumerate(zip(cycle, [*cycle[1:], cycle[0]], strict=True))}
        for row, col in np.ndindex(self.colours**2, self.colours**2):
            here, right, below, _ = corners_of(torus(self.colours))[row, col].tolist()
            strip = across.cut(-half, pairs[here, right] * cols, 2 * half, cols)
            canvas.paste(row * rows - half, col * cols, strip)
            strip = down.cut(pairs[here, below] * rows, -half, rows, 2 * half)
            canvas.paste(row * rows, col * cols - half, strip)

    def plan(self, canvas: Canvas, grid: NDArray[np.intp], begin: int) -> mrf.MrfPlan:
        """Return the plan of a run that makes the unknown pixels of tiles; the runs before it have ``begin`` pixels."""
        known = canvas.place[..., 0] >= 0
        given = Given(canvas.values, np.repeat(known[..., None], canvas.values.shape[-1], -1), canvas.place)
        shape, guide = known.shape, None
        if len(self.pictures.pixels) > 1:
            samples = tuple(np.full((*pixels.shape[:2], 1), n) for n, pixels in enumerate(self.pictures.pixels))
            guide = samples, self.labels(grid)[..., None]
        return mrf.plan(self.pictures, shape, self.options, given, guide, period=self.tile).keyed(begin, shape[1])

    def labels(self, grid: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the number of the sample of each pixel, which is that of the nearest corner, NaN half way."""
        (rows, cols), corners = self.tile, corners_of(grid)
        y, x = (np.arange(n) / n for n in (rows, cols))
        weights = np.stack([(v[:, None] * h) for v in (1 - y, y) for h in (1 - x, x)])
        share = np.stack([(corners == colour) for colour in range(self.colours)])
        shares = np.einsum("kijc,cyx->kiyjx", share.astype(np.float64), weights)
        shares = np.round(shares, 9).reshape(self.colours, grid.shape[0] * rows, grid.shape[1] * cols)
        first, second = np.sort(shares, 0)[:-3:-1]
        return np.where(first - second > 2 * FREE, shares.argmax(0), np.nan)


def _show(callback: Callback, job: str, begin: float, share: float, progress: Progress) -> Any:
    fraction, details = begin + share * progress.fraction, progress.details | {"job": job}
    return callback(replace(progress, fraction=fraction, details=details))
