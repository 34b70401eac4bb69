# SPDX-License-Identifier: BSD-3-Clause
"""The state of a page: it takes messages, makes one output at a time, and sends frames of it.

A message is a dict with a ``kind``, and buffers. Whatever carries messages calls `Session.receive`, and the session's
``send``; ``docs/live.rst`` lists them.
"""

from __future__ import annotations

import logging
import queue
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib.metadata import version
from typing import Any

from numpy.typing import NDArray

from simdtex.io.examples import EXAMPLES, example
from simdtex.io.image import read_bytes
from simdtex.live import frames
from simdtex.live.job import LABELS, Hint, Job, Message, Picture, file_stem
from simdtex.live.levels import Levels
from simdtex.live.results import Result, Results
from simdtex.live.words import METHODS, TABLES, controls
from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.options import one_of, resolve

__all__ = ["MAX_BYTES", "MAX_PIXELS", "Message", "Send", "Session"]

Send = Callable[[Message, Sequence[bytes]], None]

MAX_BYTES = 2**27
"""Bytes of a file that the page gives, at most."""

MAX_PIXELS = 2**25
"""Pixels of a picture that the page gives, at most."""

MAX_MAPS = 16
"""Further maps of a material, at most."""

PREVIEW = 512
"""The longest side of the preview of the picture, pixels."""

LARGE = 1024
"""The middle of a picture with a longer side is the sample at first."""

INTERVAL = 20
"""Time between two frames of a run in units of what the last one took: frames take about 1 / 20 of a run."""

MAX_RATE = 30
"""Frames a second, at most."""

MAX_UNSEEN = 2
"""Frames that are sent before the page has shown one, at most."""

log = logging.getLogger(__name__)


class Cancelled(Exception):
    """The run is no longer wanted."""


class Session:
    """The picture, the run and the results of one page.

    Parameters
    ----------
    send : callable
        ``send(message, buffers)`` takes a message to the page; the session's thread calls it.
    machine : Machine
    picture : Picture, optional
        What the page begins with.

    Notes
    -----
    One thread handles the messages, one after another: between runs, and during a run in its callback. A request for
    another run, or another picture, ends the run.
    """

    def __init__(self, send: Send, machine: Machine, picture: Picture | None = None) -> None:
        self.key = secrets.token_urlsafe(16)  # by which a page that comes back finds its session
        self.send, self._machine, self._picture = send, machine, picture
        self._maps: dict[str, NDArray[Any]] = {}
        self.results = Results()
        self._selected: int | None = None  # the result that the page shows; None for the run or the sample
        self._window = frames.Window()
        self._wanted: Message | None = None  # the job that is asked for, until it is finished
        self._begun: Message | None = None  # the message that announced the present run
        self._paused = self._closed = False
        self._stale = False  # whether the page waits for another frame
        self._unseen = 0  # frames that the page has not shown yet
        self._next_frame = 0.0  # when the run may be shown again
        self._levels: Levels | None = None
        self._messages: queue.SimpleQueue[tuple[Any, Sequence[Any]]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def receive(self, message: Any, buffers: Sequence[Any] = ()) -> None:
        """Handle a message of the page later; an error is sent back as one sentence."""
        self._messages.put((message, buffers))

    def close(self, wait: float = 0.0) -> None:
        """End the run and the thread; wait for it, so many seconds at most."""
        self._closed = True
        self.receive({"kind": "cancel"})
        self._thread.join(wait)

    def _work(self) -> None:
        while not self._closed:
            self._handle(*self._messages.get())
            self._handle_all()
            while self._wanted and not self._closed:
                self._run(self._wanted)
                self._handle_all()
            if self._stale:
                self._show_selected()

    def _handle_all(self) -> None:
        while not self._messages.empty():
            self._handle(*self._messages.get())

    def _handle(self, message: Any, buffers: Sequence[Any]) -> None:
        kind = message.get("kind") if isinstance(message, dict) else None
        handler = getattr(self, f"_on_{kind}", None)
        with self._reported():
            if handler is None:
                raise ValueError("the page and simdtex are of different versions; load the page again")
            handler(message, buffers)

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Tell the page in a sentence what goes wrong in this block, or what is still to be painted."""
        kind = "error"
        try:
            yield
            return
        except Hint as hint:
            kind, sentence = "hint", str(hint)
        except (ValueError, TypeError) as error:
            sentence = str(error)
        except MemoryError:
            sentence = "there is not enough memory for this; give a smaller size"
        except Exception:
            log.exception("a request of the live page failed")
            sentence = "this is an error in simdtex itself; the terminal says more"
        self.send({"kind": kind, "text": sentence}, [])

    def _on_hello(self, message: Message, buffers: Sequence[Any]) -> None:
        """Send everything that the page shows: it may have been loaded again during a run."""
        tables = {name: controls(name) for name in TABLES}
        hello = {"version": version("simdtex"), "device": self._machine.name, "controls": tables, "bytes": MAX_BYTES}
        hello |= {"methods": METHODS, "examples": list(EXAMPLES), "colours": LABELS.tolist()}
        self.send({"kind": "hello", **hello, "session": self.key, "fresh": self._picture is None}, [])
        self._unseen = 0
        if self._picture is None:
            return
        self._send_picture(new=not self.results and not self._begun)
        for result in self.results.values():
            self._send_result(result)
        if self._begun:
            self._selected, self._stale = None, True
            self.send(self._begun, [])
        else:
            self._select(self._selected)

    def _on_open(self, message: Message, buffers: Sequence[Any]) -> None:
        self._open(_read(message, buffers))

    def _on_example(self, message: Message, buffers: Sequence[Any]) -> None:
        one_of("example", message.get("name"), EXAMPLES)
        self._open(Picture(f"{message['name']}.png", example(message["name"])[:192, :192], None))

    def _open(self, picture: Picture) -> None:
        self._picture, self._maps, self._levels = picture, {}, None
        self._wanted, self._selected, self._stale, self._paused = None, None, True, False
        self._send_picture(new=True)

    def _on_map(self, message: Message, buffers: Sequence[Any]) -> None:
        given = _read(message, buffers)
        if self._picture is None:
            raise ValueError("a map belongs to a picture; give the picture first")
        size, wanted = (f"{one.pixels.shape[1]}x{one.pixels.shape[0]}" for one in (given, self._picture))
        if size != wanted:
            raise ValueError(f"{given.name} is {size} and the picture {wanted}; give a map of the picture's size")
        if len(self._maps) >= MAX_MAPS:
            raise ValueError(f"there are {MAX_MAPS} maps already; remove one first")
        self._maps[file_stem(given.name, "map")] = given.pixels
        self.send({"kind": "maps", "names": list(self._maps)}, [])

    def _on_unmap(self, message: Message, buffers: Sequence[Any]) -> None:
        self._maps.pop(str(message.get("name")), None)
        self.send({"kind": "maps", "names": list(self._maps)}, [])

    def _on_make(self, message: Message, buffers: Sequence[Any]) -> None:
        if self._picture is None:
            raise ValueError("there is no picture yet; give one first")
        self._wanted, self._paused = message, False

    def _on_pause(self, message: Message, buffers: Sequence[Any]) -> None:
        self._paused = self._stale = True

    def _on_resume(self, message: Message, buffers: Sequence[Any]) -> None:
        self._paused = False

    def _on_cancel(self, message: Message, buffers: Sequence[Any]) -> None:
        self._wanted, self._paused = None, False

    def _on_view(self, message: Message, buffers: Sequence[Any]) -> None:
        self._window, self._stale = frames.parse_window(message), True

    def _on_shown(self, message: Message, buffers: Sequence[Any]) -> None:
        self._unseen = max(0, self._unseen - 1)

    def _on_select(self, message: Message, buffers: Sequence[Any]) -> None:
        number = message.get("result")
        if number is not None:
            self.results.find(number)
        self._select(number)

    def _on_download(self, message: Message, buffers: Sequence[Any]) -> None:
        result, name = self.results.find(message.get("result")), str(message.get("name"))
        self.send({"kind": "file", "name": name, "result": result.number}, [result.file(name)])

    def _send_picture(self, *, new: bool) -> None:
        assert self._picture is not None
        pixels = self._picture.pixels
        rows, cols = pixels.shape[:2]
        preview = frames.thumbnail(frames.picture(pixels, pixels), PREVIEW)
        width, height = min(cols, LARGE), min(rows, LARGE)
        part = [(cols - width) // 2, (rows - height) // 2, width, height] if max(rows, cols) > LARGE else None
        fields = {"name": self._picture.name, "width": cols, "height": rows, "values": str(pixels.dtype), "part": part}
        fields |= {"new": new, "preview": [preview.width, preview.height], "maps": list(self._maps)}
        self.send({"kind": "picture", **fields}, [preview.pixels])

    def _send_result(self, result: Result) -> None:
        dropped = self.results.dropped
        self.send({"kind": "result", **result.describe(), "dropped": dropped}, [result.thumbnail.pixels])

    def _select(self, number: int | None, restore: bool = True) -> None:
        """Have the page show a result, and its settings if they are to be restored."""
        self._selected, self._stale = number, True
        self.send({"kind": "selected", "result": number, "restore": restore}, [])

    def _send_frame(self, layers: Mapping[str, Callable[[], frames.Layer]], of: str | int, smooth: bool = True) -> None:
        """Send the window of the layer that the page looks at, of a result, the run or the sample."""
        assert self._picture is not None
        name, pixels = self._window.layer, self._picture.pixels
        if name == "sample" or not layers:
            name, layer = "sample", frames.picture(pixels, pixels)
        else:
            name = name if name in layers else next(iter(layers))
            layer = layers[name]()
        frame = frames.render(layer, self._window, smooth=smooth)._asdict()
        pixels = frame.pop("pixels")
        fields = {"layer": name, "rows": layer.shape[0], "cols": layer.shape[1], "step": self._window.step, "of": of}
        self._stale = False
        self._unseen += 1
        self.send({"kind": "frame", **fields, **frame}, [pixels])

    def _show_selected(self) -> None:
        """Send a frame of the selected result, or of the sample."""
        if result := self.results.get(self._selected or 0):
            self._send_frame(result.layers, result.number)
        elif self._picture:
            self._send_frame({}, "sample")

    def _run(self, message: Message) -> None:
        """Make what a message asks for, unless something else is asked for meanwhile."""
        assert self._picture is not None
        with self._reported(), suppress(Cancelled):
            try:
                job = Job(message, self._picture, self._maps, self.results.find)
                levels = self._begin(job)
                began = time.perf_counter()
                image, output = job.run(self._machine, partial(self._watch, job), levels.checkpointing)
                result = self.results.add(job, image, output, time.perf_counter() - began)
                self._begun = None
                self._send_result(result)
                if self._selected not in self.results:
                    self._select(result.number, restore=False)
            finally:
                if self._begun:
                    self._begun = None
                    self.send({"kind": "ended"}, [])
                if self._wanted is message:
                    self._wanted = None

    def _begin(self, job: Job) -> Levels:
        """Find the level that the run starts from, and tell the page."""
        key = {name: value for name, value in job.message.items() if name != "options"}
        restarts = job.method == "mrf" and job.kind != "fill"
        options = resolve(mrf.Options, job.kind, job.options if restarts else {})
        levels = Levels(key if restarts else None, options, self._levels)
        first = "labels" if job.kind == "classify" else "picture"
        layers = [first, "sample", *(["arrangement", "use", "temperature"] if job.method == "mrf" else [])]
        size = {"width": job.shape[1], "height": job.shape[0]}
        self._begun = {"kind": "begun", **size, "from": levels.level, "layers": layers}
        self._levels, self._selected, self._stale = levels, None, True
        self.send(self._begun, [])
        return levels

    def _watch(self, job: Job, progress: Any) -> None:
        """Handle messages during a run, show it, and wait while it is paused; the run's callback."""
        while True:
            self._handle_all()
            if self._wanted is not job.message:
                raise Cancelled
            due = not self._paused and time.perf_counter() >= self._next_frame
            if self._unseen < MAX_UNSEEN and (self._stale or due):
                self._show_run(job, progress)
            if not self._paused:
                return
            self._handle(*self._messages.get())

    def _show_run(self, job: Job, progress: Any) -> None:
        """Send how far the run is, and a frame of it or of the selected result."""
        fields = {"fraction": progress.fraction, "doing": progress.doing, "level": progress.level}
        self.send({"kind": "progress", **fields, "paused": self._paused}, [])
        if self._selected is None:
            self._machine.sync()  # the time of the run's kernels is not the frame's
        began = time.perf_counter()
        if self._selected is None:
            source, temperature = getattr(progress, "source", None), getattr(progress, "temperature", None)
            layers = job.layers(progress.picture, source, temperature, ended=False)
            self._send_frame(layers, "run", smooth=False)
        elif self._stale:
            self._show_selected()
        self._next_frame = began + max(1 / MAX_RATE, INTERVAL * (time.perf_counter() - began))


def _read(message: Message, buffers: Sequence[Any]) -> Picture:
    """Return the picture in the file that came with a message."""
    name = message.get("name")
    if not isinstance(name, str) or len(buffers) != 1:
        raise ValueError("no file came with that; give the picture again")
    data = bytes(buffers[0])
    if len(data) > MAX_BYTES:
        raise ValueError(f"the file has {len(data)} bytes and at most {MAX_BYTES} are taken; give a smaller one")
    name = name.replace("\\", "/").rpartition("/")[2][:100] or "picture"
    if not data:
        raise ValueError(f"{name} is empty (0 bytes): give a file with an image in it")
    found = read_bytes(name, data, max_pixels=MAX_PIXELS)
    return Picture(name, found.pixels, found.channel_axis, found.metadata)
