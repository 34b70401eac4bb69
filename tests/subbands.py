# SPDX-License-Identifier: BSD-3-Clause
"""The pyramid of a picture in the picture's own unit, for figures and tests."""

from dataclasses import dataclass

import numpy as np

from simdtex.io.image import check_sample
from simdtex.machine import open_machine
from simdtex.methods.pyramid.laplacian import folded
from simdtex.methods.pyramid.pyramids import Transform
from simdtex.methods.pyramid.stretched import Stretched


@dataclass(frozen=True)
class Pyramid:
    """A picture as subbands (bands, channels, rows, cols) in its own unit, in the order of `Transform.make`.

    On a torus rows and columns stand in the picture's order. ``offset`` is to be added to the low-pass residue to have
    the picture's own zero; the subbands are whole multiples of ``unit``.
    """

    subbands: list
    kind: str
    orientations: int
    boundary: str
    offset: float
    unit: float

    def collapse(self, *, device=None):
        """The picture (rows, cols, channels) that the subbands, which may have been changed, add up to."""
        machine = open_machine(device)
        levels = len(self.subbands) - (2 if self.kind == "steerable" else 1)
        whole = [np.asarray(np.rint(band / self.unit), np.int32) for band in self.subbands]
        if self.boundary == "torus":
            orders = _orders(self.subbands[0].shape[2:], levels, self.kind)
            whole = [band[..., r[:, None], c] for band, (r, c) in zip(whole, orders, strict=True)]
        transform = Transform(machine, self.kind, levels, self.orientations, self.boundary == "torus")
        picture = machine.get(transform.collapse([machine.put(band) for band in whole]))
        return np.ascontiguousarray(np.moveaxis(picture * self.unit + self.offset, 0, -1))


def decompose(image, *, kind="steerable", levels=4, orientations=4, boundary="open", channel_axis=None, device=None):
    """The pyramid of a picture; values are rounded to 2**-20 of the picture's range at every level."""
    pixels = check_sample(image, channel_axis)
    machine = open_machine(device)
    picture = Stretched(pixels)
    transform = Transform(machine, kind, levels, orientations, boundary == "torus")
    subbands = [machine.get(band) for band in transform.make(machine.put(picture.planes))]
    if boundary == "torus":
        orders = _orders(pixels.shape[:2], levels, kind)
        natural = [(np.argsort(rows)[:, None], np.argsort(cols)) for rows, cols in orders]
        subbands = [band[..., rows, cols] for band, (rows, cols) in zip(subbands, natural, strict=True)]
    offset = float(pixels.min())
    return Pyramid([band * picture.unit for band in subbands], kind, orientations, boundary, offset, picture.unit)


def _orders(shape, levels, kind):
    """Where the rows and columns of every subband stand among those of the picture, on a torus, as ranks."""
    places = [np.arange(n) for n in shape]
    found = []
    for _ in range(levels + 1):
        rows, cols = (np.argsort(np.argsort(place)) for place in places)
        found.append((rows, cols))
        places = [place[folded(place.size)] for place in places]
    return [found[0], *found] if kind == "steerable" else found
