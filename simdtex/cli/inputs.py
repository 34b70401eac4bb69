# SPDX-License-Identifier: BSD-3-Clause
"""The files of a command: samples, masks, known values and guides that are read, and the maps of a material."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import Named, check_input, note, preview_of
from simdtex.model.pictures import check_alike, unknown_in

if TYPE_CHECKING:
    from simdtex.io.grids import CartesianGrid
    from simdtex.io.hard_data import HardData
    from simdtex.io.image import Image, Metadata
    from simdtex.model.source_map import MaterialMaps

SHEET = 4096
"""The most pixels a side of a picture of copies; a larger one is reduced."""


class Reading(NamedTuple):
    """How files are read."""

    deep: bool = False  # as cells in ascending order of y, rasters too, and a file of several layers as a volume
    palette: bool = False  # colours of a palette as their indices, which are categories
    channels: bool = False  # the last axis of an array of three axes as channels
    ascending: bool | None = None  # the order of rows, as in `simdtex.io.image.read`
    variables: tuple[str, ...] = ()  # the names of those of a grid to take
    missing: tuple[float, ...] = ()  # further numbers that mean an unknown value
    valid: tuple[float, float] | None = None  # the range of possible values
    columns: dict[str, list[str]] | None = None  # of tables, as in `simdtex.read_hard_data`
    categories: dict[str, float] | None = None


PLAIN = Reading()
"""How pictures are read without options."""


class Material(NamedTuple):
    """Pictures of one type, which all have the axes of the first."""

    paths: tuple[Path, ...]
    pixels: list[NDArray[Any]]
    channel_axis: int | None
    grid: CartesianGrid | None = None  # the first, if it is one
    deep: bool = False  # whether they are volumes
    metadata: Metadata | None = None  # what the file of the first says of its pixels

    @property
    def ascending(self) -> bool | None:
        """How files beside these are read: an ``.npy`` beside a grid begins with the smallest y."""
        return False if self.metadata and self.metadata.ascending else None

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """Rows and columns of each."""
        return [(array.shape[0], array.shape[1]) for array in self.pixels]

    @property
    def several(self) -> bool:
        """Whether there is more than one."""
        return len(self.pixels) > 1

    @property
    def array(self) -> Any:
        """The one array, or the list of several."""
        return self.pixels if self.several else self.pixels[0]

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest value that is known."""
        known = [np.ma.compressed(pixels) for pixels in self.pixels]
        low, high = ([extreme.reduce(a) for a in known] for extreme in (np.fmin, np.fmax))
        return float(np.fmin.reduce(low)), float(np.fmax.reduce(high))

    @property
    def known(self) -> bool:
        """Whether nothing is NaN."""
        return all(array.dtype.kind != "f" or not np.isnan(array).any() for array in self.pixels)


class Also(NamedTuple):
    """A map of the material, one for each sample, and the file that its arrangement goes to."""

    maps: Material
    out: Path

    def carried(self, source: Any) -> NDArray[Any]:
        """Return the map, arranged as an output."""
        from simdtex.model.source_map import apply_source_map

        return apply_source_map(source, self.maps.array, self.maps.sizes if self.maps.several else self.maps.sizes[0])

    def write(self, lead: Metadata | None, made: Any, run: Any) -> None:
        """Write the map, arranged as the output of a run, which has the metadata ``lead``."""
        from simdtex.io import image

        metadata = self.maps.metadata and self.maps.metadata.at(lead)
        image.write(self.out, self.carried(run.source), metadata)


def planes(pixels: NDArray[Any]) -> NDArray[Any]:
    """Return a picture (rows, cols) or (rows, cols, channels) as the latter."""
    return pixels[..., None] if pixels.ndim == 2 else pixels


def channels(pixels: NDArray[Any]) -> int:
    """Return the number of channels of a picture (rows, cols) or (rows, cols, channels)."""
    return int(planes(pixels).shape[2])


def size_text(pixels: NDArray[Any]) -> str:
    """Return width x height as text."""
    return f"{pixels.shape[1]}x{pixels.shape[0]}"


def without_alpha(read: Read, count: int) -> np.ma.MaskedArray[Any, Any]:
    """Return a picture without the alpha that pictures of so many channels lack, masked where it is transparent."""
    from simdtex.io.image import split_alpha

    pixels, plain = read.pixels, read.grid is not None or bool(read.metadata and read.metadata.plain)
    picture: NDArray[Any] = np.ma.getdata(pixels)
    gone: NDArray[np.bool_] = np.asarray(planes(np.ma.getmaskarray(pixels)).any(-1))
    if channels(picture) == count + 1 and not plain:
        picture, clear = split_alpha(picture)
        gone = gone | clear
    return np.ma.MaskedArray(picture, np.broadcast_to(gone if picture.ndim == 2 else gone[..., None], picture.shape))


def read_picture(path: Path, how: Reading = PLAIN) -> Image:
    """Read a picture, and say so if its file has more than one."""
    from simdtex.io import image

    picture = image.read(path, palette=how.palette, ascending=how.ascending)
    if picture.metadata.more:
        note(f"{path} has several frames or pages; only the first is read")
    return picture


def check_profiles(paths: Sequence[Path], about: Sequence[Metadata | None]) -> None:
    """Raise unless pictures that are used together have the same colour profile, sRGB by default, and palette."""
    from simdtex.io.decode import NOTHING
    from simdtex.io.image import profile_name

    # grids and arrays hold numbers alone, in whatever colours
    told = [(path, tag) for path, tag in zip(paths, about, strict=True) if tag and not tag.ascending and tag != NOTHING]
    for path, other in told[1:]:
        first, tag = told[0]
        if other.profile != tag.profile and {*(names := [profile_name(a.profile) for a in (other, tag)])} != {"sRGB"}:
            raise ValueError(f"{path} has the colour profile {names[0]} and {first} {names[1]}; convert them to one")
        if any(a != b for a, b in zip(other.palette or b"", tag.palette or b"", strict=False)):
            raise ValueError(f"{path} and {first} have different palettes; save both with the same palette")


class Read(NamedTuple):
    """What a file holds: ``pixels``, the ``metadata`` of a picture, and the ``grid`` if it is one."""

    pixels: NDArray[Any]
    metadata: Metadata | None = None
    grid: CartesianGrid | None = None


def read_pixels(path: Path, how: Reading = PLAIN) -> Read:
    """Read a picture (rows, cols[, channels]), or a grid or a volume ([layers,] rows, cols, variables)."""
    from simdtex.io import grids
    from simdtex.io.image import Metadata

    grid = None
    if grids.is_grid(path, rasters=how.deep):
        grid = grids.read_grid(path, variables=how.variables or None, missing=how.missing, valid=how.valid)
        if stepped := [name for name in grid.values if name.endswith("]") and not how.variables]:
            raise ValueError(f"{path} has steps of time or another axis: choose one, as --variables '{stepped[0]}'")
    elif how.deep or path.suffix.lower() in (".npy", ".tif", ".tiff"):  # the reader of pictures names other formats
        from simdtex.io import volume  # whose libraries take long to load

        deep = volume.is_volume(path, how.channels or not how.deep)
        grid = volume.read(path, ascending=how.deep) if deep else None
    if grid is None:
        picture = read_picture(path, how)
        if path.suffix.lower() == ".npy" and not how.channels and (count := channels(picture.pixels)) > 4:
            note(f"{path} is read as a picture of {count} channels; for a volume use simdtex simulate, with --known")
        return Read(picture.pixels, picture.metadata)
    values = np.stack(list(grid.values.values()), -1)
    if len(values) > 1 and not how.deep:
        raise ValueError(f"{path} is a volume: use simdtex simulate, which fills it as --known")
    if how.deep:
        return Read(values if len(values) > 1 else values[0], None, grid)
    return Read(values[0, ::-1], Metadata(geo=grid.georeference, ascending=True, plain=True), grid)


def read_material(paths: Sequence[Path], how: Reading = PLAIN) -> Material:
    """Read pictures or grids, or with ``how.deep`` a volume; one of a single channel gets no axis for it."""
    pictures, metadata, grids = zip(*(read_pixels(path, how) for path in paths), strict=True)
    check_profiles(paths, metadata)
    volumes = [picture.ndim == 4 for picture in pictures]
    if len({*volumes}) > 1:
        volume, other = paths[volumes.index(True)], paths[volumes.index(False)]
        raise ValueError(f"{volume} is a volume and {other} is none; give volumes, or pictures")
    pixels = [picture[..., 0] if picture.shape[-1] == 1 and picture.ndim > 2 else picture for picture in pictures]
    plain = pixels[0].ndim == 2 + volumes[0]
    return Material(tuple(paths), pixels, None if plain else -1, grids[0], volumes[0], metadata[0])


def check_each(option: str, paths: Sequence[Path], samples: Material) -> None:
    """Raise unless an option names one file for each sample."""
    if len(paths) != len(samples.pixels):
        counts = f"{len(paths)} files and there are {len(samples.pixels)} samples"
        raise ValueError(f"{option} names {counts}; give one for each sample")


def check_output(
    path: Path, pixels: NDArray[Any], metadata: Metadata | None, categorical: Any = False, kept: bool = False
) -> None:
    """Raise unless such pixels can be written; if pixels are to be ``kept``, say what the format loses of them."""
    from simdtex.io import image
    from simdtex.model.pictures import few

    suffix = path.suffix.lower()
    lossy = suffix in image.LOSSY
    labels = lossy and bool(categorical or few([planes(np.ma.getdata(pixels))]))
    image.check_writable(path, pixels.dtype, channels(pixels), metadata=metadata, labels=labels)
    if kept and lossy:
        better = image.suitable_suffix(pixels.dtype, channels(pixels), plain=bool(metadata and metadata.plain))
        note(f"{path}: JPEG changes all pixels a little; end its name in {better} to keep the known pixels exactly")
    if kept and metadata and metadata.geo and suffix not in (".tif", ".tiff"):
        note(f"{path} holds no georeference; end its name in .tif to keep it")


def read_also(pairs: Sequence[tuple[list[Path], Path]], samples: Material, *, files: bool = True) -> list[Also]:
    """Read the maps of ``--also MAP=OUT``, and check that they can be carried over and, as files, be written."""
    carried = []
    for paths, out in pairs:
        check_each("--also", paths, samples)
        maps = read_material(paths, Reading(ascending=samples.ascending))
        for path, pixels, of, sample in zip(maps.paths, maps.pixels, samples.paths, samples.pixels, strict=True):
            check_alike(str(path), planes(pixels), str(maps.paths[0]), planes(maps.pixels[0]))
            if pixels.shape[:2] != sample.shape[:2]:
                sizes = f"{path} is {size_text(pixels)} and {of} {size_text(sample)}"
                raise ValueError(f"{sizes}; give --also a map of the sample's size")
        if files:
            check_output(out, maps.pixels[0], maps.metadata)
        carried.append(Also(maps, out))
    return carried


def output_shape(size: str | None, pixels: Any, *like: Any, axes: int = 2) -> tuple[int, ...]:
    """Return the ([layers,] rows, columns) of ``--size``; by default of the first of `like`, or twice the sample's."""
    from simdtex.io.image import parse_sides

    if size is not None:
        form = "WIDTHxHEIGHTxDEPTH" if axes == 3 else "WIDTHxHEIGHT"
        return parse_sides(size, form, pixels.shape[axes - 1 :: -1])[::-1]
    doubled = tuple(2 * side for side in pixels.shape[:axes])
    return next((picture.shape[:axes] for picture in like if hasattr(picture, "shape")), doubled)  # a table has none


def last_iteration(statistics: dict[str, Any]) -> str:
    """Return levels, iterations, and how far the last iteration had to move the subbands on average."""
    reports = statistics["iterations"]
    text = f"levels {statistics['options']['levels']}, iterations {len(reports)}"
    moved = [by for name, by in reports[-1]["distances"].items() if name != "pixels"] if reports else []
    if not moved:  # no iteration, or a constant sample
        return text
    return f"{text}, mean distance of the subbands in the last: {sum(moved) / len(moved):.3f} standard deviations"


def read_masks(paths: Sequence[Path], samples: Material, how: Reading = PLAIN) -> Any:
    """Read the masks of samples, of ``--sample-mask``; None without paths."""
    from simdtex.io import image

    if not paths:
        return None
    _check_flat(samples)
    check_each("--sample-mask", paths, samples)
    sizes = zip(paths, samples.sizes, strict=True)
    masks = [image.read_mask(path, shape, ascending=how.ascending) for path, shape in sizes]
    return masks if samples.several else masks[0]


def in_place(pixels: NDArray[Any], grid: CartesianGrid) -> Any:
    """Return values of a grid, ([layers,] rows, cols, variables), as an array of xarray with its coordinates."""
    import xarray

    dims, several = [*"zyx"[4 - pixels.ndim :]], pixels.shape[-1] > 1
    coordinates: dict[str, Any] = {"spatial_ref": ((), 0, {"crs_wkt": grid.crs})} if grid.crs else {}
    for axis, first, size in zip("xyz", *grid.frame, strict=True):
        cells = np.arange(pixels.shape[dims.index(axis)]) if axis in dims else np.array(0)
        coordinates[axis] = ((axis,) if axis in dims else (), first + size * cells, grid.about.get(axis, {}))
    name = None if several else next(iter(grid.values))
    values, dims = (pixels, [*dims, "variable"]) if several else (pixels[..., 0], dims)
    sizes = {f"cell_{axis}": size for axis, size in zip("xyz", grid.cell, strict=True)}
    return xarray.DataArray(values, coordinates, dims, name, sizes | grid.about.get(name or "", {}))


def read_table(
    path: Path,
    samples: Material,
    how: Reading,
    origin: Sequence[float] | None = None,
    like: Path | None = None,
    valid: tuple[float, float] | None = None,
) -> HardData | None:
    """Read a table of data, and say where y = 0 is; None if a file is no table, by its content, else by its name."""
    from simdtex.io import grids
    from simdtex.io.hard_data import SUFFIXES, read_hard_data

    kind = grids.kind_of(path)
    if kind != "points" and (kind is not None or path.suffix.lower() not in SUFFIXES):
        return None
    table = read_hard_data(path, columns=how.columns, categories=how.categories, missing=how.missing, valid=valid)
    if table.from_top:
        note(f"{path}: rows count from the top of the output, from 0 on")
    elif samples.grid is None:
        bottom = f"as in {like}" if like else f"and y = {(origin or (0, 0))[1]:.12g} is the bottom row of the output"
        note(f"{path}: y points north, {bottom}")
    return table


def read_known(
    path: Path | None,
    samples: Material,
    how: Reading = PLAIN,
    origin: Sequence[float] | None = None,
    like: Path | None = None,
) -> tuple[Any, Any]:
    """Read the known values of an output, and the georeference of a raster or a grid; None for what there is not."""
    if path is None:
        return None, None
    variables = tuple((how.columns or {}).get("value", ()))
    if (table := read_table(path, samples, how, origin, like, samples.limits)) is not None:
        return table, None
    how = how._replace(valid=samples.limits, variables=variables, channels=not samples.deep)
    how = how._replace(palette=how.palette and samples.channel_axis is None)
    read = read_pixels(path, how)
    check_profiles([samples.paths[0], path], [samples.metadata, read.metadata])
    if read.grid is not None and how.deep:
        return in_place(read.pixels, read.grid), None
    picture = without_alpha(read, channels(samples.pixels[0]))
    place = read.metadata and read.metadata.geo and read.metadata.geo.place()
    return picture.reshape(picture.shape[:2]) if channels(picture) == 1 else picture, place


def take_reading(options: dict[str, Any], deep: bool = False) -> Reading:
    """Return how files are read, by the options about tables and grids, which are taken out."""
    columns: dict[str, list[str]] = {}
    for axis, name in options.pop("columns") or ():
        columns.setdefault(axis, []).append(name)
    return Reading(
        deep,
        bool(options.get("categorical")),
        options.pop("channels", False),
        deep or None,
        options.pop("variables", ()),
        options.pop("missing"),
        columns=columns or None,
        categories=options.pop("categories"),
    )


def _check_flat(samples: Material) -> None:
    """Raise if pictures of samples are asked for, which are no pictures."""
    if samples.deep:
        path = samples.paths[0]
        raise ValueError(f"{path} is a volume; --sample-mask and --guide are pictures: use simdtex.simulate in Python")


def read_guides(
    pair: tuple[list[Path], Path] | None, samples: Material, how: Reading = PLAIN, labels: bool | None = None
) -> tuple[Any, bool | None]:
    """Return the guide of ``SAMPLE-GUIDE=OUTPUT-GUIDE``, and whether it is of labels; None without a pair.

    Colours of 8 bits are labels, which become whole numbers, if ``labels`` says so or the samples' guides have few.
    Where the guide of the output is transparent or NaN, the output is free: it has NaN there.
    """
    from simdtex.io.image import coloured
    from simdtex.methods.mrf.plan import LABELS
    from simdtex.model.pictures import CATEGORIES, few

    if pair is None:
        return None, labels
    _check_flat(samples)
    paths, out = pair
    check_each("--guide", paths, samples)
    as_labels = Reading(how.deep, palette=True, channels=True, ascending=how.ascending)
    read = [read_pixels(path, as_labels) for path in (*paths, out)]
    pictures = tuple(guide.pixels for guide in read)
    if volumes := [path for path, guide in zip((*paths, out), pictures, strict=True) if guide.ndim > 3]:
        raise ValueError(f"{volumes[0]} is a volume; give a guide of one layer")
    palettes = [guide.metadata and guide.metadata.palette for guide in read]
    if all(palettes) or len({*palettes} - {None}) > 1 or max(map(channels, pictures)) > 2:
        pictures = tuple(map(coloured, pictures, palettes))  # the order of colours may differ
    *guides, wanted = pictures
    shown = without_alpha(read[-1]._replace(pixels=wanted), channels(guides[0]))
    wanted, free = shown.data, planes(np.ma.getmaskarray(shown)).any(-1) | unknown_in(planes(shown.data))
    are_few = few([guide.reshape(*guide.shape[:2], -1) for guide in guides], LABELS if all(palettes) else CATEGORIES)
    colours = all(guide.dtype == np.uint8 and channels(guide) == channels(wanted) > 1 for guide in (*guides, wanted))
    if labels is not False and colours and (labels or are_few):
        known = np.unique(np.concatenate([guide.reshape(-1, channels(guide)) for guide in guides]), axis=0)
        strange = [colour for colour in np.unique(wanted[~free], axis=0) if not (known == colour).all(-1).any()]
        if strange:
            more = f" and {len(strange) - 1} more" if len(strange) > 1 else ""
            raise ValueError(
                f"{out} has the colour {tuple(strange[0].tolist())}{more}, which {', '.join(map(str, paths))} "
                f"{'does' if len(paths) == 1 else 'do'} not have; paint with the colours of the labels, without soft "
                "edges, or give --no-labels"
            )
        guides, wanted, labels = [_numbers(guide, known) for guide in guides], _numbers(wanted, known), True
    elif labels is None and free.any():  # in floats, that they are whole numbers would no longer be seen
        labels = all(guide.dtype.kind in "iu" for guide in (*guides, wanted)) and are_few
    if free.any():
        wanted = wanted.astype(np.float64)
        wanted[free] = np.nan
    grid = read[-1].grid
    output = in_place(planes(wanted), grid) if how.deep and grid else wanted
    return (guides if samples.several else guides[0], output), labels


def _numbers(pixels: NDArray[Any], known: NDArray[Any]) -> NDArray[Any]:
    """Return the number of each pixel's colour, (rows, cols)."""
    labels = np.zeros(pixels.shape[:2], np.int64)
    for label, colour in enumerate(known):
        labels[(pixels == colour).all(-1)] = label
    return labels


@dataclass
class Folder:
    """The maps of a folder: ``lead``, whose pixels decide the arrangement, and the others, for a folder ``output``.

    ``maps`` are those that are read, ``lead`` first.
    """

    found: MaterialMaps
    lead: Path
    output: Path
    maps: list[Also] = field(default_factory=list)

    def read(self, lead: Material) -> None:
        """Read the other maps, and check that all can be written; `lead` is the first, which is read already."""
        from simdtex.io.files import earlier_files
        from simdtex.io.image import suitable_suffix

        for path in sorted(self.found.files, key=lambda path: path != self.lead):
            maps = read_material([path]) if self.maps else lead
            if maps.sizes != lead.sizes:
                sizes = f"{path} is {size_text(maps.pixels[0])} and {self.lead.name} {size_text(lead.pixels[0])}"
                raise ValueError(f"{sizes}: scale it to that size, or move it out of the folder")
            pixels, plain = maps.pixels[0], bool(maps.metadata and maps.metadata.plain)
            suffix = suitable_suffix(pixels.dtype, channels(pixels), path.suffix, plain=plain)
            self.maps.append(Also(maps, self.output / f"{path.stem}{suffix}"))
        names = [maps.out.name for maps in self.maps]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{self.output / twice[0]} would be written twice: move one of the maps out of the folder")
        earlier_files(self.output, "the maps", names.__contains__)

    def write(self, metadata: Metadata | None, made: NDArray[Any], run: Any) -> None:
        """Write all maps into the folder, or none; normals that are means of several get the length 1 again."""
        from simdtex.io import image
        from simdtex.io.files import atomic_folder
        from simdtex.model.source_map import NORMALS, unit_normals

        lead, *others = self.maps
        if self.found.files[self.lead] in NORMALS and made.ndim == 3:
            made = unit_normals(made, (made != lead.carried(run.source)).any(axis=2))
        with atomic_folder(self.output) as temporary:
            image.write(temporary / lead.out.name, made, metadata)
            for maps in others:
                maps._replace(out=temporary / maps.out.name).write(metadata, made, run)

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

    ``kept``: whether pixels of a file are to stay as they are. ``foreign``: why pixels are not from the sample.
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
        check_output(output, pixels, metadata, options.get("categorical"), kept)
        writers = [lambda made, run: image.write(output, made, metadata)]
    writers += [partial(maps.write, metadata) for maps in others]
    if source_map:
        writers.append(lambda made, run: save_source_map(source_map, run.source))
    if options.pop("preview", False):
        from simdtex.figures.sheet import fitted, rgb

        def write_copies(made: NDArray[Any], _: Any) -> None:
            picture = rgb(image.coloured(made, (metadata and metadata.palette) or None))
            image.write(path, fitted(np.tile(picture, (3, 3, 1)), SHEET))

        path = preview_of(output.output if isinstance(output, Folder) else output)
        writers.append(write_copies)
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


def read_lead(
    pictures: Sequence[Path], output: Path, options: dict[str, Any], how: Reading
) -> tuple[Folder | Path, Material]:
    """Return the output, of a folder of maps if a picture is one or in one, and the pictures that arrange it."""
    from simdtex.model.source_map import READABLE, ROLES, find_maps

    picture = pictures[0] if len(pictures) == 1 else Path("-")
    whole = picture.is_dir()
    folder = picture if whole else picture.parent
    named, maps = {}, None
    roles: Sequence[tuple[str, list[Path]]] = options.pop("roles")
    for role, (path, *_) in roles:
        if role not in ROLES:
            raise ValueError(f"--map names the role {role}; give one of the roles {', '.join(ROLES)}")
        named[path if path.parent.parts else folder / path] = role
    if whole or (picture.is_file() and (output.is_dir() or not output.suffix)):
        lead = next((path for path, role in named.items() if role == "albedo"), None) if whole else picture
        maps = find_maps(folder, lead)
        maps.files.update(named)
    if maps is None or not (whole or picture in maps.files):
        if roles:
            raise ValueError("--map requires a folder of maps: give a folder for the sample and for the output")
        return output, read_material(pictures, how)
    albedos = [lead] if lead else [path for path, role in maps.files.items() if role == "albedo"]
    if len(albedos) > 1:
        raise ValueError(f"{albedos[0]} and {albedos[1].name} are both albedo maps: give the path of one")
    if not albedos:
        there = next(iter(maps.files), picture / "brick_normal.png")
        what = f" ({maps.unknown[0]} is of unknown kind)" if maps.unknown else ""
        raise ValueError(
            f"{picture} has no albedo{what}: give --map albedo=FILE, or instead of the folder the map that decides the "
            f"arrangement, such as {there}"
        )
    if output.suffix.lower() in (*READABLE, ".zarr") and not output.is_dir():
        raise ValueError(f"{picture} is a folder of maps and {output} a file: give a folder for the output")
    for path in maps.files:
        check_input(Named(output, "folder"), Named(path, "read"))
    material = read_material(albedos[:1], how)
    if unknown := [name for name in maps.unknown if folder / name not in maps.files]:
        note(f"left out, because the name does not show the kind of map: {', '.join(unknown)}")
    return Folder(maps, albedos[0], output), material
