# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex bench``: how long the methods take on the devices here."""

from __future__ import annotations

import json
from pathlib import Path

import click

from simdtex.cli.command import command
from simdtex.cli.ending import afterwards
from simdtex.cli.options import QUIET
from simdtex.cli.places import WRITE


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
    from simdtex.bench import run as benchmark
    from simdtex.io.atomic import atomic_path
    from simdtex.io.image import check_writable
    from simdtex.report.terminal import print_benchmark

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
