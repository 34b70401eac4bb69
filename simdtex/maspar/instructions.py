# SPDX-License-Identifier: BSD-3-Clause
"""The instructions of the processor array: a kernel of ``kernels/maspar`` with one work-item per PE, and its twin.

Variables are arrays (layers, PEs, words). Instructions write into their argument ``to``, and only in PEs where the mask
(layers, PEs) uint8 is 1. `simdtex.maspar.machine.MP1` executes and counts them.
"""

from __future__ import annotations

from functools import cached_property
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.maspar.array import ProcessorArray
from simdtex.model.lattice import Grid
from simdtex.ops.lcpdf import Choice, Key, masses, stepped, weights

COMPARISONS = ("lt", "le", "eq", "ne", "gt", "ge")
OPERATIONS = (
    "copy",
    "add",
    "sub",
    "mul",
    *COMPARISONS,
    "put",
    "div",
    "mod",
    "and",
    "or",
    "shr",
    "bit",
    "lowest",
    "share",
)
"""The operations of the arithmetic unit, by their numbers in kernels/maspar/alu.cl."""

TYPES = {"int32": "int", "float32": "float", "uint64": "ulong"}
"""The types of variables, and their names in kernels."""

LAYOUT = np.dtype([(name, np.int32) for name in ("rows", "cols", "high", "wide", "blocks")], align=True)
"""The struct ``Layout`` of kernels/maspar/layout.h."""

STEPPED = 64
"""Candidates of a launch are a multiple of this: four vectors of the longest."""


class Layout:
    """The places of a picture (rows, cols) on an array, padded to whole layers.

    ``pixel`` (layers, PEs, 2) are the row and column of each PE's pixel, ``address`` (rows, cols) is layer * PEs + PE.
    """

    def __init__(self, array: ProcessorArray, shape: tuple[int, int]) -> None:
        self.array, self.grid = array, Grid.of(shape)
        high, wide = array.layers(self.grid)
        self.layers, self.padded, struct = high * wide, Grid(array.rows * high, array.cols * wide), np.zeros((), LAYOUT)
        struct[()] = (array.rows, array.cols, high, wide, array.mapping == "hierarchical")
        self.struct: Any = struct[()]

    @cached_property
    def address(self) -> NDArray[np.int64]:
        """The address of each pixel."""
        layer, pe = self.array.place(self.padded.sites(), self.padded)
        return (layer * self.array.size + pe).reshape(self.padded.shape)

    @cached_property
    def pixel(self) -> NDArray[np.int64]:
        """The pixel at each address."""
        place = np.argsort(self.address, axis=None)
        return np.stack(np.divmod(place, self.padded.width), 1).reshape(self.layers, self.array.size, 2)

    def launch(self, machine: Launcher, name: str, *args: Any, **defines: Any) -> None:
        """Launch a kernel with exactly one work-item per PE."""
        size = self.array.size
        machine.launch(f"maspar_{name}", (size,), self.struct, *args, local=(gcd(size, 64),), defines=defines)


def _lowest(x: NDArray[Any], _: Any) -> NDArray[Any]:
    one, ones = x.dtype.type(1), x & ~(x + x.dtype.type(1))
    return sum(((ones >> x.dtype.type(k)) & one for k in range(8 * x.itemsize)), np.zeros_like(x))


TWINS: tuple[Any, ...] = (
    *(lambda x, _: x, np.add, np.subtract, np.multiply, np.less, np.less_equal, np.equal, np.not_equal, np.greater),
    *(np.greater_equal, lambda x, y: np.broadcast_to(y, x.shape), np.floor_divide, np.mod, np.bitwise_and),
    *(np.bitwise_or, np.right_shift, lambda x, _: np.where(x < 64, np.left_shift(x.dtype.type(1), x), 0), _lowest),
    lambda x, y: random.below(x & np.uint64(2**32 - 1), x >> np.uint64(32), y),
)


@Operation
def register(machine: Launcher | None, shape: tuple[int, ...], dtype: str) -> Array:
    """Return a variable without values."""
    return np.zeros(shape, dtype) if machine is None else machine.empty(shape, dtype)


@Operation
def alu(
    machine: Launcher | None, layout: Layout, mask: Array, operation: str, to: Any, a: Any, b: Any, number: Any
) -> None:
    """Set a word of ``to`` to an operation of words of ``a`` and ``b``, or of ``a`` and a singular number if b is None.

    A word is (array, its number among the words of each PE).
    """
    code, kind = OPERATIONS.index(operation), a[0].dtype
    if machine is None:
        active = mask > 0
        y = kind.type(number) if b is None else b[0][active, b[1]]
        with np.errstate(over="ignore"):
            to[0][active, to[1]] = TWINS[code](a[0][active, a[1]], y)
        return
    operands = [part for array, word in (to, a) for part in (array, array.shape[-1], word)]
    operands += [a[0], 0, 0] if b is None else [b[0], b[0].shape[-1], b[1]]
    defines = {"T": TYPES[kind.name], "TO": TYPES[to[0].dtype.name]} | ({} if kind.kind == "f" else {"WHOLE": 1})
    layout.launch(machine, "alu", mask, code, *operands, kind.type(number), **defines)


@Operation
def xnet(
    machine: Launcher | None, layout: Layout, mask: Array, to: Array, source: Array, way: tuple[int, int], far: int
) -> None:
    """Set all words of ``to`` to those of the pixel ``far`` away in a direction (rows, columns), around the edges."""
    if machine is None:
        active = mask > 0
        row, col = np.moveaxis(layout.pixel[active] + np.array(way) * far, -1, 0)
        address = layout.address[row % layout.padded.rows, col % layout.padded.cols]
        to[active] = source.reshape(-1, source.shape[-1])[address]
        return
    layout.launch(machine, "xnet", mask, to, source, words(source), *way, far)


@Operation
def router(
    machine: Launcher | None, layout: Layout, mask: Array, to: Array, source: Array, row: Array, col: Array
) -> None:
    """Set all words of ``to`` to those of the pixel in ``row`` and ``col`` of each PE."""
    if machine is None:
        active = mask > 0
        address = layout.address[row[active, 0], col[active, 0]]
        to[active] = source.reshape(-1, source.shape[-1])[address]
        return
    layout.launch(machine, "xnet_router", mask, to, source, words(source), row, col)


def words(variable: Array) -> int:
    """Return the words of 32 bits of each PE and layer."""
    return int(variable.nbytes // variable.size * variable.shape[-1] // 4)


@Operation
def reduction(machine: Launcher | None, layout: Layout, mask: Array, a: Array, word: int, least: bool) -> Array:
    """Return the sum or the minimum of an int32 word over the layers of each PE, (PEs,) int64."""
    if machine is None:
        x = np.where(mask > 0, a[..., word], np.iinfo(np.int32).max if least else 0).astype(np.int64)
        return x.min(0) if least else x.sum(0)
    part = machine.empty((layout.array.size,), np.int64)
    layout.launch(machine, "xnet_reduce", mask, a, a.shape[-1], word, int(least), part)
    return part


@Operation
def random_bits(
    machine: Launcher | None, layout: Layout, mask: Array, to: Array, place: Array, key: Key, purpose: int
) -> None:
    """Set ``to``, uint64, to 64 random bits of each PE, keyed by the pixel ``place`` too."""
    if machine is None:
        active = mask > 0
        lo, hi, *_ = random.draw4(*key, place[active, 0], purpose)
        to[active, 0] = lo.astype(np.uint64) | hi.astype(np.uint64) << np.uint64(32)
        return
    keys = map(np.uint32, (key.level, key.turn, purpose))
    layout.launch(machine, "random", mask, to, place, np.uint64(key.seed), *keys)


@Operation
def table(
    machine: Launcher | None, layout: Layout, mask: Array, to: tuple[Array, int], entries: Array, index: Array
) -> None:
    """Set a word of ``to`` to the entry ``index`` of a table (n,)."""
    if machine is None:
        active = mask > 0
        to[0][active, to[1]] = entries[index[active, 0]]
        return
    kind = TYPES[to[0].dtype.name]
    layout.launch(machine, "table", mask, to[0], to[0].shape[-1], to[1], entries, index, T=kind)


@Operation
def keep(
    machine: Launcher | None, layout: Layout, mask: Array, near: Array, number: int, arrived: Array, heat: Array
) -> None:
    """Keep x u and u = 1 - t of the words x and t that arrived from a neighbour, and add t to ``heat``."""
    channels = arrived.shape[-1] - 1
    if machine is None:
        active = mask > 0
        t = arrived[active, channels:]
        u = (1024 - t).astype(np.float32) / np.float32(1024)
        z = near.reshape(*mask.shape, -1, channels + 1)
        z[active, number] = np.concatenate([arrived[active, :channels].astype(np.float32) * u, u], 1)
        heat[active] += t
        return
    neighbours = near.shape[-1] // (channels + 1)
    layout.launch(machine, "lcpdf_keep", mask, near, neighbours, number, arrived, heat, C=channels, V=machine.vector)


class Block(NamedTuple):
    """A block of candidates that the ACU broadcasts one after another.

    ``sample`` (N, C, size) float32, their neighbourhoods; ``number`` of them are candidates; ``first``, the number of
    the first one, and ``at``, its place among the distances that a PE keeps.
    """

    sample: Array
    number: int
    first: int
    at: int


class Draw(NamedTuple):
    """The variables of a draw in one layer after another, and its constants.

    ``distances`` (PEs, kept) and ``least`` float32, ``sum`` and ``target`` uint64 (PEs,); ``own`` (C, n) float32 are
    the values of the candidates themselves, and ``noise`` is the table of ``choice.window``.
    """

    distances: Array
    least: Array
    sum: Array
    target: Array
    own: Array
    noise: Array
    choice: Choice


@Operation
def distance(
    machine: Launcher | None, layout: Layout, mask: Array, layer: int, near: Array, block: Block, to: Draw, begin: bool
) -> None:
    """Set the distances of a block of candidates, equation (12), and the least one since the last ``begin``."""
    neighbours, channels, size = block.sample.shape
    if machine is not None:
        kept = (to.distances, to.distances.shape[-1], block.at, block.number, int(begin), to.least)
        defines = {"C": channels, "V": machine.vector}
        layout.launch(machine, "lcpdf_distance", mask, layer, near, neighbours, block.sample, size, *kept, **defines)
        return
    active = mask[layer] > 0
    z = near[layer].reshape(-1, neighbours, channels + 1)[active].astype(np.float64)
    d = np.zeros((len(z), size), np.float32)
    for k in range(neighbours):
        for c in range(channels):
            e = z[:, k, c, None] - z[:, k, channels, None] * block.sample[k, c].astype(np.float64)
            d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
    to.distances[active, block.at : block.at + size] = d
    least = d[:, : block.number].min(1)
    to.least[active] = least if begin else np.minimum(to.least[active], least)


@Operation
def weigh(
    machine: Launcher | None,
    layout: Layout,
    mask: Array,
    layer: int,
    block: Block,
    draw: Draw,
    bits: Array,
    chosen: Array,
    choose: bool,
) -> None:
    """Add the weights (7) of a block to ``draw.sum``; with ``choose``, set ``chosen`` where they exceed the draw.

    The draw is a share ``bits`` of the sum, which the weights of the first block with ``choose`` replace.
    """
    window, here = draw.choice.window, slice(block.at, block.at + block.number)
    if machine is not None:
        radius = window.radius if draw.choice.density else -1
        given: tuple[Any, ...] = (draw.distances, draw.distances.shape[-1], block.at, block.number, block.first)
        given += (draw.least, window.scale, draw.own, draw.own.shape[1], draw.noise, radius, window.top)
        given += (draw.sum, int(choose), bits, draw.target, chosen)
        layout.launch(machine, "lcpdf_weigh", mask, layer, *given, C=draw.own.shape[0], V=machine.vector)
        return
    active = mask[layer] > 0
    d = np.concatenate([draw.least[active][None], draw.distances[active, here].T])
    own = draw.own[:, block.first : block.first + block.number, None]
    total = np.cumsum(masses(weights(d, window.scale)[1:], own, draw.choice), 0, dtype=np.uint64)
    if choose and not block.first:
        draw.target[active] = TWINS[OPERATIONS.index("share")](bits[layer, active, 0], draw.sum[active])
        chosen[layer, active, 0] = -1
    total += draw.sum[active] if block.first else np.uint64(0)
    draw.sum[active] = total[-1]
    if choose:
        beyond, old = total > draw.target[active], chosen[layer, active, 0]
        found = np.where(beyond.any(0), block.first + beyond.argmax(0), -1)
        chosen[layer, active, 0] = np.where(old < 0, found, old)


@Operation
def step(
    machine: Launcher | None, layout: Layout, mask: Array, to: tuple[Array, int], draw: Draw, place: Array, key: Key
) -> None:
    """Add to the grey level of a channel a step drawn from the kernel of equation (7) around it."""
    (x, c), window = to, draw.choice.window
    if machine is None:
        active = mask > 0
        x[active, c] = stepped(x[active, c].astype(np.uint16), c, place[active, 0], window, key)
        return
    given = (
        draw.noise,
        window.radius,
        window.top,
        place,
        np.uint64(key.seed),
        np.uint32(key.level),
        np.uint32(key.turn),
    )
    layout.launch(machine, "lcpdf_step", mask, x, x.shape[-1], c, *given, V=machine.vector)
