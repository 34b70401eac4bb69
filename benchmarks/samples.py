# SPDX-License-Identifier: BSD-3-Clause
"""The samples of every study: crops of pictures that scikit-image carries."""

from fnmatch import fnmatch

from skimage import data

from simdtex.io.image import read


def grey():
    """Brick, grass and gravel, 128x128."""
    return {name: getattr(data, name)()[:128, :128] for name in ("brick", "grass", "gravel")}


def colour():
    """Tissue, wood and stars, 96x96."""
    return {
        "tissue": data.immunohistochemistry()[76:172, 126:222],
        "wood": data.coffee()[266:362, 486:582],
        "stars": data.hubble_deep_field()[346:442, 166:262],
    }


def folder(path, only=""):
    """Every picture of a folder, by its name without the suffix; `only` are names or patterns, as ``*.png``."""
    found = {}
    for file in sorted(path.iterdir()) if path.is_dir() else ():
        if only and not any(fnmatch(file.name, each) or fnmatch(file.stem, each) for each in only.split(",")):
            continue
        try:
            pixels = read(file).pixels
        except ValueError as error:
            print(f"left out: {error}")
            continue
        if file.stem in found:
            raise ValueError(f"two pictures in {path} are called {file.stem}: rename one, or leave it out by --only")
        found[file.stem] = pixels
    if not found:
        raise ValueError(f"there is no picture in {path}: give a folder of samples")
    return found


def chosen(path, only=""):
    """The pictures of a folder, or where there is none those of `grey` and `colour`; `only` are names."""
    if path:
        return folder(path, only)
    known = {**grey(), **colour()}
    names = only.split(",") if only else list(known)
    for name in names:
        if name not in known:
            raise ValueError(f"there is no sample {name}: choose of {', '.join(known)}")
    return {name: known[name] for name in names}
