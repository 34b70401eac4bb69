# SPDX-License-Identifier: BSD-3-Clause
"""Mixtures of textures: section 5 of Heeger and Bergen (1995)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample
from simdtex.machine import Machine, memory
from simdtex.methods.pyramid import algorithm as pyramid
from simdtex.methods.pyramid.matcher import Histograms, Sorted, averaged, histograms, spliced
from simdtex.methods.pyramid.options import Options
from simdtex.methods.pyramid.palette import decorrelated
from simdtex.methods.pyramid.palette import palette as colours_of
from simdtex.methods.pyramid.stretched import Stretched
from simdtex.options import real, whole


def mixture(
    samples: Sequence[ArrayLike],
    shape: tuple[int, int],
    channel_axis: int | None,
    options: Options,
    palette: int | None,
    pattern: int | None,
    average: Sequence[float] | None,
    low: int | None,
    high: int | None,
    split: int | None,
) -> Mixture:
    """Return the plan of `simdtex.mix` for its parameters; raise ValueError or TypeError if one is invalid."""
    pictures = _checked(samples, channel_axis)
    weights = _weights(len(pictures), pattern, average, low, high, split)
    if palette is not None:
        _check_number("palette", palette, len(pictures))
    sides = None if low is None or high is None else (low, high, split)
    return Mixture(pictures, shape, options, weights, sides, palette)


@dataclass(frozen=True)
class Mixture:
    """A mixture of pictures (rows, cols, channels) before it has a machine and a seed.

    ``weights`` are those of each picture in the pattern; ``sides`` are the pictures of low and high frequencies, and
    the split between them.
    """

    pictures: list[NDArray[Any]]
    shape: tuple[int, int]
    options: Options
    weights: list[float]
    sides: tuple[int, int, int | None] | None
    palette: int | None

    def on(self, machine: Machine, seed: int) -> pyramid.Run:
        """Return the run on a machine, with the samples analysed on one scale.

        Blended samples are decorrelated together, so that their channels have the same meaning.
        """
        pictures, options = self.pictures, self.options
        used = [i for i, weight in enumerate(self.weights) if weight]
        shown = [] if self.palette is None else [self.palette]
        weights = [self.weights[i] for i in used]
        sizes = (side for i in (*used, *shown) for side in pictures[i].shape[:2])
        levels = pyramid.number_of_levels(options, *self.shape, *sizes)
        memory.require(machine, max(p.shape[0] * p.shape[1] for p in pictures) * pyramid.MEMORY)
        stretched = Stretched(np.concatenate([p.reshape(-1, 1, p.shape[-1]) for p in pictures]))
        planes = _parted(stretched.planes, pictures)
        decorrelate = options.color == "decorrelate"
        palette = blended = colours_of([planes[i] for i in used], weights, decorrelate)
        if shown:
            palette = colours_of([planes[i] for i in shown], [1.0], decorrelate)
        palettes = [blended] * len(used) + [palette] * len(shown)
        scale = decorrelated([planes[i] for i in (*used, *shown)], palettes)
        transform = pyramid.transform(machine, options, levels, options.edges == "wrap")
        every = {
            i: [histograms(machine, channel, transform) for channel in channels]
            for i, channels in zip(used, scale.channels, strict=False)
        }
        if self.sides is not None:
            low, high, split = self.sides
            finest = _high_subbands(split, levels, options.pyramid)
            found = [spliced(a, b, finest) for a, b in zip(every[low], every[high], strict=True)]
        else:
            found = [averaged(channel, weights) for channel in zip(*every.values(), strict=True)]
        if shown:  # the pixels of the palette
            own: list[Sorted] = [np.sort(c.reshape(1, -1)) for c in scale.channels[-1]]
            found = [Histograms(pixels, one.subbands) for pixels, one in zip(own, found, strict=True)]
        texture = pyramid.Texture(found, palette, scale, stretched)
        return pyramid.picture_run(machine, texture, self, levels, seed)


def _parted(planes: NDArray[np.int32], pictures: list[NDArray[Any]]) -> list[NDArray[np.int32]]:
    """Return the stretched planes (C, rows, cols) of each picture from (C, pixels of all pictures, 1)."""
    sizes = [p.shape[0] * p.shape[1] for p in pictures]
    parts = np.split(planes[..., 0], np.cumsum(sizes)[:-1], axis=1)
    return [part.reshape(len(planes), *p.shape[:2]) for part, p in zip(parts, pictures, strict=True)]


def _high_subbands(split: int | None, levels: int, kind: str) -> int:
    """Return the number of subbands of a pyramid that are high frequencies."""
    if split is None:
        split = (levels + 1) // 2
    if split > levels:
        raise ValueError(f"split is {split} and the pyramids have {levels} levels; give at most that")
    return split + (kind == "steerable")


def _checked(samples: Sequence[ArrayLike], channel_axis: int | None) -> list[NDArray[Any]]:
    """Return the samples as (rows, cols, channels), grey ones with the number of channels of colour ones."""
    if not isinstance(samples, Sequence):
        what = "a single array" if isinstance(samples, np.ndarray) else f"of {type(samples).__name__}"
        raise TypeError(f"samples is {what}; give a list of samples")
    pictures = [check_sample(sample, None if np.ndim(sample) == 2 else channel_axis) for sample in samples]
    if not pictures:
        raise ValueError("there is no sample; give one or more")
    channels = max(p.shape[-1] for p in pictures)
    for number, p in enumerate(pictures):
        if p.dtype != pictures[0].dtype:
            raise TypeError(
                f"sample {number} is of {p.dtype} and the first of {pictures[0].dtype}; convert them to one type"
            )
        if p.shape[-1] not in (1, channels):
            raise ValueError(
                f"sample {number} has {p.shape[-1]} channels and another {channels}; give all the same, or grey ones"
            )
    return [np.broadcast_to(p, (*p.shape[:2], channels)) for p in pictures]


def _weights(
    count: int,
    pattern: int | None,
    average: Sequence[float] | None,
    low: int | None,
    high: int | None,
    split: int | None,
) -> list[float]:
    """Return the weight of every sample in the pattern."""
    if (low is None) != (high is None):
        raise ValueError("low and high go together; give both, or neither")
    if (pattern is not None) + (average is not None) + (low is not None) > 1:
        raise ValueError("a mixture has one pattern; give pattern, average, or low and high")
    if split is not None and low is None:
        raise ValueError("split parts low from high; give these two, or leave split out")
    if split is not None:
        whole("split", split, 0)
    chosen = [(name, n) for name, n in (("pattern", pattern), ("low", low), ("high", high)) if n is not None]
    for name, number in chosen:
        _check_number(name, number, count)
    if chosen:
        return [float(i in [number for _, number in chosen]) for i in range(count)]
    if average is not None and not isinstance(average, (Sequence, np.ndarray)):
        raise TypeError(f"average is {average!r}; give a list of weights, one for each sample")
    weights = [1.0] * count if average is None else list(average)
    if len(weights) != count:
        raise ValueError(f"average has {len(weights)} weights for {count} samples; give one for each")
    for weight in weights:
        real("a weight of average", weight, 0)
    if not any(weights):
        raise ValueError("all weights of average are 0; give one above 0")
    return [float(weight) for weight in weights]


def _check_number(name: str, number: Any, count: int) -> None:
    if isinstance(number, bool) or not isinstance(number, Integral) or not 0 <= int(number) < count:
        raise ValueError(f"{name} is {number!r}; give the number of a sample, 0 to {count - 1}")
