# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex bench``: what the devices here can do, and what the methods make of it."""

from __future__ import annotations

import json
from pathlib import Path

import click

from simdtex.cli.command import command
from simdtex.cli.ending import afterwards
from simdtex.cli.places import FOLDER, WRITE


@command(
    ("bench --quick", "A first look, within a minute."),
)
@click.option(
    "--device",
    metavar="TEXT",
    help="Measure that device alone whose name or platform has this in it, or a number of `simdtex devices`.  "
    "[all usable]",
)
@click.option("--quick", is_flag=True, help="Take small sizes: a minute instead of some six.")
@click.option("--json", "path", type=WRITE, metavar="FILE", help="Write all that was measured.")
@click.option("--plot", "folder", type=FOLDER, metavar="DIR", help="Draw rooflines and growth.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing on what is being measured, and show no tables.")
def bench(device: str | None, quick: bool, path: Path | None, folder: Path | None, quiet: bool) -> None:
    """Measure what devices can do at most, and what the methods take.

    Everything is measured in one run and compared in ratios: with the device's own limits and with the NumPy
    reference. Leave the machine alone meanwhile.
    """
    from simdtex.bench import run as benchmark
    from simdtex.bench.cases import SIZES
    from simdtex.io.atomic import atomic_path
    from simdtex.io.image import check_writable
    from simdtex.report.bench import plot, render
    from simdtex.report.folder import earlier_files

    if path:
        check_writable(path, suffixes=(".json",))
    if folder:
        earlier_files(folder, "the plots", lambda name: name.endswith(".png"))
    infos = benchmark.chosen(device)

    def tell(what: str) -> None:
        if not quiet:
            click.echo(what, err=True)

    found = benchmark.run(SIZES["quick" if quick else "full"], infos, tell)
    if path:
        with afterwards(), atomic_path(path) as whole:
            whole.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    pictures: list[Path] = []
    if folder:
        with afterwards():
            pictures = plot(found, folder)
    if not quiet:
        render(found)
        for picture in [*([path] if path else []), *pictures]:
            click.echo(picture)
