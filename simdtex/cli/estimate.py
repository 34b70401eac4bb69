# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex estimate``: what data say of each cell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from simdtex.cli.command import DATA
from simdtex.cli.guides import read_data
from simdtex.cli.inputs import output_shape, read_material, take_reading
from simdtex.cli.job import Task, job
from simdtex.cli.options import given, option, output_option, size_option, training_options
from simdtex.cli.simulate import georeferenced, read_place


@job(
    (
        "estimate facies.png -o probabilities.nc --known wells.csv --categorical",
        "Estimate the probability of each category, and the entropy.",
    ),
    ("estimate facies.gslib -o probabilities.sgems --known wells.csv --categorical", "Read a grid, and write a grid."),
    random=False,
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
    from simdtex.io.realisations import write_realisations
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
