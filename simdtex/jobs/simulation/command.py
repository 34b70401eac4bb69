# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex simulate`` and ``estimate``: realisations of a training image, and what data say of each cell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from simdtex.cli.command import DATA, DEVICE_GROUP, ENTER, OUTPUTS, READ, WRITE_PAIR, note
from simdtex.cli.inputs import (
    Material,
    Reading,
    in_place,
    output_shape,
    planes,
    read_guides,
    read_known,
    read_masks,
    read_material,
    read_pixels,
    read_table,
    take_reading,
)
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import (
    GUIDE,
    KNOWN_OPTIONS,
    NUMBERS,
    SAMPLE_MASK,
    given,
    option,
    output_option,
    report_option,
    size_option,
    together,
)
from simdtex.methods.mrf import options as mrf

if TYPE_CHECKING:
    from simdtex.jobs.simulation.job import Estimation, Simulation
    from simdtex.jobs.simulation.maps import Cells
    from simdtex.run import Output

data_option = partial(option, group=DATA)

CELL_OPTIONS = together(
    SAMPLE_MASK,
    KNOWN_OPTIONS,
    data_option(
        "--channels",
        is_flag=True,
        default=None,
        help="Treat the last axis of a .npy of three axes as channels.  [such a file is a volume]",
    ),
    data_option(
        "--origin",
        type=NUMBERS,
        metavar="X,Y[,Z]",
        help="Place the centre of the first cell here, in the units of the table of --known.  [see --like, else 0,0]",
    ),
    data_option(
        "--cell",
        type=NUMBERS,
        metavar="DX,DY[,DZ]",
        help="Make cells of this size, in the same units.  [see --like, else 1,1]",
    ),
    data_option(
        "--like",
        type=READ,
        metavar="GRID",
        help="Place the output where this grid or raster lies, and give it its size.  [that of --known, --region and "
        "other maps that are grids; else --origin and --cell; else that of a grid TRAINING_IMAGE]",
    ),
    data_option(
        "--several",
        words=("refuse", "mean", "most"),
        help="Resolve different data of a table in one cell: by an error (refuse), their mean (mean), or the most "
        "frequent value (most).  [refuse]",
    ),
    data_option(
        "--outside",
        words=("refuse", "skip"),
        help="Treat data of a table outside of the cells as an error (refuse), or leave them out (skip).  [refuse]",
    ),
    data_option(
        "--variables",
        multiple=True,
        metavar="NAME",
        help="Take this variable of a grid TRAINING_IMAGE; may be repeated.  [all]",
    ),
    option(
        "--at",
        group=OUTPUTS,
        type=WRITE_PAIR,
        metavar="POINTS=TABLE",
        help="Write the values at the points of this table of x and y into TABLE, a .csv with a column for each map.",
    ),
)
"""The data, and where the cells of an output lie."""

MAPS = {
    "region": "Make only cells in the white parts of this picture, or above 0 in this grid, of the size of a "
    "realisation.",
    "probabilities": "Follow these probabilities of the categories, in ascending order of category: a table of x, y "
    "and one column for each, or a .npy, .tif or grid with one channel for each; unknown ones are NaN.",
    "image_map": "Take each cell from the TRAINING_IMAGE of this number, counted from 0; a file with a channel for "
    "each gives their weights.",
    "rotation": "Draw each cell from TRAINING_IMAGE turned by this many degrees from x to y, in eighths of a turn.",
    "scale": "Draw each cell from TRAINING_IMAGE enlarged by this factor, 0.5 to 2, in powers of the square root of 2.",
}
"""The maps of a simulation, and the help of their options."""

TRAINING_IMAGE = click.argument("training_image", nargs=-1, required=True, type=ENTER)


def flag(name: str) -> str:
    """Return the option of a parameter."""
    return f"--{'sample-mask' if name == 'mask' else name.replace('_', '-')}"


@job(
    ("simulate facies.png -o many.nc -n 50 --categorical --known wells.csv", "Make 50 realisations that honour wells."),
    ("simulate facies.png -o many.zarr -n 10 --size 500x500 --report page", "Set the size, and write a page."),
    ("simulate facies.gslib -o many.sgems --known wells.csv --origin 5,5 --cell 10,10", "Read and write grids."),
    usual="output number size seed known categorical columns origin cell report dry_run device quiet",
    methods=[mrf.Options],
)
@TRAINING_IMAGE
@output_option("Write the realisations here: .zarr, .nc or .npz, or as a grid: .gslib, .sgems or .tif.")
@size_option("that of --known or of a map, else of TRAINING_IMAGE", "realisations", "TRAINING_IMAGE")
@option("-n", "--number", type=int, help="Make this many realisations.  [1]")
@option("--first", type=int, help="Start with the realisation of this number.")
@CELL_OPTIONS
@GUIDE
@together(*(data_option(flag(name), type=READ, metavar="FILE", help=help) for name, help in MAPS.items()))
@option(
    "--source",
    is_flag=True,
    group=OUTPUTS,
    help="Write the position in TRAINING_IMAGE of each cell too: .zarr, .nc or .npz.",
)
@option(
    "--jobs",
    type=int,
    group=DEVICE_GROUP,
    help="Make this many realisations at a time.  [one for each core, at most 4; on a GPU 1]",
)
@report_option("realisations, shares, entropy, variograms, connectivity, variety")
def simulate(
    training_image: tuple[Path, ...],
    output: Path,
    number: int | None,
    size: str | None,
    source: bool,
    guide: Any,
    **options: Any,
) -> Task:
    """Simulate realisations that look like TRAINING_IMAGE and honour data.

    A realisation depends only on the seed and on its number.
    """
    from simdtex.io.volume import write_realisations
    from simdtex.jobs.simulation.job import plan_simulation

    how, number = take_reading(options, deep=True), 1 if number is None else number
    material = read_material(training_image, how)
    lies = options["origin"], options["like"]
    data = read_data(material, how, options)
    data["guide"], options["labels"] = read_guides(guide, material, how, options["labels"])
    data |= {name: read_map(name, options.pop(name), material, how, *lies) for name in MAPS}
    cells = check_cells(material, output, size, data, options, source)
    if click.get_current_context().params["report"]:
        if source or data["region"] is not None:
            raise ValueError("--report cannot be used with --source or --region; leave them out")
        _check_report(material, cells)
    plan = plan_simulation(cells, number, source=source, **given(options))

    return Task(
        partial(make, "simulate", plan),
        f"{number} realisation{'s' * (number != 1)} of {size_of(cells)}",
        str(output),
        [lambda made, run: write_realisations(output, made), *cells.given["at"]],
        more=_say_shares,
        report=lambda folder, made, run: _report(folder, material, made, cells),
    )


@job(
    ("estimate facies.png -o probabilities.nc --known wells.csv --categorical", "Estimate the probabilities."),
    ("estimate facies.gslib -o probabilities.sgems --known wells.csv --categorical", "Read a grid, and write a grid."),
    seeded=False,
)
@TRAINING_IMAGE
@output_option("Write the maps here: .zarr, .nc or .npz, or as variables of a grid: .gslib, .sgems or .tif.")
@size_option("that of --known, else of TRAINING_IMAGE", "maps", "TRAINING_IMAGE")
@CELL_OPTIONS
@data_option("--categorical", is_flag=True, default=None, help="Treat values as categories.")
@option("--nearest", type=int, help="Use this many data for each cell, the nearest.  [8]")
@option(
    "--reach",
    type=int,
    help="Use data up to this many cells away.  [an eighth of the smaller of rows and columns of TRAINING_IMAGE]",
)
@option("--bandwidth", type=float, help="Set the width of the Parzen kernel, in units of h_opt.  [1]")
def estimate(training_image: tuple[Path, ...], output: Path, size: str | None, **options: Any) -> Task:
    """Estimate each cell from data and TRAINING_IMAGE: category probabilities, or mean and variance.

    It draws no realisations, so the estimates have no sampling noise.
    """
    from simdtex.io.volume import write_realisations
    from simdtex.jobs.simulation.job import plan_estimation

    how = take_reading(options, deep=True)
    material = read_material(training_image, how)
    if material.channel_axis is not None:
        raise ValueError(f"{training_image[0]} has several channels; give a training image of one variable")
    data = read_data(material, how, options)
    if data["known"] is None:
        raise ValueError("an estimate requires data; give --known")
    cells = check_cells(material, output, size, data, options)
    plan = plan_estimation(cells, **given(options))

    writers: list[Any] = [lambda made, _: write_realisations(output, made), *cells.given["at"]]
    return Task(partial(make, "estimate", plan), f"maps of {size_of(cells)}", str(output), writers)


def make(name: str, plan: Simulation | Estimation, full_output: bool, **call: Any) -> tuple[Any, Output]:
    """Run a job, and return its result with the attributes as statistics."""
    from simdtex.driver import run
    from simdtex.run import Output

    made = plan.result(*run(name, plan, **call))
    return made, Output(None, statistics=made.attrs)


def read_data(material: Material, how: Reading, options: dict[str, Any]) -> dict[str, Any]:
    """Return the mask, the data and the place of an output, whose options are taken out."""
    from simdtex.io.hard_data import read_hard_data

    mask, path, like = (options.pop(name) for name in ("sample_mask", "known", "like"))
    data = {"mask": read_masks(mask, material, how), "like": None, "at": []}
    data["known"], _ = read_known(path, material, how, options["origin"], like)
    if options["at"]:
        points = partial(read_hard_data, options["at"][0][0])
        try:
            data["at"] = points(columns={**(how.columns or {}), "value": []})
        except ValueError:  # without these columns
            data["at"] = points(columns={"value": []})
    if like:
        pixels, _, grid = read_pixels(like, how._replace(variables=()))
        if grid is None or not grid.frame.told:
            raise ValueError(f"{like} does not say where its cells lie; give a grid or a raster with coordinates")
        data["like"] = in_place(pixels[..., :1], grid)
    return data


def read_map(
    name: str, path: Path | None, material: Material, how: Reading, origin: Sequence[float] | None, like: Path | None
) -> Any:
    """Read a map of a simulation: of probabilities a table, too; any other a picture or a grid, channels in front."""
    from simdtex.io import grids, image

    if path is None:
        return None
    how = how._replace(channels=not material.deep)
    if name == "probabilities" and (table := read_table(path, material, how, origin, like)) is not None:
        return table
    if name == "region" and how.channels and not grids.is_grid(path):  # a picture, whose white parts it is
        return image.read_mask(path, image.read(path).pixels.shape, ascending=how.ascending)
    pixels, _, grid = read_pixels(path, how._replace(palette=name == "image_map", variables=()))
    pixels = planes(pixels) > 0 if name == "region" else planes(pixels)
    several = pixels.shape[-1] > 1
    values: Any = in_place(pixels, grid) if grid else pixels if several else pixels[..., 0]
    if several:
        return values.transpose("variable", ...) if grid else np.moveaxis(values, -1, 0)
    return values


def check_cells(
    material: Material, output: Path, size: str | None, data: dict[str, Any], options: Any, source: bool = False
) -> Cells:
    """Return the cells of an output, whose options are taken out; ``"at"`` is what writes the values at points."""
    from simdtex.io.files import check_target
    from simdtex.io.grids import SUFFIXES, check_grid
    from simdtex.io.hard_data import HardData, sites_of
    from simdtex.io.volume import check_realisations_path, write_at
    from simdtex.jobs.simulation.maps import plan_cells

    shape = None if size is None else output_shape(size, material.pixels[0], axes=2 + material.deep)
    lies = given({name: options.pop(name) for name in ("origin", "cell", "several", "outside")})
    training = material.array
    if material.grid is not None:  # which has coordinates
        first, *others = material.pixels
        placed = in_place(first if material.channel_axis else first[..., None], material.grid)
        training = [placed, *others] if others else placed
    cells = plan_cells(training, shape, data, material.channel_axis, flag, **lies)
    frame = cells.place.frame if cells.place else None
    if check_realisations_path(output, source=source) in SUFFIXES:
        check_grid(output, material.pixels, *(frame or (None, None)))
    for name, table in cells.given.items():
        if isinstance(table, HardData) and table.from_top:
            cells.given[name] = table.upside_down(cells.size[-2], frame)
    if at := options.pop("at"):
        points, (paths, out) = cells.given["at"], at
        if len(paths) > 1 or out.suffix.lower() != ".csv":
            raise ValueError(f"--at reads {len(paths)} tables and writes {out}; give one of each, the new one a .csv")
        check_target(out)
        sites, inside = sites_of(points, cells.size, lies.get("outside") == "skip", *(frame or ()))
        cells.given["at"] = [lambda made, _: write_at(out, made, points.points[inside], sites)]
    return cells


def size_of(cells: Cells) -> str:
    """Return width x height, of a volume x depth, as text."""
    return "x".join(map(str, cells.size[::-1]))


def _say_shares(made: Any, _: Output) -> None:
    """Print the shares of categories that were asked and those reached."""
    if "shares_asked" in made.attrs:
        click.echo("shares of categories: {shares_asked} asked, {shares_reached} reached".format(**made.attrs))


def _report(folder: Path, material: Material, made: Any, cells: Cells) -> None:
    from simdtex.io.hard_data import HardData
    from simdtex.jobs.simulation.report import unlike, write_ensemble, write_volumes

    pixels, categorical = material.pixels[0], bool(json.loads(made.attrs["options"])["categorical"])
    data, known = None, cells.given["known"]
    if known is not None:
        known = cells.put(known, cells.size) if isinstance(known, HardData) else np.ma.masked_invalid(known)
        at = np.nonzero(~np.ma.getmaskarray(known))
        data = np.stack([*at[::-1], known.data[at].astype(np.float64)], -1)
    shown: dict[str, Any] = {"data": data, "command": command_line()}
    if not categorical and (sentence := unlike(made.values, pixels)):
        note(sentence)
    if material.deep:
        write_volumes(folder, pixels, made, categorical, **shown)
    else:
        write_ensemble(folder, pixels, made, categories=None if categorical else [], **shown)


def _check_report(material: Material, cells: Cells) -> None:
    """Raise if a report cannot be made, before anything is simulated."""
    from simdtex.jobs.simulation.ensemble import LEAST_IMAGE_SIDE
    from simdtex.options import LARGEST

    if material.several or material.channel_axis is not None:
        raise ValueError("--report requires one training image of one variable; leave it out")
    if not material.known:
        raise ValueError("--report requires a training image without unknown cells; leave it out")
    known = cells.given["known"]
    given = material.pixels if known is None else [*material.pixels, getattr(known, "values", known)]
    if not material.deep and min(*cells.size, *material.pixels[0].shape) < LEAST_IMAGE_SIDE:
        least = f"{LEAST_IMAGE_SIDE}x{LEAST_IMAGE_SIDE} pixels"
        raise ValueError(f"--report requires {least} or more; give a larger size, or leave it out")
    if any(np.fmax.reduce(np.abs(np.ma.getdata(one), dtype=np.float64), None) > LARGEST for one in given):
        raise ValueError(f"--report requires values up to {LARGEST:g}; give them in a larger unit, or leave it out")
