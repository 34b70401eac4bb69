# SPDX-License-Identifier: BSD-3-Clause
"""Pyramid matching: the procedure of Heeger and Bergen (1995).

`match_texture` is their Match-texture, `Matcher` (matcher.py) their Match-Histogram, `Transform` (pyramids.py) their
Make-Pyramid and Collapse-Pyramid. Solid textures (solid.py) and mixtures (mixtures.py) are the same program with
another pyramid and with other histograms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.histograms import Histograms, histograms
from simdtex.methods.pyramid.matcher import Matcher, Wanted
from simdtex.methods.pyramid.options import Options
from simdtex.methods.pyramid.palette import Decorrelated, Palette, decorrelated, palette
from simdtex.methods.pyramid.pyramids import Transform, most_levels
from simdtex.model.stretched import Stretched
from simdtex.ops.matching import match_ranks
from simdtex.ops.noise import noise
from simdtex.options import within_32_bits
from simdtex.run import Callback, Iterating, Output, device_seconds

RESIDUE = 8
"""Rows and columns that the low-pass residue has at least, where the number of levels is not given."""

PART = 2**16
"""Pixels whose colours are restored at a time, in double precision: some megabytes on the host."""

VALUES = 8
"""Values for each pixel of an output that kernels number at most: six oriented bands of a level, and more to spare."""

MEMORY = 160
"""Bytes for each pixel of a picture on the device, at most (measured by benchmarks/pyramid_cost.py)."""

HOST = 20, 20, 3
"""Bytes for each pixel on the host: at all, for each channel, and for each byte of these (benchmarks/memory.py)."""

# -- what is to be matched ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Texture:
    """What a run is to match: histograms of decorrelated channels, and the colours to show them in.

    Attributes
    ----------
    histograms : list of Histograms
        Of every channel.
    palette : Palette
    scale : Decorrelated
        The unit of the channels.
    stretched : Stretched
        What turns values back into pixels.
    own : (m,) array or None
        The sample's own pixels in ascending order, where a grey output takes exactly these.
    """

    histograms: list[Histograms]
    palette: Palette
    scale: Decorrelated
    stretched: Stretched
    own: NDArray[Any] | None = None

    def image(self, channels: Sequence[NDArray[np.int32]]) -> NDArray[Any]:
        """The image (..., C) that channels, each of any one shape, stand for."""
        shape = channels[0].shape
        pixels = []
        flat = np.stack([channel.reshape(-1) for channel in channels])
        for first in range(0, flat.shape[1], PART):  # double precision, for some pixels at a time
            part = self.palette.restored(self.scale.normalised(flat[:, first : first + PART]))
            pixels.append(self.stretched.picture(part[:, None])[0])
        return np.concatenate(pixels).reshape(*shape, len(channels))


def transform(machine: Machine, options: Options, levels: int, torus: bool) -> Transform:
    """The 2-D pyramid that options describe."""
    return Transform(machine, options.pyramid, levels, options.orientations, torus)


def number_of_levels(options: Options, *sides: int) -> int:
    """Of the pyramids of pictures, or blocks, with these sides."""
    most = most_levels(*sides)
    if options.levels is None:
        return max(0, min(most, (min(sides) // RESIDUE).bit_length() - 1))
    if options.levels > most:
        raise ValueError(f"levels={options.levels} is too many for a side of {min(sides)} pixels; give at most {most}")
    return options.levels


def analyse(machine: Machine, sample: NDArray[Any], options: Options, *pyramids: Transform) -> Texture:
    """The histograms of a sample (rows, cols, channels): analysis-pyr of every decorrelated channel."""
    memory.require(machine, prod(sample.shape[:2]) * MEMORY)
    stretched = Stretched(sample)
    colours = palette([stretched.planes], [1.0], options.color == "decorrelate")
    scale = decorrelated([stretched.planes], [colours])
    found = [histograms(machine, channel, *pyramids) for channel in scale.channels[0]]
    own = np.sort(sample, axis=None) if sample.shape[-1] == 1 and options.match == "rank" else None
    return Texture(found, colours, scale, stretched, own)


# -- match-texture --------------------------------------------------------------------------------------------


def synthesize(
    machine: Machine,
    sample: NDArray[Any],
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
    keep: Keep = NOTHING,
) -> tuple[NDArray[Any], Output]:
    """Analyse the sample and make more of it, see `match_texture`."""
    began, worked = perf_counter(), machine.seconds
    levels = number_of_levels(options, *shape, *sample.shape[:2])
    texture = analyse(machine, sample, options, transform(machine, options, levels, options.edges == "wrap"))
    image, output = synthesize_from(machine, texture, shape, options, levels, seed, callback, keep)
    output.statistics.update(seconds=perf_counter() - began, device_seconds=device_seconds(machine, worked))
    return image, output


def synthesize_from(
    machine: Machine,
    texture: Texture,
    shape: tuple[int, int],
    options: Options,
    levels: int,
    seed: int,
    callback: Callback | None = None,
    keep: Keep = NOTHING,
) -> tuple[NDArray[Any], Output]:
    """A picture of a texture whose histograms are known, see `match_texture`."""
    within_32_bits(shape, max(VALUES, len(texture.histograms)))
    check_memory(machine, shape, texture, MEMORY)
    pyramid = transform(machine, options, levels, torus=True)

    def turn(picture: Array, wanted: list[Wanted], matcher: Matcher, tell: Callable[[float], None]) -> Array:
        synthesis_pyr = pyramid.make(picture.reshape((1, *shape)))  # Make-Pyramid(noise)
        matched = match_subbands(matcher, pyramid.names, synthesis_pyr, wanted)
        return pyramid.collapse(matched)  # Collapse-Pyramid(synthesis-pyr)

    return match_texture(machine, texture, shape, turn, options, levels, seed, callback, keep)


def check_memory(machine: Machine, shape: tuple[int, ...], texture: Texture, on_device: int) -> None:
    """Raise where an output takes more memory than there is, so many bytes for each pixel on the device."""
    each, channel, byte = HOST
    host = each + len(texture.histograms) * (channel + byte * texture.stretched.pixels.dtype.itemsize)
    memory.require(machine, prod(shape) * on_device, prod(shape) * host)


def match_subbands(
    matcher: Matcher, names: list[str], pyramid: list[Array], wanted: list[Wanted], together: bool = False
) -> list[Array]:
    """For a-band, s-band in the two pyramids do Match-Histogram(s-band, a-band)."""
    bands = zip(names, pyramid, wanted, strict=True)
    return [matcher.match(name, s_band, a_band, together) for name, s_band, a_band in bands]


Turn = Callable[[Array, list[Wanted], Matcher, Callable[[float], None]], Array]
"""One turn of the loop, but for the pixels: pyramid of the picture, subbands matched, collapsed."""


def match_texture(
    machine: Machine,
    texture: Texture,
    shape: tuple[int, ...],
    turn: Turn,
    options: Options,
    levels: int,
    seed: int,
    callback: Callback | None = None,
    keep: Keep = NOTHING,
) -> tuple[NDArray[Any], Output]:
    """Match-texture of the paper, for each of the decorrelated channels.

    Parameters
    ----------
    machine : Machine
        What executes the steps.
    texture : Texture
        What is to be matched.
    shape : (rows, cols) or (depth, rows, cols)
        Of the output.
    turn : callable
        What makes, matches and collapses the pyramid of a picture.
    options : Options
    levels : int
        Of the pyramids.
    seed : int
        Key of every random number.
    callback : callable, optional
        Called with a `simdtex.run.Iterating` after every channel, and after every part of a solid's turn.
    keep : Keep
        Keeps the state after every channel's turn.

    Returns
    -------
    image : (*shape, channels) array
        In the sample's type.
    output : simdtex.run.Output
        Statistics: how far the histograms of each iteration were from the sample's.

    Notes
    -----
    Memory in bytes per pixel: 160 on the device (240 per voxel of a block); on the host, where a CPU's device memory is
    too, 20 + (20 + 3 n) channels, n the bytes of a value of the sample. Both are asked for before the run.
    """
    began, worked = perf_counter(), machine.seconds
    matcher = Matcher(machine, options, seed)
    channels = enumerate(texture.histograms)
    busy = [c for c, own in channels if own.pixels[0, 0] < own.pixels[0, -1]]  # the others are flat
    pixels = {c: matcher.wanted(texture.histograms[c].pixels) for c in busy}
    subbands = {c: [matcher.wanted(band) for band in texture.histograms[c].subbands] for c in busy}
    begun, kept = _begin(machine, texture, shape, options, seed), keep.found
    if kept is None:
        pictures = {c: matcher.match("pixels", begun(c), pixels[c]) for c in busy}  # Match-Histogram(noise, texture)
    else:
        pictures = {c: machine.put(picture) for c, picture in zip(busy, kept["pictures"], strict=True)}

    def read() -> list[NDArray[np.int32]]:
        return [
            machine.get(pictures[c]).reshape(shape) if c in pictures else np.full(shape, own.pixels[0, 0])
            for c, own in enumerate(texture.histograms)
        ]

    record = _Record(options.iterations, len(busy), lambda: texture.image(read()), len(shape) == 3, callback)
    matcher.distances()  # forget those of the noise
    if kept is not None:
        matcher.restore(kept["moved"])
        record.restore(kept)

    def state() -> dict[str, Any]:
        return {"pictures": [machine.get(pictures[c]) for c in busy], "moved": matcher.kept(), **record.kept()}

    for iteration in range(1 + len(record.reports), options.iterations + 1):  # Loop for several iterations do
        for c in busy[record.turns - (iteration - 1) * len(busy) :]:
            picture = turn(pictures[c], subbands[c], matcher, record.part)
            pictures[c] = matcher.match("pixels", picture.reshape(pictures[c].shape), pixels[c])
            machine.sync()
            record.turn(c == busy[-1])
            if c != busy[-1]:
                keep.offer(state)
        record.end(iteration, matcher.distances())
        keep.offer(state)
    record.nothing_to_do()
    if texture.own is not None and busy:  # grey: the k-th smallest pixel becomes the k-th smallest of the sample
        ranks = machine.put(np.arange(texture.own.size, dtype=np.int32)[None])
        order = matcher.order(pictures[0].reshape((1, prod(shape))))
        image = texture.own[machine.get(match_ranks(machine, order, ranks)).reshape(*shape, 1)]
    else:
        image = texture.image(read())
    kept = {name: value for name, value in vars(options).items() if name != "start"}
    statistics = {
        "device": machine.name,
        "seed": seed,
        "options": kept | {"levels": levels},
        "seconds": perf_counter() - began,
        "device_seconds": device_seconds(machine, worked),
        "iterations": record.reports,
    }
    return image, Output(None, None, [], statistics)


def _begin(
    machine: Machine, texture: Texture, shape: tuple[int, ...], options: Options, seed: int
) -> Callable[[int], Array]:
    """What gives each channel (1, 1, ...) to begin with: noise, or that of the start."""
    if options.start is None:
        return lambda c: noise(machine, 1, prod(shape), seed, c).reshape((1, 1, *shape))
    start = np.asarray(options.start)
    channels = len(texture.histograms)
    if start.shape == shape or start.shape == (*shape, 1):
        start = np.broadcast_to(start.reshape(*shape, 1), (*shape, channels))
    if start.shape != (*shape, channels):
        size = " x ".join(str(n) for n in shape)
        raise ValueError(f"start has shape {start.shape}; give one of {size} pixels, grey or with {channels} channels")
    own = _own_channels(start)
    return lambda c: machine.put(own[c][None, None])


def _own_channels(image: NDArray[Any]) -> NDArray[np.int32]:
    """Channels (C, ...) of an image (..., C) under colours of its own, in 2**-14 standard deviations."""
    planes = Stretched(image.reshape(-1, 1, image.shape[-1])).planes
    normal = palette([planes], [1.0]).decorrelated(planes)
    channels = np.rint(np.clip(normal, -64, 64) * 2**14).astype(np.int32)
    return channels.reshape(-1, *image.shape[:-1])


class _Record:
    """What a run reports of its iterations, and what its callback is told."""

    def __init__(
        self,
        iterations: int,
        channels: int,
        image: Callable[[], NDArray[Any]],
        solid: bool,
        callback: Callback | None,
    ) -> None:
        self.reports: list[dict[str, Any]] = []
        self.turns = 0
        self._iterations, self._channels = iterations, channels
        self._image, self._solid, self._callback = image, solid, callback
        self._began = perf_counter()

    def kept(self) -> dict[str, Any]:
        """What is to be kept of it."""
        return {"turns": self.turns, "reports": self.reports, "seconds": perf_counter() - self._began}

    def restore(self, kept: dict[str, Any]) -> None:
        """Go on from what `kept` gave."""
        self.turns, self.reports, self._began = kept["turns"], kept["reports"], perf_counter() - kept["seconds"]

    def part(self, share: float) -> None:
        """A share of the present channel's turn is done."""
        self._tell(share, ended=False)

    def turn(self, ended: bool) -> None:
        """A channel's turn is over, and with it perhaps the iteration."""
        self.turns += 1
        self._tell(0.0, ended)

    def end(self, iteration: int, distances: dict[str, float]) -> None:
        """An iteration is over."""
        seconds, self._began = perf_counter() - self._began, perf_counter()
        self.reports.append({"iteration": iteration, "seconds": seconds, "distances": distances})

    def nothing_to_do(self) -> None:
        """Where there was no turn at all, be it that nothing varies or that no iteration was asked for, say so once."""
        if self._callback and not self.turns:
            self._call(1.0, self._iterations, ended=False)

    def _tell(self, share: float, ended: bool) -> None:
        if self._callback:
            done = self.turns + share
            iteration = min(self._iterations, int(done / self._channels) + (not ended))
            self._call(done / (self._iterations * self._channels), iteration, ended)

    def _call(self, fraction: float, iteration: int, ended: bool) -> None:
        now: dict[str, Any] = {"level": 0, "levels": 1, "fraction": fraction, "image": self._image}
        now |= {"iteration": iteration, "iterations": self._iterations, "end_of_iteration": ended}
        if self._callback:
            self._callback(Iterating(solid=self._solid, **now))
