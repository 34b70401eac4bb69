# SPDX-License-Identifier: BSD-3-Clause
"""``--checkpoint``: what a command needs to be stopped and gone on with."""

from __future__ import annotations

import functools
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from simdtex.cli.common import give_up, given_words, postponed

if TYPE_CHECKING:
    from simdtex.checkpoint import Checkpoint


def kept(command: Callable[..., None]) -> Callable[..., None]:
    """Run a command within the checkpoint of its ``--checkpoint``, and finish that once all outputs are written."""

    @functools.wraps(command)
    def wrapped(*args: Any, checkpoint: Path | None, **kwargs: Any) -> None:
        if checkpoint is None:
            command(*args, **kwargs)
            return
        from simdtex.checkpoint import Checkpoint

        keeper = Checkpoint(checkpoint, command=_command(click.get_current_context()), note=_say)
        click.get_current_context().obj = keeper
        with _signals(keeper) as caught:
            try:
                command(*args, **kwargs)
                keeper.remove()
            except KeyboardInterrupt:
                give_up(f"stopped; go on with: simdtex resume {checkpoint}", caught[0] if caught else signal.SIGINT)

    return wrapped


def _say(sentence: str) -> None:
    click.echo(f"simdtex: {sentence}", err=True)


def _command(context: click.Context) -> dict[str, Any]:
    """What ``simdtex resume`` needs to give the command again: its options, its arguments, and where it was given."""
    options, arguments = given_words(context, without=("checkpoint",))
    return {
        "name": str(context.command.name),
        **{"options": options, "arguments": arguments, "folder": os.getcwd()},
    }


@contextmanager
def _signals(keeper: Checkpoint) -> Iterator[list[int]]:
    """Have Ctrl-C and SIGTERM stop a run where its state is at hand, and a second one at once.

    Yields the list of the signals that came.
    """
    caught: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return

    def handle(number: int, frame: Any) -> None:
        if not keeper.running and number == signal.SIGINT and postponed(frame):
            return
        caught.append(number)
        if len(caught) > 1 or not keeper.running:
            raise KeyboardInterrupt
        keeper.stop()
        os.write(2, b"\nsimdtex: stopping where the state is at hand; once more stops at once\n")

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


__all__ = ["kept"]
