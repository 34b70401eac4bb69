# SPDX-License-Identifier: BSD-3-Clause
"""A whole material: a folder of maps that is read, and a folder of maps that is written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.ending import note
from simdtex.cli.inputs import Also, Material, channels, read_material, size
from simdtex.cli.places import check_input

if TYPE_CHECKING:
    from simdtex.io.image import Metadata
    from simdtex.model.material import Maps


class Folder:
    """The maps of a folder: ``lead``, whose pixels decide the arrangement, and the others, for a folder ``output``."""

    def __init__(self, maps: Maps, lead: Path, output: Path) -> None:
        self.output, self.lead, self.role = output, lead, maps.files[lead]
        self.paths = [path for path in maps.files if path != lead]
        self.unknown = [name for name in maps.unknown if lead.with_name(name) not in maps.files]
        self.sample: NDArray[Any] = np.empty(0)
        self.others: list[Also] = []
        self.name = ""

    def read(self, lead: Material) -> None:
        """Read the other maps, and check that all can be written; `lead` is the first, which is read already."""
        from simdtex.io.atomic import earlier_files

        self.sample = lead.pixels[0]
        self.name = _written(self.lead, self.sample)
        for path in self.paths:
            maps = read_material([path])
            if maps.sizes != lead.sizes:
                raise ValueError(
                    f"{path} is {size(maps.pixels[0])} and {self.lead.name} {size(self.sample)}: scale it to that "
                    "size, or move it out of the folder"
                )
            self.others.append(Also(maps, self.output / _written(path, maps.pixels[0])))
        names = [self.name, *(one.out.name for one in self.others)]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{self.output / twice[0]} would be written twice: move one of the maps out of the folder")
        earlier_files(self.output, "the maps", names.__contains__)
        if self.unknown:
            note(f"left out, because the name does not show the kind of map: {', '.join(self.unknown)}")

    def write(self, made: NDArray[Any], run: Any, metadata: Metadata | None) -> None:
        """Write all maps into the folder, or none; normals that are means of several get the length 1 again."""
        from simdtex.io import image
        from simdtex.io.atomic import atomic_folder
        from simdtex.model.material import NORMALS, unit_normals
        from simdtex.model.source_map import apply_source_map

        if self.role in NORMALS and made.ndim == 3:
            mixed = (made != apply_source_map(run.source, self.sample)).any(axis=2)
            made = unit_normals(made, mixed)
        with atomic_folder(self.output) as temporary:
            image.write(temporary / self.name, made, metadata)
            for one in self.others:
                image.write(temporary / one.out.name, one.carried(run.source), one.maps.metadata)

    def __str__(self) -> str:
        return f"{self.output} ({1 + len(self.others)} maps arranged by {self.lead.name})"


def folder_of(pictures: Sequence[Path], output: Path, roles: Sequence[str]) -> Folder | None:
    """Return the maps of a folder, if it is the only one of `pictures`, or a map in it is and `output` is a folder.

    Else None. ``roles`` are the texts of ``--map``.
    """
    from simdtex.model.material import READABLE, ROLES, find_maps

    picture = pictures[0] if len(pictures) == 1 else Path("-")
    whole = picture.is_dir()
    folder = picture if whole else picture.parent
    named, found = {}, None
    for text in roles:
        role, _, name = text.partition("=")
        if role not in ROLES or not name:
            raise ValueError(f"--map {text} must be ROLE=FILE, with one of the roles {', '.join(ROLES)}")
        named[folder / name if name == Path(name).name else Path(name)] = role
    if whole or (picture.is_file() and (output.is_dir() or not output.suffix)):
        lead = next((path for path, role in named.items() if role == "albedo"), None) if whole else picture
        found = find_maps(folder, lead)
        found.files.update(named)
    if found is None or not (whole or picture in found.files):
        if roles:
            raise ValueError("--map requires a folder of maps: give a folder for the sample and for the output")
        return None
    albedos = [lead] if lead else [path for path, role in found.files.items() if role == "albedo"]
    if len(albedos) > 1:
        raise ValueError(f"{albedos[0]} and {albedos[1].name} are both albedo maps: give the path of one")
    if not albedos:
        there = next(iter(found.files), picture / "brick_normal.png")
        what = f" ({found.unknown[0]} is of unknown kind)" if found.unknown else ""
        raise ValueError(
            f"{picture} has no albedo{what}: give --map albedo=FILE, or instead of the folder the map that decides the "
            f"arrangement, such as {there}"
        )
    if output.suffix.lower() in (*READABLE, ".zarr") and not output.is_dir():
        raise ValueError(f"{picture} is a folder of maps and {output} a file: give a folder for the output")
    for path in found.files:
        check_input(output, path)
    return Folder(found, albedos[0], output)


def _written(path: Path, pixels: NDArray[Any]) -> str:
    """Return the name of a map's file in the output: its own, if its format is written and keeps all pixels."""
    from simdtex.io.image import suitable_suffix

    return path.stem + suitable_suffix(pixels.dtype, channels(pixels), path.suffix)
