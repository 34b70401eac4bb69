# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the pages on multiresolution sampling and on pyramid matching.

    python benchmarks/pages.py [--only multires/edges,pyramid/solid] [--out docs] [--quick] [--device TEXT]

Writes a PNG file for each name, the same bytes every time. ``--quick`` divides sides and iterations by 4.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product

import common
import numpy as np
from skimage import data
from skimage.transform import resize

import simdtex
from simdtex.experiments.quality import seam
from simdtex.machine import Machine
from simdtex.methods.multires.mend import mend
from simdtex.model.stretched import Stretched
from simdtex.report.sheet import view


def reduced(picture, factor):
    """A picture reduced, smoothed before."""
    shape = [round(n / factor) for n in picture.shape[:2]]
    return np.rint(resize(picture, shape, anti_aliasing=True, preserve_range=True)).astype(np.uint8)


def stretched(picture):
    """A grey picture over the whole range, but for one value in a thousand at each end."""
    low, high = np.quantile(picture, (0.001, 0.999))
    return np.rint(np.clip((picture - low) / (high - low), 0, 1) * 255).astype(np.uint8)


SAMPLES = common.grey() | common.colour() | {"fur": data.chelsea()[0:64, 170:234]}
FAR = {"gravel": reduced(data.gravel(), 4), "grass": reduced(data.grass(), 4)}
STRONG = {
    "gravel, reduced to 1/4": FAR["gravel"],
    "grass, reduced to 1/4": FAR["grass"],
    "the moon's ground, contrast raised": stretched(data.moon()[300:428, 20:148]),
    "a lawn, contrast raised": stretched(data.camera()[415:485, 155:225]),
    "fur": SAMPLES["fur"],
    "wood": SAMPLES["wood"],
    "a blurred ground, contrast raised": stretched(data.cell()[300:428, 20:148]),
    "wood in the light": data.coffee()[310:374, 10:74],
}
"""Textures without structures beyond what histograms of subbands hold."""

FAILURES = {
    "quasi-periodic: brick": SAMPLES["brick"],
    "a mosaic: gravel": SAMPLES["gravel"],
    "a mosaic: coins": data.coins()[60:188, 60:188],
    "inhomogeneous: a lawn and a tripod": data.camera()[410:510, 150:260],
    "inhomogeneous: a margin without tissue": data.immunohistochemistry()[400:496, 80:176],
    "locally oriented: grass": SAMPLES["grass"],
    "locally oriented: tissue": SAMPLES["tissue"],
    "locally oriented: hair": data.astronaut()[20:84, 190:254],
}
"""Textures with structures beyond them, and of what kind they are."""


@dataclass
class Runs:
    """Runs on a machine, whose sides and iterations are divided by a number."""

    machine: Machine
    part: int

    def small(self, n):
        """A side, or a number of iterations."""
        return max(1, n // self.part)

    def crop(self, sample):
        return sample[: self.small(sample.shape[0]), : self.small(sample.shape[1])]

    def given(self, sample, options):
        return {"channel_axis": common.axis(sample), "rng": 1, "device": self.machine, "full_output": True} | options

    def synth(self, sample, side, **options):
        """A picture and its output."""
        return simdtex.synthesize(self.crop(sample), (self.small(side),) * 2, **self.given(sample, options))

    def pyramid(self, sample, side, **options):
        return self.synth(sample, side, method="pyramid", **options)[0]

    def mix(self, samples, side, **options):
        given, cropped = self.given(samples[0], options), [self.crop(one) for one in samples]
        return simdtex.mix(cropped, (self.small(side),) * 2, **given)[0]

    def block(self, sample, side, **options):
        return simdtex.synthesize_solid(self.crop(sample), (self.small(side),) * 3, **self.given(sample, options))


# ---------------------------------------------------------------- multiresolution sampling: label and picture


def mended(runs):
    """Samples laid beside themselves, as they are and mended."""
    for how, name in product(("keep", "mend"), ("brick", "gravel", "tissue", "wood")):
        one = runs.crop(SAMPLES[name])
        if how == "mend":
            one = one.reshape(-1, *one.shape[2:])[mend(Stretched(one.reshape(*one.shape[:2], -1)).planes)]
        yield f"{name}, {how}: seam {seam(one):.2f}", np.tile(one, (2, 2, 1)[: one.ndim])


def joined(runs):
    """Textures of the same places, whose bands are cut where they meet, and fade into each other."""
    for how, name in product(("cut", "blend"), ("gravel", "brick", "tissue")):
        one = SAMPLES[name]
        yield f"{name}, {how}", runs.synth(one, 2 * len(one), method="multires", alpha=0.3, seams=how)[0]


# ---------------------------------------------------------------- pyramid matching


def gallery(chosen, runs):
    for name, sample in chosen.items():
        kind, _, what = name.rpartition(": ")
        yield what, runs.crop(sample)
        yield kind, runs.pyramid(sample, 192)


def mixtures(runs):
    """Mixtures of two samples, and a picture to begin with."""
    wood, stroma = SAMPLES["wood"], data.immunohistochemistry()[250:346, 160:256]
    gravel, grass = SAMPLES["gravel"], FAR["grass"]
    split = (2, 3) if runs.part == 1 else (1, 0)
    start = resize(data.camera()[70:270, 120:320], (runs.small(128),) * 2, anti_aliasing=True)
    yield from (("A: wood", runs.crop(wood)), ("B: stroma", runs.crop(stroma)))
    for name, options in (("palette A, pattern B", (0, 1)), ("palette B, pattern A", (1, 0))):
        yield name, runs.mix([wood, stroma], 128, palette=options[0], pattern=options[1])
    yield from (("C: gravel", runs.crop(gravel)), ("D: grass, reduced", runs.crop(grass)))
    for low, high in ((0, 1), (1, 0)):
        label = f"low {'CD'[low]}, high {'CD'[high]}, split 2"
        yield label, runs.mix([gravel, grass], 128, low=low, high=high, split=split[0])
    for a, b in ((3, 1), (1, 1), (1, 3)):
        yield f"{a} A + {b} B", runs.mix([wood, stroma], 128, average=[a, b])
    yield "low C, high D, split 3", runs.mix([gravel, grass], 128, low=0, high=1, split=split[1])
    yield "A, begun with a picture", runs.mix([wood], 128, start=start, iterations=runs.small(5))


def solids(runs):
    """Two blocks as one sees them."""
    for name, sample in (("gravel, reduced", FAR["gravel"]), ("tissue", SAMPLES["tissue"])):
        yield name, view(runs.block(sample, 96)[0], size=max(96, runs.small(288)))


MADE = {
    "multires/edges": (mended, 4, None),
    "multires/seams": (joined, 3, None),
    "pyramid/gallery-strong": (partial(gallery, STRONG), 4, 1),
    "pyramid/gallery-failures": (partial(gallery, FAILURES), 4, 1),
    "pyramid/mixtures": (mixtures, 4, 1),
    "pyramid/solid": (solids, 1, 1),
}
"""Name -> what yields the labels and pictures of a sheet, its columns, and the scale of its pictures."""


@common.command
def main(only="", out=common.DOCS, quick=False, device=None):
    runs = Runs(common.opened(device), 4 if quick else 1)
    for name, (made, columns, scale) in common.chosen(MADE, only).items():
        common.sheet(out / f"{name}.png", [(*cell, "") for cell in made(runs)], columns, scale=scale)
        print(out / f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
