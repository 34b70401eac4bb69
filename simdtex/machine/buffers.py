# SPDX-License-Identifier: BSD-3-Clause
"""Arrays on a device: a buffer, a shape and a type, and nothing that costs time to make."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import pyopencl as cl


class DeviceArray:
    """A contiguous array of a device.

    Parameters
    ----------
    data : pyopencl.Buffer or pyopencl.tools.PooledBuffer
    shape : tuple of int
    dtype : numpy.dtype
    event : pyopencl.Event, optional
        Of the copy that fills it, kept since it keeps the source.

    Notes
    -----
    `pyopencl.array.Array` knows arithmetic and streams; one of it costs tens of microseconds, and a step of ten small
    kernels makes a dozen.
    """

    __slots__ = ("data", "dtype", "event", "nbytes", "shape", "size")

    def __init__(self, data: Any, shape: tuple[int, ...], dtype: np.dtype[Any], event: Any = None) -> None:
        self.data, self.shape, self.dtype, self.event = data, shape, dtype, event
        self.size = prod(shape)
        self.nbytes = self.size * dtype.itemsize

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    def __len__(self) -> int:
        """Size of the first axis."""
        return self.shape[0]

    def reshape(self, *shape: Any) -> DeviceArray:
        """The same memory in another shape, given as numbers or a tuple; one of them may be -1."""
        wanted = shape[0] if isinstance(shape[0], tuple) else shape
        left = self.size // max(1, prod(n for n in wanted if n != -1))
        return DeviceArray(self.data, tuple(left if n == -1 else int(n) for n in wanted), self.dtype, self.event)

    def __getitem__(self, rows: slice) -> Part:
        """Some of the first axis, to be copied to NumPy and nothing else."""
        begin, end, step = rows.indices(len(self))
        assert step == 1
        return Part(self, begin, max(begin, end))

    def get(self, queue: cl.CommandQueue) -> Any:
        """Wait for the queue, and copy to NumPy."""
        return self[:].get(queue) if self.shape else self.reshape(1)[:].get(queue).reshape(())


@dataclass(frozen=True)
class Part:
    """Rows ``begin`` to ``end`` - 1 of an array's first axis."""

    whole: DeviceArray
    begin: int
    end: int

    def get(self, queue: cl.CommandQueue) -> Any:
        """Wait for the queue, and copy to NumPy."""
        result = np.empty((self.end - self.begin, *self.whole.shape[1:]), self.whole.dtype)
        if result.size:
            row = self.whole.nbytes // len(self.whole)
            cl.enqueue_copy(queue, result, self.whole.data, src_offset=self.begin * row)
        return result
