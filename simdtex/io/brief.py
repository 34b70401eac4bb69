# SPDX-License-Identifier: BSD-3-Clause
"""Texts of results that fit a line of a terminal."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np


class Brief:
    """A base of dataclasses, declared with ``repr=False``, that hold arrays."""

    def __repr__(self) -> str:
        """Return the fields with the shape and the type of arrays, whose values would fill pages, without functions."""
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.repr}  # type: ignore[arg-type]
        shown = [f"{name}={_short(one)}" for name, one in values.items() if one is not None and not callable(one)]
        return f"{type(self).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {'x'.join(map(str, value.shape))}"
    if isinstance(value, dict):
        value = {name: _short(one) for name, one in value.items()}
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
