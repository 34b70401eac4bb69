# SPDX-License-Identifier: BSD-3-Clause
"""Pyramid matching: the procedure of Heeger and Bergen (1995).

`PyramidRun` is their Match-texture, `Matcher` (matcher.py) their Match-Histogram, `Transform` (pyramids.py) their
Make-Pyramid and Collapse-Pyramid. Solid textures (solid.py) and mixtures (mixtures.py) are the same program with
another pyramid and with other histograms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.laplacian import noise
from simdtex.methods.pyramid.matcher import Histograms, Matcher, Wanted, histograms
from simdtex.methods.pyramid.matching import match_ranks
from simdtex.methods.pyramid.options import Options
from simdtex.methods.pyramid.palette import Decorrelated, Palette, decorrelated, palette
from simdtex.methods.pyramid.pyramids import Transform, most_levels
from simdtex.methods.pyramid.stretched import Stretched
from simdtex.options import within_32_bits
from simdtex.run import Callback, Observer, Output, Progress

RESIDUE = 8
"""The fewest rows and columns of the low-pass residue, if the number of levels is not given."""

PART = 2**16
"""Pixels whose colours are restored together, in double precision: some megabytes on the host."""

VALUES = 8
"""The most values per output pixel that kernels index: six oriented bands of a level, and a margin."""

MEMORY = 160
"""The most bytes per pixel of a picture on the device (benchmarks/memory.py)."""

HOST = 20, 20, 3
"""Bytes per pixel on the host: in any case, per channel, and per byte of all channels (benchmarks/memory.py)."""


@dataclass(frozen=True)
class Texture:
    """The target of a run: histograms of decorrelated channels, and the transform back to colours.

    ``scale`` is the unit of the channels, ``stretched`` converts values to pixels, and ``own`` are the sample's pixels
    in ascending order if a grey output takes exactly these.
    """

    histograms: list[Histograms]
    palette: Palette
    scale: Decorrelated
    stretched: Stretched
    own: NDArray[Any] | None = None

    def image(self, channels: Sequence[NDArray[np.int32]]) -> NDArray[Any]:
        """Return the image (..., C) of channels (...), which have one shape."""
        shape = channels[0].shape
        pixels = []
        flat = np.stack([channel.reshape(-1) for channel in channels])
        for first in range(0, flat.shape[1], PART):  # double precision, for a part of the pixels
            part = self.palette.restored(self.scale.normalised(flat[:, first : first + PART]))
            pixels.append(self.stretched.picture(part[:, None])[0])
        return np.concatenate(pixels).reshape(*shape, len(channels))


def transform(machine: Machine, options: Options, levels: int, torus: bool) -> Transform:
    """Return the 2-D pyramid of the options."""
    return Transform(machine, options.pyramid, levels, options.orientations, torus)


def number_of_levels(options: Options, *sides: int) -> int:
    """Return the number of levels of pyramids of pictures, or blocks, with these sides."""
    most = most_levels(*sides)
    if options.levels is None:
        return max(0, min(most, (min(sides) // RESIDUE).bit_length() - 1))
    if options.levels > most:
        raise ValueError(f"levels={options.levels} is too many for a side of {min(sides)} pixels; give at most {most}")
    return options.levels


def analyse(machine: Machine, sample: NDArray[Any], options: Options, *pyramids: Transform) -> Texture:
    """Return the histograms of a sample (rows, cols, channels): analysis-pyr of every decorrelated channel."""
    memory.require(machine, prod(sample.shape[:2]) * MEMORY)
    stretched = Stretched(sample)
    colours = palette([stretched.planes], [1.0], options.color == "decorrelate")
    scale = decorrelated([stretched.planes], [colours])
    measured = [histograms(machine, channel, *pyramids) for channel in scale.channels[0]]
    ranked = np.sort(sample, axis=None) if sample.shape[-1] == 1 and options.match == "rank" else None
    return Texture(measured, colours, scale, stretched, ranked)


@dataclass(frozen=True)
class PyramidPlan:
    """A run of the method ``pyramid`` before it has a machine and a seed, of a sample (rows, cols, channels)."""

    sample: NDArray[Any]
    shape: tuple[int, int]
    options: Options

    def on(self, machine: Machine, seed: int) -> PyramidRun:
        """Return the run on a machine, with the sample analysed; raise if the memory does not suffice."""
        levels = number_of_levels(self.options, *self.shape, *self.sample.shape[:2])
        pyramid = transform(machine, self.options, levels, self.options.edges == "wrap")
        return picture_run(machine, analyse(machine, self.sample, self.options, pyramid), self, levels, seed)


def picture_run(machine: Machine, texture: Texture, plan: Any, levels: int, seed: int) -> PyramidRun:
    """Return the run that matches a picture of ``plan.shape`` with a texture, by ``plan.options``."""
    shape, options = plan.shape, plan.options
    within_32_bits(shape, max(VALUES, len(texture.histograms)))
    check_memory(machine, shape, texture, MEMORY)
    pyramid = transform(machine, options, levels, torus=True)

    def turn(picture: Array, wanted: list[Wanted], matcher: Matcher, tell: Callable[[float], None]) -> Array:
        synthesis_pyr = pyramid.make(picture.reshape((1, *shape)))  # Make-Pyramid(noise)
        matched = match_subbands(matcher, pyramid.names, synthesis_pyr, wanted)
        return pyramid.collapse(matched)  # Collapse-Pyramid(synthesis-pyr)

    return PyramidRun(machine, texture, shape, turn, options, levels, seed)


def check_memory(machine: Machine, shape: tuple[int, ...], texture: Texture, on_device: int) -> None:
    """Raise if an output does not fit the memory, with ``on_device`` bytes per pixel on the device."""
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
"""One turn of the loop without the pixels: the pyramid of the picture is made, matched and collapsed."""


class PyramidState(NamedTuple):
    """The state between two channels' turns.

    ``turns``, the number of turns done, over all channels and iterations; ``pictures`` (1, 1, ...) int32 arrays of the
    machine, one for each channel that varies; ``moved``, the distances of values in this iteration, as in
    `Matcher.moved`.
    """

    turns: int
    pictures: tuple[Array, ...]
    moved: tuple[Any, ...] = ()


class PyramidRun:
    """Match-texture of the paper, for each of the decorrelated channels; a step is one channel's turn.

    ``shape`` is (rows, cols) or (depth, rows, cols) of the output, and ``turn`` makes, matches and collapses the
    pyramid of a picture. Memory in bytes per pixel: 160 on the device (240 per voxel of a block); on the host, which
    includes a CPU's device memory, 20 + (20 + 3 n) channels, n the bytes of a value of the sample.
    """

    def __init__(
        self,
        machine: Machine,
        texture: Texture,
        shape: tuple[int, ...],
        turn: Turn,
        options: Options,
        levels: int,
        seed: int,
    ) -> None:
        self.machine, self.texture, self.shape, self.options = machine, texture, shape, options
        self.levels, self.seed, self._turn = levels, seed, turn
        self.matcher = Matcher(machine, options, seed)
        found = texture.histograms
        self.busy = [c for c, plane in enumerate(found) if plane.pixels[0, 0] < plane.pixels[0, -1]]  # others are flat
        self._pixels = [self.matcher.wanted(found[c].pixels, found[c].pixels) for c in self.busy]
        self._subbands = [[self.matcher.wanted(band, found[c].pixels) for band in found[c].subbands] for c in self.busy]

    def begin(self) -> PyramidState:
        """Return noise with the histograms of the sample's pixels: Match-Histogram(noise, texture)."""
        begun = _begin(self.machine, self.texture, self.shape, self.options, self.seed)
        pairs = zip(self.busy, self._pixels, strict=True)
        pictures = tuple(self.matcher.match("pixels", begun(c), pixels) for c, pixels in pairs)
        self.matcher.moved.clear()  # those of the noise
        return PyramidState(0, pictures)

    def step(
        self, state: PyramidState, watch: Callable[[PyramidState, float], None]
    ) -> tuple[PyramidState, dict[str, float] | None]:
        """Match the subbands and the pixels of the next channel: the body of Loop for several iterations.

        The description of the step is None or, at the end of an iteration, the histograms' distances by subband.
        """
        if not self.busy:
            return state._replace(turns=state.turns + 1), {}
        c, matcher = state.turns % len(self.busy), self.matcher
        matcher.moved[:] = state.moved
        picture = self._turn(state.pictures[c], self._subbands[c], matcher, lambda share: watch(state, share))
        picture = matcher.match("pixels", picture.reshape(state.pictures[c].shape), self._pixels[c])
        self.machine.sync()
        pictures = (*state.pictures[:c], picture, *state.pictures[c + 1 :])
        distances = matcher.distances() if c == len(self.busy) - 1 else None
        return PyramidState(state.turns + 1, pictures, tuple(matcher.moved)), distances

    def ended(self, state: PyramidState) -> bool:
        """Return whether all iterations are done."""
        return state.turns >= self.options.iterations * max(1, len(self.busy))

    def read(self, pictures: tuple[Array, ...]) -> NDArray[Any]:
        """Return the image of the channels' pictures, read back."""
        shown = dict(zip(self.busy, pictures, strict=True))
        return self.texture.image(
            [
                self.machine.get(shown[c]).reshape(self.shape) if c in shown else np.full(self.shape, flat.pixels[0, 0])
                for c, flat in enumerate(self.texture.histograms)
            ]
        )

    def result(self, state: PyramidState, observer: PyramidRecord) -> tuple[NDArray[Any], Output]:
        """Return the image (*shape, channels) in the sample's type, and the statistics."""
        ranked, machine = self.texture.own, self.machine
        if ranked is not None and self.busy:  # grey: the k-th smallest pixel becomes the k-th smallest of the sample
            ranks = machine.put(np.arange(ranked.size, dtype=np.int32)[None])
            order = self.matcher.order(state.pictures[0].reshape((1, prod(self.shape))))
            image = ranked[machine.get(match_ranks(machine, order, ranks)).reshape(*self.shape, 1)]
        else:
            image = self.read(state.pictures)
        options = {name: value for name, value in vars(self.options).items() if name != "start"}
        statistics = {"options": options | {"levels": self.levels}, "iterations": observer.reports}
        return image, Output(None, None, [], statistics)

    def save(self, state: PyramidState) -> dict[str, Any]:
        """Return a copy of the state that needs no machine."""
        get = self.machine.get
        moved = [(name, get(array), scale) for name, array, scale in state.moved]
        return PyramidState(state.turns, tuple(map(get, state.pictures)), tuple(moved))._asdict()

    def load(self, saved: dict[str, Any]) -> PyramidState:
        """Return the state that `save` copied, on this machine."""
        put = self.machine.put
        moved = tuple((name, put(array), scale) for name, array, scale in saved["moved"])
        return PyramidState(saved["turns"], tuple(map(put, saved["pictures"])), moved)

    def observer(self, callback: Callback | None) -> PyramidRecord:
        """Return the observer of this run."""
        return PyramidRecord(self, callback)


def _begin(
    machine: Machine, texture: Texture, shape: tuple[int, ...], options: Options, seed: int
) -> Callable[[int], Array]:
    """Return a function that returns the initial picture of each channel (1, 1, ...): noise, or that of ``start``."""
    if options.start is None:
        return lambda c: noise(machine, 1, prod(shape), seed, c).reshape((1, 1, *shape))
    start = np.asarray(options.start)
    channels = len(texture.histograms)
    if start.shape == shape or start.shape == (*shape, 1):
        start = np.broadcast_to(start.reshape(*shape, 1), (*shape, channels))
    if start.shape != (*shape, channels):
        size = " x ".join(str(n) for n in shape)
        raise ValueError(f"start has shape {start.shape}; give one of {size} pixels, grey or with {channels} channels")
    planes = Stretched(start.reshape(-1, 1, channels)).planes
    normal = palette([planes], [1.0]).decorrelated(planes)
    scaled = np.rint(np.clip(normal, -64, 64) * 2**14).astype(np.int32)  # in 2**-14 standard deviations
    return lambda c: machine.put(scaled[c].reshape(1, 1, *shape))


class PyramidRecord(Observer):
    """The observer of a run: it reports every channel's turn, every part of a solid's, and iterations."""

    _run: PyramidRun

    def part(self, state: PyramidState, share: float) -> None:
        """Report a share of the current channel's turn."""
        self._tell(state, state.turns + share, ended=False)

    def step(self, state: PyramidState, distances: dict[str, float] | None) -> None:
        """Report a channel's turn, and keep the distances of an iteration."""
        self._tell(state, state.turns, ended=distances is not None)
        if distances is not None:
            self.report(iteration=len(self.reports) + 1, distances=distances)

    def _tell(self, state: PyramidState, done: float, ended: bool) -> None:
        """Report ``done`` turns of channels."""
        if self._callback:
            turns, iterations = done / max(1, len(self._run.busy)), self._run.options.iterations
            iteration = min(iterations, int(turns) + (not ended))
            self._callback(
                Progress(
                    fraction=turns / iterations,
                    doing=f"iteration {iteration} of {iterations}",
                    stage=f"iteration{iteration:02d}" if ended else None,
                    image=lambda: self._run.read(state.pictures),
                    solid=len(self._run.shape) == 3,
                    details={"iteration": iteration, "iterations": iterations},
                )
            )
