# SPDX-License-Identifier: BSD-3-Clause
"""The guides of ``--guide``: pictures of labels or numbers, of the samples and of the output."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.inputs import Material, channels


class Guides(NamedTuple):
    """What ``--guide`` is given: the files, the guide of each sample, that of the output, and what is meant by both."""

    paths: tuple[Path, ...]
    samples: list[NDArray[Any]]
    output: NDArray[Any]
    labels: bool | None

    @property
    def pair(self) -> tuple[Any, NDArray[Any]]:
        """As `simdtex.synthesize` takes it."""
        return (self.samples if len(self.samples) > 1 else self.samples[0]), self.output


def read_guides(text: str, samples: Material, labels: bool | None) -> Guides:
    """Read the pictures of ``SAMPLE-GUIDE=OUTPUT-GUIDE``; of several samples, their guides are parted by commas.

    Colours of 8 bits are labels, as ``labels`` says or, if it is None, where the samples' guides have few: the output
    has whole numbers in their place. What is transparent or NaN in the guide of the output is left open, as NaN.
    """
    from simdtex.io import image

    name, equals, out = text.partition("=")
    names = [part.strip() for part in name.split(",")] if samples.several else [name]
    if not (equals and out and all(names)):
        raise ValueError(f"--guide {text} must be SAMPLE-GUIDE=OUTPUT-GUIDE, two files")
    if len(names) != len(samples.pixels):
        raise ValueError(
            f"--guide {text} names {len(names)} of the guides that the {len(samples.pixels)} samples have; "
            "give one of each, parted by commas, as GUIDE0,GUIDE1=OUTPUT-GUIDE"
        )
    paths = tuple(Path(one) for one in names)
    own = [image.read(path).pixels for path in paths]
    wanted, open_ = _opened(image.read(out).pixels, channels(own[0]))
    few = _few(own)
    colours = all(one.dtype == np.uint8 and channels(one) == channels(wanted) > 1 for one in (*own, wanted))
    if labels is not False and colours and (labels or few):
        own, wanted, labels = _numbered(own, wanted, open_, paths, out)
    elif labels is None and open_.any():  # in floats, that they are whole numbers would no longer be seen
        labels = all(one.dtype.kind in "iu" for one in (*own, wanted)) and few
    if open_.any():
        wanted = wanted.astype(np.float64)
        wanted[open_] = np.nan
    return Guides((*paths, Path(out)), own, wanted, labels)


def _opened(pixels: NDArray[Any], count: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """The guide of the output without the alpha that those of the samples lack, and where it says nothing."""
    from simdtex.io.image import split_alpha

    open_ = np.zeros(pixels.shape[:2], bool)
    if channels(pixels) == count + 1:
        pixels, open_ = split_alpha(pixels)
    if pixels.dtype.kind == "f":
        open_ = open_ | np.isnan(pixels).reshape(*open_.shape, -1).any(-1)
    return pixels, open_


def _rows(pixels: NDArray[Any]) -> NDArray[Any]:
    """The pixels of a picture, (pixels, channels)."""
    return pixels.reshape(-1, channels(pixels))


def _few(pictures: list[NDArray[Any]]) -> bool:
    """Whether there are so few different pixels that they are labels."""
    from simdtex.methods.mrf.options import few

    return few([one.reshape(*one.shape[:2], -1) for one in pictures])


def _numbered(
    own: list[NDArray[Any]], wanted: NDArray[Any], open_: NDArray[np.bool_], paths: tuple[Path, ...], out: str
) -> tuple[list[NDArray[Any]], NDArray[Any], bool]:
    """Whole numbers in place of the samples' colours; raises where the output has another colour."""
    known = np.unique(np.concatenate([_rows(one) for one in own]), axis=0)
    names = {tuple(colour): number for number, colour in enumerate(known.tolist())}
    told = np.unique(wanted[~open_], axis=0)
    strange = [colour for colour in told.tolist() if tuple(colour) not in names]
    if strange:
        more = f" and {len(strange) - 1} more" if len(strange) > 1 else ""
        raise ValueError(
            f"{out} has the colour {tuple(strange[0])}{more}, which {', '.join(map(str, paths))} "
            f"{'has' if len(paths) == 1 else 'have'} not; paint with the labels' own colours, without soft edges, "
            "or say --no-labels"
        )
    return (
        [_looked_up(one, known) for one in own],
        _looked_up(np.where(open_[..., None], known[0], wanted), known),
        True,
    )


def _looked_up(pixels: NDArray[Any], known: NDArray[Any]) -> NDArray[Any]:
    """The number of each pixel's colour, (rows, cols)."""
    found = np.zeros(pixels.shape[:2], np.int64)
    for number, colour in enumerate(known):
        found[(pixels == colour).all(-1)] = number
    return found
