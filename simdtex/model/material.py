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
    "albedo": "albedo basecolor basecolour diffuse diff color colour col",
    "normal": "normal normals normalgl nor norgl nrm nrml",
    "normal-dx": "normaldx nordx",
    "roughness": "roughness rough rgh",
    "gloss": "gloss glossiness glossy",
    "height": "height heightmap displacement displace disp dsp",
    "bump": "bump bmp",
    "ao": "ao occlusion ambientocclusion",
    "metallic": "metallic metalness metal mtl",
    "specular": "specular specularity spec spc",
    "emission": "emission emissive emit",
    "opacity": "opacity alpha transparency",
    "packed": "orm arm metallicroughness",
}
"""The roles of maps, and the words at the end of a name that give the role."""

NORMALS = ("normal", "normal-dx")

READABLE = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".ppm", ".pgm", ".npy")
UNREADABLE = (".exr", ".hdr", ".tga", ".dds", ".psd")
"""Suffixes of picture formats that are not read; files with other unknown suffixes are no pictures."""

_WORDS = {word: role for role, words in ROLES.items() for word in words.split()}
_PARTS = re.compile(r"[0-9]+(?:k|K|px|bit)?|[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_AFTER = re.compile(r"[0-9]+(?:k|px|bit)?|maps?|texture|tex|png|jpg")
"""Words that may follow the word of the role."""


class Maps(NamedTuple):
    """The maps of a folder: the file of each role, and the names of pictures with an unknown role."""

    files: dict[str, Path]
    unknown: list[str]


def map_role(name: str | os.PathLike[str]) -> str | None:
    """Return the role of a map, one of `ROLES`, by the last word of its file's name, or None.

    Case does not matter. Words are separated by anything but letters and digits, or begin with a capital letter; a size
    such as ``2K`` may follow.

    Examples
    --------
    >>> [map_role(name) for name in ("brick_normal.png", "Brick-Roughness.tif", "BrickBaseColor_2K.jpg", "brick.png")]
    ['normal', 'roughness', 'albedo', None]
    """
    words = [word.lower() for word in _PARTS.findall(Path(name).stem)]
    while len(words) > 1 and _AFTER.fullmatch(words[-1]):
        words.pop()
    return next((role for number in (2, 1) if (role := _WORDS.get("".join(words[-number:])))), None)


def find_maps(folder: str | os.PathLike[str]) -> Maps:
    """Return the maps of the material in a folder, by their names.

    Hidden files, subfolders, and files that are no pictures are ignored.

    Raises
    ------
    ValueError
        The folder cannot be read, has two maps of one role, or a map in a format that is not read.
    """
    try:
        found = sorted(path for path in Path(folder).iterdir() if path.name[0] != "." and path.is_file())
    except OSError as error:
        raise ValueError(
            f"{os.fspath(folder)} cannot be read ({error.strerror}): check the path of the folder"
        ) from None
    maps = Maps({}, [])
    for path in found:
        role, suffix = map_role(path), path.suffix.lower()
        if suffix in UNREADABLE and role:
            raise ValueError(f"{path} is of a format that is not read: save it as TIFF or as 16-bit PNG")
        if suffix not in READABLE:
            continue
        if role is None:
            maps.unknown.append(path.name)
        elif role in maps.files:
            raise ValueError(f"{maps.files[role]} and {path.name} are both {role} maps: move one out of the folder")
        else:
            maps.files[role] = path
    return maps


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
