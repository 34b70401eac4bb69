# SPDX-License-Identifier: BSD-3-Clause
"""The source map: for every output pixel, the sample position it was taken from.

It carries the arrangement of one synthesis over to any other map of the same material, and shows which parts are
copies. It is an integer array (rows, cols, 2) of (row, column) or, with several samples, (rows, cols, 3) of (row,
column, sample), counted from 0. A pixel that was given and not taken from any sample has no source: its row and column
are -1. The maps of a material in one folder have their roles by their names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.files import PathLike, atomic_path, read_npz, reading
from simdtex.io.image import check_writable, plain_array, read, write

SourceMap = NDArray[np.int32]

PIECE = 8  # side of a piece of the sample, pixels


class MostUsed(NamedTuple):
    """The most used piece: its use over its fair share, its first pixel and its size, see `effective_use`."""

    times_fair_share: float
    row: int
    col: int
    rows: int
    cols: int


class Use(NamedTuple):
    """How evenly an output uses its sample, see `effective_use`."""

    effective_share: float
    most_used: MostUsed

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as in `simdtex.run.Output.statistics`."""
        return {"effective_share": self.effective_share, "most_used": self.most_used._asdict()}


def checked(source: ArrayLike) -> SourceMap:
    """Return a source map as (rows, cols, 2 or 3) int32; raise if ``source`` is not one."""
    positions = plain_array("the source map", source)
    if not (positions.ndim == 3 and positions.shape[2] in (2, 3) and positions.size and positions.dtype.kind in "iu"):
        raise ValueError(
            f"a source map is (rows, cols, 2) or (rows, cols, 3) integers, not {positions.shape} of "
            f"{positions.dtype}: pass the one of a run"
        )
    low, high = int(positions.min()), int(positions.max())
    if low < -1 or high > np.iinfo(np.int32).max:
        wrong = low if low < -1 else high
        raise ValueError(f"the source map has the position {wrong}: pass the one of a finished run")
    none = positions < 0
    if (none[..., 0] != none[..., 1]).any() or (none[..., 2:] > none[..., :1]).any():
        raise ValueError(
            "the source map has the position -1 in a row, column or sample alone, and no source is -1 in both row and "
            "column: pass the one of a finished run"
        )
    return np.ascontiguousarray(positions, dtype=np.int32)


def counts(source: ArrayLike, sample_shape: tuple[int, ...], *, sample: int | None = None) -> NDArray[np.intp]:
    """Return the number of output pixels that were taken from each pixel of the sample.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)
        For every output pixel, the (row, column) of the sample that it was taken from, or (row, column, sample) of
        several samples; a pixel whose row and column are -1 has no source and is not counted.
    sample_shape : (rows, cols)
        The size of the sample, pixels.
    sample : int, optional
        The sample that is counted, from 0; required if the source map has several.

    Returns
    -------
    ndarray of int, sample_shape

    Raises
    ------
    ValueError
        `source` is no source map, points outside the sample, or is of several samples and none is named.
    """
    rows, cols = sample_shape[:2]
    positions = checked(source)
    several = positions.shape[2] == 3
    if several and sample is None:
        raise ValueError("the source map is of several samples: say which is counted with sample=0, sample=1 and so on")
    if sample is not None and (sample < 0 or (sample > 0 and not several)):
        raise ValueError(f"sample is {sample}: {'give 0 or more' if several else 'give None for a source map of one'}")
    counted = positions[..., 0] >= 0
    if several:
        counted &= positions[..., 2] == sample
    row, col = positions[counted].T[:2].astype(np.intp)
    if row.max(initial=0) >= rows or col.max(initial=0) >= cols:
        raise ValueError(
            f"the source map points outside a sample of {rows} x {cols} pixels: pass the sample that it was made from"
        )
    return np.bincount(row * cols + col, minlength=rows * cols).reshape(rows, cols)


def effective_use(
    source: ArrayLike, sample_shape: tuple[int, ...], piece: int = PIECE, *, sample: int | None = None
) -> Use:
    r"""Return how evenly the output uses the pieces of its sample, and the most used piece.

    The sample is cut into pieces of about 8 x 8 pixels. With :math:`u_p` the number of output
    pixels taken from the piece p, of :math:`a_p` pixels, the effective share is

    .. math::

       \frac{(\sum_p u_p)^2}{\sum_p a_p \sum_p u_p^2 / a_p} ,

    which is :math:`(\sum u)^2 / (n \sum u^2)` for n equally large pieces. It is the share of
    the sample that would suffice if all of it were used equally.

    Parameters
    ----------
    source, sample_shape, sample
        As in `counts`; of several samples the use of one is measured, by the pixels taken from it alone.
    piece : int
        Side of a piece, pixels: each side of the sample is cut into as many parts as come nearest
        to this length, which differ by one pixel at most.

    Returns
    -------
    effective_share : float
        Above 0, to 1; a verbatim copy of the sample has 1.
    most_used : MostUsed
        ``times_fair_share`` is :math:`(u_p / \sum u) / (a_p / \sum a)` of the piece where it is
        largest, 1 or more; ``row`` and ``col`` are the piece's first pixel, ``rows`` and ``cols``
        its size.

    Raises
    ------
    ValueError
        `source` is no source map, points outside the sample, or is of several samples and none is named; no pixel was
        taken from the sample; `piece` is less than 1.

    Notes
    -----
    Cost: about 1 ms for an output of 256 x 256 pixels. If pieces are taken at random, the use of a piece with n
    output pixels varies by sqrt(n), so a small output has a lower share than a large one.
    """
    return use_of(counts(source, sample_shape, sample=sample), piece)


def use_of(uses: NDArray[np.intp], piece: int = PIECE) -> Use:
    """Return `effective_use` from ``uses``, the `counts`, which add up over the parts of a source map."""
    if piece < 1:
        raise ValueError(f"piece is {piece}: give its side in pixels, 1 or more")
    if not uses.any():
        raise ValueError("no pixel was taken from the sample, so its use has no figures: pass the map of another run")
    row, col = (_starts(length, piece) for length in uses.shape)
    taken = np.add.reduceat(np.add.reduceat(uses, row, axis=0), col, axis=1)
    tall, wide = np.diff([*row, uses.shape[0]]), np.diff([*col, uses.shape[1]])
    density = taken / np.multiply.outer(tall, wide) * (uses.size / taken.sum())  # mean 1 over the sample's pixels
    i, j = (int(n) for n in np.unravel_index(density.argmax(), density.shape))
    most = MostUsed(float(density[i, j]), int(row[i]), int(col[j]), int(tall[i]), int(wide[j]))
    return Use(float(taken.sum() / (taken * density).sum()), most)


def _starts(length: int, piece: int) -> NDArray[np.intp]:
    """Return the begin of each part of a side."""
    parts = max(1, round(length / piece))
    return np.arange(parts) * length // parts


SOURCE_SUFFIXES = (".npz", ".npy", ".png")


def apply_source_map(
    source: ArrayLike,
    other_map: ArrayLike | Sequence[ArrayLike],
    sample_shape: tuple[int, ...] | Sequence[tuple[int, ...]] | None = None,
) -> NDArray[Any]:
    """Return another map of the material in the arrangement of the output, pixel for pixel.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)
        The (row, column) in the sample of every output pixel, or (row, column, sample) of several samples; row and
        column are -1 where a pixel has no source.
    other_map : array_like, (sample rows, sample cols) or (sample rows, sample cols, channels)
        A normal, height or other map of the sample; any type, any number of channels. For a source map of several
        samples, a list or tuple of such maps, one for each sample, all of one type and number of channels.
    sample_shape : (rows, cols), optional
        The size of the sample; a list of sizes if `other_map` is a list. None checks only that every position lies
        within `other_map`.

    Returns
    -------
    ndarray, (rows, cols) or (rows, cols, channels)
        An array of the type of `other_map` with its values unchanged; the vectors of a normal map are not turned, since
        pixels are moved and never turned.

    Raises
    ------
    ValueError
        The size of `other_map` is not that of the sample, the numbers of maps and samples differ, a pixel has no
        source, or an argument has the wrong shape.
    """
    positions = checked(source)
    maps, shapes = _maps(positions, other_map, sample_shape)
    none = np.argwhere(positions[..., 0] < 0)
    if len(none):
        what = f"{len(none)} pixel{'s have' if len(none) > 1 else ' has'} no source"
        raise ValueError(
            f"{what}, the first at row {none[0, 0]}, column {none[0, 1]}: carry over maps of a run without known pixels"
        )
    of = positions[..., 2] if positions.shape[2] == 3 else np.zeros(positions.shape[:2], dtype=np.int32)
    carried = np.empty((*of.shape, *maps[0].shape[2:]), dtype=maps[0].dtype)
    for k, (values, shape) in enumerate(zip(maps, shapes, strict=True)):
        places = positions[of == k]
        _check_size("the other map" if len(maps) == 1 else f"the other map of sample {k}", values, places, shape)
        carried[of == k] = values[places[:, 0], places[:, 1]]
    return carried


def _maps(
    positions: SourceMap, other_map: Any, sample_shape: Any
) -> tuple[list[NDArray[Any]], list[tuple[int, ...] | None]]:
    """Return the map of each sample and the sample's size, None if unknown."""
    shapes: list[tuple[int, ...] | None] = [sample_shape]
    several = positions.shape[2] == 3 and isinstance(other_map, (list, tuple))
    maps = [plain_array("the other map", array) for array in (other_map if several else [other_map])]
    if several:
        shapes = [None] * len(maps) if sample_shape is None else list(sample_shape)
    wanted = 1 + (int(positions[..., 2].max(initial=0)) if positions.shape[2] == 3 else 0)
    if len(maps) < wanted:
        raise ValueError(
            f"the source map has pixels of sample {wanted - 1}, counted from 0, and the number of other maps is "
            f"{len(maps)}: give a list with one for each sample"
        )
    if len(shapes) != len(maps) or any(shape is not None and np.ndim(shape) != 1 for shape in shapes):
        raise ValueError(f"sample_shape is {sample_shape!r}: give a list of (rows, cols) for each of {len(maps)} maps")
    for values in maps:
        if values.ndim not in (2, 3):
            raise ValueError(f"the other map is {values.ndim}-dimensional: give (rows, cols) or (rows, cols, channels)")
    kinds = {(values.dtype, values.shape[2:]) for values in maps}
    if len(kinds) > 1:
        named = sorted(f"{dtype} with {channels[0] if channels else 'no'} channels" for dtype, channels in kinds)
        raise ValueError(f"the other maps are {' and '.join(named)}: bring them to one type and number of channels")
    return maps, shapes


def _check_size(name: str, values: NDArray[Any], places: SourceMap, shape: tuple[int, ...] | None) -> None:
    (rows, cols), last = values.shape[:2], places[:, :2].max(axis=0, initial=-1)
    if shape is not None and (rows, cols) != tuple(shape[:2]):
        wanted = f"{shape[1]} x {shape[0]}"
    elif (last >= (rows, cols)).any():
        wanted = f"at least {last[1] + 1} x {last[0] + 1}"
    else:
        return
    raise ValueError(
        f"{name} is {cols} x {rows} pixels (width x height) and the sample {wanted}: bring it to the sample's size"
    )


def save_source_map(path: PathLike, source: ArrayLike) -> None:
    """Write a source map to a file, which is complete or not written at all.

    Parameters
    ----------
    path : path
        ``.npz`` (compressed, under the name ``source``), ``.npy``, or ``.png`` (16-bit colour: red the row, green the
        column, blue the sample, or 0; for samples up to 65536 pixels a side, where every pixel has a source).
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)

    Raises
    ------
    ValueError
        The path cannot be written, `source` is not a source map, or a PNG cannot hold it.
    """
    check_writable(path, suffixes=SOURCE_SUFFIXES)
    positions = checked(source)
    suffix = Path(path).suffix.lower()
    if suffix == ".npy":
        write(path, positions)
    elif suffix == ".npz":
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, source=positions)
    else:
        if positions.min() < 0:
            raise ValueError(f"{os.fspath(path)} cannot hold pixels without a source: use .npz")
        if positions.max() > 65535:
            raise ValueError(f"{os.fspath(path)} cannot hold positions over 65535: use .npz")
        colours = np.zeros((*positions.shape[:2], 3), dtype=np.uint16)
        colours[..., : positions.shape[2]] = positions
        write(path, colours)


def load_source_map(path: PathLike, *, max_pixels: int | None = None) -> SourceMap:
    """Return the source map of a file that `save_source_map` wrote.

    Parameters
    ----------
    path : path
        ``.npz``, ``.npy`` or ``.png``.
    max_pixels : int, optional
        The most pixels to read; None: ``SIMDTEX_MAX_PIXELS``, else 2**27.

    Returns
    -------
    ndarray of int32, (rows, cols, 2) or (rows, cols, 3)
        A ``.png`` with blue 0 everywhere has one sample, (rows, cols, 2).

    Raises
    ------
    ValueError
        The file is missing, damaged, or holds no source map.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() != ".npz":
        pixels = read(path, max_pixels=max_pixels).pixels
        if pixels.dtype.kind == "u" and pixels.shape[2:] == (3,) and not pixels[..., 2].any():
            pixels = pixels[..., :2]
        elif pixels.dtype == np.uint8:
            raise ValueError(f"{name} is a picture of 8 bits and holds no source map: give one saved by simdtex")
    else:
        with reading(path, "the source map", max_pixels, kind="a source map of simdtex") as most:
            pixels = read_npz(path, "source", most)
    try:
        return checked(pixels)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


ROLES = {
    "albedo": "albedo alb basecolor basecolour basemap diffuse diff color colour col albedotransparency",
    "normal": "normal normals norm nor nrm nrml normalgl normalogl normalopengl norgl",
    "normal-dx": "normaldx normaldirectx nordx",
    "roughness": "roughness rough rgh",
    "gloss": "gloss glossiness glossy smoothness",
    "height": "height heightmap depth displacement displace disp dsp",
    "bump": "bump bmp",
    "ao": "ao mixedao ambientocclusion occlusion occ",
    "cavity": "cavity curvature",
    "metallic": "metallic metalness metal mtl",
    "specular": "specular specularity specularlevel spec spc reflection refl",
    "emission": "emission emissive emit",
    "opacity": "opacity alpha alphamasked transparency",
    "translucency": "translucency transmission sss",
    "fuzz": "fuzz sheen",
    "packed": "orm arm rma mra ordp maskmap occlusionroughnessmetallic occlusionroughmetal metallicroughness "
    "metallicsmoothness metallicgloss metallicglossiness specgloss specularglossiness roughao aorough",
    "detail": "detailalbedo detailnormal detailmask",
}
"""The roles of maps, and the words at the end of a name that give the role."""

LETTERS = {role[0]: role for role in ("normal", "roughness", "height", "metallic", "specular", "emission")}
LETTERS |= {"bc": "albedo", "d": "albedo"}
"""Short words of Unreal, which give the role in a name that begins with ``T_``, or beside other maps of the stem."""

NORMALS = ("normal", "normal-dx")

READABLE = (
    *(".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".ppm", ".pgm", ".pbm", ".npy"),
    *(".exr", ".tga", ".avif", ".heic", ".heif", ".jp2", ".j2k"),
)
UNREADABLE = (".hdr", ".dds", ".psd", ".xcf", ".jxl")
"""Suffixes of picture formats that are not read; files with other unknown suffixes are no pictures."""

_WORDS = {word: role for role, words in ROLES.items() for word in words.split()} | LETTERS
_PARTS = re.compile(r"[0-9]+(?:k|K|px|bit)?|[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_AFTER = re.compile(r"(([0-9]+(k|px|bit)?|maps?|texture|tex|png|jpg|var|lod|(?<=[0-9k] )(metalness|specular))( |$))*")
"""Words that may follow the word of the role; after a size, metalness and specular are a workflow."""


class MaterialMaps(NamedTuple):
    """The maps of a folder: the role of each file, and the names of pictures with an unknown role."""

    files: dict[Path, str]
    unknown: list[str]


def _split(path: PathLike) -> tuple[str, str]:
    """Return the stem of a file's name, with a size, and the word of its role or, if it has none, the name and ""."""
    name = Path(path).stem
    parts = list(_PARTS.finditer(name))
    words = [part[0].lower() for part in parts]
    for first, last in ((i, j) for i in range(len(words)) for j in range(len(words), i, -1)):
        word, after, before = "".join(words[first:last]), words[last:], name[: parts[first].start()]
        if word in _WORDS and _AFTER.fullmatch(" ".join(after)) and (word not in LETTERS or before[-1:] in (*"_-. ",)):
            sizes = [size for size in after if re.fullmatch("[0-9]+k|[0-9]{4}", size)]
            return re.sub(r"[\W_]", "", before).lower() + "".join(sizes), word
    return re.sub(r"[\W_]", "", name).lower(), ""


def map_role(name: PathLike) -> str | None:
    """Return the role of a map, one of `ROLES`, by the last word of its file's name, or None.

    Case does not matter. Words are separated by anything but letters and digits, or begin with a capital letter; a size
    such as ``2K`` may follow. A word of `LETTERS` has a role in a name that begins with ``T_``.

    Examples
    --------
    >>> [map_role(name) for name in ("brick_normal.png", "Brick-Roughness.tif", "T_Brick_BC.png", "brick_n.png")]
    ['normal', 'roughness', 'albedo', None]
    """
    word = _split(name)[1]
    return _WORDS.get(word) if word not in LETTERS or Path(name).name.startswith(("T_", "t_")) else None


def find_maps(folder: PathLike, lead: Path | None = None) -> MaterialMaps:
    """Return the maps of the material in a folder, by their names; of several materials that of the map ``lead``.

    Hidden files, subfolders, and files that are no pictures are ignored. There are several materials if a role occurs
    with several stems: a stem is the name before the word of the role.

    Raises
    ------
    ValueError
        The folder cannot be read, has several materials and there is no `lead`, or a map in a format that is not read.
    """
    try:
        paths = sorted(path for path in Path(folder).iterdir() if path.name[0] != "." and path.is_file())
    except OSError as error:
        raise ValueError(
            f"{os.fspath(folder)} cannot be read ({error.strerror}): check the path of the folder"
        ) from None
    names = {path: _split(path) for path in paths if path.suffix.lower() in (*READABLE, *UNREADABLE)}
    files = {}
    for path, (stem, word) in names.items():
        beside = {other for base, other in names.values() if base == stem}
        minecraft = {"", "n", "s"} <= beside <= {"", *LETTERS}  # LabPBR, whose albedo has no word
        if map_role(path) or minecraft or (word and (beside >= {"d", "n"} or not beside <= {"", *LETTERS})):
            files[path] = _WORDS.get(word, "albedo")
    unknown = [path.name for path in names if path not in files and path.suffix.lower() in READABLE]
    if len({(names[path][0], role) for path, role in files.items()}) > len(set(files.values())):
        if lead is None:
            each = {names[path][0]: str(path) for path in sorted(files, key=lambda path: files[path] == "albedo")}
            some = " or ".join(sorted(each.values())[:4])
            raise ValueError(f"{folder} holds {len(each)} materials: instead of it give a map of one, such as {some}")
        stem, whole = _split(lead)[0], {names[path][0] for path, role in files.items() if role == "albedo"}
        unknown += [p.name for p in files if names[p][0] not in {stem, *whole} and names[p][0].startswith(stem)]
        files = {path: role for path, role in files.items() if names[path][0] == stem}
    if unread := [path for path in files if path.suffix.lower() in UNREADABLE]:
        raise ValueError(f"{unread[0]} is of a format that is not read: save it as TIFF or as 16-bit PNG")
    return MaterialMaps(files, unknown)


def unit_normals(pixels: NDArray[Any], where: NDArray[np.bool_]) -> NDArray[Any]:
    """Return a normal map with vectors of length 1 at the pixels ``where``; its other values are unchanged.

    Parameters
    ----------
    pixels : ndarray, (rows, cols, channels)
        Red, green and blue are x, y and z, from -1 to 1. In unsigned integers this is 0 to full scale; in floats
        without a negative one, 0 to 1. Further channels are unchanged, and so is a map with fewer than three.
    where : ndarray of bool, (rows, cols)

    Returns
    -------
    ndarray
        An array of the shape and type of `pixels`; unsigned integers are rounded. A vector shorter than 0.01 has no
        direction, and is unchanged.
    """
    if pixels.ndim < 3 or pixels.shape[2] < 3 or pixels.dtype.kind not in "uf":
        return pixels
    whole = pixels.dtype.kind == "u"
    scale, offset = (np.iinfo(pixels.dtype).max / 2 if whole else 0.5), 1.0
    if not whole and pixels[..., :3].min() < 0:
        scale, offset = 1.0, 0.0
    vectors = pixels[where][:, :3] / scale - offset
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors = np.divide(vectors, length, out=vectors, where=length > 0.01)
    values = (vectors + offset) * scale
    made = pixels.copy()
    made[where, :3] = (np.round(values) if whole else values).astype(pixels.dtype)
    return made
