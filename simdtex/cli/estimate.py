# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex estimate``: what data say of each cell."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import DATA, command
from simdtex.cli.guides import read_data
from simdtex.cli.inputs import output_shape, read_material, take_reading
from simdtex.cli.options import CHANNELS, DEVICE, SAMPLE_MASK, data_options, given, option, places, size_option
from simdtex.cli.places import EITHER, ENTER
from simdtex.cli.simulate import georeferenced, lies_of


@command(
    (
        "estimate facies.png -o probabilities.nc --known wells.csv --categorical",
        "Estimate the probability of each category, and the entropy.",
    ),
    ("estimate facies.gslib -o probabilities.sgems --known wells.csv --categorical", "Read a grid, and write a grid."),
)
@click.argument("training_image", nargs=-1, required=True, type=ENTER)
@click.option(
    "-o",
    "--output",
    required=True,
    type=EITHER,
    help="Write the maps here: .zarr, .nc or .npz, or as variables of a grid: .gslib, .sgems or .tif.",
)
@CHANNELS
@size_option("that of --known, else of TRAINING_IMAGE", "maps")
@data_options
@places
@SAMPLE_MASK
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
@DEVICE
@click.option("-q", "--quiet", is_flag=True, help="Show no summary.")
def estimate(
    training_image: tuple[Path, ...],
    output: Path,
    size: str | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Estimate each cell from data and TRAINING_IMAGE: category probabilities, or mean and variance.

    It draws no realisations, so the estimates have no sampling noise.
    """
    from simdtex import estimate
    from simdtex.io.grids import SUFFIXES, check_grid, write_grid
    from simdtex.io.realisations import check_realisations_path, write_realisations

    began, how = time.perf_counter(), take_reading(options, deep=True)
    material = read_material(training_image, how)
    if material.deep:
        raise ValueError(f"{training_image[0]} is a volume, and estimates are maps; use simdtex simulate")
    if material.channel_axis is not None:
        raise ValueError(f"{training_image[0]} has several channels; give a training image of one variable")
    data = read_data(material, options, how)
    known, mask = data["known"], data["mask"]
    shape = output_shape(size, material.pixels[0], known, material.pixels[0])
    if known is None:
        raise ValueError("an estimate requires data; give --known")
    lies = lies_of(material, options.pop("origin"), options.pop("cell"))
    if grid := check_realisations_path(output) in SUFFIXES:
        check_grid(output, material.pixels, **lies)
    inputs = given(options) | lies
    made = estimate(material.array, known=known, shape=(shape[0], shape[1]), mask=mask, **inputs)
    made = georeferenced(made, material.crs)
    if grid:
        variables = {str(name): one.values for name, one in made.data_vars.items() if name != "probability"}
        if "probability" in made:
            names = made.category.values.tolist()
            variables |= {f"probability_{name}": made.probability.values[k] for k, name in enumerate(names)}
        write_grid(output, variables, crs=material.crs, **lies)
    else:
        write_realisations(output, made)
    if not quiet:
        seconds = time.perf_counter() - began
        click.echo(f"{output}: maps of {shape[1]}x{shape[0]} in {seconds:.1f} s on {made.attrs['device']}")
