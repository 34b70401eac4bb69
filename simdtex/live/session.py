# SPDX-License-Identifier: BSD-3-Clause
"""A page's side of the work: it takes messages, makes one thing at a time, and shows it while it is made.

A message is a dict with a ``kind`` and a list of buffers, both ways; whatever carries it calls `Session.receive` and is
called by the session's ``send``, from any thread. ``docs/live.rst`` lists them.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable, Sequence
from contextvars import copy_context
from functools import partial
from importlib.metadata import version
from typing import Any

from numpy.typing import NDArray

from simdtex.io.image import read_bytes
from simdtex.live import looking, planes
from simdtex.live.jobs import Earlier, job
from simdtex.live.levels import Levels
from simdtex.live.looking import Look, Plane
from simdtex.live.recipe import stem
from simdtex.live.results import Result, Results
from simdtex.live.settings import Picture, parsed
from simdtex.live.words import METHODS, TABLES, controls
from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.options import resolve, whole

__all__ = ["BYTES", "PIXELS", "Session"]

Message = dict[str, Any]
Send = Callable[[Message, Sequence[bytes]], None]

BYTES = 2**27
"""Bytes of a file that a page gives, at most."""

PIXELS = 2**25
"""Pixels of a picture that a page gives, at most."""

MAPS = 16
"""Further maps of a material, at most."""

PREVIEW = 512
"""The longest side of the picture as it is shown small, pixels."""

LARGE = 1024
"""A picture with a longer side is too much to begin with: its middle is the sample until the page says otherwise."""

SHARE = 20
"""Time between two frames in units of what the last one took here: watching takes about 1 / 20 of a run."""

RATE = 30
"""Frames a second, at most."""

BESIDE = 0.1
"""Seconds between two words on a run while something else is looked at."""

AFTER = 0.5
"""Seconds without a wish before a result's figures of quality are computed."""

LAYERS = ("picture", "sample")
"""What can be looked at while a run goes on."""

OF_MRF = ("arrangement", "use", "temperature")
"""What there is besides while a run of ``mrf`` goes on."""

EXAMPLES = ("brick", "grass", "gravel")
"""Pictures of scikit-image that a page can begin with."""

log = logging.getLogger(__name__)


class Stopped(Exception):
    """The run is not wanted any more."""


class Session:
    """What one page has given and what was made for it.

    Parameters
    ----------
    send : callable
        ``send(message, buffers)`` brings a message to the page; it is called from several threads.
    machine : callable
        Gives the machine, once it is needed.

    Notes
    -----
    One thread makes things, one after another. A wish for something else ends what is being made.
    """

    def __init__(self, send: Send, machine: Callable[[], Machine]) -> None:
        self._send, self._machine = send, machine
        self._tasks: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._changed = threading.Condition()  # of what follows
        self._look = Look()
        self._paused = self._closed = False
        self._wish = 0  # counts what was wished for: a run of an earlier wish ends
        self._unseen = 0  # frames that the page has not seen yet
        self._picture: Picture | None = None
        self._pictures = 0
        self._made_any = False
        self._running: Message | None = None  # what the page was told when the run began
        self._maps: dict[str, NDArray[Any]] = {}
        self._results = Results()
        self._shown: int | None = None  # the result that is looked at; None: what is being made, else the picture
        self._unshown = False  # whether it is to be shown, beside a run
        self._levels: Levels | None = None
        self._next = 0.0  # when a frame may be shown
        self._thread: threading.Thread | None = None
        self._measuring: threading.Thread | None = None
        self._kinds: dict[str, Callable[[Message, Sequence[bytes]], None]] = {
            **{"hello": self._hello, "open": self._open, "example": self._example, "map": self._map},
            **{"unmap": self._unmap, "make": self._make, "stop": self._stop, "go": self._go, "end": self._end},
            **{"look": self._looks, "seen": self._saw, "choose": self._choose, "take": self._take},
        }

    # -- messages -------------------------------------------------------------------------------------------------

    def receive(self, message: Any, buffers: Sequence[Any] = ()) -> None:
        """Do what a message asks for; what is wrong with it is told to the page in a sentence."""
        kind = message.get("kind") if isinstance(message, dict) else None
        if not isinstance(kind, str) or kind not in self._kinds:
            self._say("the page and simdtex do not understand each other; load the page again")
            return
        try:
            self._kinds[kind](message, buffers)
        except (ValueError, TypeError) as error:
            self._say(str(error))

    def attach(self, send: Send) -> None:
        """Send to another page from now on, which has taken the place of the one before."""
        with self._changed:
            self._send, self._unseen = send, 0
            self._changed.notify_all()

    def close(self, wait: float = 0.0) -> None:
        """End what is being made, and the thread; wait so many seconds for it at most."""
        with self._changed:
            self._closed, self._wish = True, self._wish + 1
            self._changed.notify_all()
        self._tasks.put(None)
        if wait and self._thread is not None:
            self._thread.join(wait)

    @property
    def latest(self) -> Result | None:
        """The last result."""
        return self._results.latest

    def _say(self, sentence: str) -> None:
        self._send({"kind": "error", "text": sentence}, [])

    def _hello(self, message: Message, buffers: Sequence[Any]) -> None:
        """Tell the page all that it shows, at once: a run may be going on."""
        tables = {name: controls(name) for name in TABLES}
        hello = {"version": version("simdtex"), "device": self._machine().name, "controls": tables, "bytes": BYTES}
        hello |= {"methods": METHODS, "examples": list(EXAMPLES)}
        self._send({"kind": "hello", **hello, "fresh": self._picture is None}, [])
        if self._picture is not None:
            self._show_picture(new=not self._made_any)
            for result in self._results:
                self._tell(result, chosen=False)
            with self._changed:
                running = self._running
                self._shown = self._shown if running is None else None
            if running is not None:
                self._send(running, [])
                return
            if self._shown is not None:
                self._send({"kind": "chosen", "result": self._shown}, [])
            self._refresh()

    def _open(self, message: Message, buffers: Sequence[Any]) -> None:
        name, data = _file(message, buffers)
        self._do(lambda: self._opened(_read(name, data)), wish=True)

    def _example(self, message: Message, buffers: Sequence[Any]) -> None:
        name = message.get("name")
        if name not in EXAMPLES:
            raise ValueError(f"there is no example {name}; choose one of: {', '.join(EXAMPLES)}")
        self._do(lambda: self._opened(_example(str(name))), wish=True)

    def use(self, picture: Picture) -> None:
        """Take another picture, while nothing is being made; a page is told of it when it says hello."""
        self._picture, self._maps, self._shown = picture, {}, None
        self._pictures += 1

    def _opened(self, picture: Picture) -> None:
        self.use(picture)
        self._show_picture(new=True)
        self._refresh()

    def _show_picture(self, *, new: bool = False) -> None:
        assert self._picture is not None
        rows, cols = self._picture.pixels.shape[:2]
        step = -(-max(rows, cols) // PREVIEW)
        look = Look(width=-(-cols // step), height=-(-rows // step), step=step)
        seen = looking.seen(planes.picture(self._picture.pixels, self._picture.pixels), look)
        part = None
        if max(rows, cols) > LARGE:
            width, height = min(cols, LARGE), min(rows, LARGE)
            part = [(cols - width) // 2, (rows - height) // 2, width, height]
        told = {"name": self._picture.name, "width": cols, "height": rows, "step": step, "part": part}
        told |= {"values": str(self._picture.pixels.dtype), "new": new, "shown": [seen.width, seen.height]}
        self._send({"kind": "picture", **told, "maps": list(self._maps)}, [seen.pixels])

    def _map(self, message: Message, buffers: Sequence[Any]) -> None:
        name, data = _file(message, buffers)
        self._do(lambda: self._add_map(_read(name, data)))

    def _add_map(self, given: Picture) -> None:
        if self._picture is None:
            raise ValueError("a map goes with a picture; give the picture first")
        rows, cols = self._picture.pixels.shape[:2]
        if given.pixels.shape[:2] != (rows, cols):
            size = f"{given.pixels.shape[1]}x{given.pixels.shape[0]}"
            raise ValueError(f"{given.name} is {size} and the picture {cols}x{rows}; give a map of the picture's size")
        if len(self._maps) >= MAPS:
            raise ValueError(f"there are {MAPS} maps already; take one away first")
        plain = stem(given.name, "map")
        free = (name for name in (plain, *(f"{plain}-{n}" for n in range(2, MAPS + 2))) if name not in self._maps)
        self._maps[next(free)] = given.pixels
        self._send({"kind": "maps", "names": list(self._maps)}, [])

    def _unmap(self, message: Message, buffers: Sequence[Any]) -> None:
        name = message.get("name")
        self._do(lambda: self._drop_map(name))

    def _drop_map(self, name: Any) -> None:
        self._maps.pop(name, None)
        self._send({"kind": "maps", "names": list(self._maps)}, [])

    def _stop(self, message: Message, buffers: Sequence[Any]) -> None:
        self._set(paused=True)

    def _go(self, message: Message, buffers: Sequence[Any]) -> None:
        self._set(paused=False)

    def _end(self, message: Message, buffers: Sequence[Any]) -> None:
        self._set(paused=False, wish=True)

    def _set(self, *, paused: bool, wish: bool = False) -> None:
        with self._changed:
            self._paused = paused
            self._wish += wish
            self._changed.notify_all()

    def _looks(self, message: Message, buffers: Sequence[Any]) -> None:
        look = looking.parse(message)
        with self._changed:
            self._look = look
            self._next, self._unshown = 0.0, True
            self._changed.notify_all()
        self._do(partial(self._look_at, look))

    def _saw(self, message: Message, buffers: Sequence[Any]) -> None:
        with self._changed:
            self._unseen = max(0, self._unseen - 1)

    def _choose(self, message: Message, buffers: Sequence[Any]) -> None:
        number = message.get("result")
        if number is not None:
            whole("the result", number, 1)
            self._results.get(number)
        with self._changed:
            beside = self._running is not None
            if beside:
                self._shown, self._next, self._unshown = number, 0.0, True
                self._changed.notify_all()
        if beside:  # the run shows it
            self._send({"kind": "chosen", "result": number}, [])
        else:
            self._do(lambda: self._chosen(number))

    def _chosen(self, number: int | None) -> None:
        self._shown = number
        self._send({"kind": "chosen", "result": number}, [])
        self._refresh()

    def _take(self, message: Message, buffers: Sequence[Any]) -> None:
        number, what = message.get("result"), message.get("what")
        whole("the result", number, 1)
        result = self._results.get(int(number))  # type: ignore[arg-type]  # checked above
        threading.Thread(target=self._taken, args=(result, str(what)), daemon=True).start()  # beside what is made

    def _taken(self, result: Result, what: str) -> None:
        try:
            name, data = result.file(what)
        except (ValueError, TypeError, OSError) as error:
            self._say(str(error))
        else:
            self._send({"kind": "file", "name": name, "result": result.number, "what": what}, [data])

    # -- the thread -----------------------------------------------------------------------------------------------

    def _do(self, task: Callable[[], None], *, wish: bool = False) -> None:
        """Have the thread do something, after what it is doing; a wish ends that."""
        with self._changed:
            if self._closed:
                return
            if wish:
                self._wish, self._paused = self._wish + 1, False
                self._changed.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=copy_context().run, args=(self._work,), daemon=True)
                self._thread.start()
        self._tasks.put(task)

    def _work(self) -> None:
        while True:
            try:
                task = self._tasks.get(timeout=AFTER)
            except queue.Empty:
                self._figures()
                task = self._tasks.get()
            if task is None:
                return
            try:
                task()
            except Stopped:
                self._send({"kind": "ended"}, [])
            except (ValueError, TypeError, MemoryError) as error:
                memory = "the memory does not suffice for this; make it smaller"
                self._send({"kind": "ended"}, [])
                self._say(memory if isinstance(error, MemoryError) else str(error))
            except Exception:  # the page goes on, and whoever started it sees more
                log.exception("a wish of the page failed")
                self._send({"kind": "ended"}, [])
                self._say("something is wrong in simdtex itself; the terminal says more")

    def _make(self, message: Message, buffers: Sequence[Any]) -> None:
        with self._changed:
            wish = self._wish + 1
        self._do(lambda: self._made(message, wish), wish=True)

    def _made(self, message: Message, wish: int) -> None:
        if self._picture is None:
            raise ValueError("there is no picture yet; give one first")
        if wish != self._wish:  # another came after it
            return
        settings, self._made_any = parsed(message, self._picture), True
        earlier = None
        if settings.of is not None:
            before = self._results.get(settings.of)
            earlier = Earlier(before.image, before.maps, before.steps)
        asked = job(settings, self._picture, self._maps, earlier, self._pictures)
        of_mrf = settings.options if settings.method == "mrf" else {}
        options = resolve(mrf.Options, TABLES.get(settings.job, TABLES["mrf"])[1], of_mrf)
        key = asked.key if settings.method == "mrf" else None
        levels = Levels(key, options, self._levels)
        self._levels = levels
        rows, cols = asked.shape
        begun = {"kind": "begun", "width": cols, "height": rows, "from": levels.level}
        begun["layers"] = [*LAYERS, *(OF_MRF if settings.method == "mrf" else ())]
        with self._changed:
            self._running, self._shown = begun, None
        self._send(begun, [])
        self._next, began = 0.0, time.perf_counter()
        watch = partial(self._watch, wish, asked.sample, asked.shape)
        try:
            how = {"rng": settings.seed, "device": self._machine(), "checkpoint": levels.keep}
            image, output = asked.call(callback=watch, full_output=True, **how)
        finally:
            with self._changed:
                self._running = None
        seconds = time.perf_counter() - began
        steps = (*(earlier.steps if earlier else ()), asked.step)
        result = self._results.add(message, image, output, asked.sample, asked.maps, steps, seconds)
        if self._shown is None or self._shown in self._results.gone:  # else another one is looked at
            self._shown = result.number
        self._tell(result, chosen=self._shown == result.number)
        self._refresh()

    def _tell(self, result: Result, *, chosen: bool) -> None:
        told = {"kind": "result", **result.told(), "gone": self._results.gone, "chosen": chosen}
        self._send(told, [result.thumbnail])

    # -- what is seen ---------------------------------------------------------------------------------------------

    def _watch(self, wish: int, sample: NDArray[Any], shape: tuple[int, int], progress: Any) -> None:
        """Show a run while it goes on, or a result that is looked at beside it; wait while it is stopped."""
        if self._wish != wish:
            raise Stopped
        if time.perf_counter() >= self._next and self._unseen < 2:
            self._see(progress, sample, shape)
        while self._paused:
            seen = self._look, self._shown
            self._see(progress, sample, shape)
            with self._changed:
                self._changed.wait_for(partial(self._awake, wish, seen))
            if self._wish != wish:
                raise Stopped

    def _awake(self, wish: int, seen: tuple[Look, int | None]) -> bool:
        """Whether a stopped run has something to do: to go on, to end, or to show something else."""
        return not self._paused or self._wish != wish or (self._look, self._shown) != seen

    def _see(self, progress: Any, sample: NDArray[Any], shape: tuple[int, int]) -> None:
        """Show the run, or what is looked at beside it."""
        told = {"fraction": progress.fraction, "doing": progress.doing, "level": progress.level}
        told |= {"levels": progress.levels, "paused": self._paused}
        told |= {name: getattr(progress, name) for name in ("sweep", "temperature_left") if hasattr(progress, name)}
        if (number := self._shown) is None:
            self._show(progress, sample, shape, told)
            return
        if self._unshown:
            self._unshown = False
            self._show_result(number)
        self._send({"kind": "progress", **told}, [])
        self._next = time.perf_counter() + BESIDE

    def _show(self, progress: Any, sample: NDArray[Any], shape: tuple[int, int], told: Message) -> None:
        self._machine().sync()  # what the run has asked for is no part of what a frame takes
        began = time.perf_counter()
        layer = self._look.layer
        if layer not in (*LAYERS, *(OF_MRF if hasattr(progress, "source") else ())):
            layer = LAYERS[0]
        assert self._picture is not None
        given = self._picture.pixels
        made = {
            "picture": lambda: planes.picture(progress.picture(), sample, shape),
            "sample": lambda: planes.picture(given, given),
            "arrangement": lambda: planes.arrangement(progress.source(), sample, shape),
            "use": lambda: planes.use(progress.source(), sample),
            "temperature": lambda: planes.temperature(progress.temperature(), shape),
        }
        self._push(made[layer](), layer, told, smooth=False)
        took = time.perf_counter() - began
        self._next = began + max(1 / RATE, SHARE * took)

    def _look_at(self, look: Look) -> None:
        """Show what was asked for, unless something else has been since."""
        if look == self._look:
            self._refresh()

    def _refresh(self) -> None:
        """Show what is looked at while nothing is being made."""
        if self._shown is not None:
            self._show_result(self._shown)
        elif self._picture is not None:
            plane = planes.picture(self._picture.pixels, self._picture.pixels)
            self._push(plane, "sample", {"result": None}, smooth=True)

    def _show_result(self, number: int) -> None:
        result = self._results.get(number)
        layer, plane = result.plane(self._look.layer, self._picture.pixels if self._picture else None)
        self._push(plane, layer, {"result": result.number}, smooth=True)

    def _push(self, plane: Plane, layer: str, told: Message, *, smooth: bool) -> None:
        look = self._look
        seen = looking.seen(plane, look, smooth=smooth)
        rows, cols = plane.shape
        where = {"left": seen.left, "top": seen.top, "width": seen.width, "height": seen.height, "step": look.step}
        with self._changed:
            self._unseen += 1
        self._send({"kind": "frame", "layer": layer, "rows": rows, "cols": cols, **where, **told}, [seen.pixels])

    def _figures(self) -> None:
        """Have figures of quality computed beside what follows, of the result that is looked at."""
        if self._shown is None or (self._measuring is not None and self._measuring.is_alive()):
            return
        result = self._results.get(self._shown)
        if result.unmeasured:
            self._measuring = threading.Thread(target=self._measure, args=(result, self._wish), daemon=True)
            self._measuring.start()

    def _measure(self, result: Result, wish: int) -> None:
        while result.unmeasured and self._wish == wish:
            result.measure()
            self._send({"kind": "quality", "result": result.number, "figures": result.figures}, [])


def _file(message: Message, buffers: Sequence[Any]) -> tuple[str, bytes]:
    """The name and the bytes of a file that came with a message."""
    name = message.get("name")
    if not isinstance(name, str) or len(buffers) != 1:
        raise ValueError("no file came with that; give the picture again")
    data = bytes(buffers[0])
    if len(data) > BYTES:
        raise ValueError(f"the file has {len(data)} bytes and {BYTES} are taken at most; give a smaller one")
    return name.replace("\\", "/").rpartition("/")[2][:100] or "picture", data


def _read(name: str, data: bytes) -> Picture:
    if not data:
        raise ValueError(f"{name} is empty (0 bytes): give a file with an image in it")
    found = read_bytes(name, data, max_pixels=PIXELS)
    return Picture(name, found.pixels, found.channel_axis)


def _example(name: str) -> Picture:
    from skimage import data

    return Picture(f"{name}.png", getattr(data, name)()[:192, :192], None)
