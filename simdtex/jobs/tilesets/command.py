# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex tileset``: corner tiles for games."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import ENTER, FOLDER
from simdtex.cli.inputs import SHEET, Also, Folder, Material, Reading, channels, output_shape, read_lead, read_material
from simdtex.cli.job import Task, job, notes
from simdtex.cli.options import LIGHT, MAP, PROFILE, given, option, output_option, size_option
from simdtex.methods.mrf import options as mrf
from simdtex.options import whole

PLANE = 8
"""Rows and columns of tiles of the plane that shows a set."""


@job(
    ("tileset gravel.png -o tiles --size 128", "Make 16 tiles for planes of any size without a period."),
    ("tileset grass.png sand.png -o terrain", "Make tiles of grass and sand, which meet within the tiles."),
    ("tileset brick -o tiles", "Make tiles of all maps in the folder brick, arranged alike."),
    usual="output size colours seed order light roles dry_run device quiet",
    methods=[mrf.Options],
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=ENTER)
@output_option("Write this folder: pictures, and the set for Tiled, Godot and GLSL.", FOLDER)
@size_option("256", of="tiles")
@option(
    "--colours",
    type=int,
    help="Make tiles with so many colours of corners: 2 for 16 tiles, 3 for 81.  [2; with several samples their "
    "number]",
)
@LIGHT
@MAP
@PROFILE
def tileset(
    samples: tuple[Path, ...], output: Path, size: str | None, roles: Any, colours: int | None, **options: Any
) -> Task:
    """Make a set of corner tiles with the texture of SAMPLE, for a game.

    Tiles fit wherever the colours of their corners agree, so that a plane of them has no period. Two or three samples,
    such as grass and sand, are the colours. SAMPLE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    from simdtex.io.files import earlier_files
    from simdtex.jobs.tilesets.job import tileset
    from simdtex.model.source_map import NORMALS

    if colours is not None:
        whole("--colours", colours, 2, 3)
    how = Reading(palette=bool(options["categorical"]))
    leads = [read_lead([path], output, {"roles": roles}, how) for path in samples]
    lead = leads[0][1] if len(leads) == 1 else read_material([material.paths[0] for _, material in leads], how)
    folders = [target for target, _ in leads if isinstance(target, Folder)]
    maps = read_maps(folders, lead)
    rows, cols = output_shape("256" if size is None else size, lead.pixels[0])
    normals = bool(folders) and folders[0].found.files[folders[0].lead] in NORMALS
    colours = colours or max(2, len(samples))
    names = [path.stem for path in lead.paths] if len(samples) > 1 else [f"{n}" for n in range(colours)]
    if len({*names}) < len(names):
        names = [f"{name} {n}" for n, name in enumerate(names, 1)]
    corners = ["".join(map(str, place)) for place in np.ndindex(*[colours] * 4)]
    files = {f"{also.out.stem}{which}{also.out.suffix}" for also in maps for which in ("", *(f"-{c}" for c in corners))}
    files |= {"tiles.tsx", "tiles.tres", "tiles.glsl", "plane.tmx", "plane.png"}
    earlier_files(output, "the tiles", files.__contains__)
    return Task(
        partial(tileset, lead.array, (rows, cols), colours=colours, channel_axis=lead.channel_axis, **given(options)),
        f"{colours**4} tiles of {cols}x{rows}",
        str(output),
        [partial(write, output, maps, names, normals)],
        lead.limits,
        lambda made, run: notes(run),
    )


def read_maps(folders: list[Folder], lead: Material) -> list[Also]:
    """Return the maps of all samples, ``lead`` first, and then those of the other roles of ``folders``."""
    from simdtex.io.image import suitable_suffix

    if folders and len(folders) < len(lead.paths):
        raise ValueError(f"{folders[0].lead} is a map of a material and not all samples are; give one kind of sample")
    materials = [lead]
    for folder in folders:
        for has, lacks in ((folders[0], folder), (folder, folders[0])):
            if role := min({*has.found.files.values()} - {*lacks.found.files.values()}, default=""):
                raise ValueError(f"{lacks.lead.parent} has no {role} map and {has.lead.parent} has one; add or move it")
    for path, role in sorted(folders[0].found.files.items()) if folders else ():
        if path == folders[0].lead:
            continue
        others = [next(p for p, r in folder.found.files.items() if r == role) for folder in folders[1:]]
        materials.append(read_material([path, *others]))
        if materials[-1].sizes != lead.sizes:
            raise ValueError(f"{path} has another size than {lead.paths[0].name}; scale it, or move it elsewhere")
    maps = []
    for material in materials:
        plain = bool(material.metadata and material.metadata.plain)
        suffix = suitable_suffix(material.pixels[0].dtype, channels(material.pixels[0]), plain=plain)
        material = material._replace(metadata=material.metadata and material.metadata.at())
        maps.append(Also(material, Path("-".join(path.stem for path in material.paths) + suffix)))
    return maps


def write(output: Path, maps: list[Also], names: list[str], normals: bool, made: NDArray[Any], run: Any) -> None:
    """Write a set into a folder: the packed pictures and the tiles of all maps, and what other programs read."""
    from simdtex.figures.sheet import fitted, rgb
    from simdtex.io import image
    from simdtex.io.files import atomic_folder
    from simdtex.jobs.tilesets import files as tilesets
    from simdtex.jobs.tilesets.corners import corners_of, laid, numbers, plane, torus
    from simdtex.model.source_map import unit_normals

    colours, grid = len(names), corners_of(torus(len(names)))
    rows, cols = (side // len(grid) for side in made.shape[:2])
    if normals and made.ndim == 3:
        made = unit_normals(made, (made != maps[0].carried(run.source)).any(axis=2))
    corners = np.random.default_rng(run.statistics["seed"]).integers(0, colours, (PLANE + 1, PLANE + 1))
    with atomic_folder(output) as folder:
        for n, also in enumerate(maps):
            packed = also.carried(run.source) if n else made
            image.write(folder / also.out, packed, also.maps.metadata)
            for row, col in np.ndindex(grid.shape[:2]):
                which = "".join(map(str, grid[row, col]))
                tile = packed[row * rows : (row + 1) * rows, col * cols : (col + 1) * cols]
                image.write(folder / f"{also.out.stem}-{which}{also.out.suffix}", tile, also.maps.metadata)
        shown = image.coloured(plane(made, corners, colours), maps[0].maps.metadata and maps[0].maps.metadata.palette)
        image.write(folder / "plane.png", fitted(rgb(shown), SHEET))
        about = maps[0].out.name, (rows, cols), names, grid
        texts = {"tiles.tsx": tilesets.tiled_set(*about), "tiles.tres": tilesets.godot_set(*about)}
        texts["plane.tmx"] = tilesets.tiled_map("tiles.tsx", (rows, cols), laid(corners, colours))
        for name, text in {**texts, "tiles.glsl": tilesets.glsl(numbers(colours))}.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
