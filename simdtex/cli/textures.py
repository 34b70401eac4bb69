# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex synth``, ``extend``, ``tile`` and ``fill``: textures, also in tiles; and ``resume``."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import chdir
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import ENTER, RESUME, RUNS, command, note
from simdtex.cli.inputs import (
    Also,
    Folder,
    Material,
    Reading,
    arranged,
    check_profiles,
    last_iteration,
    output_shape,
    planes,
    read_also,
    read_inputs,
    read_lead,
    read_material,
    take_reading,
)
from simdtex.cli.job import Task, command_line, job, notes, observed, short_seed, watching, write_page
from simdtex.cli.options import (
    DEVICE,
    DIRECTION,
    DIRECTIONS,
    OUTPUT,
    PREVIEW,
    PROFILE,
    QUIET,
    Parsed,
    given,
    input_options,
    material_options,
    option,
    output_option,
    report_option,
    size_option,
    stages_option,
    together,
)
from simdtex.model.pictures import unknown_in

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
    from simdtex import distributed, synthesize
    from simdtex.report.tables import duration_text

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
    from simdtex import distributed

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
    from simdtex.report.page import check_folder
    from simdtex.report.synthesis import write_synthesis

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


SIDES = ("top", "bottom", "left", "right")
REPORTED = "its pictures, and how evenly it uses the picture"
"""What the page of a run shows."""


@job(
    ("synth gravel.png -o more.png", "Make a texture of twice the size that tiles."),
    ("synth brick -o more --size 2x", "Make more of a material: all maps in the folder brick, arranged alike."),
    ("synth gravel.png -o more.png --size 1024x512 --preview", "Set the size, and see 3x3 copies in more-3x3.png."),
    ("synth gravel.png -o more.zarr --size 32768x32768 --tiles 2048", "Make an output larger than the memory."),
    usual="output size seed method order also guide preview report dry_run device quiet",
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=ENTER)
@output_option("Write this picture, or a folder of maps; with --tiles a .zarr store.")
@size_option("that of --known or of the output guide, else twice the first sample")
@input_options("synth")
@material_options
@PREVIEW
@tiles_options
@stages_option("every level, sweep or iteration")
@report_option("its pictures, how evenly it uses the sample, and how much it copies")
@PROFILE
def synth(samples: tuple[Path, ...], output: Path, size: str | None, method: str, **options: Any) -> Task | None:
    """Synthesise a picture of any size with the texture of SAMPLE.

    The method mrf takes several samples of one type, and maps of them by --also MAP0,MAP1=OUT; unknown pixels may be
    NaN. SAMPLE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    from simdtex.io.decode import NOTHING
    from simdtex.io.hard_data import HardData
    from simdtex.jobs.synthesis import synthesize

    context = click.get_current_context()
    check_tiles(context)
    how = take_reading(options)
    target, material = read_lead(samples, output, options, how)
    if method == "pyramid" and (options["source_map"] or options["also"] or isinstance(target, Folder)):
        remedy = "give one picture, and leave --source-map and --also out"
        raise ValueError(f"the method pyramid takes no pixel from the sample; {remedy}")
    pixels = material.pixels[0]
    data = read_inputs("synth", options, material, how)
    place = options.pop("geo", None)  # of the known pixels; a new picture was taken nowhere else
    known, guide = data["known"], data["guide"]
    shape = output_shape(size, pixels, known, guide and guide[1])
    if isinstance(known, HardData) and not known.from_top:
        data["known"] = known.upside_down(shape[0])
    if context.params["report"] and (material.several or known is not None or not material.known):
        raise ValueError("--report requires one sample without unknown pixels, and no --known; leave it out")
    if options["tiles"] is not None:
        others = read_also(options["also"], material, files=False)
        left_out = ("tiles", "workers", "also", "source_map", "preview")
        synthesize_in_tiles(context, material.array, (shape[0], shape[1]), others, data | given(options, left_out))
        return None
    like = (material.metadata or NOTHING).at(place and NOTHING._replace(geo=place))._replace(exif=None)
    foreign = "" if known is None else "the maps have no values for known pixels, which are not from the sample"
    writers = arranged(target, material, like, options, kept=known is not None, foreign=foreign)

    def more(made: Any, output: Any) -> None:
        statistics = output.statistics
        if method == "multires":
            counts = " ".join(f"{level['candidates']:.3g}" for level in statistics["levels"][1:])
            click.echo(f"candidates per level, coarse to fine: {counts}")
        elif method == "pyramid":
            click.echo(last_iteration(statistics))
        notes(output)
        if options["array"]:
            from simdtex.report.tables import print_accounting

            print_accounting(statistics["accounting"])

    height, width = material.sizes[0]
    by = f"{len(samples)} samples" if material.several else f"{width}x{height}"
    return Task(
        partial(synthesize, material.array, shape, method=method, **data | given(options)),
        f"{shape[1]}x{shape[0]} from {by}",
        str(target),
        writers,
        material.limits,
        more,
        partial(write_page, pixels),
    )


@job(
    ("extend photo.png -o wide.png --left 200 --right 200", "Add pixels on two sides."),
    ("extend photo.png -o larger.png --size 150% --seamless", "Add pixels at the right and below, and make it tile."),
    ("extend brick -o larger --right 512", "Extend all maps in the folder brick: albedo, normal, roughness..."),
    usual="output left right top bottom size seamless seed also preview dry_run device quiet",
)
@click.argument("picture", type=ENTER)
@OUTPUT
@input_options("extend", *SIDES)
@size_option("that with the pixels of --left, --right, --top and --bottom", base="PICTURE")
@input_options("extend", "seamless", "band", "light")
@material_options
@PREVIEW
@stages_option("every level and sweep")
@report_option(REPORTED)
def extend(size: str | None, seamless: Any, **options: Any) -> Task:
    """Continue PICTURE beyond its edges, or make it seamless.

    PICTURE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    if seamless is None and options["band"] is not None:
        raise ValueError("--band requires --seamless; leave it out, or give --seamless too")
    sides = {name: options.pop(name) or 0 for name in SIDES}
    return continued(seamless or False, sides, size, **options)


@job(
    ("tile photo.png -o tile.png", "Make a photo tile."),
    ("tile brick -o tiled --preview", "Make all maps of a material tile; tiled-3x3.png shows copies."),
    ("tile panorama.png -o round.png --direction x", "Join left and right only."),
    usual="output direction band seed also roles preview report dry_run device quiet",
    of="extend",
)
@click.argument("picture", type=ENTER)
@OUTPUT
@option(
    "--direction",
    type=DIRECTION,
    words=DIRECTIONS,
    default="both",
    show_default=True,
    help="Join left and right (x), top and bottom (y), or both.",
)
@input_options("extend", "band", "light")
@material_options
@PREVIEW
@stages_option("every level and sweep")
@report_option(REPORTED)
def tile(direction: Any, **options: Any) -> Task:
    """Make PICTURE tile, or all maps of a material.

    A band along the edges is replaced; the rest does not change. PICTURE may be a folder with the maps of a material,
    whose names end in their kind, such as brick_albedo.png and brick_normal.png; the output is then a folder too. The
    albedo decides the arrangement. To let another map decide, give its path instead of the folder's.
    """
    return continued(direction, dict.fromkeys(SIDES, 0), None, **options)


def continued(
    seamless: Any, sides: dict[str, int], size: str | None, *, picture: Path, output: Path, **options: Any
) -> Task:
    """Return the task that continues a picture, or a folder of maps; ``seamless`` as in `simdtex.extend`."""
    from simdtex import extend

    target, whole = read_lead([picture], output, options, Reading(palette=bool(options["categorical"])))
    pixels, (rows, cols) = whole.pixels[0], whole.sizes[0]
    if size is not None:
        sides = _sides(size, sides, (rows, cols))
    metadata = whole.metadata
    if metadata and metadata.geo:
        metadata = metadata._replace(geo=metadata.geo.moved(sides["left"], sides["top"]))
    writers = arranged(target, whole, metadata, options)
    width, height = cols + sides["left"] + sides["right"], rows + sides["top"] + sides["bottom"]
    return Task(
        partial(extend, pixels, seamless=seamless, channel_axis=whole.channel_axis, **sides, **given(options)),
        f"{width}x{height} from {cols}x{rows}",
        str(target),
        writers,
        whole.limits,
        lambda made, output: notes(output),
        partial(write_page, pixels, continued=True),
    )


def _sides(text: str, sides: dict[str, int], shape: tuple[int, int]) -> dict[str, int]:
    """Return the number of pixels to add on each side for an output of a size."""
    from simdtex.io.image import parse_sides

    if any(sides.values()):
        raise ValueError("--size cannot be used with --left, --right, --top or --bottom; leave them out")
    size = parse_sides(text, "WIDTHxHEIGHT", shape[::-1])[::-1]
    more = [new - old for new, old in zip(size, shape, strict=True)]
    if min(more) < 0:
        raise ValueError(f"--size {text} is smaller than the picture of {shape[1]}x{shape[0]}; crop it first")
    return {"top": 0, "bottom": more[0], "left": 0, "right": more[1]}


@job(
    ("fill photo.png -o whole.png --mask hole.png", "Fill the white parts of a mask."),
    ("fill cutout.png -o whole.png", "Fill the transparent parts of a picture."),
    ("fill brick -o whole --grow 4", "Fill all maps in the folder brick where the albedo is transparent."),
    ("fill photo.png -o grass.png --mask car.png --sample meadow.png", "Fill with another texture."),
    usual="output mask invert grow feather samples reach seed also dry_run device quiet",
)
@click.argument("picture", type=ENTER)
@OUTPUT
@input_options("fill")
@material_options
def fill(
    picture: Path, output: Path, mask: Path | None, invert: bool | None, samples: tuple[Path, ...], **options: Any
) -> Task:
    """Fill the holes of PICTURE with the texture around them.

    Pixels outside the holes do not change, except with --grow and --feather. PICTURE may be a folder with the maps of a
    material, as in `simdtex tile`; the holes are those of the albedo, or of --mask.
    """
    from simdtex import fill
    from simdtex.jobs.filling import widened

    how = Reading(palette=bool(options["categorical"]))
    target, whole = read_lead([picture], output, options, how)
    pixels, hole = _hole(whole, mask, invert)
    whole = whole._replace(pixels=[pixels])
    texture = read_material(samples, how._replace(ascending=whole.ascending)) if samples else None
    if texture:
        check_profiles([whole.paths[0], samples[0]], [whole.metadata, texture.metadata])
    foreign = "maps cannot be filled with --sample, since no pixel comes from the picture" if texture else ""
    writers = arranged(target, whole, whole.metadata, options, foreign=foreign)
    sample = texture and texture.array
    filled = np.count_nonzero(widened(hole, options["grow"] or 0, options["feather"] or 0))
    axis = None if pixels.ndim == 2 else -1
    return Task(
        partial(fill, pixels, hole, sample=sample, channel_axis=axis, **given(options)),
        f"{filled} of {hole.size} pixels filled",
        str(target),
        writers,
    )


def _hole(whole: Material, mask: Path | None, invert: bool | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the picture, and its hole: where the mask is white or, without one, it is not opaque; or it is NaN."""
    from simdtex.io.image import read_mask, split_alpha

    pixels, gone = np.ma.getdata(whole.pixels[0]), planes(np.ma.getmaskarray(whole.pixels[0])).any(-1)
    if mask:
        hole = read_mask(mask, pixels.shape, ascending=whole.ascending) != bool(invert)
    elif invert:
        raise ValueError("--invert requires --mask; leave it out")
    else:
        pixels, hole = split_alpha(pixels, opaque=True, plain=bool(whole.metadata and whole.metadata.plain))
    return pixels, hole | gone | unknown_in(planes(pixels))


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
    from simdtex.cli import COMMANDS, load

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
    again = load(command["name"]) if command["name"] in COMMANDS else None
    if again is None or all(one.name != "checkpoint" for one in again.params):
        raise ValueError(f"the checkpoint in {path} is of a command that cannot be resumed; run that again")
    if not os.path.isdir(command["folder"]):
        raise ValueError(f"{command['folder']}, the folder of the run in {path}, does not exist; restore it")
    given = {"checkpoint": path.resolve(), "device": device, "quiet": quiet}
    with chdir(command["folder"]), again.make_context(f"simdtex {again.name}", list(command["words"])) as context:
        context.params |= {name: value for name, value in given.items() if value}
        again.invoke(context)
