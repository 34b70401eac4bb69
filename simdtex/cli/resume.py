# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex resume``: go on with a run that was stopped."""

from __future__ import annotations

import os
from contextlib import chdir
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import command
from simdtex.cli.options import DEVICE, QUIET
from simdtex.cli.places import ENTER
from simdtex.cli.tiles import resume_tiles, workers_option

COMMANDS = ("classify", "extend", "fill", "mix", "simulate", "solid", "synth", "tile")
"""Those that keep checkpoints."""


@command(
    ("resume state", "Continue the run of --checkpoint state."),
    ("resume more.zarr --workers 4", "Continue an output in tiles with four processes."),
)
@click.argument("path", metavar="FILE", type=ENTER)
@workers_option
@DEVICE
@QUIET
def resume(path: Path, workers: int | str | None, device: str | None, quiet: bool) -> None:
    """Continue the run whose state is in FILE, and write the outputs of its command.

    FILE is the file of --checkpoint, or the .zarr store of --tiles.
    """
    from simdtex.checkpoint import read
    from simdtex.cli import load

    if (path / "zarr.json").is_file() or (path / "work").is_dir():
        resume_tiles(path, workers, device, quiet)
        return
    if workers is not None:
        raise ValueError("--workers requires the .zarr store of --tiles; leave it out")
    if not path.exists():
        raise ValueError(f"{path} does not exist: check the path (a finished run has no checkpoint)")
    if path.is_dir():
        raise ValueError(f"{path} is a folder; give the file of --checkpoint, or the store of --tiles")
    command: dict[str, Any] | None = read(path)[0]["command"]
    if command is None:
        raise ValueError(f"the run in {path} was started in Python; make the same call with checkpoint={str(path)!r}")
    if command["name"] not in COMMANDS:
        raise ValueError(f"the checkpoint in {path} is of a command that cannot be resumed; remove it")
    if not os.path.isdir(command["folder"]):
        raise ValueError(
            f"{command['folder']}, the folder in which the run in {path} was started, does not exist; restore it"
        )
    again, given = load(command["name"]), {"checkpoint": path.resolve(), "device": device, "quiet": quiet}
    with chdir(command["folder"]), again.make_context(f"simdtex {again.name}", list(command["words"])) as context:
        context.params |= {name: value for name, value in given.items() if value}
        again.invoke(context)
