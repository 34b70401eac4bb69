# SPDX-License-Identifier: BSD-3-Clause
"""Mixtures of textures: section 5 of Heeger and Bergen (1995)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine, memory
from simdtex.methods.pyramid import algorithm as pyramid
from simdtex.methods.pyramid.matcher import Histograms, Sorted, averaged, histograms, spliced
from simdtex.methods.pyramid.options import Options
from simdtex.methods.pyramid.palette import decorrelated
from simdtex.methods.pyramid.palette import palette as colours_of
from simdtex.methods.pyramid.stretched import Stretched


@dataclass(frozen=True)
class Mixture:
    """A mixture of pictures (rows, cols, channels); ``sides`` are those of low and high frequencies, and the split."""

    pictures: list[NDArray[Any]]
    shape: tuple[int, int]
    options: Options
    average: list[float]
    sides: tuple[int, int, int | None] | None
    palette: int | None

    def on(self, machine: Machine, seed: int) -> pyramid.PyramidRun:
        """Return the run on a machine, with the samples analysed on one scale.

        Blended samples are decorrelated together, so that their channels have the same meaning.
        """
        pictures, options = self.pictures, self.options
        used = [i for i, weight in enumerate(self.average) if weight]
        shown = [] if self.palette is None else [self.palette]
        weights = [self.average[i] for i in used]
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
            patterns = [spliced(a, b, finest) for a, b in zip(every[low], every[high], strict=True)]
        else:
            patterns = [averaged(channel, weights) for channel in zip(*every.values(), strict=True)]
        if shown:  # the pixels of the palette; a channel in which the pattern is flat, as in grey, has their mean
            pixels: list[Sorted] = [np.sort(c.reshape(1, -1)) for c in scale.channels[-1]]
            for c, pattern in enumerate(patterns):
                varies = any((band[:, 0] < band[:, -1]).any() for band in pattern.subbands)
                patterns[c] = Histograms(pixels[c] if varies else np.zeros((1, 1), np.int32), pattern.subbands)
        texture = pyramid.Texture(patterns, palette, scale, stretched)
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
