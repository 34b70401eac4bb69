# SPDX-License-Identifier: BSD-3-Clause
"""A MasPar MP-1: processing elements (PEs) that execute the instructions of an array control unit (ACU).

The ACU is the Python program. A `Plural` is a variable with one value per PE and virtual layer; numbers of Python are
singular, and an instruction that uses one broadcasts it. PEs outside the activity mask change nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine, Operation
from simdtex.maspar import instructions
from simdtex.maspar.array import ProcessorArray
from simdtex.maspar.costs import COSTS, PHILOX

REGISTERS = 40
"""Registers of 32 bits of a PE for a program; results of expressions are in these, and take no memory."""

DIRECTIONS = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)
"""The X-Net's directions, (rows, columns)."""


@dataclass
class Count:
    """The count of one kind of instruction: how many a layer executed, and the PEs that were active in them, summed."""

    instructions: int = 0
    active: int = 0

    def add(self, instructions: int, active: int) -> None:
        """Add to both counts."""
        self.instructions, self.active = self.instructions + instructions, self.active + active


class Mask:
    """The PEs that are active: ``plane`` (layers, PEs) uint8 on the machine, ``counts`` the number in each layer."""

    def __init__(self, plane: Array, active: NDArray[np.bool_]) -> None:
        self.plane, self.active = plane, active
        self.counts: list[int] = active.sum(1).tolist()

    @property
    def layers(self) -> list[int]:
        """The virtual layers that have active PEs."""
        return [layer for layer, count in enumerate(self.counts) if count]


class Plural:
    """A variable with ``size`` words of one type for each PE and layer; ``[k]`` is its k-th word.

    Operators are instructions of all active PEs. `set` assigns in place, and leaves the values of inactive PEs.
    """

    def __init__(self, mp1: MP1, data: Array, word: int = 0) -> None:
        self.mp1, self.data, self.word = mp1, data, word

    def __getitem__(self, word: int) -> Plural:
        return Plural(self.mp1, self.data, word)

    def set(self, value: Plural | float) -> None:
        """Assign a plural or a singular value."""
        if isinstance(value, Plural):
            self.mp1.alu("copy", self, value)
        else:
            self.mp1.alu("put", self, self, value)

    def as_type(self, dtype: str) -> Plural:
        """Return the values as another type."""
        return self.mp1.alu("copy", self.mp1.register(dtype), self)

    def _with(self, operation: str, other: Plural | float) -> Plural:
        dtype = "int32" if operation in instructions.COMPARISONS else self.data.dtype.name
        return self.mp1.alu(operation, self.mp1.register(dtype), self, other)

    def __add__(self, other: Plural | float) -> Plural:
        return self._with("add", other)

    def __sub__(self, other: Plural | float) -> Plural:
        return self._with("sub", other)

    def __mul__(self, other: Plural | float) -> Plural:
        return self._with("mul", other)

    def __floordiv__(self, other: Plural | int) -> Plural:
        return self._with("div", other)

    def __mod__(self, other: Plural | int) -> Plural:
        return self._with("mod", other)

    def __and__(self, other: Plural | int) -> Plural:
        return self._with("and", other)

    def __or__(self, other: Plural | int) -> Plural:
        return self._with("or", other)

    def __rshift__(self, other: Plural | int) -> Plural:
        return self._with("shr", other)

    def __lt__(self, other: Plural | float) -> Plural:
        return self._with("lt", other)

    def __le__(self, other: Plural | float) -> Plural:
        return self._with("le", other)

    def __gt__(self, other: Plural | float) -> Plural:
        return self._with("gt", other)

    def __ge__(self, other: Plural | float) -> Plural:
        return self._with("ge", other)

    def __eq__(self, other: object) -> Plural:  # type: ignore[override]
        return self._with("eq", other)  # type: ignore[arg-type]

    def __ne__(self, other: object) -> Plural:  # type: ignore[override]
        return self._with("ne", other)  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]

    def bit(self) -> Plural:
        """Return 2**x."""
        return self._with("bit", 0)

    def lowest(self) -> Plural:
        """Return the number of the lowest bit that is 0."""
        return self._with("lowest", 0)

    def share(self, of: int) -> Plural:
        """Return x as a fraction of 2**64, times a number, rounded down: an integer below ``of`` from random bits."""
        return self._with("share", of)


class MP1:
    """A processor array with a picture on it.

    Parameters
    ----------
    machine : Machine or None
        The device that executes the instructions; None: they are only counted, with every PE active.
    array : ProcessorArray
    shape : (int, int)
        Rows and columns of the picture. PEs without a pixel are never active.
    memory : int
        Bytes of a PE for plural variables.

    Attributes
    ----------
    counts : dict of Count
        By kind of instruction (`simdtex.maspar.costs.COSTS`).
    row, col : Plural
        The PE's pixel, int32.
    """

    def __init__(
        self, machine: Machine | None, array: ProcessorArray, shape: tuple[int, int], memory: int = 2**16
    ) -> None:
        self.machine, self.array, self.shape, self.memory = machine, array, shape, memory
        self.layout = instructions.Layout.of(array, shape)
        self.layers, self.used = len(self.layout.pixel), 0
        self.padded = self.layout.address.shape
        self.counts = {kind: Count() for kind in COSTS}
        inside = (self.layout.pixel < np.array(shape)).all(-1)
        self.mask = Mask(self._put(inside.astype(np.uint8)), inside)
        self.row, self.col = (self.plural() for _ in range(2))
        if machine:
            for variable, at in zip((self.row, self.col), np.moveaxis(self.layout.pixel, -1, 0), strict=True):
                variable.data = machine.put(at[..., None].astype(np.int32))

    def _put(self, values: NDArray[Any]) -> Array:
        return self.machine.put(values) if self.machine else values

    def register(self, dtype: str = "int32", shape: tuple[int, ...] | None = None) -> Plural:
        """Return a plural for the result of an expression, 0 at first."""
        return Plural(self, self._put(np.zeros(shape or (self.layers, self.array.size, 1), dtype)))

    def plural(self, dtype: str = "int32", size: int = 1, layers: bool = True) -> Plural:
        """Return a plural variable of ``size`` words in the memory of every PE, 0 at first.

        It has values for every virtual layer, or without ``layers`` one for each PE. Raises ValueError if the memory of
        a PE does not suffice.
        """
        need = np.dtype(dtype).itemsize * size * (self.layers if layers else 1)
        if self.used + need > self.memory:
            raise ValueError(
                f"the program needs {self.used + need} bytes of each PE for {self.layers} pixels, and a PE has "
                f"{self.memory}; give a larger array, or more memory"
            )
        self.used += need
        shape = (self.layers, self.array.size, size) if layers else (self.array.size, size)
        return self.register(dtype, shape)

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Free the plural variables that are made inside, as at the end of a function."""
        used = self.used
        try:
            yield
        finally:
            self.used = used

    def fits(self, size: int) -> bool:
        """Return whether ``size`` more bytes fit the memory of a PE."""
        return self.used + size <= self.memory

    @contextmanager
    def where(self, condition: Plural | Mask) -> Iterator[Mask]:
        """Let only those active PEs execute whose ``condition`` is not 0, or a mask of a previous ``where``."""
        outer = self.mask
        if isinstance(condition, Mask):
            self.mask = condition
        elif self.machine:
            held = self.machine.get((condition != 0).data)[..., 0] > 0
            active = held & outer.active
            self.mask = Mask(self.machine.put(active.astype(np.uint8)), active)
            self.count("integer")
        try:
            yield self.mask
        finally:
            self.mask = outer

    def count(self, kind: str, number: int = 1, layer: int | None = None) -> None:
        """Count instructions of a kind, in one layer or in all."""
        counts = self.mask.counts if layer is None else [self.mask.counts[layer]]
        self.counts[kind].add(number * len(counts), number * sum(counts))

    def execute(self, operation: Operation[..., Any], *args: Any) -> Any:
        """Run an instruction on the device, if there is one, under the current mask."""
        return operation(self.machine, self.layout, self.mask.plane, *args) if self.machine else None

    def alu(self, operation: str, to: Plural, a: Plural, b: Plural | float | None = None) -> Plural:
        """Set a plural to an operation of the arithmetic unit, and return it."""
        kind = "float" if a.data.dtype.kind == "f" else "integer"
        self.count(kind, a.data.dtype.itemsize // 4)
        single = not isinstance(b, Plural)
        if single and operation not in ("copy", "bit", "lowest"):
            self.count("broadcast")
        other, number = (None, b or 0) if not isinstance(b, Plural) else ((b.data, b.word), 0)
        self.execute(instructions.alu, operation, (to.data, to.word), (a.data, a.word), other, number)
        return to

    def xnet(self, plural: Plural, down: int, right: int, distance: int = 1) -> Plural:
        """Return all words of the pixel ``distance`` away in a direction: 1, 0 or -1 rows and columns.

        The picture's last row and column of a padded layout are next to its first. Words move one PE at a time, if they
        leave the PE.
        """
        words = plural.data.shape[-1] * plural.data.dtype.itemsize // 4
        moves = self.moves(down * distance, right * distance)
        self.counts["x-net"].add(words * sum(moves), words * sum(n * c for n, c in zip(moves, self.mask.counts, strict=True)))
        self.count("memory", words)
        to = self.register(plural.data.dtype.name, plural.data.shape)
        self.execute(instructions.xnet, to.data, plural.data, (down, right), distance)
        return to

    def moves(self, down: int, right: int) -> list[int]:
        """Return, for each layer, the PEs that a word passes on its way from the pixel ``down`` and ``right``."""
        if self.array.mapping != "hierarchical":
            return [max(abs(down), abs(right))] * self.layers
        high, wide = (n // pes for n, pes in zip(self.padded, (self.array.rows, self.array.cols), strict=True))
        at = [(n, m) for n in range(high) for m in range(wide)]
        return [max(abs((n + down) // high), abs((m + right) // wide)) for n, m in at]

    def router(self, to: Plural, plural: Plural, row: Plural, col: Plural) -> None:
        """Set all words to those of the pixel in ``row`` and ``col`` of each PE, wherever that is."""
        self.count("router", plural.data.shape[-1] * plural.data.dtype.itemsize // 4)
        self.execute(instructions.router, to.data, plural.data, row.data, col.data)

    def sum(self, plural: Plural) -> int:
        """Return the sum of an int32 word over all active PEs, to the ACU."""
        return int(self._reduced(plural, False).sum())

    def min(self, plural: Plural) -> int:
        """Return the least int32 word of all active PEs, to the ACU."""
        return int(self._reduced(plural, True).min())

    def any(self, plural: Plural) -> bool:
        """Return whether an int32 word is not 0 in any active PE, to the ACU: the global OR."""
        return bool(self._reduced(plural != 0, False).any())

    def _reduced(self, plural: Plural, least: bool) -> NDArray[np.int64]:
        self.count("reduction")
        part = self.execute(instructions.reduction, plural.data, plural.word, least)
        return self.machine.get(part) if self.machine else np.zeros(1, np.int64)  # type: ignore[no-any-return]

    def random(self, place: Plural, key: tuple[int, int, int], purpose: int, attempt: int = 0) -> Plural:
        """Return 64 random bits of each PE, keyed by (seed, level, turn), the place of its pixel and the purpose."""
        self.count("integer", PHILOX)
        bits = self.register("uint64")
        self.execute(instructions.random_bits, bits.data, place.data, key, purpose, attempt)
        return bits

    def table(self, to: Plural, entries: Sequence[Any] | NDArray[Any], index: Plural) -> None:
        """Set a plural to the entry ``index`` of a table, which the ACU broadcasts entry by entry."""
        held = np.asarray(entries, to.data.dtype)
        self.count("broadcast", len(held))
        self.count("integer", len(held))
        self.execute(instructions.table, (to.data, to.word), self._put(held), index.data)

    def seconds(self) -> dict[str, float]:
        """Return the modelled seconds of a MasPar MP-1 by kind of instruction."""
        return {kind: count.instructions * COSTS[kind].seconds for kind, count in self.counts.items()}
