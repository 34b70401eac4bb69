# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex simulate`` and ``estimate``: realisations of a training image."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.command import DATA, DEVICE_GROUP, OUTPUTS
from simdtex.cli.inputs import MAPS, Material, output_shape, read_data, read_map, read_material, take_reading
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import GUIDE, given, option, output_option, reads, report_option, size_option, training_options


@job(
    ("simulate facies.png -o many.nc -n 50 --categorical --known wells.csv", "Make 50 realisations that honour wells."),
    ("simulate facies.png -o many.zarr -n 10 --size 500x500 --report page", "Set the size, and write a page."),
    ("simulate facies.gslib -o many.sgems --known wells.csv --origin 5,5 --cell 10,10", "Read and write grids."),
    usual="output number size seed known categorical columns origin cell report dry_run device quiet",
)
@training_options
@output_option("Write the realisations here: .zarr, .nc or .npz, or as a grid: .gslib, .sgems or .tif.")
@click.option("-n", "--number", default=1, show_default=True, type=int, help="Make this many realisations.")
@click.option("--first", default=0, show_default=True, type=int, help="Start with the realisation of this number.")
@size_option("that of --known or of a map, else of TRAINING_IMAGE", "realisations", "TRAINING_IMAGE")
@GUIDE
@reads(
    "--region",
    help="Make only cells in the white parts of this picture, or above 0 in this grid, of the size of a realisation.",
)
@reads(
    "--probabilities",
    help="Follow these probabilities of the categories, in ascending order of category: a table of x, y and one "
    "column for each, or a .npy, .tif or grid with one channel for each; unknown ones are NaN.",
)
@reads(
    "--image-map",
    help="Take each cell from the TRAINING_IMAGE of this number, counted from 0; a file with a channel for each gives "
    "their weights.",
)
@reads(
    "--rotation",
    help="Draw each cell from TRAINING_IMAGE turned by this many degrees from x to y, in eighths of a turn.",
)
@reads(
    "--scale",
    help="Draw each cell from TRAINING_IMAGE enlarged by this factor, 0.5 to 2, in powers of the square root of 2.",
)
@option(
    "--source",
    is_flag=True,
    group=OUTPUTS,
    help="Write the position in TRAINING_IMAGE of each cell too: .zarr, .nc or .npz.",
)
@option(
    "--jobs",
    group=DEVICE_GROUP,
    type=int,
    help="Make this many realisations at a time.  [one for each core, at most 4; on a GPU 1]",
)
@report_option("realisations, shares, entropy, variograms, connectivity, variety")
def simulate(
    training_image: tuple[Path, ...], output: Path, number: int, size: str | None, source: bool, **options: Any
) -> Task:
    """Simulate realisations that look like TRAINING_IMAGE and honour data.

    A realisation depends only on the seed and on its number.
    """
    from simdtex import simulate
    from simdtex.io.volume import write_realisations
    from simdtex.run import Output

    how = take_reading(options, deep=True)
    material = read_material(training_image, how)
    lies = read_place(material, output, options, source)
    data = read_data(material, options, how)
    known, pixels = data["known"], material.pixels[0]
    files = {name: options.pop(name) for name in MAPS}
    how = how._replace(channels=not material.deep)
    maps = {name: read_map(name, path, how) for name, path in files.items() if path}
    cells = [one[0] if one.ndim == 3 + material.deep else one for one in maps.values() if isinstance(one, np.ndarray)]
    shape = output_shape(size, pixels, known, *cells, pixels, axes=2 + material.deep)
    place = lies | given({name: options.pop(name) for name in ("several", "outside")})
    if click.get_current_context().params["report"]:
        if source or "region" in maps:
            raise ValueError("--report cannot be used with --source or --region; leave them out")
        _check_report(material, shape, getattr(known, "values", known))
    inputs = data | given(options) | {"shape": shape, "source": source} | maps | place

    def make(full_output: bool, **call: Any) -> tuple[Any, Output]:
        made = georeferenced(simulate(material.array, number, **inputs, **call), material.crs)
        return made, Output(None, statistics=made.attrs)

    return Task(
        make,
        f"{number} realisation{'s' * (number != 1)} of {'x'.join(map(str, shape[::-1]))}",
        str(output),
        [lambda made, run: write_realisations(output, made)],
        report=lambda folder, made, run: _report(folder, material, made, known, place),
    )


@job(
    ("estimate facies.png -o probabilities.nc --known wells.csv --categorical", "Estimate the probabilities."),
    ("estimate facies.gslib -o probabilities.sgems --known wells.csv --categorical", "Read a grid, and write a grid."),
    of=None,
)
@training_options
@output_option("Write the maps here: .zarr, .nc or .npz, or as variables of a grid: .gslib, .sgems or .tif.")
@size_option("that of --known, else of TRAINING_IMAGE", "maps", "TRAINING_IMAGE")
@option("--categorical", is_flag=True, group=DATA, help="Treat values as categories.")
@option("--nearest", default=8, show_default=True, type=int, help="Use this many data for each cell, the nearest.")
@option(
    "--reach", type=int, help="Use data up to this many cells away.  [an eighth of the smaller side of TRAINING_IMAGE]"
)
@option(
    "--bandwidth",
    default=1.0,
    show_default=True,
    type=float,
    help="Set the width of the Parzen kernel, in units of h_opt.",
)
def estimate(training_image: tuple[Path, ...], output: Path, size: str | None, **options: Any) -> Task:
    """Estimate each cell from data and TRAINING_IMAGE: category probabilities, or mean and variance.

    It draws no realisations, so the estimates have no sampling noise.
    """
    from simdtex import estimate
    from simdtex.io.volume import write_realisations
    from simdtex.run import Output

    how = take_reading(options, deep=True)
    material = read_material(training_image, how)
    if material.deep:
        raise ValueError(f"{training_image[0]} is a volume, and estimates are maps; use simdtex simulate")
    if material.channel_axis is not None:
        raise ValueError(f"{training_image[0]} has several channels; give a training image of one variable")
    lies = read_place(material, output, options)
    data = read_data(material, options, how)
    height, width = output_shape(size, material.pixels[0], data["known"], material.pixels[0])
    if data["known"] is None:
        raise ValueError("an estimate requires data; give --known")
    inputs: dict[str, Any] = {name: data[name] for name in ("known", "mask")} | given(options) | lies

    def make(device: Any, callback: Any, **_: Any) -> tuple[Any, Output]:
        made = estimate(material.array, shape=(height, width), device=device, callback=callback, **inputs)
        return georeferenced(made, material.crs), Output(None, statistics=made.attrs)

    return Task(make, f"maps of {width}x{height}", str(output), [lambda made, run: write_realisations(output, made)])


def read_place(material: Material, output: Path, options: dict[str, Any], source: bool = False) -> dict[str, Any]:
    """Return the origin and the size of cells; raise if the output cannot be written.

    As given by options, which are taken out; else of a training image that is a grid; else None.
    """
    from simdtex.io.grids import SUFFIXES, check_grid
    from simdtex.io.volume import check_realisations_path

    lies: dict[str, Any] = {name: options.pop(name) for name in ("origin", "cell")}
    if material.lies:  # whose z is left out if that of the other option is
        axes = min((len(one) for one in lies.values() if one), default=3)
        lies = {name: one or getattr(material.lies, name)[:axes] for name, one in lies.items()}
    if check_realisations_path(output, source=source) in SUFFIXES:
        check_grid(output, material.pixels, **lies)
    return lies


def georeferenced(made: Any, crs: str) -> Any:
    """Return an array or dataset of xarray with a coordinate reference system, if it is known, as CF describes it."""
    if not crs:
        return made
    found = made.assign_coords(spatial_ref=((), 0, {"crs_wkt": crs})).assign_attrs(crs=crs)
    for one in found.data_vars.values() if hasattr(found, "data_vars") else [found]:
        one.encoding["grid_mapping"] = "spatial_ref"
    return found


def _report(folder: Path, material: Material, made: Any, known: Any, place: dict[str, Any]) -> None:
    from simdtex.io.hard_data import HardData, place_hard_data
    from simdtex.report.ensemble import write_ensemble, write_volumes

    pixels, categorical = material.pixels[0], bool(json.loads(made.attrs["options"])["categorical"])
    shown: dict[str, Any] = {"command": command_line(), "upward": "cell_y" in made.attrs}
    if material.deep:
        write_volumes(folder, pixels, made.values, categorical, **shown)
        return
    data = None
    if known is not None:
        table = isinstance(known, HardData)
        known = place_hard_data(known, made.shape[1:], **place) if table else np.ma.masked_invalid(known)
        row, col = np.nonzero(~np.ma.getmaskarray(known))
        data = np.stack([col, row, known.data[row, col].astype(np.float64)], -1)
    categories: list[Any] | None = None if categorical else []
    write_ensemble(folder, pixels, made.values, data=data, categories=categories, **shown)


def _check_report(material: Material, shape: tuple[int, ...], known: Any) -> None:
    """Raise if a report cannot be made, before anything is simulated."""
    from simdtex.experiments.ensemble import LEAST_IMAGE_SIDE
    from simdtex.options import LARGEST

    if material.several or material.channel_axis is not None:
        raise ValueError("--report requires one training image of one variable; leave it out")
    if not material.known:
        raise ValueError("--report requires a training image without unknown cells; leave it out")
    given = material.pixels if known is None else [*material.pixels, known]
    if not material.deep and min(*shape, *material.pixels[0].shape) < LEAST_IMAGE_SIDE:
        least = f"{LEAST_IMAGE_SIDE}x{LEAST_IMAGE_SIDE} pixels"
        raise ValueError(f"--report requires {least} or more; give a larger size, or leave it out")
    if any(np.fmax.reduce(np.abs(np.ma.getdata(one), dtype=np.float64), None) > LARGEST for one in given):
        raise ValueError(f"--report requires values up to {LARGEST:g}; give them in a larger unit, or leave it out")
