# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex resume``: go on with a run that was stopped."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import click

from simdtex.cli.common import plainly
from simdtex.cli.helping import command
from simdtex.cli.options import DEVICE, QUIET
from simdtex.cli.places import ENTER
from simdtex.cli.tiles import resume_tiles, workers_option

COMMANDS = ("extend", "fill", "mix", "simulate", "solid", "synth")
"""Those that keep checkpoints."""


@command(
    ("resume state", "The run of --checkpoint state."),
    ("resume more.zarr --workers 4", "An output in tiles, with four processes."),
)
@click.argument("folder", metavar="FILE", type=ENTER)
@workers_option
@DEVICE
@QUIET
@plainly
def resume(folder: Path, workers: str | None, device: str | None, quiet: bool) -> None:
    """Go on with the run whose state is in FILE, and write what its command writes.

    FILE is that of --checkpoint, or the .zarr store of --tiles.
    """
    if is_store(folder):
        resume_tiles(folder, workers, device, quiet)
        return
    if workers is not None:
        raise ValueError("--workers goes with the .zarr store of --tiles; leave it out")
    more = [*(["--device", device] if device else []), *(["--quiet"] if quiet else [])]
    kind(folder)(folder, more)


def is_store(folder: Path) -> bool:
    """Whether a folder is a Zarr store, as ``--tiles`` makes."""
    return (folder / "zarr.json").is_file()


def kind(folder: Path) -> Callable[[Path, list[str]], None]:
    """What goes on with what a folder holds; it is given the folder and more options."""
    if not folder.exists():
        raise ValueError(f"{folder} does not exist: the run is finished, or the path is another")
    if folder.is_dir():
        raise ValueError(f"{folder} is a folder; give the file of --checkpoint, or the store of --tiles")
    return checkpoint


def checkpoint(folder: Path, more: list[str]) -> None:
    """Give the command of a checkpoint again, where it was given."""
    from simdtex.checkpoint import read
    from simdtex.cli import load

    command: dict[str, Any] | None = read(folder)[0]["command"]
    if command is None:
        raise ValueError(f"the run in {folder} was begun in Python; make the same call with checkpoint={str(folder)!r}")
    if command["name"] not in COMMANDS:
        raise ValueError(f"the checkpoint in {folder} is of no command that keeps one; remove it")
    if not os.path.isdir(command["folder"]):
        raise ValueError(f"{command['folder']}, where the run in {folder} was begun, is not there; put it back")
    own = ["--checkpoint", str(folder.resolve())]
    with chdir(command["folder"]):
        words = [*command["options"], *more, *own, "--", *command["arguments"]]
        load(command["name"]).main(words, prog_name=f"simdtex {command['name']}", standalone_mode=False)


__all__ = ["resume"]
