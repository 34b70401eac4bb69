# SPDX-License-Identifier: BSD-3-Clause
"""The session of a page: it receives messages, makes one output at a time, and sends frames of it.

A message is a dict with a ``kind``, and buffers. The connection passes messages of the page to `Session.receive`, and
the session passes its own to ``send``; ``docs/live.rst`` lists them.
"""

from __future__ import annotations

import logging
import queue
import secrets
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from functools import cache, partial
from importlib.metadata import version
from math import inf
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import Checkpointing, pack
from simdtex.io.image import EXAMPLES, TISSUE, Image, example, read_bytes
from simdtex.jobs.synthesis.job import synthesize
from simdtex.live import frames
from simdtex.live.job import MIN_REGION, Hint, Message, PageJob, Picture, file_stem, offered, told
from simdtex.live.results import THUMBNAIL, Inside, PageResults, Result, film
from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.model.display import temperature_colours
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import plain, regular
from simdtex.model.source_map import map_role
from simdtex.options import one_of, resolve, table
from simdtex.run import Progress

Send = Callable[[Message, Sequence[bytes]], None]

MAX_BYTES = 2**27  # of a file from the page
MAX_PIXELS = 2**25  # of a picture from the page
MAX_MAPS = 16  # further maps of a material
MAX_HELD = 2**29  # bytes of a picture and its further maps
MAX_STATE = 2**27  # bytes of the state of a run at the end of a level, which is kept
MAX_QUEUE = 64  # messages that wait to be handled
READ_WAIT = 60.0  # seconds to read a picture from the page

STARTING_SIDE = 512  # about the longest side of the first output, else twice its sample; and of a large sample; pixels
LARGE = 1024  # of a picture with a longer side the first sample is the middle, so that the run ends soon, pixels
PREVIEW = 512  # longest side of the preview of the picture, pixels
DEMO_SIDE = 160  # of the demonstration run on a page without a picture, pixels

FILMED = ("coloring", "checkerboard", "synchronous", "raster")
"""The schedules of which a page gets films."""

INTERVAL = 4  # time between two frames in times to make the last one: frames take at most a quarter of a run
MAX_RATE = 30  # frames per second
MAX_UNSEEN = 2  # frames that are sent and not yet shown by the page

log = logging.getLogger(__name__)


class Cancelled(Exception):
    """The run is cancelled."""


class Levels:
    """The states of a run of ``mrf`` at the end of each level; it begins with those shared with ``before``."""

    def __init__(self, key: Any, options: mrf.Options, before: Levels | None = None) -> None:
        self._key, self._options = key, options  # the job without its options; None keeps no state
        self._states: dict[int, Any] = {}
        if before is not None and key is not None and before._key == key and before._states:
            first = mrf.begins(before._options, options, 1 + max(before._states))
            self._states = {level: state for level, state in before._states.items() if level > first}

    @property
    def level(self) -> int | None:
        """The level after which the run starts; None if it starts from the beginning."""
        return min(self._states, default=None)

    @property
    def checkpointing(self) -> Checkpointing:
        """The state that the run starts from, and the function that receives its states."""
        state = None if self.level is None else deepcopy(self._states[self.level])
        return Checkpointing(state, self._offer)

    def _offer(self, info: Any, tree: Callable[[], Any]) -> None:
        """Keep the state at the end of a level."""
        if self._key is None or not getattr(info, "ended", False):
            return
        state = tree()
        if sum(array.nbytes for array in pack(state)[1]) <= MAX_STATE:
            self._states[info.level] = deepcopy(state)  # the run changes parts of it


class Session:
    """The picture, the run and the results of one page.

    Parameters
    ----------
    send : callable
        ``send(message, buffers)`` sends a message to the page; the session's thread calls it.
    machine : Machine
    picture : Picture, optional
        The first picture of the page.

    Notes
    -----
    One thread handles the messages, one after another, between runs and in the callback of a run. A request for another
    run, or another picture, ends the run.
    """

    def __init__(self, send: Send, machine: Machine, picture: Picture | None = None) -> None:
        self.key = secrets.token_urlsafe(16)  # with which a page that reconnects finds its session
        self.send, self._machine, self._picture = send, machine, picture
        self._maps: dict[str, NDArray[Any]] = {}
        self.results = PageResults()
        self._selected: int | None = None  # the result that the page shows; None for the run or the sample
        self._inside: dict[int, Inside] = {}  # the replayed results: the shown one, and one beside it
        self._films: Iterator[bool] = iter(())  # the films that are still to be made
        self._view = frames.View()
        self._wanted: Message | None = None  # the requested job, until it is finished
        self._asked: Message | None = None  # the last requested job with this picture
        self._refused = ""  # why the last job could not be done
        self._begun: Message | None = None  # the message that announced the current run
        self._job: PageJob | None = None  # the job of the current run
        self._paused = self._closed = False
        self._stale = False  # whether the page waits for another frame
        self._unseen = 0  # frames that the page has not shown yet
        self._next_frame = 0.0  # when the run may be shown again
        self._levels: Levels | None = None
        self._messages: queue.SimpleQueue[tuple[Any, Sequence[Any], threading.Event]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def receive(self, message: Any, buffers: Sequence[Any] = ()) -> threading.Event:
        """Queue a message of the page; return an event that is set when it is handled. Errors go back to the page."""
        handled = threading.Event()
        self._messages.put((message, buffers, handled))
        return handled

    def follow(self, handled: threading.Event, *, every: bool) -> None:
        """Wait until a message is handled; unless ``every``, only until fewer than `MAX_QUEUE` messages wait."""
        while not (self._closed or handled.is_set()) and (every or self._messages.qsize() >= MAX_QUEUE):
            handled.wait(0.01)

    def wait(self, timeout: float | None = None) -> Result:
        """Return the latest result when no run is left; start a first run if the picture has none.

        Raises ValueError if there is no picture or the job was refused or cancelled, and TimeoutError after ``timeout``
        seconds.
        """
        end = inf if timeout is None else time.monotonic() + timeout
        begun = self.receive({"kind": "begin"})
        while not begun.is_set() or self._wanted:
            if self._closed:
                raise ValueError("the page is closed; open another one")
            if time.monotonic() > end:
                raise TimeoutError(f"there is no result within {timeout} s")
            time.sleep(0.01)
        if self._picture is None:
            raise ValueError("there is no picture yet; give one first")
        if self._refused or not self.results:
            raise ValueError(self._refused or "the run was cancelled; ask for another one")
        return self.results[max(self.results)]

    def close(self, wait: float = 0.0) -> None:
        """End the run and the thread, and wait for the thread for at most ``wait`` seconds."""
        self._closed = True
        self.receive({"kind": "cancel"})
        self._thread.join(wait)

    def _work(self) -> None:
        while not self._closed:
            if not self._messages.empty() or not self._filming():
                self._handle(*self._messages.get())
            self._handle_all()
            while self._wanted and not self._closed:
                self._run(self._wanted)
                self._handle_all()
            if self._stale and self._unseen < MAX_UNSEEN:
                with self._reported():
                    self._show_selected()

    def _filming(self) -> bool:
        """Make the next film; return False if there is none."""
        with self._reported():
            return next(self._films, False)
        return False

    def _handle_all(self) -> None:
        while not self._messages.empty():
            self._handle(*self._messages.get())

    def _handle(self, message: Any, buffers: Sequence[Any], handled: threading.Event) -> None:
        kind = message.get("kind") if isinstance(message, dict) else None
        handler = getattr(self, f"_on_{kind}", None)
        with self._reported():
            if handler is None:
                raise ValueError("the page and simdtex are of different versions; load the page again")
            handler(message, buffers)
        handled.set()

    @contextmanager
    def _reported(self, job: str = "") -> Iterator[None]:
        """Send the page a sentence about an error in this block, or about what is still to be painted for a ``job``."""
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
        self.send({"kind": kind, "text": told(sentence), "job": job}, [])
        if job:
            self._refused = sentence
            if job not in ("fill", "classify"):  # these use the result or the picture that is shown
                self._select(None)

    def _on_hello(self, message: Message, buffers: Sequence[Any]) -> None:
        """Send everything that the page shows, since it may have been reloaded during a run."""
        small = {name: frames.thumbnail(frames.picture(image, image), THUMBNAIL) for name, image in _examples().items()}
        hello = {"version": version("simdtex"), "device": self._machine.name, "bytes": MAX_BYTES, **offered()}
        hello |= {"examples": {name: [frame.width, frame.height] for name, frame in small.items()}}
        hello |= {"scale": temperature_colours(np.linspace(0, 1, 9)).tolist()}
        hello |= {"session": self.key, "fresh": self._picture is None}
        self.send({"kind": "hello", **hello}, [frame.pixels for frame in small.values()])
        self._unseen = 0
        if self._picture is None:
            return
        self._send_picture(new=self._asked is None)
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
        one_of("example", message.get("name"), _examples())
        pixels = _examples()[message["name"]]
        self._open(Picture(f"{message['name']}.png", pixels, None if pixels.ndim == 2 else -1))

    def _on_lead(self, message: Message, buffers: Sequence[Any]) -> None:
        """Send the place of the picture among the names of a material's files: its albedo, or else the first."""
        roles = [map_role(str(name)) for name in message.get("names", [])]
        self.send({"kind": "lead", "place": roles.index("albedo") if "albedo" in roles else 0}, [])

    def _open(self, picture: Picture) -> None:
        self._picture, self._maps, self._levels, self._films = picture, {}, None, iter(())
        self._wanted, self._selected, self._stale, self._paused = None, None, True, False
        self._asked = None
        self._send_picture(new=True)

    def _on_demo(self, message: Message, buffers: Sequence[Any]) -> None:
        """Send the pictures of a small run to a page without a picture; any message ends the run."""
        if self._picture is not None:
            return
        side, shape = 3 * DEMO_SIDE // 5, (DEMO_SIDE, DEMO_SIDE)
        sample = example(TISSUE)[:side, :side]
        pictures: list[bytes] = []

        def keep(progress: Progress) -> None:
            if self._closed or not self._messages.empty():
                raise Cancelled
            if progress.stage and (progress.level < progress.levels - 1 or progress.sweep % 4 == 0):
                layer = frames.picture(progress.image(), sample, shape)
                pictures.append(frames.thumbnail(layer, DEMO_SIDE).pixels)

        with suppress(Cancelled):
            synthesize(sample, shape, channel_axis=-1, rng=1, device=self._machine, callback=keep)
            self.send({"kind": "demo", "width": DEMO_SIDE, "height": DEMO_SIDE}, pictures)

    def _on_map(self, message: Message, buffers: Sequence[Any]) -> None:
        further = _read(message, buffers)
        if self._picture is None:
            raise ValueError("a map belongs to a picture; give the picture first")
        size, wanted = (f"{image.pixels.shape[1]}x{image.pixels.shape[0]}" for image in (further, self._picture))
        if size != wanted:
            raise ValueError(f"{further.name} is {size} and the picture {wanted}; give a map of the picture's size")
        if len(self._maps) >= MAX_MAPS:
            raise ValueError(f"there are {MAX_MAPS} maps already; remove one first")
        held = sum(pixels.nbytes for pixels in (further.pixels, self._picture.pixels, *self._maps.values()))
        if held > MAX_HELD:
            raise ValueError(
                f"the picture and its maps have {held} bytes and at most {MAX_HELD} are held; remove a map"
            )
        self._maps[file_stem(further.name, "map")] = further.pixels
        self.send({"kind": "maps", "names": list(self._maps)}, [])

    def _on_unmap(self, message: Message, buffers: Sequence[Any]) -> None:
        self._maps.pop(str(message.get("name")), None)
        self.send({"kind": "maps", "names": list(self._maps)}, [])

    def _on_make(self, message: Message, buffers: Sequence[Any]) -> None:
        if self._picture is None:
            raise ValueError("there is no picture yet; give one first")
        self._wanted = self._asked = message
        self._paused, self._refused = False, ""

    def _on_begin(self, message: Message, buffers: Sequence[Any]) -> None:
        """Start a first run with the picture, as the page does, if no job has been requested."""
        if self._picture is not None and self._asked is None:
            part, (width, height) = _beginning(self._picture)
            first: Message = {"kind": "make", "job": "synth", "method": "mrf", "seed": 1, "options": {}, "part": part}
            self._on_make(first | {"width": width, "height": height}, [])
            self._send_picture(new=False)

    def _on_pause(self, message: Message, buffers: Sequence[Any]) -> None:
        self._paused = self._stale = True

    def _on_resume(self, message: Message, buffers: Sequence[Any]) -> None:
        self._paused = False

    def _on_cancel(self, message: Message, buffers: Sequence[Any]) -> None:
        self._wanted, self._paused = None, False

    def _on_view(self, message: Message, buffers: Sequence[Any]) -> None:
        self._view, self._stale = frames.parse_view(message), True

    def _on_shown(self, message: Message, buffers: Sequence[Any]) -> None:
        self._unseen = max(0, self._unseen - 1)

    def _on_select(self, message: Message, buffers: Sequence[Any]) -> None:
        key = message.get("result")
        if key is not None:
            self.results.find(key)
        self._select(key, restore=True)

    def _on_forget(self, message: Message, buffers: Sequence[Any]) -> None:
        """Delete a result; of those that are left, the page shows the latest if it showed this one."""
        key = self.results.find(message.get("result")).number
        del self.results[key]
        if key == self._selected:
            self._select(max(self.results, default=None))

    def _on_inside(self, message: Message, buffers: Sequence[Any]) -> None:
        """Replay the selected result and, side by side, another one; or close the replays."""
        if not message.get("open"):
            self._inside, self._stale = {}, True
            return
        if self._job:
            raise ValueError("a run is going on; look inside when it has ended")
        shown = self._selected
        if shown is None:
            raise ValueError("there is no result to look into yet; make one first")
        kept, self._inside = self._inside, {}
        both = [self.results.find(key) for key in dict.fromkeys([shown, message.get("beside") or shown])]
        self._inside = {each.number: kept.get(each.number) or Inside(each.job, self._machine) for each in both}
        samples = [frames.thumbnail(inside.sample, PREVIEW) for inside in self._inside.values()]
        panes = [
            {"result": key, "preview": [small.width, small.height], **inside.describe()}
            for small, (key, inside) in zip(samples, self._inside.items(), strict=True)
        ]
        self._stale = True
        self.send({"kind": "inside", "panes": panes}, [small.pixels for small in samples])

    def _on_seek(self, message: Message, buffers: Sequence[Any]) -> None:
        """Show a moment of the replayed results or, without a level, the results."""
        for inside in self._inside.values():
            inside.seek(message.get("level"), message.get("sweep"), message.get("sets"))
        self._stale = True
        self.send({"kind": "moments", "moments": [inside.moment for inside in self._inside.values()]}, [])

    def _on_explain(self, message: Message, buffers: Sequence[Any]) -> None:
        row, col = message.get("row"), message.get("col")
        for pane, inside in enumerate(self._inside.values()):
            try:
                why = inside.explain(row, col, order=message.get("order"), trust=message.get("trust", 0))
            except ValueError as error:
                why = {"pixel": [row, col], "reason": str(error)}
            self.send({"kind": "explained", "pane": pane, **why}, [])

    def _on_schedules(self, message: Message, buffers: Sequence[Any]) -> None:
        """Make films of a small run with each of `FILMED`, one at a time, while no other message waits."""
        if self._picture is None:
            raise ValueError("there is no picture yet; give one first")
        self._films = self._make_films(PageJob(message, self._picture, self._maps, self.results.find))

    def _make_films(self, job: PageJob) -> Iterator[bool]:
        """Send a film of a job with each of `FILMED`, and yield True after each."""
        for name in FILMED:
            message = job.message | {"options": job.options | {"schedule": name}}
            described, pictures = film(PageJob(message, *job.material, self.results.find), self._machine)
            self.send({"kind": "schedule", "name": name, **described}, pictures)
            yield True

    def _on_download(self, message: Message, buffers: Sequence[Any]) -> None:
        result, name = self.results.find(message.get("result")), str(message.get("name"))
        self.send({"kind": "file", "name": name}, [result.file(name)])

    def _send_picture(self, *, new: bool) -> None:
        assert self._picture is not None
        pixels = self._picture.pixels
        rows, cols = pixels.shape[:2]
        preview = frames.thumbnail(frames.picture(pixels, pixels), PREVIEW)
        part, size = _beginning(self._picture)
        fields = {"name": self._picture.name, "width": cols, "height": rows, "values": str(pixels.dtype), "part": part}
        fields |= {"new": new, "preview": [preview.width, preview.height], "maps": list(self._maps), "size": size}
        fields |= {"more": self._picture.metadata.more, "settings": self._asked}
        self.send({"kind": "picture", **fields}, [preview.pixels])

    def _send_result(self, result: Result) -> None:
        dropped = self.results.dropped
        self.send({"kind": "result", **result.describe(), "dropped": dropped}, [result.thumbnail.pixels])

    def _select(self, key: int | None, *, restore: bool = False) -> None:
        """Select the result to show, or the run; with ``restore`` also its picture, its maps and its settings."""
        if key not in self._inside:
            self._inside = {}
        self._selected, self._stale = key, True
        job = self._job if key is None else self.results[key].job
        settings = None
        if job and restore:
            settings = self._asked = job.message
            picture, maps = job.material
            if picture is not self._picture:
                self._levels = None
            before, after = ((image, *maps.values()) for image, maps in ((self._picture, self._maps), job.material))
            if [id(each) for each in before] != [id(each) for each in after]:
                self._picture, self._maps = picture, dict(maps)
                self._send_picture(new=False)
        self.send({"kind": "selected", "result": key, "settings": settings}, [])

    def _send_frame(
        self, layers: Mapping[str, Callable[[], frames.Layer]], of: str | int, smooth: bool = True, pane: int = 0
    ) -> None:
        """Send the page's view of its layer, of a result, the run or the sample."""
        assert self._picture is not None
        picture = self._picture.pixels
        layers = {**layers, "sample": layers.get("sample", lambda: frames.picture(picture, picture))}
        name = self._view.layer if self._view.layer in layers else next(iter(layers))
        layer = layers[name]()
        frame = frames.render(layer, self._view, smooth=smooth)._asdict()
        pixels = frame.pop("pixels")
        fields = {"layer": name, "rows": layer.shape[0], "cols": layer.shape[1], "step": self._view.step, "of": of}
        self._stale = False
        self._unseen += 1
        self.send({"kind": "frame", **fields, "pane": pane, **frame}, [pixels])

    def _show_selected(self) -> None:
        """Send a frame of the selected result and of the one beside it, or of the sample."""
        for pane, (key, inside) in enumerate(self._inside.items()):
            self._send_frame(inside.layers(self.results[key].layers), key, pane=pane)
        if self._inside:
            return
        if result := self.results.get(self._selected or 0):
            self._send_frame(result.layers, result.number)
        elif self._picture:
            self._send_frame({}, "sample")

    def _run(self, message: Message) -> None:
        """Run the job of a message, unless another job is requested meanwhile."""
        assert self._picture is not None
        with self._reported(str(message.get("job"))), suppress(Cancelled):
            try:
                job = PageJob(message, self._picture, self._maps, self.results.find)
                levels = self._begin(job)
                began = time.perf_counter()
                image, output = job.run(self._machine, partial(self._watch, job), levels.checkpointing)
                result = self.results.add(job, image, output, time.perf_counter() - began)
                self._begun = self._job = None
                self._send_result(result)
                if self._selected not in self.results:
                    self._select(result.number)
            finally:
                if self._begun:
                    self._begun = self._job = None
                    self.send({"kind": "ended"}, [])
                if self._wanted is message:
                    self._wanted = None

    def _begin(self, job: PageJob) -> Levels:
        """Return the states of the run, with the level that it starts from, and send that to the page."""
        key = {name: value for name, value in job.message.items() if name != "options"}
        restarts = job.method == "mrf" and job.kind != "fill"
        searched = {name: value for name, value in job.options.items() if name in table(mrf.Options)}
        key |= {name: value for name, value in job.options.items() if name not in searched}  # of inputs
        options = resolve(mrf.Options, job.kind, searched if restarts else {})
        levels = Levels(key if restarts else None, options, self._levels)
        first = "labels" if job.kind == "classify" else "picture"
        layers = [first, "sample", *(["arrangement", "use", "temperature"] if job.method == "mrf" else [])]
        self._begun = {"kind": "begun", "from": levels.level, "layers": layers}
        self._levels, self._selected, self._stale, self._job, self._inside = levels, None, True, job, {}
        self.send(self._begun, [])
        return levels

    def _watch(self, job: PageJob, progress: Progress) -> None:
        """Handle messages during a run, show it, and wait while it is paused: the callback of the run."""
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

    def _show_run(self, job: PageJob, progress: Progress) -> None:
        """Send the progress of the run, and a frame of it or of the selected result."""
        fields = {"fraction": progress.fraction, "doing": progress.doing, "level": progress.level}
        self.send({"kind": "progress", **fields, "paused": self._paused}, [])
        if self._selected is None:
            self._machine.sync()  # so that the frame's time excludes the run's kernels
        began = time.perf_counter()
        if self._selected is None:
            temperature = progress.maps.get("temperature")
            layers = job.layers(progress.image, progress.source, temperature, ended=False)
            self._send_frame(layers, "run", smooth=False)
        elif self._stale:
            self._show_selected()
        self._next_frame = began + max(1 / MAX_RATE, INTERVAL * (time.perf_counter() - began))


@cache
def _examples() -> dict[str, NDArray[np.uint8]]:
    """Return the pictures that the page offers, by name; the first is in colour."""
    return {name: example(name)[:192, :192] for name in (TISSUE, *EXAMPLES)}


def _beginning(picture: Picture) -> tuple[list[int] | None, list[int]]:
    """Return the part of a picture that is the first sample, None for all, and the output's width and height."""
    rows, cols = picture.pixels.shape[:2]
    width, height, part = cols, rows, None
    if max(rows, cols) > LARGE:
        width, height = min(cols, STARTING_SIDE), min(rows, STARTING_SIDE)
        part = [(cols - width) // 2, (rows - height) // 2, width, height]
    size = (min(2 * height, STARTING_SIDE), min(2 * width, STARTING_SIDE))
    if max(rows, cols) <= STARTING_SIDE and min(rows, cols) >= MIN_REGION:
        pixels = picture.pixels.reshape(rows, cols, -1)
        if np.isfinite(pixels).all():
            (grey,), (known,) = plain(Pictures((pixels,)))
            lattice = regular(grey, known)
            size = lattice.fitting(size) if lattice else size
    return part, [size[1], size[0]]


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
    image = read_apart(name, data)
    return Picture(name, image.pixels, image.channel_axis, image.metadata)


def read_apart(name: str, data: bytes) -> Image:
    """Return the picture in the bytes of a file, read in a process of its own, which is ended after `READ_WAIT`."""
    context = get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_reading, args=(there, name, data), daemon=True)
    process.start()
    there.close()
    try:
        late = ValueError(f"{name} cannot be read within {READ_WAIT:.0f} s: save it again as PNG")
        answer: Image | ValueError = here.recv() if here.poll(READ_WAIT) else late
    except EOFError:
        answer = ValueError(f"{name} ends the process that reads it: save it again as PNG")
    finally:
        process.kill()
        here.close()
    if isinstance(answer, ValueError):
        raise answer
    return answer


def _reading(there: Connection, name: str, data: bytes) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        there.send(read_bytes(name, data, max_pixels=MAX_PIXELS))
    except ValueError as error:
        there.send(ValueError(str(error)))
