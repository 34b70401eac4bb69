# SPDX-License-Identifier: BSD-3-Clause
"""Checkpoints: one file that holds the latest state of a run, so that the run can be stopped and resumed.

The file describes the call (version, function, digests of its input, seed, command line) and holds one state of the
driver (`simdtex.driver.drive`). It is written atomically with a checksum, and nothing in it is pickled.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

import simdtex
from simdtex.io.files import Damaged, check_target, exclusive, read_checked, write_checked
from simdtex.options import real
from simdtex.random import as_seed

FORMAT = 10
"""Format of the file; all other formats are rejected."""

FIRST, LOST = 1.0, 300.0
"""The least seconds before the first state is written, and the most between two, whatever time writing takes."""

SHARE = 75
"""Time between two writes in units of the duration of the last one: writing takes at most 1/76 of the time."""

NAMES = {
    **{"job": "call", "shape": "shape of the output", "pictures": "sample", "usable": "mask", "given": "known"},
    **{"place": "known_source", "pixels": "sample", "hole": "mask", "options": "option {}", "maps": "{}"},
}
"""Names of the fields of a job in messages, if they differ from the field's own; ``{}`` is the name of a part."""


@dataclass(frozen=True)
class Checkpointing:
    """The state from which a run continues, and the function that receives every later state."""

    found: Any = None  # None for a new run
    offer: Callable[..., Any] = lambda info, tree, *, now=False: None  # called after a step; `tree()` returns its state
    stopping: Callable[[], bool] = lambda: False  # whether the run is to stop


class Checkpoint:
    """A file that keeps the latest state of one run.

    Public functions take one, or the file's path, as ``checkpoint``. If the file exists, the run continues from its
    state, and the result has the bytes of an uninterrupted run. With a path, the file is removed when the function
    returns; with a Checkpoint, by `remove`.

    Parameters
    ----------
    path : path
        The file; its folder must exist. One process at a time uses it.
    every : float, optional
        Least number of seconds between two writes; 0 writes after every step. None: 75 times as long as the last write
        took, so that writing takes less than 2 % of the time, but at least a second and at most five minutes.
    command : dict, optional
        The command line, for ``simdtex resume``.
    note : callable, optional
        Receives messages for the user. None: they are warnings.

    Attributes
    ----------
    running : bool
        Whether a run is in progress; `stop` stops it after the current step.
    resumed : bool
        Whether that run continued from a state.

    Notes
    -----
    A state takes about as much space on disk as the run takes on the device. If a write fails, the run continues and
    tries again later.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        every: float | None = None,
        command: dict[str, Any] | None = None,
        note: Callable[[str], None] | None = None,
    ) -> None:
        if every is not None:
            real("every", every, 0)
        self.path = Path(os.path.abspath(path))
        check_target(self.path)
        self.running = self.resumed = self.stopping = False
        self._every, self._command, self._note = every, command, note or warn
        self._failed = self._used = self._saved = False
        self._about: dict[str, Any] = {}
        self._next = time.perf_counter() + (FIRST if every is None else every)

    def __repr__(self) -> str:
        return f"Checkpoint({str(self.path)!r})"

    def stop(self) -> None:
        """Write the state after the current step, and raise KeyboardInterrupt there; callbacks may call this."""
        self.stopping = True

    def remove(self) -> None:
        """Remove the file: the run is finished."""
        self.path.unlink(missing_ok=True)

    @contextmanager
    def begin(
        self, job: str, rng: Any, inputs: Callable[[], dict[str, Any]], device: str
    ) -> Iterator[tuple[int, Checkpointing]]:
        """Lock the file, and start or resume a run of this public function; yield its seed and its checkpointing."""
        if self._used:
            raise ValueError("a checkpoint keeps one run; give each call a checkpoint of its own")
        self._used = True
        with exclusive(self.path):
            seed, state = self._open(job, rng, inputs(), device)
            self.running, self.resumed = True, state is not None
            try:
                yield seed, Checkpointing(state, self.offer, lambda: self.stopping)
            except (ValueError, TypeError):  # the input, which a plan finds out; a checkpoint of it is of no use
                if not self._saved and state is None:
                    self.remove()
                raise
            finally:
                self.running = False

    def _open(self, job: str, rng: Any, inputs: dict[str, Any], device: str) -> tuple[int, Any]:
        """Return the seed and the state to continue from; write the file if it is new."""
        about, state = read(self.path) if self.path.exists() else (None, None)
        now = {"job": job, **{name: identity(value) for name, value in inputs.items()}}
        seed = None if rng is None else as_seed(rng)
        if about is not None:
            self._compare(about, now, seed)
            seed = int(about["seed"])
            if about["device"] != device:
                self._note(
                    f"the run in {self.path} was begun on {about['device']} and goes on on {device}; "
                    "the bytes are the same on every device"
                )
        command = self._command or (about or {}).get("command")
        seed = as_seed(None) if seed is None else seed
        self._about = {"version": simdtex.__version__, "seed": seed, "inputs": now, "command": command}
        self._about["device"] = device
        if about is None:
            self._write(None)
        return seed, state

    def _compare(self, about: dict[str, Any], now: dict[str, Any], seed: int | None) -> None:
        """Raise if the file belongs to another run; the message gives the difference."""
        before = about["inputs"] | {"seed": about["seed"]}
        now = now | {"seed": about["seed"] if seed is None else seed}
        for name in {**before, **now}:
            old, new = before.get(name), now.get(name)
            if old == new:
                continue
            what = NAMES.get(name, name)
            if isinstance(old, dict) and isinstance(new, dict):
                part = next(part for part in {**old, **new} if old.get(part) != new.get(part))
                old, new = old.get(part), new.get(part)
                what = what.format(part) if "{" in what else NAMES.get(part, what)
            raise ValueError(
                f"the checkpoint {self.path} is of another {what}{_shown(old, new)}; give the same, or a new file for "
                "this run"
            )

    def offer(self, info: Any, tree: Callable[[], Any], *, now: bool = False) -> bool:
        """Write the state ``tree()`` if it is due, ``now`` is true, or the run is to stop here; return whether so."""
        stopping = self.stopping
        wrote = (now or stopping or time.perf_counter() >= self._next) and self._save(tree)
        if stopping or (wrote and self.stopping):
            raise KeyboardInterrupt
        return wrote

    def _save(self, tree: Callable[[], Any]) -> bool:
        began = time.perf_counter()
        try:
            self._write(tree())
        except ValueError as error:  # the run is worth more than its checkpoint
            if not self._failed:
                self._note(f"{error}; the run goes on, and will try again")
            self._failed = True
            return False
        finally:
            ended = time.perf_counter()
            self._next = ended + (
                min(LOST, max(FIRST, SHARE * (ended - began))) if self._every is None else self._every
            )
        self._failed, self._saved = False, True
        return True

    def _write(self, tree: Any) -> None:
        write_state(self.path, {"format": FORMAT, **self._about}, tree)


@contextmanager
def begin_run(
    checkpoint: str | os.PathLike[str] | Checkpoint | Checkpointing | None,
    job: str,
    rng: Any,
    inputs: Callable[[], dict[str, Any]],
    device: str,
) -> Iterator[tuple[int, Checkpointing]]:
    """Open the checkpoint of a public function, see `Checkpoint.begin`; a `Checkpointing` is used unchanged."""
    if checkpoint is None or isinstance(checkpoint, Checkpointing):
        yield as_seed(rng), checkpoint or Checkpointing()
        return
    made = not isinstance(checkpoint, Checkpoint)
    kept = checkpoint if isinstance(checkpoint, Checkpoint) else Checkpoint(checkpoint)
    with kept.begin(job, rng, inputs, device) as run:
        yield run
    if made:
        kept.remove()


def read(path: Path) -> tuple[dict[str, Any], Any]:
    """Return the description of the run in a checkpoint, and its state."""
    try:
        about, tree = read_state(path)
    except Damaged:
        raise ValueError(f"{path} is no checkpoint, or is damaged; give another file, or begin anew") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}); give another file") from None
    check_version(f"the checkpoint {path}", about, FORMAT)
    return about, tree


def check_version(name: str, about: dict[str, Any], known: int) -> None:
    """Raise unless a state with the description ``about`` has a known format and this version."""
    wrote, version = about.get("version"), simdtex.__version__
    wrong = f"format {about.get('format')} and this simdtex reads {known}" if about.get("format") != known else ""
    if not wrong and wrote != version:
        wrong = f"simdtex {wrote} and this is {version}, whose results may differ"
    if wrong:
        raise ValueError(f"{name} is of {wrong}; go on with the code of simdtex {wrote} that wrote it, or begin anew")


def write_state(path: Path, about: dict[str, Any], tree: Any) -> None:
    """Write a description of JSON types and a tree into a file with a checksum, atomically."""
    text, arrays = pack(tree)

    def write(file: BinaryIO) -> None:
        named: dict[str, Any] = {str(index): array for index, array in enumerate(arrays)}
        named["about"] = np.frombuffer(json.dumps(about | {"tree": text}).encode(), np.uint8)
        np.savez(file, **named)

    write_checked(path, write)


def read_state(path: Path) -> tuple[dict[str, Any], Any]:
    """Return the arguments of `write_state`; raise Damaged if the content of the file has changed, and OSError."""
    try:
        with read_checked(path) as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        about: dict[str, Any] = json.loads(arrays.pop("about").tobytes())
        return about, unpack(about.pop("tree"), [arrays[str(index)] for index in range(len(arrays))])
    except (ValueError, KeyError, BadZipFile):
        raise Damaged(f"{path} is damaged") from None


def _shown(old: Any, new: Any) -> str:
    """Return both values in parentheses, or nothing if they are long."""
    words = [value_text(value) for value in (old, new)]
    return "" if any("sha256:" in word or len(word) > 60 for word in words) else f" ({words[0]}, not {words[1]})"


def value_text(value: Any) -> str:
    """Return a JSON value as text."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, list):
        return "x".join(map(value_text, value))
    return "none" if value is None else str(value)


def warn(sentence: str) -> None:
    """Give a sentence to the user as a warning."""
    warnings.warn(sentence, stacklevel=2)


def pack(tree: Any) -> tuple[str, list[NDArray[Any]]]:
    """Return a tree as JSON, and the arrays that it refers to by number; TypeError if it holds anything else."""
    arrays: list[NDArray[Any]] = []

    def keep(node: Any) -> dict[str, int]:
        if not isinstance(node, (np.ndarray, np.generic)) or node.dtype.hasobject:
            raise TypeError(f"a checkpoint cannot keep {type(node).__name__}; give plain arrays and numbers")
        arrays.append(np.asarray(node))
        return {"array" if isinstance(node, np.ndarray) else "scalar": len(arrays) - 1}

    return json.dumps(tree, default=keep), arrays


def unpack(text: str, arrays: Sequence[NDArray[Any]]) -> Any:
    """Return the tree that `pack` packed, with lists for tuples (see `like`)."""

    def kept(node: dict[str, Any]) -> Any:
        match node:
            case {"array": int(index)}:
                return arrays[index]
            case {"scalar": int(index)}:
                return arrays[index][()]
        return node

    return json.loads(text, object_hook=kept)


def like(template: Any, node: Any) -> Any:
    """Return the tree ``node`` with the tuple types of ``template``, a tree of the same form."""
    if not (isinstance(node, (list, tuple)) and isinstance(template, tuple) and len(node) == len(template)):
        return node
    inside = [like(form, value) for form, value in zip(template, node, strict=True)]
    kind: Any = type(template)
    return tuple(inside) if kind is tuple else kind(*inside)


def digest(*arrays: NDArray[Any]) -> str:
    """Return the SHA-256 of the types, shapes and bytes, in C order, of arrays."""
    total = hashlib.sha256()
    for array in arrays:
        total.update(f"{array.dtype.str}{array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def identity(thing: Any) -> Any:
    """Return an input for comparison in JSON: numbers and texts themselves, arrays by their digest."""
    if isinstance(thing, np.ndarray):
        return f"sha256:{digest(thing)}"
    if thing is None or isinstance(thing, (bool, str)):
        return thing
    if isinstance(thing, np.bool_):
        return bool(thing)
    if isinstance(thing, Integral) and abs(int(thing)) >= 2**53:
        return str(int(thing))
    if isinstance(thing, Real):
        return "nan" if thing != thing else float(thing)  # 1 and 1.0 are equal, and so are two NaN
    if isinstance(thing, (list, tuple)):
        return [identity(item) for item in thing]
    if isinstance(thing, dict):
        return {str(name): identity(item) for name, item in thing.items()}
    if is_dataclass(thing):
        return {field.name: identity(getattr(thing, field.name)) for field in fields(thing)}
    return f"{type(thing).__qualname__} {getattr(thing, 'name', '')}".strip()
