# SPDX-License-Identifier: BSD-3-Clause
"""What a method is handed to keep its state in, and how often it is kept."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from math import inf
from typing import Any

from simdtex.checkpoints.folder import Folder
from simdtex.checkpoints.tree import size

FIRST = 1.0
"""Seconds before the first state is written, at least."""

SHARE = 75
"""Seconds between two writes, in units of what the last one took: at most 1 / (1 + 75) of the time goes into them."""

LONGEST = 60.0
"""Seconds that results wait at most: they grow with the time, and so does what their next write takes."""

SPEED = 2.0**27
"""Bytes a second that a first write is taken to manage, before any is measured."""


class Keep:
    """Where a run may keep its state; this one keeps nothing.

    A state is a tree of plain arrays and numbers: see `simdtex.checkpoints.tree.packed`.
    """

    @property
    def found(self) -> Any:
        """The state that the run is to go on from, None to begin."""
        return None

    def offer(self, state: Callable[[], Any], ended: int | None = None) -> bool:
        """Say that a state is at hand; it is asked for and written where it is time. Whether it was.

        ``ended`` is the level that ends with it, if one does.

        Raises
        ------
        KeyboardInterrupt
            The run is to stop here.
        """
        return False

    def within(self, around: Callable[[], Any], found: Any) -> Keep:
        """For a part of the run, whose states are kept together with what ``around`` gives, as ``(around, state)``.

        ``found`` is the part's own state to go on from.
        """
        return self

    def one(self, name: str) -> Keep:
        """For one of several runs that go on beside each other, whose states have this name."""
        return self

    def all(self) -> Iterator[Any]:
        """What `add` was given so far."""
        return iter(())

    def add(self, result: Callable[[], Any], *, now: bool = False) -> bool:
        """Offer a result that is kept to the end, with others; with ``now`` it is written at once. Whether it was."""
        return False

    def drop(self) -> None:
        """The states of this name are no longer needed."""


NOTHING = Keep()
"""Keeps nothing."""


class Pace:
    """When to write: not before a second, and then seldom enough.

    Parameters
    ----------
    every : float, optional
        Seconds between two writes. None: at least a second, and 75 times what the last one took; the first, and one of
        far more bytes than the last, waits as long for what it should take.
    """

    def __init__(self, every: float | None) -> None:
        self._every = every
        self._since = time.perf_counter()
        self._next = self._since + (FIRST if every is None else every)
        self._size = 0

    @property
    def due(self) -> bool:
        """Whether it is time."""
        return time.perf_counter() >= self._next

    def early(self, began: float, size: int) -> bool:
        """Whether a write of so many bytes, which were asked for then, had better wait; and have it wait."""
        now = time.perf_counter()
        if self._every is not None or size <= 2 * self._size:
            return False
        self._next = self._since + SHARE * (now - began + size / SPEED)
        return now < self._next

    def wrote(self, began: float, size: int, longest: float = inf) -> None:
        """Note a write of so many bytes that began then and ends now; the next one waits for so long at most."""
        now, self._size = time.perf_counter(), size
        self._since = now
        self._next = now + (min(longest, max(FIRST, SHARE * (now - began))) if self._every is None else self._every)


class Watch:
    """What all keeps of a run share.

    ``stopping`` whether the run is to stop at the next state; ``failed`` whether the last write failed; ``note`` what
    tells the user a sentence.
    """

    def __init__(self, note: Callable[[str], None]) -> None:
        self.stopping = self.failed = False
        self.note = note


class Kept(Keep):
    """Keeps states of one name in a folder.

    Parameters
    ----------
    folder : Folder
    name : str
        Letters, and digits after them.
    every : float, optional
        As of `Pace`.
    watch : Watch
    anew : bool
        Whether to begin anew where all states are damaged.
    """

    def __init__(self, folder: Folder, name: str, every: float | None, watch: Watch, *, anew: bool = False) -> None:
        self._folder, self._name, self._every, self._watch = folder, name, every, watch
        self._pace = Pace(every)
        self._found = folder.latest(name, anew=anew)
        self._tell("an earlier one is gone on from" if self._found is not None else "it is made anew")

    @property
    def found(self) -> Any:
        """The latest state that is whole."""
        return self._found

    def offer(self, state: Callable[[], Any], ended: int | None = None) -> bool:
        """Write it where it is time, or where the run is to stop."""
        self._found = None  # it has been gone on from, and need not be held
        stopping = self._watch.stopping
        wrote = (stopping or self._pace.due) and self._write(self._name, state)
        if stopping or (wrote and self._watch.stopping):  # asked for before or during the write
            raise KeyboardInterrupt
        return wrote

    def within(self, around: Callable[[], Any], found: Any) -> Keep:
        """The same, with something around its states."""
        return Within(self, around, found)

    def one(self, name: str) -> Keep:
        """The same folder under another name."""
        return Kept(self._folder, name, self._every, self._watch, anew=True)

    def all(self) -> Iterator[Any]:
        """All results that are whole."""
        yield from self._folder.all("results")
        self._tell("what was in it is made anew")

    def add(self, result: Callable[[], Any], *, now: bool = False) -> bool:
        """Write it where it is time, beside what is there."""
        return (now or self._watch.stopping or self._pace.due) and self._write("results", result, beside=True)

    def drop(self) -> None:
        """Remove them."""
        self._folder.forget(self._name)

    def _tell(self, what: str) -> None:
        for name in self._folder.damaged:
            self._watch.note(f"the state {name} in {self._folder.path} is damaged; {what}")
        self._folder.damaged.clear()

    def _write(self, name: str, state: Callable[[], Any], beside: bool = False) -> bool:
        began = time.perf_counter()
        tree = state()
        much = size(tree)
        if not (beside or self._watch.stopping) and self._pace.early(began, much):
            return False
        try:
            self._folder.keep(name, tree, beside=beside)
        except OSError as error:  # the run is worth more than its checkpoint
            if not self._watch.failed:
                self._watch.note(
                    f"the checkpoint in {self._folder.path} could not be written ({error.strerror or error}); "
                    "the run goes on, and will try again"
                )
            self._watch.failed = True
            return False
        finally:
            self._pace.wrote(began, much, LONGEST if beside else inf)
        self._watch.failed = False
        return True


class Within(Keep):
    """Keeps the states of a part of a run: see `Keep.within`."""

    def __init__(self, keep: Keep, around: Callable[[], Any], found: Any) -> None:
        self._keep, self._around, self._found = keep, around, found

    @property
    def found(self) -> Any:
        """The part's."""
        return self._found

    def offer(self, state: Callable[[], Any], ended: int | None = None) -> bool:
        """The part's state, with what is around it."""
        self._found = None
        return self._keep.offer(lambda: (self._around(), state()))
