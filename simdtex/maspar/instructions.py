# SPDX-License-Identifier: BSD-3-Clause
"""The instructions of the array in NumPy; each has a kernel of the same name in ``kernels/maspar``.

Plural variables are arrays (layers, PEs, words), from the word on that an instruction uses, or (1, PEs, words) if one
layer after another uses them. Arguments are those of the kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.array import PixelLayout
from simdtex.methods.mrf.arithmetic import fma32, minus_gumbel
from simdtex.methods.mrf.lcpdf import Key, ParzenWindow, spread, stepped, weighed, weights
from simdtex.methods.mrf.relax import PAIRS
from simdtex.methods.mrf.square import LANES
from simdtex.random import GUMBEL, below, draw4

Array: TypeAlias = NDArray[Any]

STEPPED = 64
"""Candidates in the memory of a device are a multiple of this: four vectors of the longest."""


class On(NamedTuple):
    """The PEs that execute an instruction: ``at`` are their layers and their numbers, (active,) each."""

    layout: PixelLayout
    at: tuple[NDArray[np.intp], NDArray[np.intp]]


def _share(x: Array, y: Array) -> Array:
    return below(x & np.uint64(2**32 - 1), x >> np.uint64(32), y)


def _lowest(x: Array, _: Array) -> Array:
    unit, ones = x.dtype.type(1), x & ~(x + x.dtype.type(1))
    return sum(((ones >> x.dtype.type(k)) & unit for k in range(8 * x.itemsize)), np.zeros_like(x))


COMPARISONS = {
    **{"lt": np.less, "le": np.less_equal, "eq": np.equal, "ne": np.not_equal},
    **{"gt": np.greater, "ge": np.greater_equal},
}
OPERATIONS: dict[str, Callable[[Array, Array], Array]] = {
    "copy": lambda x, _: x,
    **{"add": np.add, "sub": np.subtract, "mul": np.multiply},
    **COMPARISONS,
    "put": lambda x, y: np.broadcast_to(y, x.shape),
    **{"div": np.floor_divide, "mod": np.mod, "and": np.bitwise_and, "or": np.bitwise_or, "shr": np.right_shift},
    "bit": lambda x, _: np.where(x < 64, np.left_shift(x.dtype.type(1), x), 0),
    **{"lowest": _lowest, "share": _share},
}
"""The operations of the arithmetic unit, in the order of their numbers in kernels/maspar/alu.cl."""


def alu(on: On, operation: int, to: Array, a: Array, b: Array, singular: int, number: Any) -> None:
    """Set a word to an operation of words ``a`` and ``b``, or of ``a`` and a ``singular`` number."""
    x, y = a[..., 0][on.at], number if singular else b[..., 0][on.at]
    with np.errstate(over="ignore"):
        to[..., 0][on.at] = [*OPERATIONS.values()][operation](x, y)


def xnet(on: On, to: Array, source: Array, down: int, right: int, far: int) -> None:
    """Set all words to those of the pixel ``far`` away in a direction (rows, columns), around the edges."""
    row, col = np.moveaxis(on.layout.pixel[on.at] + np.array((down, right)) * far, -1, 0)
    rows, cols = on.layout.padded.shape
    to[on.at] = source.reshape(-1, source.shape[-1])[on.layout.address[row % rows, col % cols]]


def xnet_router(on: On, to: Array, source: Array, row: Array, col: Array) -> None:
    """Set all words to those of the pixel in ``row`` and ``col`` of each PE."""
    address = on.layout.address[row[..., 0][on.at], col[..., 0][on.at]]
    to[on.at] = source.reshape(-1, source.shape[-1])[address]


def xnet_reduce(on: On, part: Array, a: Array, least: int) -> None:
    """Set ``part`` to the sum or the minimum of a word over the layers of each PE."""
    part[:] = np.iinfo(np.int32).max if least else 0
    (np.minimum if least else np.add).at(part[0, :, 0], on.at[1], a[..., 0][on.at])


def random(on: On, to: Array, place: Array, key: Key, purpose: int) -> None:
    """Set a word to 64 random bits of each PE, keyed by the pixel ``place`` too."""
    lo, hi, *_ = draw4(*key, place[..., 0][on.at], purpose)
    to[..., 0][on.at] = lo.astype(np.uint64) | hi.astype(np.uint64) << np.uint64(32)


def table(on: On, to: Array, entries: Array, index: Array) -> None:
    """Set a word to the entry ``index`` of a table (n,)."""
    to[..., 0][on.at] = entries[index[..., 0][on.at]]


def lcpdf_keep(on: On, near: Array, offset: int, arrived: Array, heat: Array) -> None:
    """Keep x u and u = 1 - t of the words x and t that arrived from a neighbour, and add t to ``heat``."""
    x, t = np.split(arrived[on.at], [-1], 1)
    u = (1024 - t).astype(np.float32) / np.float32(1024)
    words = slice(offset * arrived.shape[-1], (offset + 1) * arrived.shape[-1])
    near[..., words][on.at] = np.concatenate([x.astype(np.float32) * u, u], 1)
    heat[on.at] += t


class Broadcast(NamedTuple):
    """Candidates, which the ACU broadcasts one after another.

    ``sample`` (N, C, n or more) float32 are the values of their neighbours, those of lane k from ``lanes[k]`` to
    ``lanes[k + 1]`` - 1; ``own`` (C, n) float32 the values of the candidates; ``share`` (C, n) float32 logarithms of
    the legal shares of their kernels, 0 unless a density is drawn; ``noise`` (n,) int32 the numbers of their noise.
    """

    sample: Any
    lanes: Any
    own: Any
    share: Any
    noise: Any


def _distances(on: On, of: Broadcast, near: Array) -> Iterator[tuple[Any, NDArray[np.float32]]]:
    """Yield some of the active PEs at a time, and the distances (12) there, (candidates, PEs), summed by lane."""
    (_, channels, _), n = of.sample.shape, of.own.shape[1]
    for pes in np.split(np.transpose(on.at), range(PAIRS // n or 1, on.at[0].size, PAIRS // n or 1)):
        at, lanes = tuple(pes.T), []
        z = near[at].reshape(len(pes), -1, channels + 1).astype(np.float64)
        for begin, end in pairwise((of.lanes * channels).tolist()):
            d = np.zeros((n, len(pes)), np.float32)
            for k, c in (divmod(r, channels) for r in range(begin, end)):
                e = z[:, k, c] - z[:, k, channels] * of.sample[k, c, :n, None].astype(np.float64)
                d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
            lanes.append(d)
        while len(lanes) > 1:
            half = len(lanes) // 2
            lanes = [a + b for a, b in zip(lanes[:half], lanes[half:], strict=True)]
        yield at, lanes[0]


def lcpdf_choose(
    on: On,
    of: Broadcast,
    near: Array,
    least: Array,
    chosen: Array,
    spread: np.float32,
    place: Array,
    key: Key,
) -> None:
    """Choose the candidate of the ``least`` distance (12) or, of a draw, of that plus ``spread`` times its noise."""
    for at, d in _distances(on, of, near):
        if spread:
            q = of.noise[:, None]
            words = draw4(*key, place[..., 0][at], GUMBEL, q // 64 * LANES + q % LANES)
            noise = minus_gumbel(np.choose(q // LANES % 4, words))
            for share in of.share:
                noise = noise - share[:, None]
            d = fma32(spread, noise, d)
        least[..., 0][at], chosen[..., 0][at] = d.min(0), d.argmin(0)


def lcpdf_mode(
    on: On, of: Broadcast, near: Array, least: Array, chosen: Array, window: ParzenWindow, mass: Array, x: Array, c: int
) -> None:
    """Set ``mass`` to the sums of the weights (7), given all channels of ``x`` but ``c``, of each grey level.

    With ``c`` -1, the candidate that gives most is chosen.
    """
    grey = of.own.astype(np.int64)
    for at, d in _distances(on, of, near):
        w = weighed(x[at].T, weights(d, window.scale), grey, window, c)
        if c < 0:
            chosen[..., 0][at] = np.where(w.any(0), w.argmax(0), chosen[..., 0][at])
        else:
            sums = np.zeros((window.top + 1, w.shape[1]), np.uint64)
            np.add.at(sums, grey[c], w)
            mass[0, at[1]] = sums.T


def lcpdf_highest(on: On, mass: Array, window: ParzenWindow, x: Array) -> None:
    """Set a word to the grey level with the highest density, of several the lowest."""
    x[..., 0][on.at] = spread(mass[0, on.at[1]].T, window).argmax(0)


def lcpdf_step(on: On, x: Array, window: ParzenWindow, place: Array, key: Key, c: int) -> None:
    """Add to the grey level of channel ``c`` a step drawn from the kernel of equation (7) around it."""
    grey = x[..., 0][on.at].astype(np.uint16)
    x[..., 0][on.at] = stepped(grey, c, place[..., 0][on.at], window, key)
