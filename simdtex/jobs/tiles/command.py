# SPDX-License-Identifier: BSD-3-Clause
"""The options ``--tiles`` and ``--workers``, and outputs in tiles on the command line."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import RESUME, RUNS, note
from simdtex.cli.inputs import (
    Also,
)
from simdtex.cli.job import command_line, observed, short_seed, watching
from simdtex.cli.options import (
    Parsed,
    option,
    together,
)

ALONE = ("stages", "profile", "array", "preview", "checkpoint")
"""Options that are of a picture which one process holds."""


CALIBRATED = 512
"""The side of the output, in pixels, from which the time of tiles is estimated."""


workers_option = option(
    "--workers",
    group=RUNS,
    metavar="N|ADDRESS",
    type=Parsed(lambda text: text if "://" in text else int(text), "a number or an address such as tcp://HOST:8786"),
    help="Use N processes on this machine for the tiles, or the workers of the Dask scheduler at tcp://HOST:8786.",
)


tiles_options = together(
    option(
        "--tiles",
        group=RUNS,
        type=int,
        metavar="SIDE",
        help="Make the output in tiles of this many pixels a side, in a .zarr store, for outputs larger than "
        "one machine. The pixels are the same. Then --source-map is STORE/source, and --also MAP=STORE/NAME.",
    ),
    workers_option,
)


def check_tiles(context: click.Context) -> None:
    """Raise if options exclude one another."""
    given = context.params
    if given["tiles"] is None:
        if given["workers"] is not None:
            raise ValueError("--workers requires --tiles; give the side of a tile, such as --tiles 2048")
        return
    if given["method"] != "mrf":
        raise ValueError(f"the method {given['method']} needs the whole output at once; leave --tiles out")
    for name in ALONE:
        if given.get(name):
            raise ValueError(f"--{name.replace('_', '-')} cannot be used with --tiles; leave out one of them")
    if given["output"].suffix.lower() != ".zarr":
        raise ValueError(f"{given['output']} is not a .zarr store, which --tiles requires; end its name in .zarr")
    if given["source_map"] not in (None, given["output"] / "source"):
        raise ValueError(
            f"with --tiles the source map is an array of the store; give --source-map {given['output'] / 'source'}"
        )


def synthesize_in_tiles(
    context: click.Context, sample: Any, shape: tuple[int, int], others: Sequence[Also], options: dict[str, Any]
) -> None:
    """Make an output in tiles and other maps in its arrangement; ``options`` are keywords of `distributed.plan`."""
    from simdtex.figures.tables import duration_text
    from simdtex.jobs import tiles as distributed
    from simdtex.jobs.synthesis.job import synthesize

    given, began = context.params, time.perf_counter()
    output: Path = given["output"]
    for one in others:
        if one.out.parent != output:
            raise ValueError(f"{one.out} is not an array of the store; end --also in ={output / one.out.stem}")
    options |= {"source_map": given["source_map"] is not None}
    options |= {"maps": {one.out.name: one.maps.array for one in others}}
    plan = distributed.plan(sample, shape, tiles=given["tiles"], **options)
    if given["dry_run"] or not given["quiet"]:
        for line in plan.lines():
            click.echo(line, err=not given["dry_run"])
    if given["dry_run"]:
        if options["known"] is None and options["guide"] is None:  # which have the size of the output
            side = min(CALIBRATED, *shape)
            own = {name: value for name, value in options.items() if name not in ("source_map", "maps")}
            seconds, _ = observed(partial(synthesize, sample, (side, side), **own), given["device"])
            click.echo(f"one process needs about {duration_text(seconds * prod(shape) / side**2)}; nothing was written")
        return
    options |= {"rng": short_seed() if given["seed"] is None else given["seed"], "ended": _write_report, "note": note}
    options |= {name: given[name] for name in ("tiles", "workers", "device")}
    if given["report"]:
        options["command"] = {"report": os.path.realpath(given["report"]), "line": command_line()}
    context.meta[RESUME] = output
    with watching(given["quiet"]) as callback:
        distributed.synthesize(sample, shape, output, callback=callback, **options)
    _done(output, given["quiet"], began)


def resume_tiles(store: Path, workers: int | str | None, device: str | None, quiet: bool) -> None:
    """Go on with an output in tiles."""
    from simdtex.jobs import tiles as distributed

    began, finished = time.perf_counter(), distributed.finished(store)
    click.get_current_context().meta[RESUME] = store
    with watching(quiet) as callback:
        distributed.resume(store, workers=workers, device=device, callback=callback, note=note, ended=_write_report)
    if finished:
        click.echo(f"{store} is finished already")
    else:
        _done(store, quiet, began)


def _write_report(samples: list[Any], image: Any, output: Any, command: dict[str, str] | None) -> None:
    """Write the report of an output that is complete, if the command that began it has ``--report``."""
    if command is None:
        return
    from simdtex.figures.page import check_folder
    from simdtex.jobs.synthesis.report import write_synthesis

    try:
        check_folder(command["report"])
    except ValueError as error:
        store = click.get_current_context().meta[RESUME]
        raise ValueError(f"{error}; then go on with: simdtex resume {store}") from None
    write_synthesis(command["report"], samples[0], image, output, command["line"])


def _done(store: Path, quiet: bool, began: float) -> None:
    if quiet:
        return
    import zarr

    root: Any = zarr.open_group(store, mode="r")
    (rows, cols), seed = root["image"].shape[:2], root.attrs["simdtex"]["seed"]
    click.echo(f"{store}: {cols}x{rows} in {time.perf_counter() - began:.1f} s, seed {seed}; the array is called image")
