# SPDX-License-Identifier: BSD-3-Clause
"""The job of a page: its controls, the call of a public function, and the command line that repeats it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from contextlib import suppress
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
import PIL.Image
import PIL.ImageDraw
from numpy.typing import NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.io.decode import NOTHING
from simdtex.io.image import Metadata, suitable_suffix
from simdtex.jobs.classification import options as classifier
from simdtex.jobs.classification.job import classify
from simdtex.jobs.classification.model import FEWEST_NEIGHBOURHOODS
from simdtex.jobs.filling.job import extend, fill, plan_extension, plan_filling
from simdtex.jobs.synthesis.job import plan_synthesis, synthesize
from simdtex.jobs.why.holes import HoleReplay
from simdtex.jobs.why.replay import Replay
from simdtex.live import frames
from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.model.display import label_colours
from simdtex.model.light import LIGHT
from simdtex.options import Choice, Number, Option, Other, Whole, is_flag, one_of, real, shown, table, whole
from simdtex.run import Output

Array = NDArray[Any]
Maps = dict[str, Array]
Message = dict[str, Any]

FUNCTIONS: dict[str, tuple[Any, Any]] = {
    "synth": (synthesize, plan_synthesis),
    "extend": (extend, plan_extension),
    "fill": (fill, plan_filling),
    "classify": (classify, None),
}
"""The function of each job of the page, by command, and the function that plans its run, to look inside the run."""

METHODS = {
    "mrf": "Markov random field: any texture",
    "multires": "Multiresolution sampling: very quick, loose order",
    "pyramid": "Pyramid matching: stone, bark, cloth",
}
"""The names of the methods on the page."""

TABLES: dict[str, tuple[Any, str]] = {
    "mrf": (mrf.Options, "synth"),
    "multires": (multires.Options, "synth"),
    "pyramid": (pyramid.Options, "synth"),
    "fill": (mrf.Options, "fill"),
    "extend": (mrf.Options, "extend"),
    "classify": (classifier.Options, "classify"),
}
"""The options and the command of each set of controls: for the methods, and for the jobs with a single method."""

MAX_SIDE = 2**14  # of an output, pixels
MIN_REGION = 8  # a side of a region of the picture, pixels
MAX_POINTS = 2**16  # of all strokes together
MAX_LABEL = 8  # of a stroke; 0 erases

LABELS = label_colours(MAX_LABEL + 1)
"""The colours of labels, for the brush and over a picture."""

Part = tuple[slice, slice]
WHOLE: Part = (slice(None), slice(None))

RESERVED = ("", "texture", "hole", "guide-sample", "guide-texture", "labels", "strokes")
"""Names that the picture's files cannot have, since other files of an archive have them."""


class Hint(ValueError):
    """More has to be painted; the sentence names what is missing."""


class Picture(NamedTuple):
    """A given picture: the name of its file, its pixels, its channel axis or None, and the metadata of the file."""

    name: str
    pixels: Array
    channel_axis: int | None
    metadata: Metadata = NOTHING


class PageJob:
    """A run that a page requests with a ``make`` message (docs/live.rst); raises ValueError or TypeError if invalid.

    ``maps`` are further maps of the picture, by name, which ``pyramid`` and ``classify`` do not arrange;
    ``result(number)`` returns a result.

    ``options`` are those that differ from their defaults, ``files`` the pictures that the command line reads, by file
    name, and ``output`` and ``carried`` the files that it writes: the picture, and the further maps by name.
    ``material`` are the picture and its maps, ``labelled`` the files of labels, and ``classes`` the painted labels.
    """

    def __init__(self, message: Message, picture: Picture, maps: Maps, result: Callable[[Any], Any]) -> None:
        self.message, self.material = message, (picture, dict(maps))
        one_of("job", message.get("job"), FUNCTIONS)
        self.kind: str = message["job"]
        self.metadata = picture.metadata._replace(exif=None)
        self.method: str = "classifier" if self.kind == "classify" else "mrf"
        if self.kind == "synth":
            self.method = message.get("method", "mrf")
            one_of("method", self.method, METHODS)
        seed: Any = message.get("seed")
        whole("seed", seed, 0, 2**32 - 1)
        maps = {} if self.method in ("pyramid", "classifier") else maps
        self.classes: list[int] = []
        self.labelled: tuple[str, ...] = ()
        self._keywords: dict[str, Any] = {}
        self._flags: list[str] = []
        whole_picture = self.kind in ("fill", "classify")
        part = _part(None if whole_picture else message.get("part"), picture.pixels.shape)
        key = message.get("of") if self.kind == "fill" else None
        if key is None:
            name = file_stem(picture.name, "sample") + ("" if part == WHOLE else "-part")
            self._read(name, picture.pixels[part], {role: values[part] for role, values in maps.items()})
        else:
            before = result(key)
            self._read(f"result-{key}", before.image, before.maps)
        self.shape: tuple[int, int] = self.sample.shape[:2]
        if self.kind == "synth":
            self._size(message)
            self._add("method", self.method, "--method", self.method)
            self._guide(message, picture.pixels.shape, part)
        elif self.kind == "extend":
            self._add("seamless", True, "--seamless")
        elif self.kind == "fill":
            self._hole(message)
        else:
            self._classes(message)
        self._add("rng", seed, "--seed", str(seed))
        self._add("channel_axis", picture.channel_axis)
        self.options = _options(message.get("options", {}), self.method if self.kind == "synth" else self.kind)
        for name, value in self.options.items():
            self._add(name, value, f"--{name.replace('_', '-')}", *([] if value is True else [str(value)]))

    def run(
        self, machine: Machine, callback: Callable[[Any], None], checkpointing: Checkpointing
    ) -> tuple[Array, Output]:
        """Run the job on a machine, and return its output; `checkpointing` has the state to continue from, if any."""
        keywords = {**self._keywords, "device": machine, "callback": callback, "full_output": True}
        image, output = FUNCTIONS[self.kind][0](self.sample, checkpoint=checkpointing, **keywords)
        return image, output

    def replay(self, machine: Machine) -> Replay | HoleReplay:
        """Return the replay of the run; raise ValueError if it is not one run of ``mrf``."""
        if self.method != "mrf":
            name = METHODS["mrf"].partition(":")[0]
            raise ValueError(f'only runs of the method "{name}" can be looked into; make a result by it first')
        keywords = {name: value for name, value in self._keywords.items() if name != "rng"}
        job: Any = FUNCTIONS[self.kind][1](self.sample, **keywords)
        if self.kind == "fill":
            return HoleReplay(job, machine, self._keywords["rng"])
        return Replay(job.plan(), machine, self._keywords["rng"])

    def layers(
        self,
        image: Callable[[], Array],
        source: Callable[[], Array] | None = None,
        temperature: Callable[[], Array] | None = None,
        *,
        ended: bool = True,
    ) -> dict[str, Callable[[], frames.Layer]]:
        """Return functions that make the layers of the run or, once it has ended, of its result: `frames.layers`."""
        if self.kind != "classify":
            return frames.layers(self.sample, self.shape, image, source, temperature)
        shares = [0.5 if ended else 0.0, *[0.5] * MAX_LABEL]
        return {"labels": lambda: frames.overlay(self.sample, image(), LABELS, shares)}

    def shares(self, labels: Array) -> list[tuple[int, float]]:
        """Return each label of a result and its share; 0 is unknown."""
        return [(label, float((labels == label).mean())) for label in ([0, *self.classes] if self.classes else [])]

    @property
    def command(self) -> str:
        """The command line that makes the same bytes from ``files``."""
        words = ["simdtex", self.kind, next(iter(self.files)), "-o", self.output, *self._flags]
        words += [word for read, write in self._also for word in ("--also", f"{read}={write}")]
        return shlex.join(words) + "\n"

    def _read(self, name: str, sample: Array, maps: Maps) -> None:
        """Add the sample and its maps; the names of their files begin with ``name``."""
        self.sample, self.maps = sample, maps
        self.output = f"texture{_suffix(sample)}"
        self.carried = {role: f"texture-{role}{_suffix(pixels)}" for role, pixels in maps.items()}
        files = {f"{name}-{role}{_suffix(pixels)}": pixels for role, pixels in maps.items()}
        self._also = list(zip(files, self.carried.values(), strict=True))
        self.files = {f"{name}{_suffix(sample)}": sample, **files}

    def _add(self, name: str, value: Any, *flags: str) -> None:
        """Add an argument to the call and to the command line."""
        self._keywords[name] = value
        self._flags += flags

    def _size(self, message: Message) -> None:
        for side in ("width", "height"):
            whole(side, message.get(side), 1, MAX_SIDE)
        rows, cols = self.shape = (message["height"], message["width"])
        self._add("shape", self.shape, "--size", f"{cols}x{rows}")

    def _guide(self, message: Message, shape: tuple[int, ...], part: Part) -> None:
        guide = _painted(message)
        labels = paint(guide.get("sample", []), shape)[part]
        wanted = paint(guide.get("output", []), self.shape)
        if not wanted.any():
            return
        if missing := sorted(set(np.unique(wanted)) - {0} - set(np.unique(labels))):
            raise ValueError(f"label {missing[0]} is on the output and not on the sample; paint it on the sample too")
        transparent = np.stack([wanted, np.where(wanted > 0, 255, 0)], -1).astype(np.uint8)
        self.files |= {"guide-sample.png": labels, "guide-texture.png": transparent}
        both = "guide-sample.png=guide-texture.png"
        self._add("guide", (labels, np.where(wanted == 0, np.nan, wanted)), "--guide", both)
        self._add("labels", True)

    def _classes(self, message: Message) -> None:
        strokes = paint(_painted(message).get("sample", []), self.shape)
        counts = np.bincount(strokes.ravel())
        self.classes = [label for label in np.flatnonzero(counts).tolist() if label]
        if len(self.classes) < 2:
            done = f"only label {self.classes[0]} is painted" if self.classes else "no label is painted yet"
            raise Hint(f"{done}; paint over two or more textures of the picture, each with a label of its own")
        few = min(self.classes, key=lambda label: int(counts[label]))
        if counts[few] < FEWEST_NEIGHBOURHOODS:
            raise Hint(f"label {few} is painted on {counts[few]} pixels; paint {FEWEST_NEIGHBOURHOODS} or more")
        self.output = "labels.png"
        self.files["strokes.png"] = strokes
        self.labelled = (self.output, "strokes.png")
        self._add("textures", strokes, "--strokes", "strokes.png")

    def _hole(self, message: Message) -> None:
        hole = paint(message.get("hole", []), self.shape) > 0
        if not hole.any():
            raise ValueError("there is no hole to fill; paint over what is to be replaced")
        if hole.all():
            raise ValueError("the hole covers the whole picture; leave some of it")
        self.files["hole.png"] = hole * np.uint8(255)
        self._add("mask", hole, "--mask", "hole.png")


def _painted(message: Message) -> dict[str, Any]:
    guide = message.get("guide") or {}
    if not isinstance(guide, dict):
        raise TypeError("a guide is painted on the sample and on the output; paint both")
    return guide


def paint(strokes: Any, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the labels painted by strokes of a round brush, (rows, cols), 0 where there are none."""
    if not isinstance(strokes, list):
        raise TypeError("strokes must be a list; paint again")
    labels = PIL.Image.new("L", (shape[1], shape[0]))
    draw = PIL.ImageDraw.Draw(labels)
    count = 0
    for stroke in strokes:
        if not isinstance(stroke, dict) or not isinstance(stroke.get("points"), list) or not stroke["points"]:
            raise TypeError("a stroke has no points; paint again")
        label: Any = stroke.get("label")
        width: Any = stroke.get("width")
        whole("the label of a stroke", label, 0, MAX_LABEL)
        real("the width of a stroke", width, 0, MAX_SIDE, above=True)
        if (count := count + len(stroke["points"])) > MAX_POINTS:
            raise ValueError(f"there are more than {MAX_POINTS} points; paint with a wider brush")
        points = _points(stroke["points"])
        if len(points) > 1:
            draw.line(points, fill=label, width=max(1, round(width)))
        for x, y in points:  # round ends and corners
            draw.ellipse((x - width / 2, y - width / 2, x + width / 2, y + width / 2), fill=label)
    return np.array(labels)


def _points(pairs: list[Any]) -> list[tuple[float, float]]:
    with suppress(ValueError, TypeError, OverflowError):
        points = np.array(pairs, np.float64)
        if points.shape == (len(pairs), 2) and np.isfinite(points).all() and abs(points).max() < 2**20:
            return [(x, y) for x, y in points.tolist()]
    raise TypeError("a point of a stroke must be two numbers; paint again")


def _options(values: Any, table: str) -> dict[str, Any]:
    """Return the options that differ from their defaults; only options with a control are valid."""
    if not isinstance(values, dict):
        raise TypeError(f"options must be names and values, not {shown(values)}")
    defaults = {control["name"]: control["default"] for control in controls(table)}
    for name in values:
        if name not in defaults:
            raise ValueError(f"there is no control for {shown(name)}; choose one of: {', '.join(defaults)}")
    return {name: value for name, value in values.items() if value is not None and value != defaults[name]}


def _part(region: Any, shape: tuple[int, ...]) -> Part:
    """Return the rows and columns of a region, `WHOLE` if it is the whole picture."""
    if region is None:
        return WHOLE
    if not isinstance(region, list) or len(region) != 4:
        raise TypeError("a part of the picture is four numbers: left, top, width and height")
    rows, cols = shape[:2]
    for name, value, most in zip(("left", "top", "width", "height"), region, (cols, rows, cols, rows), strict=True):
        whole(f"the {name} of the part", value, min(MIN_REGION, most) if name in ("width", "height") else 0, most)
    left, top, width, height = region
    if left + width > cols or top + height > rows:
        raise ValueError(f"the part reaches beyond the picture of {cols}x{rows}; choose one within it")
    return WHOLE if region == [0, 0, cols, rows] else (slice(top, top + height), slice(left, left + width))


def file_stem(name: str, otherwise: str) -> str:
    """Return a file's name without its suffix, in lower case letters, digits and dashes."""
    stem = re.sub(r"[^a-z0-9]+", "-", name.rpartition(".")[0].lower() or name.lower()).strip("-")[:40]
    return otherwise if stem in RESERVED else stem


def _suffix(pixels: Array) -> str:
    return suitable_suffix(pixels.dtype, 1 if pixels.ndim == 2 else pixels.shape[2])


def controls(name: str) -> list[dict[str, Any]]:
    """Return the controls of one of `TABLES`: each option of the command that is a word, a switch, or has a slider."""
    options, job = TABLES[name]
    shown = {name: option for name, option in table(options).items() if job in option.shown}
    words = {"light": LIGHT} if job in ("synth", "extend") else {}  # elsewhere the picture decides, or it has none
    made = [_control(name, option, option.default_of(job)) for name, option in (shown | words).items()]
    return [control for control in made if "kind" in control]


def offered() -> Message:
    """Return the methods, the controls and the colours of labels of the page."""
    return {"methods": METHODS, "controls": {name: controls(name) for name in TABLES}, "colours": LABELS.tolist()}


def told(sentence: str) -> str:
    """Return a message of the package with the labels of the page: ``Search "exact"`` for ``search="exact"``."""
    labels = {control["name"]: control["label"] for name in TABLES for control in controls(name)}
    labels |= {"seed": "Seed", "width": "Result width", "height": "Result height"}
    names = "|".join(labels)
    named = re.sub(rf"\b({names})=", lambda match: f"{labels[match[1]]} ", sentence)
    named = re.sub(rf"^({names})(?= is | must )", lambda match: labels[match[1]], named)
    left = names if named == sentence else f"{names}|it"
    return re.sub(rf"leave ({left}) out", lambda match: f"set {labels.get(match[1], 'it')} to its default", named)


def _control(name: str, option: Option, default: Any) -> dict[str, Any]:
    """Return the control of an option; without ``kind`` if it has none."""
    hint = f"{option.hint or option.help}."
    hint = f"{hint} Empty: {option.none}." if option.none else hint
    label = option.label or name.replace("_", " ").capitalize()
    control = {"name": name, "group": option.group, "label": label, "hint": hint, "default": default}
    kind = option.kind
    if isinstance(kind, Choice) or (isinstance(kind, Other) and default in kind.valid):
        return control | {"kind": "words", "valid": [[word, word] for word in kind.valid]}
    if is_flag(kind) and default is not None:
        return control | {"kind": "switch"}
    if isinstance(kind, (Whole, Number)) and option.slider:
        control |= {"least": kind.least if isfinite(kind.least) else None, "span": option.slider}
        usual = re.match(r"[\d.]+(?=;|$)", option.none)  # the number of an empty field, if that is fixed
        control["usual"] = float(usual[0]) if usual else default
        control["empty"] = "" if default is not None else f"automatic: {usual[0]}" if usual else "automatic"
        return control | {"kind": "whole" if isinstance(kind, Whole) else "number"}
    return control
