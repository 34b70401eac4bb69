# SPDX-License-Identifier: BSD-3-Clause
"""How evenly an output uses its sample: counted on the source map over pieces of the sample."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.options import unmasked

__all__ = ["MostUsed", "SourceMap", "Use", "checked", "counts", "effective_use", "use_of"]

SourceMap = NDArray[np.int32]

PIECE = 8  # side of a piece of the sample, pixels


class MostUsed(NamedTuple):
    """The most used piece: its use over its fair share, its first pixel and its size, see `effective_use`."""

    times_fair_share: float
    row: int
    col: int
    rows: int
    cols: int


class Use(NamedTuple):
    """How evenly an output uses its sample, see `effective_use`."""

    effective_share: float
    most_used: MostUsed

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as in `simdtex.run.Output.statistics`."""
        return {"effective_share": self.effective_share, "most_used": self.most_used._asdict()}


def checked(source: ArrayLike) -> SourceMap:
    """Return a source map as (rows, cols, 2 or 3) int32; raise if ``source`` is not one."""
    unmasked("the source map", source)
    positions = np.asarray(source)
    if (
        positions.ndim != 3
        or positions.shape[2] not in (2, 3)
        or positions.size == 0
        or positions.dtype.kind not in "iu"
    ):
        raise ValueError(
            f"a source map is (rows, cols, 2) or (rows, cols, 3) integers, not {positions.shape} of "
            f"{positions.dtype}: pass the one of a run"
        )
    low, high = int(positions.min()), int(positions.max())
    if low < -1 or high > np.iinfo(np.int32).max:
        wrong = low if low < -1 else high
        raise ValueError(f"the source map has the position {wrong}: pass the one of a finished run")
    none = positions < 0
    if (none[..., 0] != none[..., 1]).any() or (none[..., 2:] > none[..., :1]).any():
        raise ValueError(
            "the source map has the position -1 in a row, column or sample alone, and no source is -1 in both row and "
            "column: pass the one of a finished run"
        )
    return np.ascontiguousarray(positions, dtype=np.int32)


def counts(source: ArrayLike, sample_shape: tuple[int, ...], *, sample: int | None = None) -> NDArray[np.intp]:
    """Return the number of output pixels that were taken from each pixel of the sample.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)
        For every output pixel, the (row, column) of the sample that it was taken from, or (row, column, sample) of
        several samples; a pixel whose row and column are -1 has no source and is not counted.
    sample_shape : (rows, cols)
        The size of the sample, pixels.
    sample : int, optional
        The sample that is counted, from 0; required if the source map has several.

    Returns
    -------
    ndarray of int, sample_shape

    Raises
    ------
    ValueError
        `source` is no source map, points outside the sample, or is of several samples and none is named.
    """
    rows, cols = sample_shape[:2]
    positions = checked(source)
    several = positions.shape[2] == 3
    if several and sample is None:
        raise ValueError("the source map is of several samples: say which is counted with sample=0, sample=1 and so on")
    if sample is not None and (sample < 0 or (sample > 0 and not several)):
        raise ValueError(
            f"sample is {sample}: {'give 0 or more' if several else 'give None, the source map is of one'}"
        )
    counted = positions[..., 0] >= 0
    if several:
        counted &= positions[..., 2] == sample
    row, col = positions[counted].T[:2].astype(np.intp)
    if row.max(initial=0) >= rows or col.max(initial=0) >= cols:
        raise ValueError(
            f"the source map points outside a sample of {rows} x {cols} pixels: pass the sample that it was made from"
        )
    return np.bincount(row * cols + col, minlength=rows * cols).reshape(rows, cols)


def effective_use(
    source: ArrayLike, sample_shape: tuple[int, ...], piece: int = PIECE, *, sample: int | None = None
) -> Use:
    r"""Return how evenly the output uses the pieces of its sample, and the most used piece.

    The sample is cut into pieces of about 8 x 8 pixels. With :math:`u_p` the number of output
    pixels taken from the piece p, of :math:`a_p` pixels, the effective share is

    .. math::

       \frac{(\sum_p u_p)^2}{\sum_p a_p \sum_p u_p^2 / a_p} ,

    which is :math:`(\sum u)^2 / (n \sum u^2)` for n equally large pieces. It is the share of
    the sample that would suffice if all of it were used equally.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)
        For every output pixel, the (row, column) of the sample that it was taken from, or (row, column, sample) of
        several samples; a pixel whose row and column are -1 has no source and is not counted.
    sample_shape : (rows, cols)
        The size of the sample, pixels.
    piece : int
        Side of a piece, pixels: each side of the sample is cut into as many parts as come nearest
        to this length, which differ by one pixel at most.
    sample : int, optional
        The sample whose use is measured, from 0, by the pixels taken from it alone; required if the source map has
        several.

    Returns
    -------
    effective_share : float
        Above 0, to 1; a verbatim copy of the sample has 1.
    most_used : MostUsed
        ``times_fair_share`` is :math:`(u_p / \sum u) / (a_p / \sum a)` of the piece where it is
        largest, 1 or more; ``row`` and ``col`` are the piece's first pixel, ``rows`` and ``cols``
        its size.

    Raises
    ------
    ValueError
        `source` is no source map, points outside the sample, or is of several samples and none is named; no pixel was
        taken from the sample; `piece` is less than 1.

    Notes
    -----
    Cost: about 1 ms for an output of 256 x 256 pixels. If pieces are taken at random, the use of a piece with n
    output pixels varies by sqrt(n), so a small output has a lower share than a large one.
    """
    return use_of(counts(source, sample_shape, sample=sample), piece)


def use_of(uses: NDArray[np.intp], piece: int = PIECE) -> Use:
    """Return `effective_use` from ``uses``, the `counts`, which add up over the parts of a source map."""
    if piece < 1:
        raise ValueError(f"piece is {piece}: give its side in pixels, 1 or more")
    if not uses.any():
        raise ValueError("no pixel was taken from the sample, so its use has no figures: pass the map of another run")
    row, col = (_starts(length, piece) for length in uses.shape)
    taken = np.add.reduceat(np.add.reduceat(uses, row, axis=0), col, axis=1)
    tall, wide = np.diff([*row, uses.shape[0]]), np.diff([*col, uses.shape[1]])
    density = taken / np.multiply.outer(tall, wide) * (uses.size / taken.sum())  # mean 1 over the sample's pixels
    i, j = (int(n) for n in np.unravel_index(density.argmax(), density.shape))
    most = MostUsed(float(density[i, j]), int(row[i]), int(col[j]), int(tall[i]), int(wide[j]))
    return Use(float(taken.sum() / (taken * density).sum()), most)


def _starts(length: int, piece: int) -> NDArray[np.intp]:
    """Return the begin of each part of a side."""
    parts = max(1, round(length / piece))
    return np.arange(parts) * length // parts
