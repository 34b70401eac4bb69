# SPDX-License-Identifier: BSD-3-Clause
"""The instructions of the array in NumPy; each has a kernel of the same name in ``kernels/maspar``.

Plural variables are arrays (layers, PEs, words), from the word on that an instruction uses, or (1, PEs, words) if one
layer after another uses them. Arguments are those of the kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.array import Layout
from simdtex.ops.lcpdf import Choice, Key, masses, spread, stepped, weighed, weights
from simdtex.random import below, draw4

Array: TypeAlias = NDArray[Any]

STEPPED = 64
"""Candidates in the memory of a device are a multiple of this: four vectors of the longest."""

AT_ONCE = 16
"""The most times `STEPPED` candidates of one launch; fewer on an array beyond the largest MP-1."""


class On(NamedTuple):
    """The PEs that execute an instruction: ``at`` are their layers and their numbers, (active,) each."""

    layout: Layout
    at: tuple[NDArray[np.intp], NDArray[np.intp]]


def _share(x: Array, y: Array) -> Array:
    return below(x & np.uint64(2**32 - 1), x >> np.uint64(32), y)


def _lowest(x: Array, _: Array) -> Array:
    one, ones = x.dtype.type(1), x & ~(x + x.dtype.type(1))
    return sum(((ones >> x.dtype.type(k)) & one for k in range(8 * x.itemsize)), np.zeros_like(x))


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


def lcpdf_keep(on: On, near: Array, number: int, arrived: Array, heat: Array) -> None:
    """Keep x u and u = 1 - t of the words x and t that arrived from a neighbour, and add t to ``heat``."""
    x, t = np.split(arrived[on.at], [-1], 1)
    u = (1024 - t).astype(np.float32) / np.float32(1024)
    words = slice(number * arrived.shape[-1], (number + 1) * arrived.shape[-1])
    near[..., words][on.at] = np.concatenate([x.astype(np.float32) * u, u], 1)
    heat[on.at] += t


class Broadcast(NamedTuple):
    """Candidates that the ACU broadcasts in a launch, and what the PEs compute of them.

    ``begin`` is the number of the first of ``size`` candidates; of all candidates ``own`` (C, n) float32 are the values
    and ``sample`` (N, C, n or more) those of their neighbours. ``choice`` has the Gaussian (7). The layers share
    ``distance``, float32; ``least``, the least one so far, and ``chosen``, a candidate, are plural.
    """

    begin: int
    size: int
    sample: Any
    own: Any
    choice: Choice
    distance: Any
    least: Any
    chosen: Any

    @classmethod
    def blocks(cls, mp1: Any, level: Any, keeps: bool, least: Any, chosen: Any) -> list[Broadcast]:
        """Return the candidates in as few launches as an array allows; with ``keeps``, PEs keep all distances."""
        n, most = level.own.shape[1], STEPPED * max(1, min(AT_ONCE, 2**18 // mp1.array.size))
        held = n if keeps else min(n, most)
        distance = mp1.expression("float32", held + -held % STEPPED, shared=True)
        tables = (mp1.put(level.sample, STEPPED), mp1.put(level.own), level.choice)
        return [cls(p, min(n - p, most), *tables, distance, least, chosen) for p in range(0, n, most)]

    @property
    def numbers(self) -> slice:
        """The candidates."""
        return slice(self.begin, self.begin + self.size)

    @property
    def kept(self) -> slice:
        """Their places among the distances that a PE keeps."""
        at = self.begin % self.distance.shape[-1]
        return slice(at, at + self.size)

    def weights(self, on: On) -> NDArray[np.uint64]:
        """Return the weights (7) in the active PEs, (candidates, PEs)."""
        d = np.concatenate([self.least[on.at].T, self.distance[0, on.at[1], self.kept].T])
        return weights(d, self.choice.window.scale)[1:]


def lcpdf_distance(on: On, of: Broadcast, near: Array) -> None:
    """Set the distances (12), and ``least`` and ``chosen`` to the nearest so far."""
    neighbours, channels = of.sample.shape[:2]
    z = near[on.at].reshape(-1, neighbours, channels + 1).astype(np.float64)
    d = np.zeros((len(z), of.size), np.float32)
    for k in range(neighbours):
        for c in range(channels):
            e = z[:, k, c, None] - z[:, k, channels, None] * of.sample[k, c, of.numbers].astype(np.float64)
            d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
    of.distance[0, on.at[1], of.kept] = d
    old = of.least[on.at]
    of.least[on.at] = np.minimum(d.min(1, keepdims=True), old)
    nearest = of.begin + d.argmin(1, keepdims=True)
    of.chosen[on.at] = np.where(d.min(1, keepdims=True) < old, nearest, of.chosen[on.at])


def lcpdf_weigh(on: On, of: Broadcast, total: Array, target: Array, choose: int) -> None:
    """Add the weights (7) to ``total``; with ``choose``, the first to exceed the target is chosen, if none was."""
    w = masses(of.weights(on), of.own[:, of.numbers, None], of.choice)
    sums = np.cumsum(w, 0, dtype=np.uint64) + total[on.at].T
    total[on.at] = sums[-1:].T
    if choose:
        beyond, old = sums > target[on.at].T, of.chosen[on.at]
        found = np.where(beyond.any(0), of.begin + beyond.argmax(0), -1)
        of.chosen[on.at] = np.where(old < 0, found[:, None], old)


def lcpdf_mode(on: On, of: Broadcast, mass: Array, most: Array, x: Array, c: int) -> None:
    """Add the weights (7) given all channels of ``x`` but ``c`` to the ``mass`` of each grey level.

    With ``c`` -1, the candidate that gives most is chosen, and ``most`` is its weight.
    """
    grey = of.own[:, of.numbers].astype(np.int64)
    w = weighed(x[on.at].T, of.weights(on), grey, of.choice.window, c)
    if c < 0:
        better = w.max(0) > most[on.at][:, 0]
        of.chosen[on.at] = np.where(better, of.begin + w.argmax(0), of.chosen[on.at][:, 0])[:, None]
        most[on.at] = np.maximum(w.max(0)[:, None], most[on.at])
    else:
        sums = mass[0, on.at[1]].T * np.uint64(of.begin > 0)
        np.add.at(sums, grey[c], w)
        mass[0, on.at[1]] = sums.T


def lcpdf_highest(on: On, mass: Array, choice: Choice, x: Array) -> None:
    """Set a word to the grey level with the highest density, of several the lowest."""
    x[..., 0][on.at] = spread(mass[0, on.at[1]].T, choice.window).argmax(0)


def lcpdf_step(on: On, x: Array, choice: Choice, place: Array, key: Key, c: int) -> None:
    """Add to the grey level of channel ``c`` a step drawn from the kernel of equation (7) around it."""
    grey = x[..., 0][on.at].astype(np.uint16)
    x[..., 0][on.at] = stepped(grey, c, place[..., 0][on.at], choice.window, key)
