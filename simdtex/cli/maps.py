# SPDX-License-Identifier: BSD-3-Clause
"""A whole material: a folder of maps that is read, and a folder of maps that is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.ending import note
from simdtex.cli.inputs import Also, Material, Reading, channels, note_lossy, read_also, read_material, size_text
from simdtex.cli.places import Named, check_input, preview_of

if TYPE_CHECKING:
    from simdtex.io.image import Metadata
    from simdtex.model.material import Maps

SHEET = 4096
"""The most pixels a side of a picture of copies; a larger one is reduced."""


@dataclass
class Folder:
    """The maps of a folder: ``lead``, whose pixels decide the arrangement, and the others, for a folder ``output``.

    ``maps`` are those that are read, ``lead`` first.
    """

    found: Maps
    lead: Path
    output: Path
    maps: list[Also] = field(default_factory=list)

    def read(self, lead: Material) -> None:
        """Read the other maps, and check that all can be written; `lead` is the first, which is read already."""
        from simdtex.io.files import earlier_files

        for path in sorted(self.found.files, key=lambda path: path != self.lead):
            maps = read_material([path]) if self.maps else lead
            if maps.sizes != lead.sizes:
                sizes = f"{path} is {size_text(maps.pixels[0])} and {self.lead.name} {size_text(lead.pixels[0])}"
                raise ValueError(f"{sizes}: scale it to that size, or move it out of the folder")
            self.maps.append(Also(maps, self.output / _written(path, maps.pixels[0])))
        names = [one.out.name for one in self.maps]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{self.output / twice[0]} would be written twice: move one of the maps out of the folder")
        earlier_files(self.output, "the maps", names.__contains__)
        if unknown := [name for name in self.found.unknown if self.lead.with_name(name) not in self.found.files]:
            note(f"left out, because the name does not show the kind of map: {', '.join(unknown)}")

    def write(self, metadata: Metadata | None, made: NDArray[Any], run: Any) -> None:
        """Write all maps into the folder, or none; normals that are means of several get the length 1 again."""
        from simdtex.io import image
        from simdtex.io.files import atomic_folder
        from simdtex.model.material import NORMALS, unit_normals

        lead, *others = self.maps
        if self.found.files[self.lead] in NORMALS and made.ndim == 3:
            made = unit_normals(made, (made != lead.carried(run.source)).any(axis=2))
        with atomic_folder(self.output) as temporary:
            image.write(temporary / lead.out.name, made, metadata)
            for one in others:
                image.write(temporary / one.out.name, one.carried(run.source), one.maps.metadata)

    def __str__(self) -> str:
        return f"{self.output} ({len(self.maps)} maps arranged by {self.lead.name})"


def arranged(
    output: Folder | Path,
    samples: Material,
    metadata: Metadata | None,
    options: dict[str, Any],
    *,
    kept: bool = True,
    foreign: str = "",
) -> list[Callable[[Any, Any], object]]:
    """Return functions that write a picture or all maps of a folder, ``--also``, ``--source-map`` and ``--preview``.

    These options are taken out. Raises ValueError if one cannot be written. ``kept``: whether pixels of a file are to
    stay as they are, and its ``metadata`` holds for the output; a format that loses them is noted. ``foreign``: why
    pixels are not from the sample, so that other maps have none for them.
    """
    from simdtex.io import image
    from simdtex.model.source_map import save_source_map

    also, source_map = options.pop("also"), options.pop("source_map")
    if foreign and (also or isinstance(output, Folder)):
        raise ValueError(f"{foreign}; {'leave --also out' if also else 'give one picture'}")
    if source_map:
        check_source_map(source_map, samples, everywhere=not foreign)
    others, pixels = read_also(also, samples), samples.pixels[0]
    if isinstance(output, Folder):
        output.read(samples)
        writers: list[Callable[[Any, Any], object]] = [partial(output.write, metadata)]
    else:
        image.check_writable(output, pixels.dtype, channels(pixels))
        if kept:
            note_lossy(output, pixels, metadata)
        writers = [lambda made, run: image.write(output, made, metadata)]
    writers += [one.write for one in others]
    if source_map:
        writers.append(lambda made, run: save_source_map(source_map, run.source))
    if options.pop("preview", False):
        path = preview_of(output.output if isinstance(output, Folder) else output)
        palette = metadata and metadata.palette
        writers.append(lambda made, run: _write_copies(path, image.coloured(made, palette or None)))
    return writers


def check_source_map(path: Path, samples: Material, everywhere: bool) -> None:
    """Raise where a source map cannot be written there; ``everywhere`` says that all pixels are from a sample."""
    from simdtex.io import image
    from simdtex.model.source_map import SOURCE_SUFFIXES

    image.check_writable(path, suffixes=SOURCE_SUFFIXES)
    far = max(max(sides) for sides in samples.sizes) > 2**16
    if path.suffix.lower() == ".png" and (far or not everywhere):
        what = "positions over 65535" if far else "pixels that are not from the sample"
        raise ValueError(f"{path} cannot hold {what}; end its name in .npz instead")


def _write_copies(path: Path, made: NDArray[Any]) -> None:
    """Write 3x3 copies of a picture, edge to edge, of at most `SHEET` pixels a side."""
    from simdtex.io import image
    from simdtex.report.sheet import fitted, rgb

    image.write(path, fitted(np.tile(rgb(made), (3, 3, 1)), SHEET))


def read_lead(
    pictures: Sequence[Path], output: Path, options: dict[str, Any], how: Reading
) -> tuple[Folder | Path, Material]:
    """Return the output, and the pictures that decide its arrangement.

    The output is of a folder of maps, if this is the only one of `pictures`, or a map in it is and `output` is a
    folder. The roles of ``--map`` are taken out of the options.
    """
    from simdtex.model.material import READABLE, ROLES, find_maps

    picture = pictures[0] if len(pictures) == 1 else Path("-")
    whole = picture.is_dir()
    folder = picture if whole else picture.parent
    named, found = {}, None
    roles: Sequence[tuple[str, list[Path]]] = options.pop("roles")
    for role, (path, *_) in roles:
        if role not in ROLES:
            raise ValueError(f"--map names the role {role}; give one of the roles {', '.join(ROLES)}")
        named[path if path.parent.parts else folder / path] = role
    if whole or (picture.is_file() and (output.is_dir() or not output.suffix)):
        lead = next((path for path, role in named.items() if role == "albedo"), None) if whole else picture
        found = find_maps(folder, lead)
        found.files.update(named)
    if found is None or not (whole or picture in found.files):
        if roles:
            raise ValueError("--map requires a folder of maps: give a folder for the sample and for the output")
        return output, read_material(pictures, how)
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
        check_input(Named(output, "folder"), Named(path, "read"))
    return Folder(found, albedos[0], output), read_material(albedos[:1], how)


def _written(path: Path, pixels: NDArray[Any]) -> str:
    """Return the name of a map's file in the output: its own, if its format is written and keeps all pixels."""
    from simdtex.io.image import suitable_suffix

    return path.stem + suitable_suffix(pixels.dtype, channels(pixels), path.suffix)
