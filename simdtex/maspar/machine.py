# SPDX-License-Identifier: BSD-3-Clause
"""A MasPar MP-1: processing elements (PEs) that execute the instructions of an array control unit (ACU).

The ACU is the Python program. A `Plural` is a variable with one value per PE and virtual layer; numbers of Python are
singular, and an instruction that uses one broadcasts it. PEs outside the activity mask change nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partialmethod
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.machine.interface import Array, Machine, Operation
from simdtex.maspar import instructions
from simdtex.maspar.array import ProcessorArray
from simdtex.maspar.costs import COSTS, PHILOX
from simdtex.ops.lcpdf import Key


@dataclass
class Count:
    """The number of instructions of a kind that layers executed, and the sum of the PEs that were active in them."""

    instructions: int = 0
    active: int = 0


class Mask:
    """The PEs that are active: ``active`` (layers, PEs) here, ``plane`` on the machine, ``counts`` in each layer."""

    def __init__(self, active: NDArray[np.bool_], plane: Array = None) -> None:
        self.active, self.plane = active, plane
        self.counts: list[int] = active.sum(1).tolist()

    @property
    def layers(self) -> list[int]:
        """The virtual layers that have active PEs."""
        return [layer for layer, count in enumerate(self.counts) if count]


class Plural:
    """A variable with words of one type for each PE and layer; ``[k]`` is its k-th word.

    Operators return expressions, which all active PEs compute from first words. Expressions are in registers, take no
    memory, and have no value in inactive PEs.
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
        dtype = "int32" if operation in instructions.COMPARISONS else self.data.dtype.name
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
        By section of the program and kind of instruction (`simdtex.maspar.costs.COSTS`).
    row, col : Plural
        The PE's pixel, int32.
    everywhere : Mask
        All PEs.
    """

    def __init__(
        self, machine: Machine | None, array: ProcessorArray, shape: tuple[int, int], memory: float = 2**16
    ) -> None:
        self.machine, self.array, self.shape, self.memory = machine, array, shape, memory
        self.layout = instructions.Layout(array, shape)
        self.layers, self.used, self._section = self.layout.layers, 0, ""
        self.counts: dict[tuple[str, str], Count] = defaultdict(Count)
        self.everywhere = self.mask = self._mask(np.broadcast_to(True, (self.layers, array.size)))
        self.row, self.col = self.plural(), self.plural()
        if machine:
            pixel = self.layout.pixel
            self.mask = self._mask(np.all(pixel < np.array(shape), -1))
            self.row.data, self.col.data = (machine.put(pixel[..., [axis]].astype(np.int32)) for axis in (0, 1))

    def put(self, values: NDArray[Any]) -> Array:
        """Return a table of the ACU, from which it broadcasts, on the machine."""
        return self.machine.put(values) if self.machine else values

    def _mask(self, active: NDArray[np.bool_]) -> Mask:
        return Mask(active, self.machine and self.machine.put(active.astype(np.uint8)))

    def expression(self, dtype: str = "int32", shape: tuple[int, ...] | None = None) -> Plural:
        """Return a plural without values, for the result of an expression."""
        shape = shape or (self.layers, self.array.size, 1)
        if not self.machine:
            return Plural(self, np.broadcast_to(np.zeros(1, dtype), shape))
        return Plural(self, instructions.register(self.machine, shape, dtype))

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

    def plural(self, dtype: str = "int32", size: int = 1) -> Plural:
        """Return a plural variable of ``size`` words in the memory of every PE, 0 at first."""
        self.reserve(np.dtype(dtype).itemsize * size * self.layers)
        shape = (self.layers, self.array.size, size)
        return Plural(self, self.machine.put(np.zeros(shape, dtype))) if self.machine else self.expression(dtype, shape)

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
            self.mask = self._mask((self.machine.get(condition.data)[..., condition.word] != 0) & outer.active)
        try:
            yield self.mask
        finally:
            self.mask = outer

    def count(self, kind: str, number: int | list[int] = 1, layer: int | None = None) -> None:
        """Count a number of instructions of a kind in a layer, or in each of all layers."""
        counts = self.mask.counts if layer is None else [self.mask.counts[layer]]
        numbers = number if isinstance(number, list) else [number] * len(counts)
        total = self.counts[self._section, kind]
        total.instructions += sum(numbers)
        total.active += sum(map(mul, numbers, counts))

    def execute(self, operation: Operation[..., Any], *args: Any) -> Any:
        """Run an instruction on the device, if there is one, under the current mask."""
        on = instructions.On(self.layout, self.mask.plane)
        return operation(self.machine, on, *args) if self.machine else None

    def alu(self, operation: str, to: Plural, a: Plural, b: Plural | float = 0) -> Plural:
        """Set a plural to an operation of the arithmetic unit, and return it."""
        self.count("float" if a.data.dtype.kind == "f" else "integer", a.data.dtype.itemsize // 4)
        if isinstance(b, Plural):
            other, number = (b.data, b.word), 0.0
        else:
            other, number = None, b
            self.count("broadcast", operation not in ("copy", "bit", "lowest"))
        self.execute(instructions.alu, operation, (to.data, to.word), (a.data, a.word), other, number)
        return to

    def xnet(self, plural: Plural, down: int, right: int, distance: int = 1) -> Plural:
        """Return all words of the pixel ``distance`` away in a direction: 1, 0 or -1 rows and columns.

        The last row and column of the picture, padded to whole layers, are next to its first. Words move one PE at a
        time, if they leave the PE.
        """
        moves = self.array.moves(self.layout.grid, down * distance, right * distance)
        self.count("x-net", [instructions.words(plural.data) * one for one in moves])
        to = self.expression(plural.data.dtype.name, plural.data.shape)
        self.execute(instructions.xnet, to.data, plural.data, (down, right), distance)
        return to

    def router(self, to: Plural, plural: Plural, row: Plural, col: Plural) -> None:
        """Set all words to those of the pixel in ``row`` and ``col`` of each PE, wherever that is."""
        self.count("router", instructions.words(plural.data))
        self.execute(instructions.router, to.data, plural.data, row.data, col.data)

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
        self.count("reduction")
        part = self.execute(instructions.reduction, (plural.data, plural.word), least)
        return np.asarray(self.machine.get(part)) if self.machine else np.zeros(1, np.int64)

    def random(self, place: Plural, key: Key, purpose: int) -> Plural:
        """Return 64 random bits of each PE, keyed by ``key``, the place of its pixel and the purpose."""
        self.count("integer", PHILOX)
        bits = self.expression("uint64")
        self.execute(instructions.random_bits, bits.data, place.data, key, purpose)
        return bits

    def table(self, to: Plural, entries: ArrayLike, index: Plural) -> None:
        """Set a plural to the entry ``index`` of a table, which the ACU broadcasts entry by entry."""
        held = np.asarray(entries, to.data.dtype)
        self.count("broadcast", len(held))
        self.count("integer", len(held))
        self.execute(instructions.table, (to.data, to.word), self.put(held), index.data)

    def seconds(self) -> dict[str, dict[str, float]]:
        """Return the modelled seconds of a MasPar MP-1 by section of the program and kind of instruction."""
        found: dict[str, dict[str, float]] = {}
        for (section, kind), count in self.counts.items():
            found.setdefault(section, {})[kind] = count.instructions * COSTS[kind].seconds
        return found
