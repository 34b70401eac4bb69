# SPDX-License-Identifier: BSD-3-Clause
"""The options ``--tiles`` and ``--workers``, and outputs in tiles on the command line."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from simdtex.cli.command import RESUME, RUNS
from simdtex.cli.job import observed, short_seed, watching
from simdtex.cli.options import Parsed, option, together

if TYPE_CHECKING:
    from simdtex.jobs.tiles.job import TileStore
    from simdtex.run import Progress

ALONE = ("stages", "profile", "array", "preview", "checkpoint")
"""Options that are of a picture which one process holds."""

CALIBRATED = 512
"""The side of the output, in pixels, from which the time of tiles is estimated."""

WORKERS = option(
    "--workers",
    group=RUNS,
    metavar="N|ADDRESS",
    type=Parsed(lambda text: text if "://" in text else int(text), "a number or an address such as tcp://HOST:8786"),
    help="Use N processes on this machine for the tiles, or the workers of the Dask scheduler at tcp://HOST:8786.",
)
TILES = together(
    option(
        "--tiles",
        group=RUNS,
        type=int,
        metavar="SIDE",
        help="Make the output in tiles of this many pixels a side, in a .zarr store, for outputs larger than "
        "one machine. The pixels are the same. Then --source-map is STORE/source, and --also MAP=STORE/NAME.",
    ),
    WORKERS,
)


def check_tiles(given: dict[str, Any]) -> None:
    """Raise if options of a command exclude one another."""
    if given["tiles"] is None:
        if given["workers"] is not None:
            raise ValueError("--workers requires --tiles; give the side of a tile, such as --tiles 2048")
        return
    if given["method"] != "mrf":
        raise ValueError(f"the method {given['method']} needs the whole output at once; leave --tiles out")
    for name in ALONE:
        if given.get(name):
            raise ValueError(f"--{name.replace('_', '-')} cannot be used with --tiles; leave out one of them")
    output: Path = given["output"]
    if output.suffix.lower() != ".zarr":
        raise ValueError(f"{output} is not a .zarr store, which --tiles requires; end its name in .zarr")
    if given["source_map"] not in (None, output / "source"):
        raise ValueError(f"with --tiles the source map is an array of the store; give --source-map {output / 'source'}")
    for _, out in given["also"]:
        if out.parent != output:
            raise ValueError(f"{out} is not an array of the store; end --also in ={output / out.stem}")


def make_in_tiles(store: TileStore, job: Any) -> None:
    """Make the output of a job in a store, as the running command says; or print its tiles and the expected time."""
    from simdtex.driver import run
    from simdtex.figures.tables import duration_text

    params = click.get_current_context().params
    unsaid = 0 if params["dry_run"] else short_seed()
    tiles = store.plan(job, unsaid if params["seed"] is None else params["seed"])
    if params["dry_run"] or not params["quiet"]:
        for line in tiles.layout.lines():
            click.echo(line, err=not params["dry_run"])
    if not params["dry_run"]:
        with _going_on(store, params["quiet"]) as callback:
            store.make(job, tiles, params["device"], callback)
    elif job.given is None and job.guide is None:  # which have the size of the output
        side = min(CALIBRATED, *job.shape)
        part = replace(job, shape=(side, side))
        seconds, _ = observed(lambda *, full_output, **how: run("synthesize", part, **how), params["device"])
        time_needed = duration_text(seconds * prod(job.shape) / side**2)
        click.echo(f"one process needs about {time_needed}; nothing was written")


def resume_tiles(store: TileStore, device: str | None, quiet: bool) -> None:
    """Go on with an output in tiles."""
    finished = store.finished
    with _going_on(store, quiet or finished) as callback:
        store.resume(device, callback)
    if finished:
        click.echo(f"{store.path} is finished already")


@contextmanager
def _going_on(store: TileStore, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield a callback that reports progress; then say what was made, or how to go on with it."""
    began, path = time.perf_counter(), Path(store.path)
    click.get_current_context().meta[RESUME] = path
    with watching(quiet) as callback:
        yield callback
    if not quiet:
        import zarr

        root: Any = zarr.open_group(path, mode="r")
        (rows, cols), seed = root["image"].shape[:2], root.attrs["simdtex"]["seed"]
        took = f"in {time.perf_counter() - began:.1f} s"
        click.echo(f"{path}: {cols}x{rows} {took}, seed {seed}; the array is called image")
