# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex live``, ``demo``, ``devices`` and ``bench``: the page in the browser, and what this machine can do."""

from __future__ import annotations

import json
import os
import time
import webbrowser
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from simdtex.cli.command import FOLDER, READ, WRITE, afterwards, command
from simdtex.cli.inputs import read_picture
from simdtex.cli.job import watching
from simdtex.cli.options import DEVICE, QUIET, output_option
from simdtex.options import require

if TYPE_CHECKING:
    from simdtex.machine import Machine
    from simdtex.machine.devices import DeviceInfo


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

    given = None
    if picture:
        found = read_picture(picture)
        given = Picture(picture.name, found.pixels, found.channel_axis, found.metadata)

    def ready(address: str, machine: Machine) -> None:
        click.echo(f"{address}  (on {machine.name}; Ctrl-C ends it)")
        if browser:
            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve(given, device, host, port, ready)
    click.echo("ended")


@command(
    ("demo", "Make three textures, and a sheet of them, in the folder demo."),
)
@output_option("Write into this folder.", FOLDER, default="demo", show_default=True)
@click.option(
    "--size", default="256x256", show_default=True, metavar="WIDTHxHEIGHT", help="Make outputs of this size, in pixels."
)
@click.option("--seed", type=int, default=1, show_default=True, help="Use this seed.")
@DEVICE
def demo(output: Path, size: str, seed: int, device: str | None) -> None:
    """Synthesise brick, grass and gravel from pictures of scikit-image."""
    from simdtex.io import image
    from simdtex.io.files import earlier_files
    from simdtex.io.image import EXAMPLES, example
    from simdtex.jobs.synthesis import synthesize
    from simdtex.machine import open_machine
    from simdtex.report.sheet import contact_sheet

    shape = image.parse_size(size)
    names = [f"{name}.png" for name in (*EXAMPLES, "sheet")]
    earlier = all((output / name).is_file() for name in names)
    earlier_files(output, "the pictures", lambda name: earlier and name in names)
    machine = open_machine(device)
    click.echo(f"device: {machine.name}")
    output.mkdir(exist_ok=True)
    pictures = []
    for name in EXAMPLES:
        sample = example(name)[:128, :128]
        began = time.perf_counter()
        with watching() as callback:
            made = synthesize(sample, shape, rng=seed, device=machine, callback=callback)
        seconds = time.perf_counter() - began
        image.write(output / f"{name}.png", made)
        pictures += [(f"{name}, the sample", sample), (f"{name}, {seconds:.1f} s", made)]
        click.echo(f"{output / name}.png: {shape[1]}x{shape[0]} from 128x128 in {seconds:.1f} s")
    image.write(output / "sheet.png", contact_sheet(pictures, columns=2))
    click.echo(f"sheet of all pictures: {output / 'sheet.png'}")


@command()
def devices() -> None:
    """List all OpenCL devices, whether they work, and the default device."""
    from simdtex.machine.devices import devices

    render(devices())


def render(listing: Sequence[DeviceInfo]) -> None:
    """Print a listing of probed devices as a table, and the default device, which is marked with "*"."""
    from simdtex.machine.devices import VARIABLE, DeviceError, choose
    from simdtex.report.tables import Table, print_table

    wanted, default = os.environ.get(VARIABLE) or None, None
    try:
        default = choose(wanted, listing)
        sentence = f"Chosen by {VARIABLE if wanted else 'default'}: {default}"
    except DeviceError as error:
        sentence = str(error)
    rows = [
        {
            "": "*" if info is default else "",
            "index": str(info.index),
            "platform": info.platform,
            "device": info.name or "-",
            "kind": info.kind if info.name else "-",
            "OpenCL": info.version.removeprefix("OpenCL ").partition(" ")[0] or "-",
            "units": str(info.compute_units or "-"),
            "memory": f"{info.memory / 2**30:.1f} GiB" if info.memory else "-",
            "usable": ("yes (simulator)" if info.simulated else "yes") if info.usable else f"no: {info.reason}",
        }
        for info in listing
    ]
    print_table(Table("", rows))
    click.echo(sentence)


@command(
    ("bench --quick", "Measure small sizes, within a minute."),
)
@click.option(
    "--device",
    metavar="TEXT",
    help="Measure only this device: a part of its name or platform, or its index in `simdtex devices`.  "
    "[all usable devices]",
)
@click.option(
    "--quick",
    is_flag=True,
    help="Use small sizes, which take a quarter of a minute for each device instead of two minutes.",
)
@click.option("--json", "path", type=WRITE, metavar="FILE", help="Write all measurements.")
@QUIET
def bench(device: str | None, quick: bool, path: Path | None, quiet: bool) -> None:
    """Measure the time of each method on each device, and compare with NumPy.

    All times are from one run. Do not use the machine for other work during the run.
    """
    from simdtex.experiments import benchmark
    from simdtex.io.files import atomic_path
    from simdtex.io.image import check_writable
    from simdtex.report.tables import print_benchmark

    if path:
        check_writable(path, suffixes=(".json",))
    infos = benchmark.chosen(device)

    def tell(what: str) -> None:
        if not quiet:
            click.echo(what, err=True)

    found = benchmark.run(benchmark.QUICK if quick else benchmark.FULL, infos, tell)
    if path:
        with afterwards(), atomic_path(path) as whole:
            whole.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if not quiet:
        print_benchmark(found)
        if path:
            click.echo(path)
