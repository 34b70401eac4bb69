# SPDX-License-Identifier: BSD-3-Clause
"""The maps of a material in one folder: the role of each file by its name, and normals of length 1."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    "packed": "orm arm rma mra ordp maskmap occlusionroughnessmetallic metallicroughness metallicsmoothness "
    "roughao aorough",
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


class Maps(NamedTuple):
    """The maps of a folder: the role of each file, and the names of pictures with an unknown role."""

    files: dict[Path, str]
    unknown: list[str]


def _split(path: str | os.PathLike[str]) -> tuple[str, str]:
    """Return the stem of a file's name, with a size, and the word of its role or, if it has none, the name and ""."""
    name = Path(path).stem
    parts = list(_PARTS.finditer(name))
    words = [part[0].lower() for part in parts]
    for first, last in ((i, j) for i in range(len(words)) for j in range(len(words), i, -1)):
        word, after, before = "".join(words[first:last]), words[last:], name[: parts[first].start()]
        if word in _WORDS and _AFTER.fullmatch(" ".join(after)) and (word not in LETTERS or before[-1:] in (*"_-. ",)):
            sizes = [one for one in after if re.fullmatch("[0-9]+k|[0-9]{4}", one)]
            return re.sub(r"[\W_]", "", before).lower() + "".join(sizes), word
    return re.sub(r"[\W_]", "", name).lower(), ""


def map_role(name: str | os.PathLike[str]) -> str | None:
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


def find_maps(folder: str | os.PathLike[str], lead: Path | None = None) -> Maps:
    """Return the maps of the material in a folder, by their names; of several materials that of the map ``lead``.

    Hidden files, subfolders, and files that are no pictures are ignored. There are several materials if a role occurs
    with several stems: a stem is the name before the word of the role.

    Raises
    ------
    ValueError
        The folder cannot be read, has several materials and there is no `lead`, or a map in a format that is not read.
    """
    try:
        found = sorted(path for path in Path(folder).iterdir() if path.name[0] != "." and path.is_file())
    except OSError as error:
        raise ValueError(
            f"{os.fspath(folder)} cannot be read ({error.strerror}): check the path of the folder"
        ) from None
    names = {path: _split(path) for path in found if path.suffix.lower() in (*READABLE, *UNREADABLE)}
    files = {}
    for path, (stem, word) in names.items():
        beside = {other for one, other in names.values() if one == stem and other}
        if map_role(path) or (word and (beside >= {"d", "n"} or not beside <= LETTERS.keys())):
            files[path] = _WORDS[word]
    unknown = [path.name for path in names if path not in files and path.suffix.lower() in READABLE]
    if len({(names[path][0], role) for path, role in files.items()}) > len(set(files.values())):
        if lead is None:
            one = {names[path][0]: str(path) for path in sorted(files, key=lambda path: files[path] == "albedo")}
            some = " or ".join(sorted(one.values())[:4])
            raise ValueError(f"{folder} holds {len(one)} materials: instead of it give a map of one, such as {some}")
        files = {path: role for path, role in files.items() if names[path][0] == _split(lead)[0]}
    if unread := [path for path in files if path.suffix.lower() in UNREADABLE]:
        raise ValueError(f"{unread[0]} is of a format that is not read: save it as TIFF or as 16-bit PNG")
    return Maps(files, unknown)


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
