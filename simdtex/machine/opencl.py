# SPDX-License-Identifier: BSD-3-Clause
"""The machine on an OpenCL device: compiles kernels, holds arrays, launches."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from threading import RLock
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.tools as cl_tools
from numpy.typing import NDArray

from simdtex.machine import programs, runtimes
from simdtex.machine.buffers import DeviceArray
from simdtex.machine.devices import DeviceError, DeviceInfo
from simdtex.machine.forms import Form, default
from simdtex.machine.interface import Array, Operation, P, R, Work
from simdtex.machine.log import Log
from simdtex.machine.tally import Tally
from simdtex.model.sample import BLOCK

LITTLE = 2**16
"""Bytes that are copied to a device without waiting."""

OUT_OF_MEMORY = (
    cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE,
    cl.status_code.OUT_OF_RESOURCES,
    cl.status_code.OUT_OF_HOST_MEMORY,
    cl.status_code.INVALID_BUFFER_SIZE,
)

SMALL_GROUP = 4
"""Work-items to a work-group of a CPU where each has much to do: a small group of sites still feeds all cores."""

TOGETHER = ("active", "start")
"""Files whose kernels need no -D constant and serve every run of ``mrf``: one program, since each costs some 50 ms to
load on PoCL."""

LONGEST = 2**17
"""Work-items of a launch over a group: a multiple of every work-group size, and no long launch."""


def kernel_folder() -> Path:
    """Where the .cl files are: inside the package in a wheel, beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "kernels"
    return inside if inside.is_dir() else package.parent / "kernels"


class OpenCL:
    """One OpenCL device, which threads may share: the bytes of each are those of a run alone.

    Operations of several threads take turns, so that sharing saves compilation, but no time; figures of work, as
    `launches` and `seconds`, count what all of them asked for. In a process that was forked it raises DeviceError.

    Parameters
    ----------
    info : DeviceInfo
        From `simdtex.machine.devices.find`.
    work_group : int, optional
        Forces the work-group size of every launch; changes no bit of any result.
    scratch : int, optional
        Bytes that distances may take at a time; changes no bit of any result.
    vector : int, optional
        Sites side by side in a work-item (1, 4, 8 or 16); changes no bit of any result.
    step : int, optional
        Candidates kept in registers together, a divisor of 64; changes no bit of any result.
    split : int, optional
        Work-items that share a site's candidates; changes no bit of any result.
    skip : bool
        Whether candidates that are proved to lose are skipped; changes no bit of any result.
    profile : bool
        Whether to measure how long the device works.
    """

    def __init__(
        self,
        info: DeviceInfo,
        *,
        work_group: int | None = None,
        scratch: int | None = None,
        vector: int | None = None,
        step: int | None = None,
        split: int | None = None,
        skip: bool = True,
        profile: bool = False,
    ) -> None:
        runtimes.alive()
        self.info = info
        # The arguments of a kernel object, the pool and the log are one for all threads; copies of a machine share it.
        self._turn = RLock()
        self.name = f"{info.name.strip()} ({info.platform})"
        self.context = cl.Context([info.handle])  # type: ignore[list-item]
        timed: dict[str, Any] = {"properties": cl.command_queue_properties.PROFILING_ENABLE} if profile else {}
        self.queue = cl.CommandQueue(self.context, **timed)
        self.log = Log(profile)
        on_gpu = info.kind == "gpu"
        self.forced = work_group is not None
        self.scratch = scratch or (2**28 if on_gpu else 2**24)
        form = default(info)  # a fixed group size: PoCL compiles once per size
        self.take(Form(vector or form.vector, step or form.step, work_group or form.group))
        if BLOCK % self.step:
            raise ValueError(f"step is {self.step}; give a divisor of {BLOCK}")
        self.skip = skip
        self.tally = Tally(self)
        self._split = split
        self._crowd = info.compute_units * (2048 if on_gpu else 64)  # work-items that keep the device busy
        self._abreast = 64 if on_gpu else 1  # of a site: neighbours in a row of the sample
        self._pool = cl_tools.MemoryPool(cl_tools.ImmediateAllocator(self.queue))
        self._pending, self._burst, self._synced = 0, 1e8, time.perf_counter()
        self._constants: dict[tuple[str, bytes], Array] = {}
        self._programs: dict[tuple[str, str], Any] = {}
        self._kernels: dict[tuple[str, str, str], Any] = {}

    @property
    def kind(self) -> str:
        """Of the device."""
        return self.info.kind

    def take(self, form: Form) -> None:
        """Take this form of the inner loop."""
        self.vector, self.step, self.group = form
        self.tile = (self.group, 1) if self.info.kind == "gpu" else (1, 8)

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Launch the operation's kernels, while no other thread launches any."""
        with self._use(), self._turn:
            return operation.launch(self, *args, **kwargs)

    def put(self, array: Any) -> Array:
        """Copy to the device."""
        array = np.array(array, order="C")
        with self._use():  # little comes in turn, and is not waited for: its event keeps the copy
            later = array.nbytes <= LITTLE
            result = self._pooled(array.shape, array.dtype) if later else self._alone(array.shape, array.dtype)
            if array.size:
                event = cl.enqueue_copy(self.queue, result.data, array, is_blocking=not later)
                result.event = event if later else None
            return result

    def get(self, array: Array) -> Any:
        """Copy from the device."""
        with self._use():
            return array.get(self.queue)

    def empty(self, shape: Any, dtype: Any) -> Array:
        """An array whose contents do not matter yet, from a pool."""
        return self._pooled((int(shape),) if isinstance(shape, (int, np.integer)) else tuple(shape), np.dtype(dtype))

    def _pooled(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        with self._turn:
            return DeviceArray(self._pool.allocate(max(1, prod(shape) * dtype.itemsize)), shape, dtype)

    def _alone(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """The same from no pool: large arrays that come once."""
        size = max(1, prod(shape) * dtype.itemsize)
        return DeviceArray(cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size), shape, dtype)

    def constant(self, array: Any) -> Array:
        """A small table on the device, uploaded once."""
        key = (array.dtype.str, array.tobytes())
        if key not in self._constants:
            self._constants[key] = self.put(array)
        return self._constants[key]

    def sync(self, work: int = 0) -> None:
        """Wait until the queue is empty; given the fma just asked for, only when a tenth of a second is due."""
        self._pending += work
        if work and self._pending < self._burst:
            return
        with self._use(), self._turn:  # nothing is launched between the end of the queue and the reading of its times
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
        """Seconds the device has worked, None without ``profile``."""
        self.sync()
        return self.log.seconds

    def profile(self) -> dict[str, Any] | None:
        """What was launched since this was called last, see `simdtex.machine.log.Log.take`."""
        with self._turn:
            self.sync()
            return self.log.take()

    @property
    def spared(self) -> int:
        """Fma of distances that a bound has spared so far."""
        with self._turn:
            return self.tally.spared

    def part(self, array: Array, begin: int, end: int) -> Array:
        """Some elements of an array of one axis, copied on the device."""
        result = self.empty((end - begin,), array.dtype)
        if result.size:
            item = array.dtype.itemsize
            size, offset = result.size * item, begin * item
            cl.enqueue_copy(self.queue, result.data, array.data, byte_count=size, src_offset=offset)
        return result

    def require(self, size: int) -> None:
        """Raise DeviceError where this many bytes are more than the device has."""
        if size > self.info.memory:
            raise DeviceError(
                f"this needs about {size / 2**20:.0f} MiB and {self.name} has {self.info.memory / 2**20:.0f}; "
                "give a smaller size or another --device"
            )

    @contextmanager
    def _use(self) -> Iterator[None]:
        """Say in one sentence that the device ran out of memory, or was lost in a fork."""
        runtimes.alive()
        try:
            yield
        except cl.Error as error:
            if error.code not in OUT_OF_MEMORY:
                raise
            raise DeviceError(
                f"{self.name} ran out of memory; give a smaller size or sample, or another --device"
            ) from error

    def split(self, items: int, most: int) -> int:
        """How many work-items are to share each of so many: enough to keep the device busy, up to `most`."""
        wanted = self._split or -(-self._crowd // (items * self._abreast)) * self._abreast
        return max(1, min(wanted, most))

    def chunk(self, candidates: int, neighbours: int, channels: int, stored: bool = True) -> int:
        """Whole vectors of sites: bounded by scratch memory, and by 4e9 fma so that no launch is long."""
        padded = -(-candidates // BLOCK) * BLOCK
        per_site = 4 * (padded + padded // BLOCK + neighbours * (1 + channels))
        if not stored:
            per_site = 4 * (12 * self.split(1, padded) + neighbours * (4 + 3 * channels))
        fit = min(self.scratch // per_site, int(4e9) // (2 * padded * neighbours * channels))
        return max(1, fit // self.vector) * self.vector

    def kernel(self, file: str, function: str, /, **defines: int | str) -> Any:
        """A kernel of ``kernels/FILE.cl``, compiled once for these -D constants."""
        options = " ".join(f"-D {key}={value}" for key, value in sorted(defines.items()))
        files = TOGETHER if file in TOGETHER and not defines else (file,)
        key = (" ".join(files), function, options)
        if key not in self._kernels:
            if key[::2] not in self._programs:
                self._programs[key[::2]] = self._build(files, options)
            self._kernels[key] = cl.Kernel(self._programs[key[::2]], function)
        return self._kernels[key]

    @property
    def include(self) -> list[str]:
        """The compiler option that finds the kernels' headers."""
        return ["-I", str(kernel_folder())]

    def _build(self, files: tuple[str, ...], options: str) -> Any:
        source = "\n".join((kernel_folder() / f"{file}.cl").read_text(encoding="utf-8") for file in files)
        return programs.compiled(self.context, source, [*options.split(), *self.include])

    def launch(
        self,
        kernel: Any,
        size: tuple[int, ...],
        *args: Any,
        local: tuple[int, ...] | None = None,
        work: Work | None = None,
    ) -> None:
        """Enqueue a kernel over a range of work-items, rounded up to whole work-groups: kernels guard.

        `work` is the work of the launch, for profiles.
        """
        one_dimensional = (self.group,) + (1,) * (len(size) - 1)
        local = local if local and not self.forced else one_dimensional
        size = tuple(-(-n // group) * group for n, group in zip(size, local, strict=True))
        data = [a.data if type(a) is DeviceArray else a for a in args]
        self.log.add(prod(size), kernel(self.queue, size, local, *data), kernel, work)

    def launch_groups(self, kernel: Any, groups: NDArray[np.int64], *args: Any) -> None:
        """Enqueue a kernel over groups of work-items one after another, from ``groups[g, 0]`` up to ``groups[g, 1]``.

        The kernel's second argument is the end of the group that it is launched for. The others are set once, so that a
        launch costs a few microseconds.
        """
        kernel.set_args(*(a.data if type(a) is DeviceArray else a for a in args))
        group = self.group if self.forced or self.info.kind == "gpu" else SMALL_GROUP
        for begin, end in groups.tolist():
            kernel.set_arg(1, np.int32(end))
            for first in range(begin, end, LONGEST):
                size = -(-min(end - first, LONGEST) // group) * group
                event = cl.enqueue_nd_range_kernel(self.queue, kernel, (size,), (group,), (first,))
                self.log.add(size, event, kernel)
