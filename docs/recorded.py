# SPDX-License-Identifier: BSD-3-Clause
"""Record a session of the live page for the documentation: `python docs/recorded.py` writes docs/_static/recording.js.

The page of docs/concepts/why.rst plays it without a server. It has the pictures of a small run after every sweep, those
of one sweep after every set of sites, the explanations of a few pixels, and the films of four schedules.
"""

import json
import re
import sys
import zlib
from base64 import b64decode, b64encode
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from live import Fake, asked

from simdtex.io.image import example
from simdtex.live import script
from simdtex.live.job import Picture
from simdtex.live.session import FILMED
from simdtex.machine import open_machine

FILE = Path(__file__).parent / "_static" / "recording.js"
SIDE = 32
"""Rows and columns of the output."""

OPTIONS = json.loads(re.search(r"const PLAIN = ({.*?});", script(), re.DOTALL)[1])
"""The options of the run of the page's lecture."""

SEED = 1
PIXELS = [(9, 9), (8, 22), (16, 16), (23, 9)]
LAYERS = ("picture", "temperature", "arrangement", "sets")


def sample():
    """The sample of the recorded run."""
    return example("gravel")[:48, :48]


def record():
    """Return the recorded messages, and the bytes of their buffers."""
    page = Fake(Picture("gravel.png", sample(), None), machine=None)
    buffers, size = [], 0

    def kept(message, own):
        nonlocal size
        places = []
        for one in own:
            places.append([size, len(one)])
            buffers.append(bytes(one))
            size += len(one)
        return [message, places]

    def shown(layer, side=SIDE):
        after = len(page.got)
        page.say(kind="view", layer=layer, left=0, top=0, width=side, height=side, step=1)
        return kept(*page.wait("frame", after=after, layer=layer))

    page.ask("hello", kind="hello")
    run = {"width": SIDE, "height": SIDE, "seed": SEED, "options": OPTIONS}
    page.result(**run)
    after = len(page.got)
    page.ask("selected", kind="hello")
    wanted = {one["kind"]: (one, own) for one, own in page.got[after:]}
    wanted["picture"][0]["new"] = False
    start = [kept(*wanted[kind]) for kind in ("hello", "picture", "result", "selected")]
    inside = kept(*page.ask("inside", kind="inside", open=True))
    sweeps = inside[0]["panes"][0]["sweeps"]
    fine = next(n for n, one in enumerate(sweeps) if one[0] == 0) + 1
    moments = [("null", None)]
    for n, (level, sweep, sets, *_) in enumerate(sweeps):
        for count in range(sets + 1) if n == fine else [sets]:
            moments.append((json.dumps([n, count]), [level, sweep, count]))
    frames, explained, reasons = {}, {}, []
    for key, moment in moments:
        seek = {} if moment is None else dict(zip(("level", "sweep", "sets"), moment, strict=True))
        page.ask("moments", kind="seek", **seek)
        for layer in LAYERS[: 3 if moment is None else 4]:
            frames[f"{layer} {key}"] = shown(layer)
        for pixel in PIXELS:
            found, _ = page.ask("explained", kind="explain", row=pixel[0], col=pixel[1])
            if found not in reasons:  # a pixel keeps its value for many moments
                reasons.append(found)
            explained[f"{pixel[0]},{pixel[1]} {key}"] = reasons.index(found)
    quick = Fake(Picture("gravel.png", sample(), None), machine=open_machine())  # which gives the same bytes
    quick.say(**asked(**run) | {"kind": "schedules"})
    films = [kept(*quick.wait("schedule", name=name, timeout=600)) for name in FILMED]
    quick.session.close(10)
    frames["sample null"] = shown("sample", len(sample()))
    for key, _ in moments[1:]:
        frames[f"sample {key}"] = frames["sample null"]
    page.session.close(10)
    recorded = {"start": start, "inside": inside, "moments": moments, "frames": frames, "explained": explained}
    return recorded | {"pixels": PIXELS, "reasons": reasons, "films": films}, b"".join(buffers)


def pack(recorded, data):
    """Return the text of the file."""
    text = json.dumps(recorded, separators=(",", ":"), default=np.ndarray.tolist).encode()
    packed = b64encode(zlib.compress(text + bytes(1) + data, 9)).decode()
    return f'window.simdtexRecording = "{packed}";\n'


def unpack(text):
    """Return what `pack` was given."""
    head, _, data = zlib.decompress(b64decode(text.split('"')[1])).partition(bytes(1))
    return json.loads(head), data


if __name__ == "__main__":
    FILE.write_text(pack(*record()), encoding="ascii")
    print(f"{FILE.name}: {FILE.stat().st_size} bytes")
