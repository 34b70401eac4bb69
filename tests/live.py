"""What tests of the live page share: a page that has no browser, and pictures."""

import threading
import zipfile
from io import BytesIO

import numpy as np
import PIL.Image

from simdtex.live.session import Session
from simdtex.machine import open_machine


def texture(rows=40, cols=48, channels=3, dtype=np.uint8, seed=0):
    """A small picture that has some order."""
    rng = np.random.default_rng(seed)
    i, j = np.indices((rows, cols))
    base = 100 + 60 * np.sin(i / 3) * np.cos(j / 4)
    noisy = base[..., None] + rng.normal(0, 12, (rows, cols, channels))
    scale = 257 if dtype == np.uint16 else 1
    found = (noisy.clip(0, 255) * scale).astype(dtype)
    return found[..., 0] if channels == 1 else found


def png(pixels):
    """The bytes of a PNG."""
    file = BytesIO()
    PIL.Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def asked(**settings):
    """A wish with few levels, so that it is quick."""
    options = {"order": 4} if settings.get("method", "mrf") == "mrf" else {}
    wish = {"kind": "make", "job": "synth", "width": 36, "height": 28, "seed": 7}
    return wish | settings | {"options": options | settings.get("options", {})}


class Fake:
    """A page without a browser: it gives messages, and waits for those that come."""

    def __init__(self, *, sees=True, machine=None):
        self.got, self.sees = [], sees
        self._came = threading.Condition()
        machine = machine or open_machine("reference")
        self.session = Session(self.send, lambda: machine)

    def send(self, message, buffers):
        with self._came:
            self.got.append((message, buffers))
            self._came.notify_all()
        if self.sees and message["kind"] == "frame":
            self.session.receive({"kind": "seen"})

    def say(self, *buffers, **message):
        self.session.receive(message, buffers)

    def wait(self, *kinds, after=0, timeout=60):
        """The first message of one of these kinds that came after so many, and its buffers."""

        def found():
            return next((one for one in self.got[after:] if one[0]["kind"] in kinds), None)

        with self._came:
            assert self._came.wait_for(found, timeout), f"no {kinds} came, but {[one['kind'] for one, _ in self.got]}"
            return found()

    def ask(self, kinds, *buffers, **message):
        """Say something, and wait for an answer of these kinds."""
        after = len(self.got)
        self.say(*buffers, **message)
        return self.wait(*([kinds] if isinstance(kinds, str) else kinds), after=after)

    def result(self, **settings):
        """Have something made; what is told of it."""
        message, _ = self.ask(("result", "error"), **asked(**settings))
        assert message["kind"] == "result", message
        return message

    def error(self, *buffers, **message):
        return self.ask("error", *buffers, **message)[0]["text"]

    def package(self, number):
        """The files of a result, by name."""
        _, (data,) = self.ask("file", kind="take", result=number, what="all")
        with zipfile.ZipFile(BytesIO(data)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}

    def kinds(self):
        return [message["kind"] for message, _ in self.got]
