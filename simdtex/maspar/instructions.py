# SPDX-License-Identifier: BSD-3-Clause
"""The instructions of the processor array: a kernel of ``kernels/maspar`` with one work-item per PE, and its twin.

Variables are arrays (layers, PEs, words); a word is an array and the number of one of these. Instructions write into
their argument ``to``, and only in active PEs. `simdtex.maspar.machine.MP1` executes and counts them.
"""

from __future__ import annotations

from functools import cached_property
from math import gcd
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.maspar.array import ProcessorArray
from simdtex.model.lattice import Grid
from simdtex.ops.lcpdf import Choice, Key, masses, spread, stepped, weighed, weights

Word: TypeAlias = tuple[Array, int]

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


class On(NamedTuple):
    """The PEs that execute an instruction: those of ``mask``, (layers, PEs) uint8."""

    layout: Layout
    mask: Array

    @property
    def active(self) -> NDArray[np.bool_]:
        """The mask of the twin."""
        return np.asarray(self.mask > 0)

    def launch(self, machine: Launcher, name: str, *args: Any, **defines: Any) -> None:
        """Launch a kernel with exactly one work-item per PE."""
        size, given = self.layout.array.size, (self.layout.struct, self.mask, *args)
        machine.launch(f"maspar_{name}", (size,), *given, local=(gcd(size, 64),), defines=defines)


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


def words(variable: Array) -> int:
    """Return the words of 32 bits of each PE and layer."""
    return int(variable.nbytes // variable.size * variable.shape[-1] // 4)


@Operation
def alu(machine: Launcher | None, on: On, operation: str, to: Word, a: Word, b: Word | None, number: Any) -> None:
    """Set a word to an operation of words ``a`` and ``b``, or of ``a`` and a singular number if ``b`` is None."""
    code, kind = OPERATIONS.index(operation), a[0].dtype
    if machine is None:
        active = on.active
        y = kind.type(number) if b is None else b[0][active, b[1]]
        with np.errstate(over="ignore"):
            to[0][active, to[1]] = TWINS[code](a[0][active, a[1]], y)
        return
    operands = [part for array, word in (to, a) for part in (array, array.shape[-1], word)]
    operands += [a[0], 0, 0] if b is None else [b[0], b[0].shape[-1], b[1]]
    defines = {"T": TYPES[kind.name], "TO": TYPES[to[0].dtype.name]} | ({} if kind.kind == "f" else {"WHOLE": 1})
    on.launch(machine, "alu", code, *operands, kind.type(number), **defines)


@Operation
def xnet(machine: Launcher | None, on: On, to: Array, source: Array, way: tuple[int, int], far: int) -> None:
    """Set all words of ``to`` to those of the pixel ``far`` away in a direction (rows, columns), around the edges."""
    if machine is not None:
        on.launch(machine, "xnet", to, source, words(source), *way, far)
        return
    layout = on.layout
    row, col = np.moveaxis(layout.pixel[on.active] + np.array(way) * far, -1, 0)
    address = layout.address[row % layout.padded.rows, col % layout.padded.cols]
    to[on.active] = source.reshape(-1, source.shape[-1])[address]


@Operation
def router(machine: Launcher | None, on: On, to: Array, source: Array, row: Array, col: Array) -> None:
    """Set all words of ``to`` to those of the pixel in ``row`` and ``col`` of each PE."""
    if machine is not None:
        on.launch(machine, "xnet_router", to, source, words(source), row, col)
        return
    address = on.layout.address[row[on.active, 0], col[on.active, 0]]
    to[on.active] = source.reshape(-1, source.shape[-1])[address]


@Operation
def reduction(machine: Launcher | None, on: On, a: Word, least: bool) -> Array:
    """Return the sum or the minimum of an int32 word over the layers of each PE, (PEs,) int64."""
    if machine is None:
        x = np.where(on.active, a[0][..., a[1]], np.iinfo(np.int32).max if least else 0).astype(np.int64)
        return x.min(0) if least else x.sum(0)
    part = machine.empty((on.layout.array.size,), np.int64)
    on.launch(machine, "xnet_reduce", a[0], a[0].shape[-1], a[1], int(least), part)
    return part


def _keys(key: Key) -> tuple[Any, ...]:
    return np.uint64(key.seed), np.uint32(key.level), np.uint32(key.turn)


@Operation
def random_bits(machine: Launcher | None, on: On, to: Array, place: Array, key: Key, purpose: int) -> None:
    """Set ``to``, uint64, to 64 random bits of each PE, keyed by the pixel ``place`` too."""
    if machine is not None:
        on.launch(machine, "random", to, place, *_keys(key), np.uint32(purpose))
        return
    lo, hi, *_ = random.draw4(*key, place[on.active, 0], purpose)
    to[on.active, 0] = lo.astype(np.uint64) | hi.astype(np.uint64) << np.uint64(32)


@Operation
def table(machine: Launcher | None, on: On, to: Word, entries: Array, index: Array) -> None:
    """Set a word to the entry ``index`` of a table (n,)."""
    if machine is None:
        to[0][on.active, to[1]] = entries[index[on.active, 0]]
        return
    on.launch(machine, "table", to[0], to[0].shape[-1], to[1], entries, index, T=TYPES[to[0].dtype.name])


@Operation
def keep(machine: Launcher | None, on: On, near: Array, number: int, arrived: Array, heat: Array) -> None:
    """Keep x u and u = 1 - t of the words x and t that arrived from a neighbour, and add t to ``heat``."""
    channels = arrived.shape[-1] - 1
    if machine is not None:
        neighbours = near.shape[-1] // (channels + 1)
        on.launch(machine, "lcpdf_keep", near, neighbours, number, arrived, heat, C=channels, V=machine.vector)
        return
    t = arrived[on.active, channels:]
    u = (1024 - t).astype(np.float32) / np.float32(1024)
    z = near.reshape(*on.mask.shape, -1, channels + 1)
    z[on.active, number] = np.concatenate([arrived[on.active, :channels].astype(np.float32) * u, u], 1)
    heat[on.active] += t


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
    """The variables of a draw, and its constants.

    One layer after another uses ``distances`` (PEs, kept) and ``least`` float32, ``sum`` and ``target`` uint64 (PEs,);
    ``bits`` and ``chosen`` are of all layers; ``own`` (C, n) float32 are the values of the candidates themselves, and
    ``noise`` and ``gauss`` are the tables of ``choice.window``. ``mass`` (PEs, greys) uint64 is of one layer too.
    """

    distances: Array
    least: Array
    sum: Array
    target: Array
    bits: Array
    chosen: Array
    own: Array
    noise: Array
    gauss: Array
    mass: Array
    choice: Choice

    def kept(self, block: Block) -> tuple[Any, ...]:
        """Return the arguments of kernels that weigh the candidates of a block."""
        place = (self.distances, self.distances.shape[-1], block.at, block.number, block.first)
        return *place, self.least, self.choice.window.scale, self.own, self.own.shape[1]

    def weights(self, active: NDArray[np.bool_], block: Block) -> NDArray[np.uint64]:
        """Return the weights (7) of a block in the active PEs, (candidates, PEs), in NumPy."""
        here = slice(block.at, block.at + block.number)
        d = np.concatenate([self.least[active][None], self.distances[active, here].T])
        return weights(d, self.choice.window.scale)[1:]


@Operation
def distance(machine: Launcher | None, on: On, layer: int, near: Array, block: Block, to: Draw, begin: bool) -> None:
    """Set the distances (12) of a block of candidates, and ``least`` and ``chosen`` to the nearest since ``begin``."""
    neighbours, channels, size = block.sample.shape
    if machine is not None:
        kept = (to.distances, to.distances.shape[-1], block.at, block.number, block.first)
        given = (layer, near, neighbours, block.sample, size, *kept, int(begin))
        on.launch(machine, "lcpdf_distance", *given, to.least, to.chosen, C=channels, V=machine.vector)
        return
    active = on.active[layer]
    z = near[layer].reshape(-1, neighbours, channels + 1)[active].astype(np.float64)
    d = np.zeros((len(z), size), np.float32)
    for k in range(neighbours):
        for c in range(channels):
            e = z[:, k, c, None] - z[:, k, channels, None] * block.sample[k, c].astype(np.float64)
            d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
    to.distances[active, block.at : block.at + size] = d
    real, old = d[:, : block.number], np.float32(np.inf) if begin else to.least[active]
    to.least[active] = np.minimum(real.min(1), old)
    nearest = block.first + real.argmin(1)
    to.chosen[layer, active, 0] = np.where(real.min(1) < old, nearest, to.chosen[layer, active, 0])


@Operation
def weigh(machine: Launcher | None, on: On, layer: int, block: Block, draw: Draw, choose: bool) -> None:
    """Add the weights (7) of a block to ``draw.sum``; with ``choose``, set ``draw.chosen`` where it exceeds the target.

    The target is a share ``draw.bits`` of the sum, which the weights of the first block with ``choose`` replace.
    """
    if machine is not None:
        window = draw.choice.window
        given: tuple[Any, ...] = (draw.noise, window.radius if draw.choice.density else -1, window.top)
        given += (draw.sum, int(choose), draw.bits, draw.target, draw.chosen)
        on.launch(machine, "lcpdf_weigh", layer, *draw.kept(block), *given, C=draw.own.shape[0], V=machine.vector)
        return
    active = on.active[layer]
    own = draw.own[:, block.first : block.first + block.number, None]
    total = np.cumsum(masses(draw.weights(active, block), own, draw.choice), 0, dtype=np.uint64)
    if choose and not block.first:
        draw.target[active] = TWINS[-1](draw.bits[layer, active, 0], draw.sum[active])
        draw.chosen[layer, active, 0] = -1
    total += draw.sum[active] if block.first else np.uint64(0)
    draw.sum[active] = total[-1]
    if choose:
        beyond, old = total > draw.target[active], draw.chosen[layer, active, 0]
        found = np.where(beyond.any(0), block.first + beyond.argmax(0), -1)
        draw.chosen[layer, active, 0] = np.where(old < 0, found, old)


@Operation
def mode(machine: Launcher | None, on: On, layer: int, block: Block, draw: Draw, x: Array, c: int, start: bool) -> None:
    """Add the weights (7) of a block given all channels of ``x`` but ``c``; after the last block ``x`` takes the mode.

    With ``start``, ``x`` begins with ``draw.chosen``; with ``c`` -1, that is set to the first that gives most at ``x``.
    """
    window, (channels, n) = draw.choice.window, draw.own.shape
    if machine is not None:
        given: tuple[Any, ...] = (draw.gauss, window.radius, window.top + 1, draw.mass, draw.sum)
        given += (x, x.shape[-1], c, int(start), draw.chosen)
        on.launch(machine, "lcpdf_mode", layer, *draw.kept(block), *given, C=channels, V=machine.vector)
        return
    active, end = on.active[layer], block.first + block.number
    own = draw.own[:, block.first : end].astype(np.int64)
    if start and not block.first:
        x[layer, active, :channels] = draw.own[:, draw.chosen[layer, active, 0]].T
    w = weighed(x[layer, active].T, draw.weights(active, block), own, window, c)
    if c < 0:
        most = draw.sum[active] if block.first else np.uint64(0)
        chosen = np.where(w.max(0) > most, block.first + w.argmax(0), draw.chosen[layer, active, 0])
        draw.chosen[layer, active, 0], draw.sum[active] = chosen, np.maximum(w.max(0), most)
        return
    mass = draw.mass[active].T * np.uint64(block.first > 0)
    np.add.at(mass, own[c], w)
    draw.mass[active] = mass.T
    if end == n:
        x[layer, active, c] = spread(mass, window).argmax(0)


@Operation
def step(machine: Launcher | None, on: On, to: Word, draw: Draw, place: Array, key: Key) -> None:
    """Add to the grey level of a channel a step drawn from the kernel of equation (7) around it."""
    (x, c), window = to, draw.choice.window
    if machine is None:
        x[on.active, c] = stepped(x[on.active, c].astype(np.uint16), c, place[on.active, 0], window, key)
        return
    given = (draw.noise, window.radius, window.top, place, *_keys(key))
    on.launch(machine, "lcpdf_step", x, x.shape[-1], c, *given, V=machine.vector)
