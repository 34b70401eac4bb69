# SPDX-License-Identifier: BSD-3-Clause
"""Filling the holes of a picture from the rest of it, and extending a picture: `fill` and `extend`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil, log2, prod
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from simdtex.checkpoint import Checkpointing
from simdtex.driver import Device, Kept, Seed, drive, run
from simdtex.inputs import check_mask, check_picture, check_samples
from simdtex.io.image import check_sample
from simdtex.jobs.synthesis.job import Synthesis
from simdtex.machine import Machine, memory
from simdtex.maspar import observers
from simdtex.methods import mrf
from simdtex.methods.mrf.options import Options, of_palette
from simdtex.methods.mrf.plan import NEAR
from simdtex.model.given import Given
from simdtex.model.guide import Surroundings
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.light import EXACT, LIGHTS, Light, Relit, in_light, trends, unevenness
from simdtex.model.pictures import Mask, Pictures, check_alike
from simdtex.model.regularity import autocorrelation, plain, regular
from simdtex.options import one_of, resolve, whole, within_32_bits
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

EACH = 2**18
"""Pixels of a window with all holes that take about as long as the window of a small hole, which has one level."""


class Window(NamedTuple):
    """A part of a picture with a separate lattice: its rows and columns, and its number of levels."""

    rows: slice
    cols: slice
    levels: int


def windows(hole: Mask, radius: int, levels: int | None) -> list[Window]:
    """Return windows, which do not overlap, that hold the holes of a picture and the neighbourhoods of their sites."""
    # without levels, the neighbourhood in the middle of a hole reaches the rim at the coarsest level
    deepest = ndimage.distance_transform_cdt(np.pad(hole, 1), metric="chessboard")[1:-1, 1:-1]
    wanted = levels or 1 + max(0, ceil(log2(max(1, int(deepest.max())) / radius)))
    around = radius * 2 ** min(wanted - 1, 32) + 1  # larger than any picture
    near = ndimage.distance_transform_cdt(~hole, metric="chessboard") <= around
    apart: list[tuple[slice, slice]] = []
    while len(boxes := ndimage.find_objects(ndimage.label(near, np.ones((3, 3)))[0])) != len(apart):
        apart = boxes
        for box in apart:
            near[box] = True  # the bend of a hole may contain another hole
    joined = ndimage.find_objects(near.astype(np.uint8))
    area, area_joined = (sum((r.stop - r.start) * (c.stop - c.start) for r, c in boxes) for boxes in (apart, joined))
    cheaper = wanted == 1 and MANY < area_joined < len(apart) * EACH
    several = len(apart) <= FEW and area <= near.size // 2 and not cheaper
    return [Window(r, c, wanted) for r, c in (apart if several else joined)]


def fill(
    image: ArrayLike,
    mask: ArrayLike | None = None,
    *,
    grow: int = 0,
    feather: int = 0,
    light: Literal["keep", "even"] | None = None,
    sample: ArrayLike | Sequence[ArrayLike] | None = None,
    reach: int | None = None,
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Return a picture with its holes filled with the texture around them.

    Parameters
    ----------
    image : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        The picture; any real type.
    mask : (rows, cols) bool array, optional
        True in the holes. None: the pixels of `image` that are NaN or, in a masked array, masked.
    grow : int, 0 or more
        Make the holes wider by this many pixels.
    feather : int, 0 or more
        Blend the filled pixels with the picture up to this many pixels around the holes. Values without a mean
        (categories, few different pixels) change half-way instead.
    light : {"keep", "even"}, optional
        Take pixels as they are (keep), or without a quadratic of row and column, which is added at their new place
        (even). None: even if the picture is smooth for the most part, as a sky; keep with a reach or ``finish=0``.
    sample : array of the image's type, or a list of such, optional
        The texture to fill with. None: the rest of the picture.
    reach : int, 1 or more, optional
        Fill a hole from the surroundings up to this far away, in pixels. It has no effect with `sample`. None: 128, or
        twice the hole's longer side.
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
    image : array of the image's shape and type
        Pixels outside the holes, widened by `grow` and `feather`, are those of the image, to the bit.
    output : simdtex.run.Output
        Only with ``full_output=True``. ``source`` has positions in the image, and known pixels have their own. With
        `sample` it has positions in the sample, and -1 at known pixels.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Each hole, with the surroundings in reach of its sites, has a separate lattice, unless the picture wraps around
    (``boundary="torus"``) or there are many holes. The smooth colours around a hole, continued into it, and the place
    in the picture are a guide (`simdtex.model.guide.Surroundings`), except with a `sample`, with categories or with few
    different pixels (see `finish`). Cost: that of `simdtex.synthesize` for the holes' pixels, and of a sample of the
    surroundings' size.

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
    about: dict[str, Any] = {"grow": grow, "feather": feather, "light": light, "sample": sample, "reach": reach}
    job = plan_filling(image, mask, channel_axis=channel_axis, **about, **options)
    picture, output = run("fill", job, rng, device, callback, checkpoint)
    return (picture, output) if full_output else picture


def plan_filling(
    image: ArrayLike,
    mask: ArrayLike | None,
    *,
    grow: int = 0,
    feather: int = 0,
    light: str | None = None,
    sample: Any = None,
    reach: int | None = None,
    channel_axis: int | None = None,
    **options: Any,
) -> Filling:
    """Check the arguments of `fill`, and return its job."""
    whole("grow", grow, 0)
    whole("feather", feather, 0)
    pixels, gaps = check_picture(image, channel_axis)
    hole = gaps if mask is None else gaps | check_mask(mask, pixels.shape[:2])
    if light is not None:
        one_of("light", light, LIGHTS)
    if reach is not None:
        whole("reach", reach, 1)
    pictures = None if sample is None else check_samples(sample, channel_axis)
    if pictures:
        check_alike("the sample", pictures.pixels[0], "the picture", pixels)
    if not hole.any():
        raise ValueError("there is nothing to fill; give a mask that is True (white) where the picture is to be made")
    share = widened(hole, grow, feather)
    hole = share > 0
    if hole.all():
        raise ValueError("nothing of the picture is known; give a mask that is False (black) where it is to be kept")
    chosen = resolve(Options, "fill", options, fill)
    lit = Light({"light": "keep"})
    if light == "even" or (light is None and _may_be_lit(reach, chosen, pixels[~hole][None])):
        (trend,) = trends([pixels], [~hole], chosen.categorical)
        if light or trend.explains(pixels, ~hole):
            lit = Light({"light": "even"}, Relit(pixels, hole, trend))
            pixels = trend.removed(pixels)
            pictures = pictures and in_light(pictures, "even", chosen.categorical)[0]
    return Filling(pixels, hole, pictures, reach, chosen, share, lit, channel_axis)


def extend(
    image: ArrayLike,
    *,
    left: int = 0,
    right: int = 0,
    top: int = 0,
    bottom: int = 0,
    seamless: bool | Literal["x", "y"] = False,
    band: int | None = None,
    light: Literal["keep", "even"] = "keep",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Return a picture that is continued beyond its edges, or seamless.

    Parameters
    ----------
    image : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        The picture, which is also the sample; any real type.
    left, right, top, bottom : int, 0 or more
        Add this many pixels at a side.
    seamless : bool or {"x", "y"}
        Whether the result wraps around: in both directions, or only left and right (x) or top and bottom (y). If no
        pixels are added in such a direction, a band along its edges is replaced.
    band : int, 1 or more, optional
        Replace this many pixels along each edge that no pixels are added to, so that the output tiles. None: the size
        of the picture's parts, such as stones or bricks: between an eighth and a fifth of the shorter side.
    light : {"keep", "even"}
        Take pixels as they are (keep), or without a quadratic of row and column, which is added at their new place
        (even), except where the result wraps around.
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
        Those of the method, see `simdtex.methods.mrf.Options`, but for ``boundary``.

    Returns
    -------
    image : array of the image's type
        ``top + rows + bottom`` by ``left + cols + right``; the image, except for the bands, is at (top, left).
    output : simdtex.run.Output
        Only with ``full_output=True``; ``source`` is in pixels of the image.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> grass = data.grass()[:64, :64]
    >>> simdtex.extend(grass, right=16, bottom=8, rng=1).shape
    (72, 80)
    """
    sides: dict[str, Any] = {"left": left, "right": right, "top": top, "bottom": bottom}
    about: dict[str, Any] = {"seamless": seamless, "band": band, "light": light, "channel_axis": channel_axis}
    job = plan_extension(image, **sides, **about, **options)
    picture, output = run("extend", job, rng, device, callback, checkpoint)
    return (picture, output) if full_output else picture


def plan_extension(
    image: ArrayLike,
    *,
    left: int = 0,
    right: int = 0,
    top: int = 0,
    bottom: int = 0,
    seamless: bool | str = False,
    band: int | None = None,
    light: str = "keep",
    channel_axis: int | None = None,
    **options: Any,
) -> Synthesis:
    """Check the arguments of `extend`, and return its job."""
    pixels = check_sample(image, channel_axis)
    for name, count in {"left": left, "right": right, "top": top, "bottom": bottom}.items():
        whole(name, count, 0)
    if seamless not in (True, False, "x", "y"):
        raise ValueError(f'seamless is {seamless!r}; give True, False, "x" or "y"')
    if band is not None:
        whole("band", band, 1)
    rows, cols = pixels.shape[:2]
    tall, wide = seamless in (True, "y"), seamless in (True, "x")
    if not (seamless or top or bottom or left or right):
        raise ValueError("there is nothing to add; give top, bottom, left or right, or seamless=True")
    least = min([rows] * tall + [cols] * wide or [rows, cols])  # half of it at least is kept
    width = min(band_of(pixels), max(1, least // 4)) if band is None else band
    shape = (top + rows + bottom, left + cols + right, pixels.shape[2])
    within_32_bits(shape[:2], 1)
    memory.require_host(prod(shape[:2]) * GIVEN + 2 * prod(shape) * pixels.dtype.itemsize)
    canvas = np.zeros(shape, pixels.dtype)
    hole = np.ones(canvas.shape[:2], bool)
    across, along = (width if wide and not (left or right) else 0), (width if tall and not (top or bottom) else 0)
    if 2 * across >= cols or 2 * along >= rows:
        raise ValueError(f"band={width} leaves nothing of {rows}x{cols} (rows x columns); give a narrower one")
    hole[top + along : top + rows - along, left + across : left + cols - across] = False
    if "boundary" in options:
        raise ValueError("the boundary of what is extended follows from seamless; leave boundary out")
    # on a torus the lattice of the picture is deformed, and its known pixels are not
    usual = {"boundary": "torus", "lattice": "none"} if seamless else {"boundary": "open"}
    chosen = resolve(Options, "extend", usual | options, extend)
    at: Any = slice(top, top + rows), slice(left, left + cols)
    one_of("light", light, LIGHTS)
    lit = Light({"light": light, **unevenness(pixels)})
    if light == "even":
        (trend,) = trends([pixels], [np.ones((rows, cols), bool)], chosen.categorical)
        wraps = (0,) * tall + (1,) * wide
        whole_picture = canvas.copy()
        whole_picture[at] = trend.removed(pixels, wraps)
        lit = replace(lit, relit=Relit(whole_picture, hole, trend, (top, left), wraps))
        pixels = trend.removed(pixels)
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
    return Synthesis(pictures, (shape[0], shape[1]), "mrf", chosen, given, guide, lit, channel_axis)


def band_of(pixels: NDArray[Any]) -> int:
    """Return the width of the bands that make a picture (rows, cols, C) seamless: the size of its parts, in pixels."""
    side: int = min(pixels.shape[:2])
    factor: int = -(-max(pixels.shape[:2]) // ENOUGH)
    (reduced,), (known,) = plain(Pictures((pixels[::factor, ::factor],)))
    if lattice := regular(reduced, known):
        size = float(np.hypot(*lattice.basis.T).max())  # the longer vector
    else:  # the lag at which the autocorrelation has fallen to a tenth
        values = autocorrelation(reduced, known).values
        row, col = (n // 2 for n in values.shape)
        size = max(int(np.argmax(np.append(line, 0) < 0.1)) for line in (values[row:, col], values[row, col:]))
    return max(8, min(64, side // 8), min(round(factor * size), side // 5))


class Made(NamedTuple):
    """The result of a window: the corner of its sample, and values, temperatures and sources of its hole."""

    corner: tuple[int, int]
    values: NDArray[Any]
    temperature: NDArray[np.float64]
    source: NDArray[np.int32]
    statistics: dict[str, Any]


class WholePicture(NamedTuple):
    """The whole picture so far, (rows, cols, channels), its temperatures and its source map."""

    image: NDArray[Any]
    temperature: NDArray[np.float64]
    source: NDArray[np.int32]


class WindowSample(NamedTuple):
    """The sample of a window, its first pixel in the picture, and where the window is in it, None if elsewhere."""

    pictures: Pictures
    corner: tuple[int, int]
    place: NDArray[np.int32] | None


@dataclass(frozen=True)
class Filling:
    """The job of `fill`: a run for each window of ``pixels`` (rows, cols, C); ``share`` is from `widened`."""

    pixels: NDArray[Any]
    hole: Mask
    sample: Pictures | None
    reach: int | None
    options: Options
    share: NDArray[Any]
    light: Light
    channel_axis: int | None = field(compare=False)

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Fill one window after the other; the state is the finished windows, and the state of the current run."""
        whole, parts = self.begin(), self.windows()
        saved, inside = checkpointing.found or ([], None)
        finished = [Made(*made) for made in saved]
        for number, window in enumerate(parts):
            at = window[:2]
            hole = self.hole[at]
            if number == len(finished):
                sample = self.sample_of(window)
                seen = callback and partial(self._show, callback, whole, at, sample, (number, len(parts)))
                now = Checkpointing(inside, lambda info, tree: checkpointing.offer(info, lambda: (finished, tree())))
                plan, account = self.plan(window, sample), observers(self.options.array)
                made, output = drive(plan, machine, seed, seen, now, account)
                assert output.source is not None and output.temperature is not None
                about = output.statistics | {"window": [side for part in at for side in (part.start, part.stop)]}
                finished.append(Made(sample.corner, made[hole], output.temperature[hole], output.source[hole], about))
                inside = None
                checkpointing.offer(None, lambda: (finished, None))
            done = finished[number]
            whole.image[at][hole], whole.temperature[at][hole] = done.values, done.temperature
            whole.source[at][hole] = shifted(done.source, done.corner)
        self._blend(whole)
        runs = [done.statistics for done in finished]
        seconds = [run["device_seconds"] for run in runs]
        statistics = {name: runs[0][name] for name in ("device", "seed", "options", "levels")}
        statistics |= {"seconds": sum(run["seconds"] for run in runs), "windows": runs}
        statistics["device_seconds"] = None if None in seconds else sum(seconds)
        return whole.image, OutputWithSource(whole.source, whole.temperature, [], statistics)

    def _show(
        self,
        callback: Callback,
        whole: WholePicture,
        at: Any,
        sample: WindowSample,
        part: tuple[int, int],
        now: Progress,
    ) -> Any:
        """Call back with the whole picture, with the current hole in it, and the share of all windows."""
        pasted = partial(paste, at=at, hole=self.hole[at], level=now.level)
        read: Any = now.source
        return callback(
            replace(
                now,
                fraction=(part[0] + now.fraction) / part[1],
                image=lambda: pasted(whole.image, now.image()),
                maps={"temperature": lambda: pasted(whole.temperature, now.temperature())},
                source=lambda: pasted(whole.source, shifted(read(), sample.corner)),
            )
        )

    def _blend(self, whole: WholePicture) -> None:
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

    def begin(self) -> WholePicture:
        """Return the picture before any hole is filled."""
        shape = self.hole.shape
        several = self.sample is not None and len(self.sample.pixels) > 1
        whole = WholePicture(self.pixels.copy(), np.zeros(shape), np.full((*shape, 3 if several else 2), -1, np.int32))
        if self.sample is None:
            whole.source[:] = np.moveaxis(np.indices(shape), 0, -1)
        return whole

    def sample_of(self, window: Window) -> WindowSample:
        """Return the sample of a window: its surroundings, or the sample of the job."""
        if self.sample is not None:
            return WindowSample(self.sample, (0, 0), None)
        at = window[:2]
        ((rows, cols),) = ndimage.find_objects(self.hole[at].astype(np.uint8))
        reach = self.reach or max(REACH, 2 * (rows.stop - rows.start), 2 * (cols.stop - cols.start))
        top, left = (max(0, side.start - reach) for side in at)
        # a pixel of a reduced window is to be one of its reduced sample; all further levels are refused
        square = 1 << min(31, max(0, window.levels - NEAR))
        top, left = (first + (side.start - first) % square for first, side in zip((top, left), at, strict=True))
        near = (slice(top, window.rows.stop + reach), slice(left, window.cols.stop + reach))
        place = (np.moveaxis(np.mgrid[at], 0, -1) - (top, left)).astype(np.int32)
        return WindowSample(Pictures((self.pixels[near],), unknown=(self.hole[near],)), (top, left), place)

    def plan(self, window: Window, sample: WindowSample) -> mrf.MrfPlan:
        """Return the plan of a window's run, guided by the colours around its hole unless the sample is separate."""
        at, options, guide = window[:2], self.options, None
        pictures, hole, free = sample.pictures, self.hole[at], window.levels and options.levels is None
        least = 1 + max(0, ceil(log2(prod(pictures.pixels[0].shape[:2]) / MANY) / 2))
        known = np.repeat(~hole[..., None], self.pixels.shape[2], -1)
        values = np.where(known, self.pixels[at], 0).astype(self.pixels.dtype)
        if sample.place is not None and pictures.known and _has_tones(options, pictures):
            row, col = sample.place[0, 0].tolist()
            guide = Surroundings(pictures.pixels[0], pictures.known[0], values, ~hole, (row, col))
        return mrf.plan(
            pictures,
            hole.shape,
            replace(options, overview=FEWEST_CANDIDATES) if free else options,
            Given(values, known, sample.place, suggests=False),
            guide,
            most=max(window.levels, least) if window.levels else None,
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


def _may_be_lit(reach: int | None, options: Options, known: NDArray[Any]) -> bool:
    """Return whether the known pixels (1, n, C) of a picture to fill may lose their trend without being asked."""
    whole, tones = reach is None and options.boundary == "open", _has_tones(options, Pictures((known,)))
    return whole and tones and options.finish != 0 and max(float(known.max()), -float(known.min())) <= EXACT


def shifted(source: NDArray[np.int32], corner: tuple[int, int]) -> NDArray[np.int32]:
    """Return sources (..., 2 or 3) relative to ``corner`` as positions in the whole picture; -1 stays -1."""
    moved = source.copy()
    moved[..., :2] += np.where(source[..., :1] < 0, 0, np.array(corner, np.int32))
    return moved


def paste(below: NDArray[Any], values: NDArray[Any], at: tuple[slice, slice], hole: Mask, level: int) -> NDArray[Any]:
    """Return a copy of ``below`` with the values of a level's lattice in the hole of a window."""
    above = below.copy()
    fine = values.repeat(2**level, 0).repeat(2**level, 1)[: hole.shape[0], : hole.shape[1]]
    above[at][hole] = fine[hole]
    return above
