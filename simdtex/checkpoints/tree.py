# SPDX-License-Identifier: BSD-3-Clause
"""Plain arrays and numbers, in dicts, lists and tuples, as JSON and a list of arrays; and what identifies them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAVES = (str, int, float, bool, type(None))


def packed(tree: Any) -> tuple[Any, list[NDArray[Any]]]:
    """A tree of plain things as what JSON holds exactly, and the arrays that it refers to by number.

    Raises
    ------
    TypeError
        Something is no array, number, text, dict, list or tuple.
    """
    arrays: list[NDArray[Any]] = []

    def pack(node: Any) -> Any:
        if isinstance(node, (np.ndarray, np.generic)):
            if node.dtype.hasobject:
                raise TypeError("an array of objects cannot be kept in a checkpoint; give arrays of numbers")
            arrays.append(np.asarray(node))
            return {"array" if isinstance(node, np.ndarray) else "scalar": len(arrays) - 1}
        if type(node) in LEAVES:
            return node
        if isinstance(node, dict) and all(type(key) is str for key in node):
            return {"dict": {key: pack(value) for key, value in node.items()}}
        if isinstance(node, (list, tuple)):
            return {"tuple" if isinstance(node, tuple) else "list": [pack(value) for value in node]}
        raise TypeError(
            f"a state holds {type(node).__name__}, which a checkpoint cannot keep; give plain arrays and numbers"
        )

    return pack(tree), arrays


def size(tree: Any) -> int:
    """Bytes of the arrays of a tree."""
    return sum(array.nbytes for array in packed(tree)[1])


def unpacked(told: Any, arrays: Sequence[NDArray[Any]]) -> Any:
    """What `packed` was given; tuples with names come back without them (see `like`)."""
    if not isinstance(told, dict):
        return told
    ((kind, node),) = told.items()
    if kind == "array":
        return arrays[node]
    if kind == "scalar":
        return arrays[node][()]
    if kind == "dict":
        return {key: unpacked(value, arrays) for key, value in node.items()}
    found = [unpacked(value, arrays) for value in node]
    return tuple(found) if kind == "tuple" else found


def like(template: Any, node: Any) -> Any:
    """A tree whose tuples have the types of those of another tree of the same form."""
    if not (isinstance(node, tuple) and isinstance(template, tuple) and len(node) == len(template)):
        return node
    inside = [like(one, value) for one, value in zip(template, node, strict=True)]
    kind: Any = type(template)
    return tuple(inside) if kind is tuple else kind(*inside)


def digest(*arrays: NDArray[Any]) -> str:
    """SHA-256 over types, shapes and bytes in C order."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def identity(thing: Any) -> Any:
    """What tells an input from another, for JSON: numbers and texts themselves, arrays by their digest."""
    if isinstance(thing, np.ndarray):
        return f"sha256:{digest(thing)}"
    if thing is None or isinstance(thing, (bool, str)):
        return thing
    if isinstance(thing, np.bool_):
        return bool(thing)
    if isinstance(thing, Integral) and abs(int(thing)) >= 2**53:
        return str(int(thing))
    if isinstance(thing, Real):
        return float(thing)  # 1 and 1.0 say the same
    if isinstance(thing, (list, tuple)):
        return [identity(one) for one in thing]
    if isinstance(thing, dict):
        return {str(name): identity(one) for name, one in thing.items()}
    if is_dataclass(thing):
        return {field.name: identity(getattr(thing, field.name)) for field in fields(thing)}
    return f"{type(thing).__qualname__} {getattr(thing, 'name', '')}".strip()
