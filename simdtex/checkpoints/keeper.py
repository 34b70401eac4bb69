# SPDX-License-Identifier: BSD-3-Clause
"""`checkpoint`: a folder that the run within a ``with`` block keeps its state in, and goes on from."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from simdtex.checkpoints.folder import JOB, Folder
from simdtex.checkpoints.keep import Keep, Kept, Watch
from simdtex.checkpoints.tree import identity
from simdtex.options import real


class Around(Protocol):
    """What is around a run: it may keep the run's states, and give one to go on from; `Keeper` is one.

    ``running`` says whether a run is going on.
    """

    running: bool

    def begin(self, job: str, seed: int | None, fresh: Callable[[], int], inputs: dict[str, Any]) -> int:
        """Hear of a job, and give its seed; see `Keeper.begin`."""

    def on(self, device: str) -> Keep:
        """Where the run on a device of this name keeps its states."""


CURRENT: ContextVar[Around | None] = ContextVar("checkpoint", default=None)
"""The keeper of the block that is being run; `simdtex.envelope` reads it, and hands on what comes of it."""

NAMES = {"job": "call", "shape": "shape of the output", "known_source": "known_source"}
"""What inputs are called in sentences, where that is not their own name."""


class Keeper:
    """Keeps one run in a folder: what `checkpoint` gives.

    Parameters
    ----------
    folder : path
    every : float, optional
        Seconds between two writes. None: as seldom as costs less than 2 % of the time.
    command : dict, optional
        The command line that the run is of, for ``simdtex resume``.
    note : callable, optional
        Tells the user a sentence. None: a warning.

    Attributes
    ----------
    running : bool
        Whether a run is going on, which `stop` stops where its state is at hand.
    resumed : bool
        Whether that run goes on from a state.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        every: float | None = None,
        command: dict[str, Any] | None = None,
        note: Callable[[str], None] | None = None,
    ) -> None:
        if every is not None:
            real("every", every, 0)
        self.running = self.resumed = False
        self._every, self._command = every, command
        self._folder = Folder(Path(folder))
        self._watch = Watch(note or _warned)
        self._job: dict[str, Any] | None = None
        self._begun = self._taken = False
        before = self._folder.job()
        if before is not None and before["finished"]:
            raise ValueError(f"the run in {folder} is finished; give an empty folder to begin another")

    def stop(self) -> None:
        """Have the run write its state where that is at hand next, and raise KeyboardInterrupt there.

        A callback or a signal handler may call it. A second call makes no difference.
        """
        self._watch.stopping = True

    def begin(self, job: str, seed: int | None, fresh: Callable[[], int], inputs: dict[str, Any]) -> int:
        """Check that the folder's run, where there is one, is of this job, and give the seed.

        Parameters
        ----------
        job : str
            The function that is called.
        seed : int, optional
            None: the one of the folder's run, else ``fresh()``.
        fresh : callable
        inputs : dict
            Everything else that determines the result, by name.

        Raises
        ------
        ValueError
            It is of another one; the sentence says in what they differ.
        """
        if self._begun:
            raise ValueError("a checkpoint keeps one run; give the next one a simdtex.checkpoint of its own")
        self._begun = True
        before = self._folder.job()
        told = {"job": job, **{name: identity(value) for name, value in inputs.items()}}
        here = version("simdtex")
        if before is not None:
            if before["version"] != here:
                raise ValueError(
                    f"the checkpoint in {self._folder.path} is of simdtex {before['version']} and this is {here}, "
                    f"whose results may differ; go on with {before['version']}, or give an empty folder"
                )
            self._compare(before["inputs"], told)
            if seed is not None and seed != before["seed"]:
                raise ValueError(self._of_another("seed", f" ({before['seed']}, not {seed})"))
            seed = int(before["seed"])
        seed = fresh() if seed is None else seed
        command = self._command or (before or {}).get("command")
        self._job = {"version": here, "seed": seed, "inputs": told, "command": command, "finished": False}
        self._job["device"] = before and before["device"]
        return seed

    def on(self, device: str) -> Keep:
        """Open the folder for the run on a device of this name.

        Raises
        ------
        ValueError
            It cannot be written, another process has it, or its states are damaged.
        """
        assert self._job is not None
        before = self._job["device"]
        self._folder.take()
        self._taken = True
        try:
            keep = Kept(self._folder, "state", self._every, self._watch)
            self._folder.tidy()
            if before != device or self._command:
                self._folder.keep_job(self._job | {"device": device})
        except OSError as error:
            raise ValueError(
                f"the folder {self._folder.path} cannot be written ({error.strerror}); choose another"
            ) from None
        self._job["device"] = device
        if before is not None and before != device:
            self._watch.note(
                f"the run in {self._folder.path} was begun on {before} and goes on on {device}; "
                "the bytes are the same on every device"
            )
        self.running, self.resumed = True, keep.found is not None
        return keep

    def close(self, finished: bool) -> None:
        """Let the folder go; where the job is finished, say so in it and remove the states."""
        self.running = False
        if not self._taken:
            return
        try:
            if finished:
                self._folder.keep_job({**(self._job or {}), "finished": True})
                self._folder.forget()
        except OSError as error:
            path = self._folder.path / JOB
            self._watch.note(
                f"{path} could not be written ({error.strerror or error}): the run is finished all the same"
            )
        finally:
            self._folder.release()

    def _compare(self, before: dict[str, Any], now: dict[str, Any]) -> None:
        for name in {**before, **now}:
            old, new = before.get(name), now.get(name)
            if old == new:
                continue
            if name == "options" and isinstance(old, dict) and isinstance(new, dict):
                which = next(one for one in {**old, **new} if old.get(one) != new.get(one))
                raise ValueError(self._of_another(f"option {which}", _shown(old.get(which), new.get(which))))
            raise ValueError(self._of_another(NAMES.get(name, name), _shown(old, new)))

    def _of_another(self, what: str, shown: str) -> str:
        path = self._folder.path
        return f"the checkpoint in {path} is of another {what}{shown}; give the same, or an empty folder for this run"


def _shown(old: Any, new: Any) -> str:
    """What differs, where that is short."""
    words = [json_word(one) for one in (old, new)]
    return "" if any("sha256:" in word or len(word) > 60 for word in words) else f" ({words[0]}, not {words[1]})"


def json_word(value: Any) -> str:
    """A value of JSON in words."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, list):
        return "x".join(map(json_word, value))
    return "none" if value is None else str(value)


def _warned(sentence: str) -> None:
    warnings.warn(sentence, stacklevel=2)


@contextmanager
def keeping(keeper: Keeper) -> Iterator[Keeper]:
    """Have the run in this block kept by a keeper."""
    token = CURRENT.set(keeper)
    finished = False
    try:
        yield keeper
        finished = True
    finally:
        CURRENT.reset(token)
        keeper.close(finished)


@contextmanager
def checkpoint(folder: str | os.PathLike[str], *, every: float | None = None) -> Iterator[Keeper]:
    """Keep the state of the run within a ``with`` block in a folder, and go on from it.

    The run is one call of `synthesize`, `synthesize_solid`, `fill`, `extend`, `simulate` or `mix`. Where the folder
    holds the state of the same call, the run goes on from there, and its result has the bytes of a run that was never
    stopped. A block that is left without an error is finished: its states are removed, and the folder says so.

    Parameters
    ----------
    folder : path
        Empty or new to begin; else that of the same call. One process at a time uses it.
    every : float, optional
        Seconds between two writes at least, 0 for one wherever the state is at hand. None: a second, and 75 times what
        the last write took, so that less than 2 % of the time goes into them.

    Yields
    ------
    Keeper
        Its ``stop()`` has the run write its state where that is at hand next, and raise KeyboardInterrupt.

    Raises
    ------
    ValueError
        The folder holds other files, another run (another version of simdtex, sample, option, seed), a finished one, or
        damaged states alone; nothing is changed.

    Warns
    -----
    UserWarning
        The run goes on on another device, from an earlier state since the last is damaged, or a state could not be
        written.

    Notes
    -----
    A seed that was drawn (``rng=None``) is kept, and the same call without a seed goes on with it. Without a `stop` an
    exception, KeyboardInterrupt among them, leaves what was written last. A state takes on disk about what the run has
    on the device for each output pixel, and there are two of them.

    Examples
    --------
    >>> import tempfile
    >>> from skimage import data
    >>> import simdtex
    >>> with tempfile.TemporaryDirectory() as folder, simdtex.checkpoint(folder):
    ...     more = simdtex.synthesize(data.brick()[:64, :64], (80, 96), order=2, rng=1)
    """
    with keeping(Keeper(folder, every=every)) as keeper:
        yield keeper
