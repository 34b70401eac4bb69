# SPDX-License-Identifier: BSD-3-Clause
"""A MasPar MP-1: processing elements (PEs) that execute the instructions of an array control unit (ACU).

The ACU is the Python program. A `Plural` is a variable with one value per PE and virtual layer; numbers of Python are
singular, and an instruction that uses one broadcasts it. PEs outside the activity mask change nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partialmethod
from math import gcd
from operator import mul
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.machine.interface import Array, Launcher, Machine
from simdtex.maspar import instructions
from simdtex.maspar.array import PixelLayout, ProcessorArray
from simdtex.maspar.instructions import COMPARISONS, OPERATIONS, On
from simdtex.methods.mrf.lcpdf import Key

FULL = 16384
"""PEs of the full MP-1, for which rates are published."""

CLOCK = 80e-9
"""Seconds of a clock; sources give 80 to 83 ns."""

PUBLISHED = "published figures: Blank 1990, Nickolls 1990, netlib report on array processors"
"""Which of the three gives which figure is not verified."""

WORD = 4
"""Bytes of a word."""


class Cost(NamedTuple):
    """The seconds of one instruction, for one active PE or all, and the source of the figure."""

    seconds: float
    source: str


COSTS = {
    "integer": Cost(FULL / 26_000e6, PUBLISHED),  # 26,000 MIPS
    "float": Cost(FULL / 1_200e6, PUBLISHED),  # 1,200 Mflop/s
    "x-net": Cost(WORD * FULL / 23e9, PUBLISHED),  # a word to an adjacent PE, 23 GB/s
    "router": Cost(WORD * FULL / 1.28e9, PUBLISHED),  # a word to any PE, 1.28 GB/s
    "broadcast": Cost(8 * CLOCK, "assumption"),  # a word from the ACU: its 8 nibbles enter the 4-bit PEs in turn
    "reduction": Cost(32 * CLOCK, "assumption"),  # a word from all PEs to the ACU, bit by bit
}
"""The costs by kind of instruction, on 32-bit words."""

PHILOX = 10 * 12
"""Integer instructions of four random words: ten rounds of 2 wide multiplications, in halves, and 4 exclusive ors."""

NOISE = {"integer": PHILOX + 12, "float": 54}
"""Instructions of the Gumbel noise of a candidate, added to its distance: a random word and two logarithms.

Each logarithm has 23 float (10 fma, a product, a difference and a conversion) and 4 integer; the uniform number has two
forms, one for near 1, of 3 float each, and 4 integer for the choice; and the sum is an fma.
"""

EXP = 26
"""Float instructions of a weight (7): a difference, its scale, exp by 9 fma, and the conversion."""

TYPES = {"int32": "int", "float32": "float", "uint64": "ulong"}
"""The types of variables, and their names in kernels."""

LAYOUT = np.dtype([(name, np.int32) for name in ("rows", "cols", "high", "wide", "blocks", "begin", "end")], align=True)
"""The struct ``Layout`` of kernels/maspar/layout.h."""


@dataclass
class Count:
    """The number of instructions of a kind that layers executed, and the sum of the PEs that were active in them."""

    instructions: int = 0
    active: int = 0


class Mask:
    """The PEs that are active, (layers, PEs): ``active`` here, ``plane`` on the machine.

    ``over`` are the layers that execute an instruction, all or a single one; ``counts`` are the active PEs in each.
    """

    def __init__(self, active: NDArray[np.bool_], plane: Array = None, over: slice | None = None) -> None:
        self.active, self.plane, self.over = active, plane, over or slice(0, len(active))
        self.counts: list[int] = active[self.over].sum(1).tolist()

    @property
    def layers(self) -> list[Mask]:
        """The virtual layers that have active PEs."""
        each = [slice(n, n + 1) for n in range(len(self.active))]
        return [Mask(self.active, self.plane, layer) for layer, count in zip(each, self.counts, strict=True) if count]

    @cached_property
    def at(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Layers and numbers of the active PEs."""
        layer, pe = np.nonzero(self.active[self.over])
        return layer + self.over.start, pe


class Plural:
    """A variable with words of one type for each PE and layer; ``[k]`` is its k-th word.

    Operators return expressions, which all active PEs compute from first words. Expressions take no memory, and have no
    value in inactive PEs.
    """

    def __init__(self, mp1: MP1, data: Array, word: int = 0) -> None:
        self.mp1, self.data, self.word = mp1, data, word

    def __getitem__(self, word: int) -> Plural:
        return Plural(self.mp1, self.data, word)

    def set(self, value: Plural | float) -> None:
        """Assign a plural or a singular value in all active PEs."""
        operation = "copy" if isinstance(value, Plural) else "put"
        self.mp1.alu(operation, self, value if isinstance(value, Plural) else self, value)

    def as_type(self, dtype: str) -> Plural:
        """Return the values as another type: int32, uint64 or float32."""
        return self.mp1.alu("copy", self.mp1.expression(dtype), self)

    def _with(self, operation: str, other: Plural | float = 0) -> Plural:
        dtype = "int32" if operation in COMPARISONS else self.data.dtype.name
        return self.mp1.alu(operation, self.mp1.expression(dtype), self, other)

    __add__ = partialmethod(_with, "add")
    __sub__ = partialmethod(_with, "sub")
    __mul__ = partialmethod(_with, "mul")
    __floordiv__ = partialmethod(_with, "div")
    __mod__ = partialmethod(_with, "mod")
    __and__ = partialmethod(_with, "and")
    __or__ = partialmethod(_with, "or")
    __rshift__ = partialmethod(_with, "shr")
    __lt__ = partialmethod(_with, "lt")
    __le__ = partialmethod(_with, "le")
    __gt__ = partialmethod(_with, "gt")
    __ge__ = partialmethod(_with, "ge")
    __eq__ = partialmethod(_with, "eq")  # type: ignore[assignment]
    __ne__ = partialmethod(_with, "ne")  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]
    bit = partialmethod(_with, "bit")  # 2**x
    lowest = partialmethod(_with, "lowest")  # the number of the lowest bit that is 0
    share = partialmethod(_with, "share")  # x / 2**64 of a number: of random bits, an integer below it


class MP1:
    """A processor array with a picture on it.

    Parameters
    ----------
    machine : Machine or None
        The device that executes the instructions; None: they are only counted, with every PE active.
    array : ProcessorArray
    shape : (int, int)
        Rows and columns of the picture. PEs without a pixel are active only in ``where(mp1.everywhere)``.
    memory : int
        Bytes of a PE for plural variables.

    Attributes
    ----------
    counts : dict of Count
        By section of the program and kind of instruction (`simdtex.maspar.machine.COSTS`).
    row, col : Plural
        The PE's pixel, int32.
    everywhere : Mask
        All PEs.
    """

    def __init__(
        self, machine: Machine | None, array: ProcessorArray, shape: tuple[int, int], memory: float = 2**16
    ) -> None:
        self.machine, self.array, self.shape, self.memory = machine, array, shape, memory
        self.layout = PixelLayout(array, shape)
        self.layers, self.used, self._section = self.layout.high * self.layout.wide, 0, ""
        self.counts: dict[tuple[str, str], Count] = defaultdict(Count)
        self.everywhere = self.mask = self._mask(np.broadcast_to(True, (self.layers, array.size)))
        self.row, self.col = self.plural(), self.plural()
        if machine:
            pixel = self.layout.pixel
            self.mask = self._mask(np.all(pixel < np.array(shape), -1))
            self.row.data, self.col.data = (machine.put(pixel[..., [axis]].astype(np.int32)) for axis in (0, 1))

    def put(self, values: NDArray[Any], whole: int = 1) -> Array:
        """Return a table of the ACU on the machine, with zeros up to a multiple of ``whole`` entries."""
        if not self.machine:
            return values
        return self.machine.put(np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, -values.shape[-1] % whole)]))

    def _mask(self, active: NDArray[np.bool_], over: slice | None = None) -> Mask:
        return Mask(active, self.machine and self.machine.put(active.astype(np.uint8)), over)

    def expression(self, dtype: str = "int32", size: int = 1, shared: bool = False) -> Plural:
        """Return a plural without values, for the result of an expression; layers may share it one after another."""
        shape = (1 if shared else self.layers, self.array.size, size)
        zeros, empty = np.broadcast_to(np.zeros(1, dtype), shape), getattr(self.machine, "empty", None)
        return Plural(self, empty(shape, dtype) if empty else self.put(zeros))

    def reserve(self, size: int) -> None:
        """Take bytes of every PE's memory; raise ValueError if it does not suffice."""
        if not self.fits(size):
            raise ValueError(
                f"the program needs {self.used + size} bytes of each PE, which holds {self.layers} pixels, and a PE "
                f"has {self.memory}; give a larger array, a smaller picture or order, or more memory"
            )
        self.used += size

    def fits(self, size: int) -> bool:
        """Return whether ``size`` more bytes fit the memory of a PE."""
        return self.used + size <= self.memory

    def plural(self, dtype: str = "int32", size: int = 1, shared: bool = False) -> Plural:
        """Return a plural variable of ``size`` words in the memory of every PE, 0 at first.

        With ``shared``, one layer after another uses the same words.
        """
        made = self.expression(dtype, size, shared)
        self.reserve(np.dtype(dtype).itemsize * size * made.data.shape[0])
        made.data = self.put(np.broadcast_to(np.zeros(1, dtype), made.data.shape))
        return made

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Free the plural variables that are made inside, as at the end of a function."""
        used = self.used
        try:
            yield
        finally:
            self.used = used

    @contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Count the instructions inside as those of a section of the program."""
        outer, self._section = self._section, name
        try:
            yield
        finally:
            self._section = outer

    @contextmanager
    def where(self, condition: Plural | Mask) -> Iterator[Mask]:
        """Let only those active PEs execute whose ``condition`` is not 0, or those of a previous mask."""
        outer = self.mask
        if isinstance(condition, Mask):
            self.mask = condition
        elif self.machine:
            holds = self.machine.get(condition.data)[..., condition.word] != 0
            self.mask = self._mask(holds & outer.active, outer.over)
        try:
            yield self.mask
        finally:
            self.mask = outer

    def count(self, **numbers: int | list[int]) -> None:
        """Count numbers of instructions, by kind as in `COSTS`, for every layer, or one number for each."""
        counts = self.mask.counts
        for kind, amount in numbers.items():
            each = amount[self.mask.over] if isinstance(amount, list) else [amount] * len(counts)
            total = self.counts[self._section, kind]
            total.instructions += sum(each)
            total.active += sum(map(mul, each, counts))

    def execute(self, instruction: Callable[..., None], *args: Any, **defines: int | str) -> None:
        """Run a function of `simdtex.maspar.instructions` under the current mask, or its kernel on a device."""
        if not self.machine:
            return
        with self.machine.running() as launcher:
            if launcher is None:
                instruction(On(self.layout, self.mask.at), *map(_viewed, args))
                return
            rows, cols, blocks = self.array.rows, self.array.cols, self.array.mapping == "hierarchical"
            high, wide, over = self.layout.high, self.layout.wide, self.mask.over
            struct = np.array((rows, cols, high, wide, blocks, over.start, over.stop), LAYOUT)[()]
            expanded = [part for arg in args for part in _expanded(launcher, arg)]
            defines |= {"V": launcher.vector} if "C" in defines else {}
            name, group = f"maspar_{instruction.__name__}", (gcd(self.array.size, 64),)
            launcher.launch(name, (self.array.size,), struct, self.mask.plane, *expanded, local=group, defines=defines)

    def alu(self, operation: str, to: Plural, a: Plural, b: Plural | float = 0) -> Plural:
        """Set a plural to an operation of the arithmetic unit, and return it."""
        kind, singular = a.data.dtype, not isinstance(b, Plural)
        real = kind.kind == "f"
        cost = {"float" if real and operation not in ("copy", "put") else "integer": kind.itemsize // 4}
        self.count(**cost, broadcast=int(singular and operation not in ("copy", "bit", "lowest")))
        scalar = kind.type(b if singular else 0)
        defines = {"T": TYPES[kind.name], "TO": TYPES[to.data.dtype.name]} | ({} if real else {"WHOLE": 1})
        code = [*OPERATIONS].index(operation)
        self.execute(instructions.alu, code, to, a, a if singular else b, int(singular), scalar, **defines)
        return to

    def xnet(self, plural: Plural, down: int, right: int, distance: int = 1) -> Plural:
        """Return all words of the pixel ``distance`` away in a direction: 1, 0 or -1 rows and columns.

        The last row and column of the picture, padded to whole layers, are next to its first. Words move one PE at a
        time, if they leave the PE.
        """
        kind, size = plural.data.dtype, plural.data.shape[-1]
        moves = self.array.moves(self.layout.grid, down * distance, right * distance)
        self.count(**{"x-net": [size * kind.itemsize // 4 * move for move in moves]})
        to = self.expression(kind.name, size)
        self.execute(instructions.xnet, to, plural[0], down, right, distance, T=TYPES[kind.name])
        return to

    def router(self, to: Plural, plural: Plural, row: Plural, col: Plural) -> None:
        """Set all words to those of the pixel in ``row`` and ``col`` of each PE, wherever that is."""
        kind = plural.data.dtype
        self.count(router=plural.data.shape[-1] * kind.itemsize // 4)
        self.execute(instructions.xnet_router, to[0], plural[0], row, col, T=TYPES[kind.name])

    def sum(self, plural: Plural) -> int:
        """Return the sum of an int32 word over all active PEs, to the ACU."""
        return int(self._reduced(plural, False).sum())

    def min(self, plural: Plural) -> int:
        """Return the least int32 word of all active PEs, to the ACU."""
        return int(self._reduced(plural, True).min())

    def any(self, plural: Plural) -> bool:
        """Return whether an int32 word is not 0 in any active PE, to the ACU: the global OR."""
        return self.sum(plural != 0) > 0

    def _reduced(self, plural: Plural, least: bool) -> NDArray[np.int64]:
        self.count(reduction=1)
        part = self.expression("int64", shared=True)
        self.execute(instructions.xnet_reduce, part, plural, int(least), T=TYPES[plural.data.dtype.name])
        return np.asarray(self.machine.get(part.data) if self.machine else part.data)

    def random(self, place: Plural, key: Key, purpose: int) -> Plural:
        """Return 64 random bits of each PE, keyed by ``key``, the place of its pixel and the purpose."""
        self.count(integer=PHILOX)
        bits = self.expression("uint64")
        self.execute(instructions.random, bits, place, key, np.uint32(purpose))
        return bits

    def table(self, to: Plural, entries: ArrayLike, index: Plural) -> None:
        """Set a plural to the entry ``index`` of a table, which the ACU broadcasts entry by entry."""
        held = np.asarray(entries, to.data.dtype)
        self.count(broadcast=len(held), integer=len(held))
        self.execute(instructions.table, to, self.put(held), index, T=TYPES[held.dtype.name])

    def seconds(self) -> dict[str, dict[str, float]]:
        """Return the modelled seconds of a MasPar MP-1 by section of the program and kind of instruction."""
        table: dict[str, dict[str, float]] = {}
        for (section, kind), count in self.counts.items():
            table.setdefault(section, {})[kind] = count.instructions * COSTS[kind].seconds
        return table


def _viewed(arg: Any) -> Any:
    """Return an argument of an instruction in NumPy."""
    return arg.data[..., arg.word :] if isinstance(arg, Plural) else arg


def _expanded(launcher: Launcher, arg: Any) -> list[Any]:
    """Return the arguments of a kernel for one of an instruction, as in kernels/maspar."""
    if isinstance(arg, Plural):
        return [arg.data, arg.data.shape[-1], arg.word]
    if isinstance(arg, Key):
        return [np.uint64(arg.seed), np.uint32(arg.level), np.uint32(arg.turn)]
    if isinstance(arg, tuple):
        return [part for each in arg for part in _expanded(launcher, each)]
    if isinstance(arg, np.ndarray):
        arg = launcher.constant(arg)
    return [arg, arg.shape[-1]] if getattr(arg, "shape", ()) else [arg]
