# SPDX-License-Identifier: BSD-3-Clause
"""The instructions of the processor array: a kernel of ``kernels/maspar`` with one work-item per PE, and its twin.

Arrays of variables are (layers, PEs, words); a mask (layers, PEs) uint8 is 1 where a PE is active, and all others change
nothing. Instructions write into their argument ``to``. `simdtex.maspar.machine.MP1` executes and counts them.
"""

from __future__ import annotations

from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.maspar.array import ProcessorArray
from simdtex.model.lattice import Grid
from simdtex.ops.lcpdf import Choice, legal, masses, weights

OPERATIONS = (
    *("copy", "add", "sub", "mul", "lt", "le", "eq", "ne", "gt", "ge", "put"),
    *("div", "mod", "and", "or", "shr", "bit", "lowest", "share"),
)
"""The operations of the arithmetic unit, by their numbers in kernels/maspar/alu.cl."""

COMPARISONS = ("lt", "le", "eq", "ne", "gt", "ge")

TYPES = {"int32": "int", "float32": "float", "uint64": "ulong"}
"""The types of variables, and their names in kernels."""

LAYOUT = np.dtype([(name, np.int32) for name in ("rows", "cols", "high", "wide", "blocks")], align=True)
"""The struct ``Layout`` of kernels/maspar/layout.h."""

STEPPED = 64
"""Candidates of a launch are a multiple of this: four vectors of the longest."""


class Layout(NamedTuple):
    """A picture on an array: ``struct`` for kernels, ``pixel`` (layers, PEs, 2) its rows and columns, ``address`` back."""

    array: ProcessorArray
    struct: np.void
    pixel: NDArray[np.int64]
    address: NDArray[np.int64]

    @classmethod
    def of(cls, array: ProcessorArray, shape: tuple[int, int]) -> Layout:
        """Return the layout of a picture (rows, cols), padded to whole layers."""
        high, wide = array.layers(Grid.of(shape))
        struct = np.zeros((), LAYOUT)
        struct[()] = (array.rows, array.cols, high, wide, array.mapping == "hierarchical")
        padded = Grid(array.rows * high, array.cols * wide)
        layer, pe = array.place(padded.sites(), padded)
        address = (layer * array.size + pe).reshape(padded.shape)
        pixel = np.empty((high * wide * array.size, 2), np.int64)
        pixel[address.ravel()] = np.stack(np.divmod(padded.sites(), padded.width), 1)
        return cls(array, struct[()], pixel.reshape(high * wide, array.size, 2), address)  # type: ignore[arg-type]


def _launch(machine: Launcher, name: str, layout: Layout, *args: Any, defines: dict[str, Any] | None = None) -> None:
    """Launch a kernel with exactly one work-item per PE."""
    size = layout.array.size
    machine.launch(f"maspar_{name}", (size,), layout.struct, *args, local=(gcd(size, 64),), defines=defines or {})


def _lowest(x: NDArray[Any]) -> NDArray[Any]:
    ones, found = x & ~(x + x.dtype.type(1)), np.zeros(x.shape, x.dtype)
    for k in range(8 * x.dtype.itemsize):
        found += (ones >> x.dtype.type(k)) & x.dtype.type(1)
    return found


TWINS: tuple[Any, ...] = (
    *(lambda x, _: x, np.add, np.subtract, np.multiply, np.less, np.less_equal, np.equal, np.not_equal),
    *(np.greater, np.greater_equal, lambda x, y: np.broadcast_to(y, x.shape), np.floor_divide, np.mod),
    *(np.bitwise_and, np.bitwise_or, np.right_shift, lambda x, _: x.dtype.type(1) << x, lambda x, _: _lowest(x)),
    lambda x, y: random.below(x & np.uint64(2**32 - 1), x >> np.uint64(32), y),
)


@Operation
def alu(
    machine: Launcher | None,
    layout: Layout,
    mask: Array,
    operation: str,
    to: tuple[Array, int],
    a: tuple[Array, int],
    b: tuple[Array, int] | None,
    number: Any,
) -> None:
    """Set a word of ``to`` to an operation of a word of ``a`` and a word of ``b``; b None: and the singular ``number``.

    A word is (array, its number among the words of each PE).
    """
    code = OPERATIONS.index(operation)
    if machine is None:
        active = mask > 0
        with np.errstate(over="ignore"):
            y = a[0].dtype.type(number) if b is None else b[0][active, b[1]]
            to[0][active, to[1]] = TWINS[code](a[0][active, a[1]], y)
        return
    defines: dict[str, Any] = {"T": TYPES[a[0].dtype.name], "TO": TYPES[to[0].dtype.name]}
    defines |= {} if a[0].dtype.kind == "f" else {"WHOLE": 1}
    words = [part for array, word in (to, a) for part in (array, array.shape[-1], word)]
    words += [a[0], 0, 0] if b is None else [b[0], b[0].shape[-1], b[1]]
    _launch(machine, "alu", layout, mask, code, *words, a[0].dtype.type(number), defines=defines)


@Operation
def xnet(
    machine: Launcher | None,
    layout: Layout,
    mask: Array,
    to: Array,
    source: Array,
    direction: tuple[int, int],
    distance: int,
) -> None:
    """Set all words of ``to`` to those of the pixel ``distance`` away in a direction (rows, columns), around the edges."""
    if machine is None:
        active, (rows, cols) = mask > 0, layout.address.shape
        at = layout.pixel[active] + np.array(direction) * distance
        to[active] = source.reshape(-1, source.shape[-1])[layout.address[at[:, 0] % rows, at[:, 1] % cols]]
        return
    size = source.nbytes // 4 // (source.size // source.shape[-1])
    _launch(machine, "xnet", layout, mask, to, source, size, *direction, distance)


@Operation
def router(
    machine: Launcher | None, layout: Layout, mask: Array, to: Array, source: Array, row: Array, col: Array
) -> None:
    """Set all words of ``to`` to those of the pixel in ``row`` and ``col`` of each PE."""
    if machine is None:
        active = mask > 0
        there = layout.address[row[active, 0], col[active, 0]]
        to[active] = source.reshape(-1, source.shape[-1])[there]
        return
    size = source.nbytes // 4 // (source.size // source.shape[-1])
    _launch(machine, "xnet_router", layout, mask, to, source, size, row, col)


@Operation
def reduction(machine: Launcher | None, layout: Layout, mask: Array, a: Array, word: int, least: bool) -> Array:
    """Return the sum or the minimum of an int32 word over the layers of each PE, (PEs,) int64."""
    if machine is None:
        x = np.where(mask > 0, a[..., word], np.iinfo(np.int32).max if least else 0).astype(np.int64)
        return x.min(0) if least else x.sum(0)
    part = machine.empty((layout.array.size,), np.int64)
    _launch(machine, "xnet_reduce", layout, mask, a, a.shape[-1], word, int(least), part)
    return part


@Operation
def random_bits(
    machine: Launcher | None,
    layout: Layout,
    mask: Array,
    to: Array,
    place: Array,
    key: tuple[int, int, int],
    purpose: int,
    attempt: int,
) -> None:
    """Set ``to``, uint64, to 64 random bits for each PE; ``key`` is (seed, level, turn), ``place`` the PE's pixel."""
    if machine is None:
        active = mask > 0
        lo, hi, *_ = random.draw4(*key, place[active, 0], purpose, attempt)
        to[active, 0] = lo.astype(np.uint64) | hi.astype(np.uint64) << np.uint64(32)
        return
    words = (np.uint32(word) for word in (*key[1:], purpose, attempt))
    _launch(machine, "random", layout, mask, to, place, np.uint64(key[0]), *words)


@Operation
def table(
    machine: Launcher | None, layout: Layout, mask: Array, to: tuple[Array, int], entries: Array, index: Array
) -> None:
    """Set a word of ``to`` to the entry ``index`` of a table (n,)."""
    if machine is None:
        active = mask > 0
        to[0][active, to[1]] = entries[index[active, 0]]
        return
    defines = {"T": TYPES[to[0].dtype.name]}
    _launch(machine, "table", layout, mask, to[0], to[0].shape[-1], to[1], entries, index, defines=defines)


class Block(NamedTuple):
    """A block of candidates that the ACU broadcasts one after another.

    ``sample`` (N, C, size) float32, their neighbourhoods; ``count`` of them are candidates; ``first``, the number of
    the first one, and ``at``, its place among the distances that a PE keeps.
    """

    sample: Array
    count: int
    first: int
    at: int


@Operation
def keep(machine: Launcher | None, layout: Layout, mask: Array, near: Array, number: int, arrived: Array) -> None:
    """Keep the words (C values and a temperature in 1/1024) that arrived from a neighbour: x u and u = 1 - t."""
    channels = arrived.shape[-1] - 1
    if machine is None:
        active = mask > 0
        u = (1024 - arrived[active, channels]).astype(np.float32) / np.float32(1024)
        z = near.reshape(*mask.shape, -1, channels + 1)
        z[active, number] = np.concatenate([arrived[active, :channels].astype(np.float32) * u[:, None], u[:, None]], 1)
        return
    neighbours = near.shape[-1] // (channels + 1)
    defines = {"C": channels, "V": machine.vector}
    _launch(machine, "lcpdf_keep", layout, mask, near, neighbours, number, arrived, defines=defines)


@Operation
def distance(
    machine: Launcher | None, layout: Layout, mask: Array, layer: int, near: Array, block: Block, to: Array
) -> None:
    """Set distances of a layer's PEs, (PEs, kept), to those of a block of candidates, equation (12)."""
    neighbours, channels, size = block.sample.shape
    if machine is None:
        active = mask[layer] > 0
        z = near[layer].reshape(-1, neighbours, channels + 1)[active].astype(np.float64)
        d = np.zeros((len(z), size), np.float32)
        for k in range(neighbours):
            for c in range(channels):
                e = z[:, k, c, None] - z[:, k, channels, None] * block.sample[k, c].astype(np.float64)
                d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
        to[active, block.at : block.at + size] = d
        return
    defines = {"C": channels, "V": machine.vector}
    words = (near, neighbours, block.sample, size, to, to.shape[-1], block.at)
    _launch(machine, "lcpdf_distance", layout, mask, layer, *words, defines=defines)


@Operation
def least(
    machine: Launcher | None, layout: Layout, mask: Array, layer: int, distances: Array, block: Block, to: Array
) -> None:
    """Set ``to`` (PEs,) float32 to the least distance of the blocks so far; the first block begins it."""
    if machine is None:
        active = mask[layer] > 0
        found = distances[active, block.at : block.at + block.count].min(1)
        to[active] = np.minimum(to[active], found) if block.first else found
        return
    words = (distances, distances.shape[-1], block.at, block.count, block.first, to)
    _launch(machine, "lcpdf_least", layout, mask, layer, *words, defines={"V": machine.vector})


class Draw(NamedTuple):
    """The variables of a draw.

    ``least``, ``sum``, ``target`` (PEs,) serve one layer after another; ``bits`` and ``chosen`` are of all layers;
    ``own`` (C, n) float32 are the values of the candidates themselves; ``noise`` is the table of ``choice.window``.
    """

    least: Array
    sum: Array
    target: Array
    bits: Array
    chosen: Array
    own: Array
    noise: Array
    choice: Choice


@Operation
def weigh(
    machine: Launcher | None,
    layout: Layout,
    mask: Array,
    layer: int,
    distances: Array,
    block: Block,
    draw: Draw,
    choose: bool,
) -> None:
    """Add the weights (7) of a block to ``draw.sum``; with ``choose``, set ``draw.chosen`` where they exceed the draw.

    The draw is a share ``draw.bits`` of the sum, which the first block with ``choose`` replaces.
    """
    window = draw.choice.window
    if machine is not None:
        radius = window.radius if draw.choice.density else -1
        words: tuple[Any, ...] = (distances, distances.shape[-1], block.at, block.count, block.first, draw.least)
        words += (window.scale, draw.own, draw.own.shape[1], draw.noise, radius, window.top)
        words += (draw.sum, int(choose), draw.bits, draw.target, draw.chosen)
        defines = {"C": draw.own.shape[0], "V": machine.vector}
        _launch(machine, "lcpdf_weigh", layout, mask, layer, *words, defines=defines)
        return
    active, here = mask[layer] > 0, slice(block.first, block.first + block.count)
    d = np.concatenate([draw.least[active][None], distances[active, block.at : block.at + block.count].T])
    w = masses(weights(d, window.scale)[1:], draw.own[:, here, None], draw.choice)
    if choose and not block.first:
        bits = draw.bits[layer, active, 0]
        draw.target[active] = TWINS[OPERATIONS.index("share")](bits, draw.sum[active])
        draw.chosen[layer, active, 0] = -1
    before = draw.sum[active] if block.first else np.zeros(int(active.sum()), np.uint64)
    total = before + np.cumsum(w, 0, dtype=np.uint64)
    draw.sum[active] = total[-1]
    if choose:
        beyond = total > draw.target[active]
        chosen = np.where(beyond.any(0), block.first + beyond.argmax(0), -1)
        old = draw.chosen[layer, active, 0]
        draw.chosen[layer, active, 0] = np.where(old < 0, chosen, old)


@Operation
def step(
    machine: Launcher | None, layout: Layout, mask: Array, to: tuple[Array, int], draw: Draw, bits: Array
) -> None:
    """Add to a grey level a step that random ``bits`` choose from the kernel of equation (7) around it."""
    window = draw.choice.window
    if machine is None:
        active = mask > 0
        x = to[0][active, to[1]]
        low, mass = legal(x, window)
        share = ((bits[active, 0] & np.uint64(2**32 - 1)) * mass >> np.uint64(32)).astype(np.uint32)
        to[0][active, to[1]] = x + np.searchsorted(window.noise, low + share, side="right") - window.radius
        return
    words = (to[0], to[0].shape[-1], to[1], draw.noise, window.radius, window.top, bits)
    _launch(machine, "lcpdf_step", layout, mask, *words, defines={"V": machine.vector})
