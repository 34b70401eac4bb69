# SPDX-License-Identifier: BSD-3-Clause
"""Filling the holes of a picture from the rest of it, and extending a picture: `fill`, `extend` and their replay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import ceil, log2, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from simdtex.checkpoint import Checkpointing
from simdtex.driver import drive
from simdtex.inputs import Extend, Fill
from simdtex.jobs.inputs import Work, public, trends, with_light
from simdtex.machine import Machine, memory
from simdtex.methods import mrf
from simdtex.methods.mrf.options import Options, of_palette
from simdtex.methods.mrf.plan import NEAR
from simdtex.model.given import Given
from simdtex.model.guide import Surroundings
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.light import EXACT, Relit, unevenness
from simdtex.model.pictures import Mask, Pictures
from simdtex.model.regularity import autocorrelation, plain, regular
from simdtex.options import resolve, within_32_bits
from simdtex.run import Callback, Output, OutputWithSource, Progress

REACH = 128
"""The least distance around its window from which a hole is filled, pixels."""

FEWEST_CANDIDATES = 16
"""The fewest candidates at the coarsest level of a hole, since its known surroundings determine the layout."""

GIVEN = 100
"""The least bytes on the host for each pixel of an extended picture, with its known values."""

MANY = 2**17
"""The most candidates at the coarsest level of a hole; a site evaluates all of them."""

FEW = 16
"""The most windows that are filled one by one; holes in more places are in a single window."""

ENOUGH = 512
"""Rows and columns of a picture that determine the size of its parts; of a larger one every n-th pixel is taken."""

TENTH = 0.1
"""The autocorrelation at a lag of the size of a picture's parts."""

EACH = 2**18
"""Pixels of a window with all holes that take about as long as the window of a small hole, which has one level."""


class Window(NamedTuple):
    """A part of a picture with a separate lattice: its rows and columns, and its number of levels."""

    rows: slice
    cols: slice
    levels: int

    @property
    def at(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return self.rows, self.cols


def windows(hole: Mask, radius: int, levels: int | None) -> list[Window]:
    """Return windows that hold the holes of a picture and the neighbourhoods of their sites, from top to bottom.

    ``hole`` (rows, cols) is True somewhere, ``radius`` is that of a neighbourhood, and ``levels`` the number of levels.
    With None, the neighbourhood of a site in the middle of its hole reaches the rim at the coarsest level. Overlapping
    windows are joined.
    """
    deepest = ndimage.distance_transform_cdt(np.pad(hole, 1), metric="chessboard")[1:-1, 1:-1]
    wanted = levels or 1 + max(0, ceil(log2(max(1, int(deepest.max())) / radius)))
    around = radius * 2 ** min(wanted - 1, 32) + 1  # larger than any picture
    near = ndimage.distance_transform_cdt(~hole, metric="chessboard") <= around
    found: list[tuple[slice, slice]] = []
    while len(boxes := ndimage.find_objects(ndimage.label(near, np.ones((3, 3)))[0])) != len(found):
        found = boxes
        for box in found:
            near[box] = True  # the bend of a hole may contain another hole
    around_all = ndimage.find_objects(near.astype(np.uint8))
    area, all_of_it = (sum((r.stop - r.start) * (c.stop - c.start) for r, c in boxes) for boxes in (found, around_all))
    cheaper = wanted == 1 and MANY < all_of_it < len(found) * EACH
    if len(found) > FEW or area > near.size // 2 or cheaper:
        found = around_all
    return [Window(r, c, wanted) for r, c in found]


@public("fill")
def fill(call: Fill) -> Work:
    """Return a picture with its holes filled with the texture around them.

    Returns
    -------
    image : array of the image's shape and type
        Pixels outside the holes, widened by `grow` and `feather`, are those of the image, to the bit.
    output : simdtex.run.Output
        Only with ``full_output=True``. ``source`` has positions in the image, and known pixels have their own. With
        `sample` it has positions in the sample, and -1 at known pixels.

    Notes
    -----
    Known pixels are sites of temperature 0 that are never relaxed. Each hole, with the surroundings in reach of its
    sites, has a separate lattice, unless the picture wraps around (``boundary="torus"``) or there are many holes. The
    smooth colours around a hole, continued into it, and the place in the picture are a guide
    (`simdtex.model.guide.Surroundings`), so that the hole gets the texture of its surroundings. There is no such guide
    with a `sample`, with categories or with few different pixels (see `finish`). Cost: that of `simdtex.synthesize` for
    the holes' pixels, and of a sample of the surroundings' size.

    Examples
    --------
    >>> import numpy as np
    >>> from skimage import data
    >>> import simdtex
    >>> gravel = data.gravel()[:96, :96]
    >>> hole = np.zeros(gravel.shape, bool)
    >>> hole[40:56, 30:60] = True
    >>> filled = simdtex.fill(gravel, hole, rng=1)
    >>> bool((filled[~hole] == gravel[~hole]).all())
    True
    """
    pixels, gaps = call.image
    hole = gaps if call.mask is None else gaps | call.mask
    if not hole.any():
        raise ValueError("there is nothing to fill; give a mask that is True (white) where the picture is to be made")
    share = widened(hole, call.grow, call.feather)
    hole = share > 0
    if hole.all():
        raise ValueError("nothing of the picture is known; give a mask that is False (black) where it is to be kept")
    chosen = resolve(Options, "fill", call.options)
    call.image, call.mask = np.where(hole[..., None], 0, pixels), hole
    sample, found, relit = call.sample, None, None
    if call.light == "even" or (call.light is None and _may_be_lit(call, chosen, pixels[~hole][None])):
        (found,) = trends([pixels], [~hole], chosen.categorical)
        found = found if call.light or found.explains(pixels, ~hole) else None
    call.light = "even" if found else "keep"
    if found:
        sample = sample and with_light(sample, call.light, chosen.categorical)[0]
        relit = Relit(pixels, hole, found)
        pixels = found.removed(pixels)
    job: Any = Filling(pixels, hole, sample, call.reach, chosen, share)
    return Work(job, chosen, call.channel_axis, light={"light": call.light}, relit=relit)


@public("extend", without="boundary")
def extend(call: Extend) -> Work:
    """Return a picture that is continued beyond its edges, or seamless.

    Returns
    -------
    image : array of the image's type
        ``top + rows + bottom`` by ``left + cols + right``; the image, except for the bands, is at (top, left).
    output : simdtex.run.Output
        Only with ``full_output=True``; ``source`` is in pixels of the image.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> grass = data.grass()[:64, :64]
    >>> simdtex.extend(grass, right=16, bottom=8, rng=1).shape
    (72, 80)
    """
    pixels, seamless = call.image, call.seamless
    top, bottom, left, right = call.top, call.bottom, call.left, call.right
    rows, cols = pixels.shape[:2]
    if seamless not in (True, False, "x", "y"):
        raise ValueError(f'seamless is {seamless!r}; give True, False, "x" or "y"')
    tall, wide = seamless in (True, "y"), seamless in (True, "x")
    if not (seamless or top or bottom or left or right):
        raise ValueError("there is nothing to add; give top, bottom, left or right, or seamless=True")
    least = min([rows] * tall + [cols] * wide or [rows, cols])  # half of it at least is kept
    width = call.band = min(band_of(pixels), max(1, least // 4)) if call.band is None else call.band
    shape = (top + rows + bottom, left + cols + right, pixels.shape[2])
    within_32_bits(shape[:2], 1)
    memory.require_host(prod(shape[:2]) * GIVEN + 2 * prod(shape) * pixels.dtype.itemsize)
    canvas = np.zeros(shape, pixels.dtype)
    hole = np.ones(canvas.shape[:2], bool)
    across, along = (width if wide and not (left or right) else 0), (width if tall and not (top or bottom) else 0)
    if 2 * across >= cols or 2 * along >= rows:
        raise ValueError(f"band={width} leaves nothing of {rows}x{cols} (rows x columns); give a narrower one")
    hole[top + along : top + rows - along, left + across : left + cols - across] = False
    if "boundary" in call.options:
        raise ValueError("the boundary of what is extended follows from seamless; leave boundary out")
    # on a torus the lattice of the picture is deformed, and its known pixels are not
    usual = {"boundary": "torus", "lattice": "none"} if seamless else {"boundary": "open"}
    chosen = resolve(Options, "extend", usual | call.options)
    at: Any = slice(top, top + rows), slice(left, left + cols)
    light, relit = {"light": call.light, **unevenness(pixels)}, None
    if call.light == "even":
        (found,) = trends([pixels], [np.ones((rows, cols), bool)], chosen.categorical)
        wraps = (0,) * tall + (1,) * wide
        whole = canvas.copy()
        whole[at] = found.removed(pixels, wraps)
        relit = Relit(whole, hole, found, (top, left), wraps)
        pixels = found.removed(pixels)
    canvas[at] = pixels
    place = np.full((*hole.shape, 2), -1, np.int32)
    place[top : top + rows, left : left + cols] = np.moveaxis(np.indices((rows, cols)), 0, -1)
    place[hole] = -1
    given = Given(canvas, np.repeat(~hole[..., None], canvas.shape[2], -1), place, suggests=bool(seamless))

    guide, pictures = None, Pictures((pixels,))
    if _has_tones(chosen, pictures):
        # rows go on as rows, and columns as columns; along a row, parts move towards the seam
        corner = (np.nan if top or bottom else 0, np.nan if left or right or seamless else 0)
        guide = Surroundings(pixels, np.ones((rows, cols), bool), canvas, ~hole, corner, colours=not seamless)
    plan = mrf.plan(pictures, canvas.shape[:2], chosen, given, guide)
    return Work(plan, chosen, call.channel_axis, light=light, relit=relit)


def band_of(pixels: NDArray[Any]) -> int:
    """Return the width of the bands that make a picture (rows, cols, C) seamless: the size of its parts, in pixels.

    That is the longer vector of its lattice, or the lag at which its autocorrelation has fallen to a tenth, but a
    fifth of the shorter side at most. It is at least 8, and an eighth of the shorter side up to 64.
    """
    side: int = min(pixels.shape[:2])
    factor: int = -(-max(pixels.shape[:2]) // ENOUGH)
    (reduced,), (known,) = plain(Pictures((pixels[::factor, ::factor],)))
    found = regular(reduced, known)
    if found:
        size = float(np.hypot(*found.basis.T).max())
    else:
        values = autocorrelation(reduced, known).values
        row, col = (n // 2 for n in values.shape)
        size = max(int(np.argmax(np.append(line, 0) < TENTH)) for line in (values[row:, col], values[row, col:]))
    return max(8, min(64, side // 8), min(round(factor * size), side // 5))


class Made(NamedTuple):
    """The result of a window: values, temperatures and sources of its hole, and the statistics of its run.

    ``corner`` is the first pixel of its sample in the picture.
    """

    corner: tuple[int, int]
    values: NDArray[Any]
    temperature: NDArray[np.float64]
    source: NDArray[np.int32]
    statistics: dict[str, Any]


class Whole(NamedTuple):
    """The whole picture so far, (rows, cols, channels), its temperatures and its source map."""

    image: NDArray[Any]
    temperature: NDArray[np.float64]
    source: NDArray[np.int32]


class WindowSample(NamedTuple):
    """The sample of a window.

    ``corner`` is its first pixel in the picture; ``place`` is the position of the window's pixels in it, None for a
    separate sample.
    """

    pictures: Pictures
    corner: tuple[int, int]
    place: NDArray[np.int32] | None


@dataclass(frozen=True)
class Filling:
    """The job of `fill`: a sequence of runs, one for each window.

    ``hole`` (rows, cols) are the free sites of ``pixels`` (rows, cols, C). They are filled from ``sample`` or, if it is
    None, from their surroundings up to ``reach`` pixels around a hole; ``share`` is from `widened`.
    """

    pixels: NDArray[Any]
    hole: Mask
    sample: Pictures | None
    reach: int | None
    options: Options
    share: NDArray[Any]

    def __call__(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Fill one window after the other, and return the result.

        The state is the results of finished windows, and the state of the current run.
        """
        whole = self.begin()
        parts = self.windows()
        done, inside = checkpointing.found or ([], None)
        finished = [Made(*made) for made in done]
        for number, window in enumerate(parts):
            at, hole = window.at, self.hole[window.at]
            if number == len(finished):
                sample = self.sample_of(window)
                seen = callback and partial(self._show, callback, whole, window, sample, number, len(parts))
                now = Checkpointing(inside, lambda info, tree: checkpointing.offer(info, lambda: (finished, tree())))
                made, output = drive(self.plan(window, sample), machine, seed, seen, now)
                assert output.source is not None and output.temperature is not None
                about = output.statistics | {"window": [side for part in at for side in (part.start, part.stop)]}
                finished.append(Made(sample.corner, made[hole], output.temperature[hole], output.source[hole], about))
                inside = None
                checkpointing.offer(None, lambda: (finished, None))
            found = finished[number]
            whole.image[at][hole], whole.temperature[at][hole] = found.values, found.temperature
            whole.source[at][hole] = shifted(found.source, found.corner)
        self._blend(whole)
        runs = [found.statistics for found in finished]
        seconds = [run["device_seconds"] for run in runs]
        statistics = {name: runs[0][name] for name in ("device", "seed", "options", "levels")}
        statistics |= {"seconds": sum(run["seconds"] for run in runs), "windows": runs}
        statistics["device_seconds"] = None if None in seconds else sum(seconds)
        return whole.image, OutputWithSource(whole.source, whole.temperature, [], statistics)

    def _show(
        self,
        callback: Callback,
        whole: Whole,
        window: Window,
        sample: WindowSample,
        number: int,
        count: int,
        progress: Progress,
    ) -> Any:
        """Call back with the whole picture, with the current hole in it, and the share of all windows."""
        pasted = partial(paste, at=window.at, hole=self.hole[window.at], level=progress.level)
        read: Any = progress.source
        return callback(
            replace(
                progress,
                fraction=(number + progress.fraction) / count,
                image=lambda: pasted(whole.image, progress.image()),
                maps={"temperature": lambda: pasted(whole.temperature, progress.temperature())},
                source=lambda: pasted(whole.source, shifted(read(), sample.corner)),
            )
        )

    def _blend(self, whole: Whole) -> None:
        """Blend the picture into the rims of filled holes; sources and values without a mean change half-way."""
        rim = self.hole & (self.share < 1)
        if not rim.any():
            return
        mixed = self.pixels[rim] + self.share[rim, None] * (whole.image[rim] - self.pixels[rim].astype(np.float64))
        kept = self.share < 0.5
        whole.image[kept], whole.source[kept], whole.temperature[kept] = self.pixels[kept], self.begin().source[kept], 0
        if _has_tones(self.options, Pictures((self.pixels,))):
            whole.image[rim] = np.round(mixed) if self.pixels.dtype.kind in "iu" else mixed

    def windows(self) -> list[Window]:
        """Return the windows, in the order in which they are filled."""
        if self.options.boundary == "torus":
            return [Window(slice(0, self.hole.shape[0]), slice(0, self.hole.shape[1]), 0)]
        return windows(self.hole, int(neighbourhood_offsets(self.options.neighbourhood).max()), self.options.levels)

    def begin(self) -> Whole:
        """Return the picture before any hole is filled."""
        shape = self.hole.shape
        several = self.sample is not None and len(self.sample.pixels) > 1
        whole = Whole(self.pixels.copy(), np.zeros(shape), np.full((*shape, 3 if several else 2), -1, np.int32))
        if self.sample is None:
            whole.source[:] = np.moveaxis(np.indices(shape), 0, -1)
        return whole

    def sample_of(self, window: Window) -> WindowSample:
        """Return the sample of a window: its surroundings, or the sample of the job."""
        if self.sample is not None:
            return WindowSample(self.sample, (0, 0), None)
        at = window.at
        ((rows, cols),) = ndimage.find_objects(self.hole[at].astype(np.uint8))
        reach = self.reach or max(REACH, 2 * (rows.stop - rows.start), 2 * (cols.stop - cols.start))
        top, left = (max(0, side.start - reach) for side in at)
        # a pixel of a reduced window is to be one of its reduced sample; all further levels are refused
        square = 1 << min(31, max(0, window.levels - NEAR))
        top, left = (first + (side.start - first) % square for first, side in zip((top, left), at, strict=True))
        near = (slice(top, window.rows.stop + reach), slice(left, window.cols.stop + reach))
        place = (np.moveaxis(np.mgrid[at], 0, -1) - (top, left)).astype(np.int32)
        return WindowSample(Pictures((self.pixels[near],), unknown=(self.hole[near],)), (top, left), place)

    def plan(self, window: Window, sample: WindowSample) -> mrf.Plan:
        """Return the plan of a window's run, guided by the colours around its hole unless the sample is separate."""
        at, options, guide = window.at, self.options, None
        pictures, hole, least = sample.pictures, self.hole[at], window.levels and options.levels is None
        known = np.repeat(~hole[..., None], self.pixels.shape[2], -1)
        values = np.where(known, self.pixels[at], 0).astype(self.pixels.dtype)
        if sample.place is not None and pictures.known and _has_tones(options, pictures):
            row, col = sample.place[0, 0].tolist()
            guide = Surroundings(pictures.pixels[0], pictures.known[0], values, ~hole, (row, col))
        return mrf.plan(
            pictures,
            hole.shape,
            replace(options, overview=FEWEST_CANDIDATES) if least else options,
            Given(values, known, sample.place, suggests=False),
            guide,
            most=max(window.levels, _fewest_levels(pictures)) if window.levels else None,
        ).keyed(window.rows.start * self.hole.shape[1] + window.cols.start, self.hole.shape[1])


def widened(hole: Mask, grow: int, feather: int) -> NDArray[Any]:
    """Return the share of filled pixels in the result of `fill` with these options, from 1 in the hole down to 0."""
    if not (grow or feather):
        return hole
    away = np.ceil(ndimage.distance_transform_edt(~hole) - grow)
    return np.asarray(np.clip(1 - away / (feather + 1), 0, 1))


def _has_tones(options: Options, pictures: Pictures) -> bool:
    """Return whether the mean of pixels is a legal pixel: not for categories or for grey levels of a density."""
    return not (options.categorical or options.pixel == "density" or of_palette(pictures.pixels))


def _may_be_lit(call: Fill, options: Options, known: NDArray[Any]) -> bool:
    """Return whether the known pixels (1, n, C) of a picture to fill may lose their trend without being asked.

    The trend is of the whole picture, does not wrap around, and changes pixels.
    """
    whole, tones = call.reach is None and options.boundary == "open", _has_tones(options, Pictures((known,)))
    return whole and tones and options.finish != 0 and max(float(known.max()), -float(known.min())) <= EXACT


def _fewest_levels(pictures: Pictures) -> int:
    """Return the least number of levels whose coarsest level has at most `MANY` candidates."""
    return 1 + max(0, ceil(log2(prod(pictures.pixels[0].shape[:2]) / MANY) / 2))


def shifted(source: NDArray[np.int32], corner: tuple[int, int]) -> NDArray[np.int32]:
    """Return sources (..., 2 or 3) relative to ``corner`` as positions in the whole picture; -1 stays -1."""
    found = source.copy()
    found[..., :2] += np.where(source[..., :1] < 0, 0, np.array(corner, np.int32))
    return found


def paste(below: NDArray[Any], values: NDArray[Any], at: tuple[slice, slice], hole: Mask, level: int) -> NDArray[Any]:
    """Return a copy of ``below`` with the values of a level's lattice in the hole of a window."""
    above = below.copy()
    fine = values.repeat(2**level, 0).repeat(2**level, 1)[: hole.shape[0], : hole.shape[1]]
    above[at][hole] = fine[hole]
    return above
