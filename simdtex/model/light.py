# SPDX-License-Identifier: BSD-3-Clause
"""Uneven light: the smooth trend of each channel of a picture, which ``light="even"`` removes.

The trend is a quadratic of row and column, fitted by iteratively reweighted least squares with Tukey's weights, so that
parts unlike the rest count little. Coefficients are rounded, and values follow from them by products and sums alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.pictures import Mask, Pictures, few
from simdtex.model.regularity import lattice_sentence
from simdtex.options import LARGEST, Choice, Option, moderate, one_of

Axes = tuple[int, ...]

ROUNDS, CUT = 5, 7.0
"""Rounds of least squares, and the residual, in medians of all residuals, from which a pixel has no weight."""

MOST = 2**18
"""The most pixels that a fit uses, and the judgement of it: of a larger picture every n-th row and column."""

ROUND = 2.0**20
"""Coefficients are rounded to 1 / ROUND of the channel's range: libraries differ in their last bits by less."""

SINGULAR = 1e-6
"""Ratio of singular values below which a term is not determined, and is 0: such as the bend of two rows."""

ROW, COL = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 0, 2, 1, 0])
"""The exponents of row and column in each term."""

LIGHTS = ("keep", "even")
"""The values of the option ``light``: as it is, or without its trend."""

LIGHT = Option(
    "keep",
    Choice(LIGHTS),
    "Keep the sample's light, or take pixels from the sample in even light",
    group="Appearance",
)
"""The option of commands and of the live page, where the light of a sample is kept by default."""

BLOCKS, SMOOTH, SHARE = 8, 0.9, 0.2
"""A picture of `BLOCKS` x `BLOCKS` means is uneven if the trend is `SMOOTH` of their variance, and `SHARE` of the
deviation of the pixels. Few crops of photographs are, of tissue and fur among them, but for those of a clear sky."""


EXACT = 2.0**53
"""The integers up to which all are numbers of the type of a trend."""

LEFT = 1 / 3
"""Share of the median deviation that a trend leaves of a picture that it explains. It leaves 0.2 of skies and of pages,
and 0.6 or more of pictures of objects and of textures."""


class Trend(NamedTuple):
    """The trend of a picture of ``shape`` rows and columns, whose mean over the pixels of the fit is 0."""

    shape: tuple[int, int]
    terms: NDArray[np.float64]  # (6, C), the coefficients
    limits: NDArray[np.float64]  # (2, C), its extremes at pixels of the fit, which it does not exceed elsewhere
    ends: NDArray[Any]  # (2, C), the extremes of the picture

    def at(self, rows: NDArray[np.integer], cols: NDArray[np.integer], wraps: Axes = ()) -> NDArray[np.float64]:
        """Return the trend (rows, cols, C), beyond the picture that of the nearest edge; along ``wraps`` its mean."""
        if len(wraps) == 2:
            return np.zeros((1, 1, self.terms.shape[1]))
        lines = [np.arange(side) if n in wraps else (rows, cols)[n] for n, side in enumerate(self.shape)]
        y, x = (_centred(np.clip(at, 0, side - 1), side) for at, side in zip(lines, self.shape, strict=True))
        trend = np.clip(_sheet(self.terms, y[:, None, None], x[:, None]), *self.limits)
        return np.asarray(trend.mean(wraps, keepdims=True)) if wraps else trend

    def removed(self, picture: NDArray[Any], along: Axes = (0, 1)) -> NDArray[Any]:
        """Return the picture (rows, cols, C) without the trend's changes along these axes."""
        if not along:
            return picture
        lines: Any = map(np.arange, self.shape)
        rows, cols = lines
        return self.cast(picture - (self.at(rows, cols) - self.at(rows, cols, along)))

    def explains(self, picture: NDArray[Any], use: Mask) -> bool:
        """Return whether most of a picture (rows, cols, C) where ``use`` is this trend, as in a sky or a blank page."""
        every = _thinned(use)
        lines: Any = (np.arange(side)[part] for side, part in zip(self.shape, every, strict=True))
        whole, there = picture[every], use[every]
        before, after = (np.abs(part[there] - np.median(part[there], 0)) for part in (whole, whole - self.at(*lines)))
        return bool(np.median(after, 0).sum() < LEFT * np.median(before, 0).sum())

    def cast(self, values: NDArray[np.float64]) -> NDArray[Any]:
        """Return values (..., C) within those of the picture, in its type."""
        clipped = np.clip(values, *self.ends.astype(np.float64))
        return (np.rint(clipped) if self.ends.dtype.kind in "iu" else clipped).astype(self.ends.dtype)


def trend(picture: NDArray[Any], use: Mask | None = None) -> Trend:
    """Return the trend of a picture (rows, cols, C) over the pixels of the mask ``use``; None: over all.

    A channel of 16 different values or fewer, such as a mask, has no trend.
    """
    shape = (picture.shape[0], picture.shape[1])
    moderate("a picture whose light is to be even", picture)
    inside = np.ones(shape, bool) if use is None or not use.any() else use
    every = _thinned(inside)
    y, x = (_centred(np.arange(side)[part], side) for side, part in zip(shape, every, strict=True))
    known = picture[inside]
    ends = np.stack([known.min(0), known.max(0)])
    if picture.dtype.kind in "iu" and np.abs(ends.astype(np.float64)).max() > EXACT:
        raise ValueError("integers beyond 2**53 have no trend; give smaller ones, or leave light out")
    terms, limits = np.zeros((6, len(ends[0]))), np.zeros((2, len(ends[0])))
    for channel, (low, high) in enumerate(ends.T.astype(np.float64).tolist()):
        plane = picture[(*every, channel)]
        if not few([known[:, None, channel, None]]):
            fit = _fitted((plane - low) / (high - low), inside[every], y, x)
            sheet = _sheet(fit, y[:, None], x)[inside[every]]
            mean = np.rint(sheet.mean() * ROUND) / ROUND
            fit[0] -= mean
            limits[:, channel] = [(end - mean) * (high - low) for end in (sheet.min(), sheet.max())]
            terms[:, channel] = fit * (high - low)
    return Trend(shape, terms, limits, ends)


class Relit(NamedTuple):
    """A picture in its light: ``whole`` (rows, cols, C), but for its part ``made``, which is made in even light."""

    whole: NDArray[Any]
    made: Mask
    trend: Trend
    corner: tuple[int, int] = (0, 0)  # where the picture of the trend begins
    wraps: Axes = ()  # along which the light is even

    def __call__(self, image: NDArray[Any], level: int = 0) -> NDArray[Any]:
        """Return the picture with its part from ``image``, which is of its size or that of a level."""
        step = 1 if image.shape == self.whole.shape else 2**level
        rows, cols = (np.arange(0, n, step) - first for n, first in zip(self.made.shape, self.corner, strict=True))
        lit = self.trend.cast(image + self.trend.at(rows, cols, self.wraps))
        return np.where(self.made[::step, ::step, None], lit, self.whole[::step, ::step])


@dataclass(frozen=True)
class Light:
    """What a job does to the light of its pictures: ``about`` for the statistics, and ``relit``, the way back."""

    about: dict[str, Any] = field(default_factory=dict)
    relit: Relit | None = None

    def __call__(self, image: NDArray[Any], level: int = 0) -> NDArray[Any]:
        """Return a picture of a run, or of a level, in the light of its place."""
        return self.relit(image, level) if self.relit else image


def in_light(pictures: Pictures, light: str, categorical: Any = False) -> tuple[Pictures, Light]:
    """Return the pictures of a sample with the option ``light``, ``"keep"`` or ``"even"``, and what was done."""
    one_of("light", light, LIGHTS)
    about = {"light": light, **unevenness(pictures.pixels[0])}
    if light == "keep":
        return pictures, Light(about)
    use = [np.ones(picture.shape[:2], bool) for picture in pictures.pixels]
    for masks in filter(None, (pictures.known, pictures.usable)):
        use = [used & mask for used, mask in zip(use, masks, strict=True)]
    sheets = trends(pictures.pixels, use, categorical)
    pixels = tuple(sheet.removed(picture) for sheet, picture in zip(sheets, pictures.pixels, strict=True))
    return replace(pictures, pixels=pixels), Light(about)


def trends(pixels: Sequence[NDArray[Any]], use: Sequence[Mask], categorical: Any) -> list[Trend]:
    """Return the trends that ``light="even"`` removes; raise ValueError if the values are categories."""
    if categorical or few(pixels):
        raise ValueError(
            'light="even" subtracts a smooth trend, and categories, or at most 16 different pixels, have none; '
            "leave light out"
        )
    return [trend(*pair) for pair in zip(pixels, use, strict=True)]


def unevenness(picture: NDArray[Any]) -> dict[str, float]:
    """Return the share of the trend in the variance of 8 x 8 means, and its deviation in units of the pixels'."""
    if min(picture.shape[:2]) < BLOCKS or float(np.abs(picture).max()) > LARGEST:
        return {"smooth": 0.0, "share": 0.0}
    means = plane = picture.mean(-1, dtype=np.float64)
    for axis, side in enumerate(plane.shape):
        starts = np.arange(BLOCKS) * side // BLOCKS
        means = np.add.reduceat(means, starts, axis) / np.expand_dims(np.diff(starts, append=side), 1 - axis)
    line = _centred(np.arange(BLOCKS), BLOCKS)
    terms = np.stack([np.outer(line**row, line**col).ravel() for row, col in zip(ROW, COL, strict=True)], 1)
    smooth = (terms @ np.linalg.lstsq(terms, means.ravel(), rcond=None)[0]).std()
    return {"smooth": float((smooth / (means.std() or 1)) ** 2), "share": float(smooth / (plane.std() or 1))}


def light_sentence(light: dict[str, Any] | None) -> str:
    """Return a sentence on a sample whose light is clearly uneven and is kept; "" for others."""
    uneven = light and light["light"] == "keep" and light.get("smooth", 0) >= SMOOTH and light["share"] >= SHARE
    return "The sample's light is uneven; set light to even to remove that." if uneven else ""


def sample_sentences(statistics: dict[str, Any]) -> str:
    """Return the sentences on a run's sample, on its lattice and its light, from the statistics; "" without any."""
    sentences = lattice_sentence(statistics.get("lattice")), light_sentence(statistics.get("light"))
    return " ".join(filter(None, sentences))


def _thinned(use: Mask) -> tuple[slice, slice]:
    """Return the rows and columns of a picture for a fit, and all if ``use`` is False there."""
    every = (slice(None, None, max(1, ceil(sqrt(use.size / MOST)))),) * 2
    return every if use[every].any() else (slice(None), slice(None))


def _centred(at: NDArray[np.integer], side: int) -> NDArray[np.float64]:
    """Return places in ``side`` pixels as numbers from -1 to 1."""
    return np.asarray((2 * at + 1) / side - 1)


def _sheet(terms: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quadratic of ``terms`` (6, ...) at ``y`` and ``x``, without matrices: the same bits everywhere."""
    sheet: NDArray[np.float64] = terms[0] + y * (terms[2] + y * terms[5]) + x * (terms[1] + x * terms[3])
    sheet += y * terms[4] * x
    return sheet


def _fitted(
    plane: NDArray[np.float64], use: Mask, y: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the terms (6,) of a plane, from 0 to 1 where ``use``, by robust least squares."""
    values, weights = np.where(use, plane, 0), use.astype(np.float64)
    rows, cols = (line ** np.arange(5)[:, None] for line in (y, x))
    fit = np.zeros(6)
    for _ in range(ROUNDS):
        square = (rows @ weights @ cols.T)[ROW[:, None] + ROW, COL[:, None] + COL]
        right = (rows @ (weights * values) @ cols.T)[ROW, COL]
        fit = np.rint(np.linalg.lstsq(square, right, rcond=SINGULAR)[0] * ROUND) / ROUND
        away = np.abs(values - _sheet(fit, y[:, None], x))
        cut = CUT * np.median(away[use])
        if not cut:
            break
        weights = use * np.maximum(0, 1 - (away / cut) ** 2) ** 2
    return fit
