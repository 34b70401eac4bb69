# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex live``: the page in the browser."""

from __future__ import annotations

import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from simdtex.cli.command import READ, command
from simdtex.cli.inputs import read_picture
from simdtex.cli.options import DEVICE
from simdtex.options import require

if TYPE_CHECKING:
    from simdtex.machine import Machine


@command(
    ("live", "Open the page; drop a picture on it."),
    ("live gravel.png", "Start with this picture."),
    ("live --no-browser --port 8080", "Print the address of the page and open no browser."),
)
@click.argument("picture", required=False, type=READ)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Listen on this port.  [a free one]")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Listen on this address. With another one, anybody who can reach it and knows the page's address can use "
    "the page.",
)
@click.option("--browser/--no-browser", default=True, help="Open the page in the browser, or only print its address.")
@DEVICE
def live(picture: Path | None, port: int, host: str, browser: bool, device: str | None) -> None:
    """Synthesise, fill, extend and classify on a page in the browser.

    Only this machine can open the page. The page ends with this command.
    """
    require("live", "websockets")
    from simdtex.live.job import Picture
    from simdtex.live.server import serve

    first = None
    if picture:
        image = read_picture(picture)
        first = Picture(picture.name, image.pixels, image.channel_axis, image.metadata)

    def ready(address: str, machine: Machine) -> None:
        click.echo(f"{address}  (on {machine.name}; Ctrl-C ends it)")
        if browser:
            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve(first, device, host, port, ready)
    click.echo("ended")
