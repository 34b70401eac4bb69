# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex simulate``, ``estimate`` and ``classify``: realisations of a training image, and which texture is where."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

from simdtex.cli.command import ENTER
from simdtex.cli.inputs import Material, in_place, output_shape, read_inputs, read_material, take_reading
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import given, input_options, output_option, report_option, size_option
from simdtex.declared import inputs as inputs_of
from simdtex.methods.mrf import options as mrf

TRAINING_IMAGE = click.argument("training_image", nargs=-1, required=True, type=ENTER)


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
@input_options("simulate")
@report_option("realisations, shares, entropy, variograms, connectivity, variety")
def simulate(
    training_image: tuple[Path, ...],
    output: Path,
    number: int | None,
    size: str | None,
    source: bool | None,
    **options: Any,
) -> Task:
    """Simulate realisations that look like TRAINING_IMAGE and honour data.

    A realisation depends only on the seed and on its number.
    """
    from simdtex.io.volume import write_realisations
    from simdtex.jobs.simulation.job import simulate
    from simdtex.jobs.simulation.maps import Maps
    from simdtex.run import Output

    how, number = take_reading(options, deep=True), 1 if number is None else number
    material = read_material(training_image, how)
    data = read_inputs("simulate", options, material, how)
    pixels, maps = material.pixels[0], [data[name] for name in Maps._fields if hasattr(data[name], "shape")]
    cells = [one[0] if one.ndim == 3 + material.deep else one for one in maps if one.ndim >= 2 + material.deep]
    shape = output_shape(size, pixels, data["like"], data["known"], *cells, pixels, axes=2 + material.deep)
    place = check_place(material, output, options, data, shape, bool(source))
    known = data["known"]
    if click.get_current_context().params["report"]:
        if source or data["region"] is not None:
            raise ValueError("--report cannot be used with --source or --region; leave them out")
        _check_report(material, shape, getattr(known, "values", known))
    inputs = data | given(options) | {"shape": shape, "source": bool(source)}

    def make(full_output: bool, **call: Any) -> tuple[Any, Output]:
        made = simulate(described(material), number, **inputs, **call)
        return made, Output(None, statistics=made.attrs)

    return Task(
        make,
        f"{number} realisation{'s' * (number != 1)} of {'x'.join(map(str, shape[::-1]))}",
        str(output),
        [lambda made, run: write_realisations(output, made)],
        more=lambda made, _: _say_shares(made.attrs),
        report=lambda folder, made, run: _report(folder, material, made, known, place),
    )


@job(
    ("estimate facies.png -o probabilities.nc --known wells.csv --categorical", "Estimate the probabilities."),
    ("estimate facies.gslib -o probabilities.sgems --known wells.csv --categorical", "Read a grid, and write a grid."),
    seeded=False,
)
@TRAINING_IMAGE
@output_option("Write the maps here: .zarr, .nc or .npz, or as variables of a grid: .gslib, .sgems or .tif.")
@size_option("that of --known, else of TRAINING_IMAGE", "maps", "TRAINING_IMAGE")
@input_options("estimate")
def estimate(training_image: tuple[Path, ...], output: Path, size: str | None, **options: Any) -> Task:
    """Estimate each cell from data and TRAINING_IMAGE: category probabilities, or mean and variance.

    It draws no realisations, so the estimates have no sampling noise.
    """
    from simdtex.io.volume import write_realisations
    from simdtex.jobs.simulation.job import estimate
    from simdtex.run import Output

    how = take_reading(options, deep=True)
    material = read_material(training_image, how)
    if material.channel_axis is not None:
        raise ValueError(f"{training_image[0]} has several channels; give a training image of one variable")
    data = read_inputs("estimate", options, material, how)
    pixels = material.pixels[0]
    shape = output_shape(size, pixels, data["like"], data["known"], pixels, axes=2 + material.deep)
    if data["known"] is None:
        raise ValueError("an estimate requires data; give --known")
    check_place(material, output, options, data, shape)
    inputs: dict[str, Any] = {name: data[name] for name in ("known", "mask", "like")} | given(options)

    def make(device: Any, callback: Any, **_: Any) -> tuple[Any, Output]:
        made = estimate(described(material), shape=shape, device=device, callback=callback, **inputs)
        return made, Output(None, statistics=made.attrs)

    size = "x".join(map(str, shape[::-1]))
    return Task(make, f"maps of {size}", str(output), [lambda made, run: write_realisations(output, made)])


def check_place(
    material: Material,
    output: Path,
    options: dict[str, Any],
    data: dict[str, Any],
    shape: tuple[int, ...],
    source: bool = False,
) -> dict[str, Any]:
    """Return the origin and the size of cells, and how data are placed in them, as parameters of `place_hard_data`.

    Rows of tables become coordinates. Raises ValueError if places differ, or the output cannot hold the place.
    """
    from simdtex.io.grids import SUFFIXES, check_grid
    from simdtex.io.hard_data import HardData
    from simdtex.io.places import located
    from simdtex.io.volume import check_realisations_path

    flags = {one.flag(name): data[name] for name, one in inputs_of("simulate").items() if name in data and one.reader}
    place = located(flags, described(material), options["origin"], options["cell"])
    lies: dict[str, Any] = place.frame._asdict() if place else {}
    if check_realisations_path(output, source=source) in SUFFIXES:
        check_grid(output, material.pixels, lies.get("origin"), lies.get("cell"))
    for name, one in data.items():
        if isinstance(one, HardData) and one.from_top:
            data[name] = one.upside_down(shape[-2], place and place.frame)
    return lies | given({name: options[name] for name in ("several", "outside")})


def described(material: Material) -> Any:
    """Return the training image, as an array of xarray with its coordinates if it is a grid."""
    if material.grid is None:
        return material.array
    first, *others = material.pixels
    placed = in_place(first if material.channel_axis else first[..., None], material.grid)
    return [placed, *others] if others else placed


def _say_shares(attributes: dict[str, Any]) -> None:
    """Print the shares of categories that were asked and those reached."""
    if "shares_asked" in attributes:
        click.echo("shares of categories: {shares_asked} asked, {shares_reached} reached".format(**attributes))


def _report(folder: Path, material: Material, made: Any, known: Any, place: dict[str, Any]) -> None:
    from simdtex.io.hard_data import HardData, place_hard_data
    from simdtex.jobs.simulation.report import write_ensemble, write_volumes

    pixels, categorical = material.pixels[0], bool(json.loads(made.attrs["options"])["categorical"])
    data = None
    if known is not None:
        table = isinstance(known, HardData)
        known = (
            place_hard_data(known, made.shape[1:], **place)
            if table
            else np.ma.masked_invalid(getattr(known, "values", known))
        )
        cells = np.nonzero(~np.ma.getmaskarray(known))
        data = np.stack([*cells[::-1], known.data[cells].astype(np.float64)], -1)
    shown: dict[str, Any] = {"data": data, "command": command_line()}
    if material.deep:
        write_volumes(folder, pixels, made, categorical, **shown)
    else:
        write_ensemble(folder, pixels, made, categories=None if categorical else [], **shown)


def _check_report(material: Material, shape: tuple[int, ...], known: Any) -> None:
    """Raise if a report cannot be made, before anything is simulated."""
    from simdtex.jobs.simulation.ensemble import LEAST_IMAGE_SIDE
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
