# SPDX-License-Identifier: BSD-3-Clause
"""The machine on an OpenCL device: compiles kernels, allocates arrays, launches."""

from __future__ import annotations

import re
import time
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from math import prod
from pathlib import Path
from threading import RLock
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from simdtex.machine import devices
from simdtex.machine.devices import DeviceError, DeviceInfo
from simdtex.machine.reference import Log

SMALL_COPY = 2**16
"""The most bytes that are copied to a device without waiting."""

OUT_OF_MEMORY = (
    cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE,
    cl.status_code.OUT_OF_HOST_MEMORY,
    cl.status_code.INVALID_BUFFER_SIZE,
)

REMEDY = "give a smaller size or sample, or another --device"

NONE: Mapping[str, int | str] = {}
"""No -D constants."""

SMALL_GROUP = 4
"""Work-group size on a CPU for kernels with much work in each item: few sites still occupy all cores."""

ONE_PROGRAM = ("schedules/active", "schedules/coloring", "mrf/start", "mrf/use")
"""Kernel files without -D constants that every run of ``mrf`` needs, compiled as one program: each takes about 50 ms to
load on PoCL."""

ITEMS = 128
"""Work-items that relax one site together on a GPU."""

LONGEST = 2**17
"""Work-items of one launch of `OpenCL.launch_groups`: a multiple of every work-group size, and no long launch."""


def kernel_folder() -> Path:
    """Return the folder of the .cl files: inside the package in a wheel, next to it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "kernels"
    return inside if inside.is_dir() else package.parent / "kernels"


def kernel_source(*names: str) -> str:
    """Return the text of files of that folder, with the text of each header in place of its first ``#include``.

    So a header needs no guard, but no ``#include`` may stand within ``#if``. The compiler needs no path, which may
    contain a space, and its messages count the lines of each file.
    """
    read = set()

    def text(name: str) -> str:
        if name in read:
            return ""
        read.add(name)
        lines = [f'#line 1 "{name}"', *(kernel_folder() / name).read_text(encoding="utf-8").splitlines()]
        for index, line in enumerate(lines):
            if line.startswith("#include"):
                lines[index] = f'{text(line.split(chr(34))[1])}\n#line {index + 1} "{name}"'
        return "\n".join(lines) + "\n"

    return "".join(map(text, names))


@cache
def kernel_files() -> dict[str, str]:
    """Return the file of each kernel, without its ending: that which defines a function of this name."""
    folder, files = kernel_folder(), {}
    for path in folder.rglob("*.cl"):
        for function in re.findall(r"^__kernel\b.*?\bvoid (\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE):
            files[function] = path.relative_to(folder).with_suffix("").as_posix()
    return files


class Pool:
    """Buffers of a device that are used again: allocating one takes long.

    A buffer is free as soon as no array has it, since commands of a queue run in order. Threads may share a pool. They
    may not share `pyopencl.tools.MemoryPool`: while one thread allocates, another may not free a buffer.
    """

    def __init__(self, queue: Any, largest: int) -> None:
        self._queue, self._largest, self._made, self._free = queue, largest, 0, dict[int, list[Taken]]()
        self._used: set[Taken] = set()

    @property
    def active_bytes(self) -> int:
        """Bytes of the buffers that arrays have."""
        return self._made - sum(size * len(free) for size, free in self._free.items())

    def take(self, size: int) -> BufferUse:
        """Return the use of a buffer of at least ``size`` bytes, a quarter more at most."""
        unit = 1 << max(6, size.bit_length() - 3)
        size = max(1, -(-size // unit)) * unit
        if self._largest > 0:
            size = min(size, self._largest)
        free = self._free.setdefault(size, [])
        try:
            before = free.pop()
        except IndexError:  # another thread may have taken the last one
            pass
        else:
            self._used.discard(before)
            return self._use(before.buffer, free)
        try:
            buffer = self._new(size)
        except cl.MemoryError:
            self._made = self.active_bytes
            for unused in self._free.values():
                self._used.difference_update(unused)
                unused.clear()
            buffer = self._new(size)
        self._made += size
        return self._use(buffer, free)

    def _use(self, buffer: Any, free: list[Taken]) -> BufferUse:
        use = BufferUse()
        taken = Taken(use, free.append)
        taken.buffer = use.buffer = buffer
        self._used.add(taken)
        return use

    def _new(self, size: int) -> Any:
        """Return a buffer to which a byte was copied, since some runtimes only then find that there is no memory."""
        buffer = cl.Buffer(self._queue.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_copy(self._queue, buffer, np.zeros(1, np.uint8))
        return buffer


class BufferUse:
    """The use of a buffer of a `Pool`, which ends with the last array that has it."""

    __slots__ = ("__weakref__", "buffer")
    buffer: Any


class Taken(weakref.ref[BufferUse]):
    """A buffer in use, which is appended to the free ones at the end: by C alone, where no signal can raise."""

    __slots__ = ("buffer",)
    buffer: Any


class DeviceArray:
    """A contiguous array on a device: a buffer, a shape and a type.

    ``event`` belongs to the copy that fills the buffer, and keeps the source alive; ``taken`` keeps a buffer of a pool.
    Creating a `pyopencl.array.Array` takes tens of microseconds, and a step of ten small kernels creates a dozen.
    """

    __slots__ = ("data", "dtype", "event", "nbytes", "shape", "size", "taken")

    def __init__(self, data: Any, shape: tuple[int, ...], dtype: np.dtype[Any], taken: Any = None) -> None:
        self.data, self.shape, self.dtype, self.taken = data, shape, dtype, taken
        self.event: Any = None
        self.size = prod(shape)
        self.nbytes = self.size * dtype.itemsize

    def __len__(self) -> int:
        """Return the size of the first axis."""
        return self.shape[0]

    def reshape(self, shape: int | tuple[int, ...]) -> DeviceArray:
        """Return an array of another shape in the same memory."""
        wanted = shape if isinstance(shape, tuple) else (shape,)
        assert prod(wanted) == self.size
        result = DeviceArray(self.data, wanted, self.dtype, self.taken)
        result.event = self.event
        return result


class OpenCL:
    """One OpenCL device. Threads may share it, and the bytes of a run do not depend on other threads.

    Operations of several threads run one after another, so that sharing saves compilation, but no time. Figures of
    work, such as `launches` and `seconds`, cover all threads. In a forked process it raises DeviceError.

    Parameters
    ----------
    info : DeviceInfo
        From `simdtex.machine.devices.find`.
    work_group : int, optional
        Forces the work-group size of every launch. This and the other options change no bit of any result.
    scratch : int, optional
        Bytes available for neighbourhoods and tables of densities at a time.
    vector : int, optional
        Sites or candidates in a vector: 1, 4, 8 or 16.
    step : int, optional
        Vectors kept in registers at a time: 1, 2, 4 or 8.
    items : int, optional
        Work-items that relax one site together: 1, or a multiple of 16 with ``vector=1``.
    profile : bool
        Whether to measure the time of every kernel.
    """

    def __init__(
        self,
        info: DeviceInfo,
        *,
        work_group: int | None = None,
        scratch: int | None = None,
        vector: int | None = None,
        step: int | None = None,
        items: int | None = None,
        profile: bool = False,
    ) -> None:
        devices.check_fork()
        self.info, self.kind, self.memory = info, info.kind, float(info.memory)
        self.name = f"{info.name.strip()} ({info.platform})"
        self.context = devices.context(info.handle)
        timed: dict[str, Any] = {"properties": cl.command_queue_properties.PROFILING_ENABLE} if profile else {}
        self.queue = cl.CommandQueue(self.context, **timed)
        self.log = Log(profile)
        on_gpu = info.kind == "gpu"
        # PoCL compiles once for each work-group size, so there is only one.
        self._group, self._forced = work_group or (64 if on_gpu else 16), work_group is not None
        device, grouped = self.context.devices[0], on_gpu and not work_group and vector in (None, 1)
        self.items = items or (min(ITEMS, int(device.max_work_group_size) // 16 * 16) if grouped else 0) or 1
        self.vector = vector or (1 if on_gpu or self.items > 1 else 16)
        self.step = step or 4
        if self.step not in (1, 2, 4, 8):
            raise ValueError(f"step is {self.step}; give 1, 2, 4 or 8")
        if self.items > 1 and (self.items % 16 or self.vector > 1 or self._forced):
            raise ValueError(f"items is {self.items}; give 1, or a multiple of 16 with vector=1 and no work_group")
        self.local_memory = int(device.local_mem_size)
        self.scratch = scratch or (2**28 if on_gpu else 2**24)
        self._lock = RLock()  # threads share the arguments of kernel objects, and the log
        self._pool = Pool(self.queue, info.largest)
        self._pending, self._burst, self._synced = 0, 1e8, time.perf_counter()
        self._counters: DeviceArray | None = None
        self._spared = 0
        self._constants: dict[tuple[str, bytes], DeviceArray] = {}
        self._kernels: dict[tuple[tuple[str, ...], str], dict[str, Any]] = {}

    def __repr__(self) -> str:
        return f"<OpenCL device {self.info.name.strip()} ({self.kind})>"

    @contextmanager
    def running(self) -> Iterator[OpenCL]:
        """Let an operation launch its kernels while no other thread launches kernels."""
        with self._plain_errors(), self._lock:
            yield self

    def put(self, array: Any) -> Any:
        """Return a copy on the device; a small array is copied in the queue's order, without waiting."""
        array = np.array(array, order="C")
        large = array.nbytes > SMALL_COPY  # without the pool, which would round the size up and keep the memory
        with self._plain_errors():
            if large:
                self._check_size(array.nbytes)
                data = cl.Buffer(self.context, cl.mem_flags.READ_WRITE, array.nbytes)
                result = DeviceArray(data, array.shape, array.dtype)
            else:
                result = self.empty(array.shape, array.dtype)
            if array.size:
                event = cl.enqueue_copy(self.queue, result.data, array, is_blocking=large)
                result.event = None if large else event
            return result

    def get(self, array: DeviceArray) -> Any:
        """Return a copy in NumPy, after waiting for the queue."""
        result = np.empty(array.shape, array.dtype)
        with self._plain_errors():
            if result.size:
                cl.enqueue_copy(self.queue, result, array.data)
        return result

    def part(self, array: DeviceArray, begin: int, end: int) -> Any:
        """Return a copy on the device of elements ``begin`` to ``end`` - 1 of the first axis."""
        with self._plain_errors():
            result = self.empty((end - begin, *array.shape[1:]), array.dtype)
            if result.size:
                offset = begin * (array.nbytes // len(array))
                cl.enqueue_copy(self.queue, result.data, array.data, byte_count=result.nbytes, src_offset=offset)
            return result

    def empty(self, shape: Any, dtype: Any) -> DeviceArray:
        """Return an uninitialised array, from a pool."""
        wanted = tuple(shape) if isinstance(shape, tuple | list) else (int(shape),)
        kind = np.dtype(dtype)
        size = prod(wanted) * kind.itemsize
        self._check_size(size)
        taken = self._pool.take(size)
        return DeviceArray(taken.buffer, wanted, kind, taken)

    def constant(self, array: Any) -> DeviceArray:
        """Return a small table as a device array, uploaded once."""
        key = (array.dtype.str, array.tobytes())
        if key not in self._constants:
            self._constants[key] = self.put(array)
        return self._constants[key]

    def sync(self, work: int = 0) -> None:
        """Wait until the queue is empty; given the multiply-adds just enqueued, only every tenth of a second."""
        self._pending += work
        if work and self._pending < self._burst:
            return
        with self._plain_errors(), self._lock:  # no launch between the end of the queue and the reading of its times
            self.queue.finish()
            self.log.settle()
            seconds = time.perf_counter() - self._synced
            if work:
                rate = self._pending / max(seconds, 1e-6)
                self._burst = min(max(rate * 0.1, self._burst / 2), self._burst * 2)
            self._pending, self._synced = 0, time.perf_counter()

    @property
    def launches(self) -> int:
        """Kernels enqueued so far."""
        return self.log.launches

    @property
    def seconds(self) -> float | None:
        """Seconds spent in kernels so far, None without ``profile``."""
        self.sync()
        return self.log.seconds

    def profile(self) -> dict[str, Any] | None:
        """Return the times of the kernels launched since the last call, see `simdtex.machine.reference.Log.take`."""
        with self._lock:
            self.sync()
            return self.log.take()

    def fma_counters(self, count: int, expected: int) -> DeviceArray:
        """Return `count` or more uint64 to which kernels add the multiply-adds done, of the `expected` number."""
        if self._counters is None or self._counters.size < count:
            self._read_counters()
            self._counters = self.put(np.zeros(count, np.uint64))
        self._spared += expected
        return self._counters

    def _read_counters(self) -> None:
        if self._counters is not None:
            self._spared -= int(self.get(self._counters).sum())
            self._counters = None

    @property
    def spared(self) -> int:
        """Multiply-adds of distances that a bound has avoided so far; waits for the device."""
        with self._lock:
            self._read_counters()
            return self._spared

    @contextmanager
    def _plain_errors(self) -> Iterator[None]:
        """Raise DeviceError if the process was forked, if the device runs out of memory, or if it gives up a launch."""
        devices.check_fork()
        try:
            yield
        except cl.Error as error:
            if error.code not in OUT_OF_MEMORY:
                devices.context.cache_clear()  # an error of a kernel can leave the context unusable
            if error.code == cl.status_code.OUT_OF_RESOURCES:
                raise DeviceError(
                    f"{self.name} gave up (CL_OUT_OF_RESOURCES), since a kernel took more registers or memory than "
                    "there are, ran longer than a watchdog allows, or accessed memory of no array; give a smaller size "
                    "or another --device, and report it"
                ) from error
            if error.code not in OUT_OF_MEMORY:
                raise
            raise DeviceError(f"{self.name} ran out of memory; {REMEDY}") from error

    def _check_size(self, size: int) -> None:
        """Raise DeviceError if an array of ``size`` bytes is larger than the device allows a single one to be."""
        if 0 < self.info.largest < size:
            raise DeviceError(
                f"one array needs {size / 2**20:.0f} MiB and {self.name} allows {self.info.largest / 2**20:.0f} MiB in "
                f"each; {REMEDY}"
            )

    def chunk(self, candidates: int, neighbours: int, channels: int, table: int = 0) -> int:
        """Return the number of sites, each with ``table`` bytes, that fit the scratch memory and 4e9 multiply-adds."""
        fit = self.scratch // (table + 8 * neighbours * (1 + channels))
        return max(1, min(fit, int(4e9) // (2 * candidates * neighbours * channels)))

    def kernel(self, function: str, defines: Mapping[str, int | str] = NONE) -> Any:
        """Return a kernel, compiled once for these -D constants."""
        file = kernel_files()[function]
        options = " ".join(f"-D {key}={defines[key]}" for key in sorted(defines))
        files = ONE_PROGRAM if file in ONE_PROGRAM and not defines else (file,)
        if (files, options) not in self._kernels:
            source = kernel_source(*(f"{name}.cl" for name in files))
            self._kernels[files, options] = devices.build(self.context, source, options.split())
        return self._kernels[files, options][function]

    def launch(
        self,
        function: str,
        size: tuple[int, ...],
        *args: Any,
        local: tuple[int, ...] | None = None,
        defines: Mapping[str, int | str] = NONE,
    ) -> None:
        """Enqueue a kernel over a range of work-items, rounded up to whole work-groups: kernels check the range.

        ``function`` and ``defines`` are as in `kernel`; with ITEMS, so many work-items form a group that does what one
        work-item of the range does otherwise. ``args`` are arrays of the device, scalars and structs of NumPy, and
        integers of Python, which become 32 bits.
        """
        items = int(defines.get("ITEMS", 1))
        if items > 1:
            size, local = (size[0] * items,), (items,)
        self.enqueue(self.kernel(function, defines), size, *args, local=local)

    def enqueue(self, kernel: Any, size: tuple[int, ...], *args: Any, local: tuple[int, ...] | None = None) -> None:
        """Enqueue a compiled kernel, as `launch` does."""
        local = local if local and not self._forced else (self._group,) + (1,) * (len(size) - 1)
        local = (min(local[0], self.most_together(kernel)), *local[1:])
        size = tuple(-(-n // group) * group for n, group in zip(size, local, strict=True))
        self.log.add(kernel(self.queue, size, local, *map(_argument, args)), kernel)

    def most_together(self, kernel: Any) -> int:
        """Return the most work-items in a work-group of a kernel: fewer than elsewhere if it takes many registers."""
        # pyopencl keeps the answer
        return int(kernel.get_work_group_info(cl.kernel_work_group_info.WORK_GROUP_SIZE, self.info.handle))

    def launch_groups(
        self, function: str, groups: NDArray[np.int64], *args: Any, defines: Mapping[str, int | str]
    ) -> None:
        """Enqueue a kernel for one range of work-items after another, from ``groups[g, 0]`` up to ``groups[g, 1]``.

        The kernel's second and third arguments are the begin and the end of a launch's range, since PoCL recompiles a
        kernel for launches with a global offset. All other arguments are set once, so that a launch takes a few
        microseconds.
        """
        kernel = self.kernel(function, defines)
        kernel.set_args(*map(_argument, args))
        items = int(defines.get("ITEMS", 1))
        group = self._group if self._forced or self.kind == "gpu" else SMALL_GROUP
        group = items if items > 1 else min(group, self.most_together(kernel))
        for begin, end in groups.tolist():
            kernel.set_arg(2, np.int32(end))
            for first in range(begin, end, LONGEST):
                kernel.set_arg(1, np.int32(first))
                size = -(-min(end - first, LONGEST) * items // group) * group
                self.log.add(cl.enqueue_nd_range_kernel(self.queue, kernel, (size,), (group,)), kernel)


def _argument(value: Any) -> Any:
    """Return an argument of a kernel in the type for pyopencl."""
    if type(value) is DeviceArray:
        return value.data
    return np.int32(value) if isinstance(value, int) else value
