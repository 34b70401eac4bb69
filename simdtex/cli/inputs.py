# SPDX-License-Identifier: BSD-3-Clause
"""What a command is given in files, read and checked: samples, masks, known values, and other maps of a material."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.common import afterwards

if TYPE_CHECKING:
    from simdtex.io.hard_data import HardData
    from simdtex.io.image import Image

TABLES = (".csv", ".tsv", ".txt", ".dat")
"""How the name of a table of known values ends; a file of any other name is a picture."""


class Material(NamedTuple):
    """Pictures of one type: ``paths``, and their ``pixels``, which all have the axes of the first."""

    paths: tuple[Path, ...]
    pixels: list[NDArray[Any]]
    channel_axis: int | None

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
        return min(float(np.nanmin(a)) for a in self.pixels), max(float(np.nanmax(a)) for a in self.pixels)

    @property
    def known(self) -> bool:
        """Whether nothing is NaN."""
        return all(array.dtype.kind != "f" or not np.isnan(array).any() for array in self.pixels)


class Also(NamedTuple):
    """A map of the material, one for each sample, and the file that its arrangement goes to."""

    maps: Material
    out: Path

    def carried(self, source: Any) -> NDArray[Any]:
        """The map in the arrangement of an output."""
        from simdtex.model.source_map import apply_source_map

        return apply_source_map(source, self.maps.array, self.maps.sizes if self.maps.several else self.maps.sizes[0])


def channels(pixels: NDArray[Any]) -> int:
    """How many a picture (rows, cols) or (rows, cols, channels) has."""
    return 1 if pixels.ndim == 2 else pixels.shape[2]


def size(pixels: NDArray[Any]) -> str:
    """Width x height in words."""
    return f"{pixels.shape[1]}x{pixels.shape[0]}"


def kind(pixels: NDArray[Any]) -> str:
    """Channels and type in words."""
    count = channels(pixels)
    return f"{count} channel{'s' * (count != 1)} of {pixels.dtype}"


def check_alike(path: Path, pixels: NDArray[Any], other: Path, like: NDArray[Any]) -> None:
    """Raise unless two pictures have the same type and as many channels."""
    if (pixels.dtype, channels(pixels)) != (like.dtype, channels(like)):
        raise ValueError(f"{path} has {kind(pixels)} and {other} {kind(like)}; convert them to one type")


def read_material(paths: Sequence[Path], *, unknown: bool = False) -> Material:
    """Read pictures that must be of one type; ``unknown`` is that of `simdtex.io.image.read`."""
    from simdtex.io import image

    pictures = [image.read(path, unknown=unknown) for path in paths]
    first = pictures[0].pixels
    for path, picture in zip(paths, pictures, strict=True):
        if picture.pixels.dtype.kind == "f" and np.isnan(picture.pixels).all():
            raise ValueError(f"{path} is NaN everywhere, so nothing of it is known; leave it out")
        check_alike(path, picture.pixels, paths[0], first)
    return Material(
        tuple(paths),
        [p.pixels.reshape(*p.pixels.shape[:2], *first.shape[2:]) for p in pictures],
        pictures[0].channel_axis,
    )


def read_masks(paths: Sequence[Path], samples: Material) -> list[NDArray[np.bool_]] | None:
    """The masks of ``--sample-mask``, one for each sample, True where pixels may be taken from; or None."""
    from simdtex.io import image

    if not paths:
        return None
    if len(paths) != len(samples.pixels):
        raise ValueError(
            f"--sample-mask is given {len(paths)} times and the number of samples is {len(samples.pixels)}; "
            "give it once for each sample"
        )
    masks = [image.read_mask(path, shape) for path, shape in zip(paths, samples.sizes, strict=True)]
    if not any(mask.any() for mask in masks):
        named = " and ".join(map(str, paths))
        raise ValueError(f"nothing of {named} is white, so nothing of the sample may be used; paint white what may")
    return masks


def read_also(texts: Sequence[str], samples: Material) -> list[Also]:
    """Read the maps of ``--also MAP=OUT``, and check that they can be carried over and written."""
    return [_other_map(text, samples) for text in texts]


def _other_map(text: str, samples: Material) -> Also:
    from simdtex.io import image

    name, equals, out = text.partition("=")
    names = [part.strip() for part in name.split(",")] if samples.several else [name]
    if not (equals and out and all(names)):
        raise ValueError(f"--also {text} must be MAP=OUT, the map's file and the file to write")
    if len(names) != len(samples.pixels):
        raise ValueError(
            f"--also {text} names {len(names)} of the maps that the {len(samples.pixels)} samples have; "
            "give a map of each, parted by commas, as MAP0,MAP1=OUT"
        )
    maps = read_material([Path(one) for one in names], unknown=True)
    for path, pixels, of, sample in zip(maps.paths, maps.pixels, samples.paths, samples.pixels, strict=True):
        if pixels.shape[:2] != sample.shape[:2]:
            raise ValueError(
                f"{path} is {size(pixels)} and {of} {size(sample)}; give --also a map of the sample's size"
            )
    image.check_writable(out, maps.pixels[0].dtype, channels(maps.pixels[0]))
    return Also(maps, Path(out))


def write_arranged(
    output: Path, made: NDArray[Any], others: Sequence[Also], source_map: Path | None, source: Any
) -> None:
    """Write a picture, the other maps in its arrangement and, where it is asked for, the source map."""
    from simdtex.io import image
    from simdtex.model.source_map import save_source_map

    carried = [(one.carried(source), one.out) for one in others]
    with afterwards():
        image.write(output, made)
    for array, path in carried:
        with afterwards():
            image.write(path, array)
    if source_map:
        with afterwards():
            save_source_map(source_map, source)


def check_source_map(path: Path | None, samples: Material, *, everywhere: bool = True) -> None:
    """Raise where a source map cannot be written there; ``everywhere`` says that all pixels are from a sample."""
    from simdtex.io import image
    from simdtex.model.source_map import SOURCE_SUFFIXES

    if path is None:
        return
    image.check_writable(path, suffixes=SOURCE_SUFFIXES)
    far = max(max(sides) for sides in samples.sizes) > 2**16
    if path.suffix.lower() == ".png" and (far or not everywhere):
        what = "positions over 65535" if far else "pixels that are from no sample"
        raise ValueError(f"{path} cannot hold {what}; end its name in .npz instead")


def read_known(path: Path) -> Image | HardData:
    """Read the known values of an output: a table, told by its name, or a picture."""
    from simdtex.io import image
    from simdtex.io.hard_data import read_hard_data

    return read_hard_data(path) if path.suffix.lower() in TABLES else image.read(path, unknown=True)


def known_size(known: Image | HardData | None) -> NDArray[Any] | None:
    """The picture of known values, which says how large the output is; None where it is a table."""
    from simdtex.io.image import Image

    return known.pixels if isinstance(known, Image) else None


def known_values(
    known: Image | HardData, path: Path, shape: tuple[int, int], samples: Material
) -> np.ma.MaskedArray[Any, Any]:
    """The known values of an output of this shape as a masked array that `simdtex.synthesize` takes.

    Of a picture unknown is what is NaN and, if it has alpha and the sample none, what is transparent.
    """
    from simdtex.io.hard_data import HardData, place_hard_data
    from simdtex.io.image import split_alpha
    from simdtex.machine import memory

    like = samples.pixels[0]
    if isinstance(known, HardData):
        memory.require_host(prod(shape) * channels(like) * (like.itemsize + 1))  # values and a mask
        if len(known.names) != channels(like):
            raise ValueError(
                f"{path} has {len(known.names)} values to a datum and {samples.paths[0]} has {kind(like)}; give as many"
            )
        try:
            return place_hard_data(known, shape, like.dtype).reshape(*shape, *like.shape[2:])
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    values, gone = known.pixels, np.zeros(known.pixels.shape[:2], bool)
    if channels(values) == channels(like) + 1:
        values, gone = split_alpha(values)
    if channels(values) != channels(like) or values.dtype not in (like.dtype, np.float32, np.float64):
        raise ValueError(f"{path} has {kind(values)} and {samples.paths[0]} {kind(like)}; convert them to one type")
    if values.shape[:2] != shape:
        raise ValueError(
            f"{path} is {size(values)} and the output {shape[1]}x{shape[0]}; give a picture of the output's size"
        )
    mask = np.broadcast_to(gone.reshape(*shape, *[1] * (values.ndim - 2)), values.shape)
    mask = mask | np.isnan(values) if values.dtype.kind == "f" else mask
    if not mask.any():
        raise ValueError(f"{path} is known everywhere, so nothing is left to do; make transparent, or NaN, what is not")
    if mask.all():
        raise ValueError(f"{path} is known nowhere; leave --known out, or give a picture that has something")
    return np.ma.MaskedArray(values, mask).reshape(*shape, *like.shape[2:])
