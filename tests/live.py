"""What tests of the live page share: a page that has no browser, and pictures."""

import threading
import zipfile
from io import BytesIO

import numpy as np
import PIL.Image

from simdtex.live.session import Session
from simdtex.machine import open_machine


def texture(rows=40, cols=48, channels=3, dtype=np.uint8, seed=0):
    rng = np.random.default_rng(seed)
    i, j = np.indices((rows, cols))
    base = 100 + 60 * np.sin(i / 3) * np.cos(j / 4)
    noisy = base[..., None] + rng.normal(0, 12, (rows, cols, channels))
    scale = 257 if dtype == np.uint16 else 1
    found = (noisy.clip(0, 255) * scale).astype(dtype)
    return found[..., 0] if channels == 1 else found


def striped(channels=3, dtype=np.uint8):
    found, top = texture(48, 96, channels, dtype), np.iinfo(dtype).max
    rng = np.random.default_rng(1)
    i, j = np.indices((48, 40))
    found[:, 40:80] = (np.where((i // 3 + j // 5) % 2, top // 4, top // 2) + rng.integers(0, 9, (48, 40))).reshape(
        48, 40, *[1] * (found.ndim - 2)
    )
    found[:, 80:] = rng.integers(0, top, found[:, 80:].shape, dtype)
    return found


def png(pixels):
    file = BytesIO()
    PIL.Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def asked(**settings):
    """A request with few levels, which is quick."""
    order = settings.get("method", "mrf") == "mrf" and settings.get("job") != "classify"
    options = {"order": 2} if order else {}
    message = {"kind": "make", "job": "synth", "method": "mrf", "width": 36, "height": 28, "seed": 7}
    return message | settings | {"options": options | settings.get("options", {})}


class Fake:
    """A page without a browser: it gives messages, and waits for those that come."""

    def __init__(self, picture=None, *, sees=True, machine=None):
        self.got, self.sees = [], sees
        self._came = threading.Condition()
        self.session = Session(self.send, machine or open_machine("reference"), picture)

    def send(self, message, buffers):
        with self._came:
            self.got.append((message, buffers))
            self._came.notify_all()
        if self.sees and message["kind"] == "frame":
            self.session.receive({"kind": "shown"})

    def say(self, *buffers, **message):
        self.session.receive(message, buffers)

    def wait(self, *kinds, after=0, timeout=120, **values):
        """The first message of one of these kinds, with these values, that came after so many, and its buffers."""

        def found():
            matching = (one for one in self.got[after:] if one[0]["kind"] in kinds)
            return next((one for one in matching if values.items() <= one[0].items()), None)

        with self._came:
            assert self._came.wait_for(found, timeout), f"no {kinds} came, but {[one['kind'] for one, _ in self.got]}"
            return found()

    def ask(self, kinds, *buffers, wanted=None, **message):
        """Say something, and wait for an answer of these kinds, with the values that are wanted."""
        after = len(self.got)
        self.say(*buffers, **message)
        return self.wait(*([kinds] if isinstance(kinds, str) else kinds), after=after, **(wanted or {}))

    def result(self, **settings):
        message, _ = self.ask(("result", "error"), **asked(**settings))
        assert message["kind"] == "result", message
        return message

    def error(self, *buffers, **message):
        return self.ask("error", *buffers, **message)[0]["text"]

    def package(self, number):
        """The files of a result, by name."""
        archive = self.session.results[number].files[-1]
        _, (data,) = self.ask("file", kind="download", result=number, name=archive)
        with zipfile.ZipFile(BytesIO(data)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}

    def kinds(self, after=0):
        return [message["kind"] for message, _ in self.got[after:]]

    @property
    def latest(self):
        results = self.session.results
        return results[max(results)]
