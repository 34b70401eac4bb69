# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the pages on multiresolution sampling, on pyramid matching and on the papers' figures.

    python benchmarks/pages.py [--only "multires/edges,figures/*"] [--out docs] [--device TEXT]

Writes a PNG file for each name, the same bytes every time. Samples are pictures that scikit-image carries, or drawn by
``benchmarks/drawings.py``.
"""

from functools import partial
from itertools import product

import common
import drawings
import numpy as np
from skimage import data
from skimage.transform import resize

import simdtex
from simdtex.figures.sheet import magnified, view
from simdtex.io.image import example
from simdtex.jobs.studies.quality import seam
from simdtex.methods.multires.mend import mend
from simdtex.methods.pyramid.stretched import Stretched


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


TEXTURES = {
    "sand": FAR["gravel"],
    "wood": np.rint(data.coffee()[270:398, 472:600].mean(-1)).astype(np.uint8),
    "grass": SAMPLES["grass"],
    "gravel": SAMPLES["gravel"],
    "cells": drawings.cells(),
    "reptile": drawings.reptile(),
    "brick": example("brick")[:128, :128].T,  # courses are level
    "canvas": drawings.canvas(),
    "mesh": drawings.mesh(),
    "gingham": drawings.gingham(),
}
"""Samples of 128x128 grey pixels, from the stochastic to the well structured."""

COLOUR = {
    "stucco": drawings.stucco(),
    "granite": drawings.granite(),
    "green marble": drawings.marble(),
    "fur": SAMPLES["fur"],
    "wood": SAMPLES["wood"],
    "wood in the light": STRONG["wood in the light"],
}
"""Samples of Heeger and Bergen's Figure 3."""


def synth(machine, sample, side, **options):
    """A picture with a side."""
    given = {"channel_axis": common.axis(sample), "rng": 1, "device": machine} | options
    return simdtex.synthesize(sample, (side, side), **given)


# ---------------------------------------------------------------- multiresolution sampling: label and picture


def mended(machine):
    """Samples laid beside themselves, as they are and mended."""
    for how, name in product(("keep", "mend"), ("brick", "gravel", "tissue", "wood")):
        one = SAMPLES[name]
        if how == "mend":
            one = one.reshape(-1, *one.shape[2:])[mend(Stretched(one.reshape(*one.shape[:2], -1)).planes)]
        yield f"{name}, {how}: seam {seam(one):.2f}", np.tile(one, (2, 2, 1)[: one.ndim])


def joined(machine):
    """Textures of the same places, whose bands are cut where they meet, and fade into each other."""
    for how, name in product(("cut", "blend"), ("gravel", "brick", "tissue")):
        one = SAMPLES[name]
        yield f"{name}, {how}", synth(machine, one, 2 * len(one), method="multires", alpha=0.3, seams=how)


# ---------------------------------------------------------------- pyramid matching


def gallery(chosen, machine):
    for name, sample in chosen.items():
        kind, _, what = name.rpartition(": ")
        yield what, sample
        yield kind, synth(machine, sample, 192, method="pyramid")


def mixtures(machine):
    """Mixtures of two samples, and a picture to begin with."""
    wood, stroma = SAMPLES["wood"], data.immunohistochemistry()[250:346, 160:256]
    gravel, grass = SAMPLES["gravel"], FAR["grass"]
    start = resize(data.camera()[70:270, 120:320], (128, 128), anti_aliasing=True)

    def mix(*samples, **options):
        given = {"channel_axis": common.axis(samples[0]), "rng": 1, "device": machine} | options
        return simdtex.mix(samples, (128, 128), **given)

    yield from (("A: wood", wood), ("B: stroma", stroma))
    for name, options in (("palette A, pattern B", (0, 1)), ("palette B, pattern A", (1, 0))):
        yield name, mix(wood, stroma, palette=options[0], pattern=options[1])
    yield from (("C: gravel", gravel), ("D: grass, reduced", grass))
    for low, high in ((0, 1), (1, 0)):
        label = f"low {'CD'[low]}, high {'CD'[high]}, split 2"
        yield label, mix(gravel, grass, low=low, high=high, split=2)
    for a, b in ((3, 1), (1, 1), (1, 3)):
        yield f"{a} A + {b} B", mix(wood, stroma, average=[a, b])
    yield "low C, high D, split 3", mix(gravel, grass, low=0, high=1, split=3)
    yield "A, begun with a picture", mix(wood, start=start, iterations=5)


def solids(chosen, machine):
    """Blocks as one sees them."""
    for name, sample in chosen.items():
        given = {"channel_axis": common.axis(sample), "rng": 1, "device": machine}
        yield name, view(simdtex.synthesize_solid(sample, (96, 96, 96), **given), size=288)


# ---------------------------------------------------------------- the papers' figures


def levels(machine):
    """Paget and Longstaff, Figure 5: the picture at the end of every level."""
    sample, pictures = TEXTURES["reptile"], {}

    def watch(progress):
        if progress.stage:
            pictures[progress.level] = progress.image()

    synth(machine, sample, 256, order=8, callback=watch, preset="paper")
    yield "sample", sample
    yield from ((f"level {level}", magnified(one, 256 // len(one))) for level, one in pictures.items())


def orders(sample, machine):
    """Paget and Longstaff, Figure 6: a sample beside pictures at two orders."""
    row = np.full((256, 2 * 256 + len(sample) + 16), 255, np.uint8)
    row[: len(sample), : len(sample)] = sample
    row[:, len(sample) + 8 :][:, :256] = synth(machine, sample, 256, order=8, preset="paper")
    row[:, -256:] = synth(machine, sample, 256, order=18, preset="paper")
    yield "sample, order 8, order 18", row


def thresholds(sample, beta, more, machine):
    """De Bonet, Figures 11 and 12: the sample repeated, six thresholds, and more options."""
    yield "sample", sample
    for options in [{"alpha": alpha} for alpha in (0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3)] + more:
        label = ", ".join(f"{name} {value}" for name, value in options.items())
        yield label, synth(machine, sample, 256, method="multires", beta=beta, **options)


def colours(machine):
    """Heeger and Bergen, Figures 2 and 3: samples in colour, and pictures."""
    for name, sample in COLOUR.items():
        yield name, sample
        yield "", synth(machine, sample, 192, method="pyramid", preset="paper")


def palettes(machine):
    """Heeger and Bergen, Figure 6: the palettes of three samples with the patterns of each."""
    names = ("stucco", "green marble", "wood")
    samples = [COLOUR[name] for name in names]
    for pattern, name in enumerate(names):
        yield f"pattern: {name}", samples[pattern]
        for palette, other in enumerate(names):
            given = {"channel_axis": -1, "rng": 1, "device": machine}
            yield f"palette: {other}", simdtex.mix(samples, (128, 128), pattern=pattern, palette=palette, **given)


MADE = {
    "multires/edges": (mended, 4, None),
    "multires/seams": (joined, 3, None),
    "pyramid/gallery-strong": (partial(gallery, STRONG), 4, 1),
    "pyramid/gallery-failures": (partial(gallery, FAILURES), 4, 1),
    "pyramid/mixtures": (mixtures, 4, 1),
    "pyramid/solid": (partial(solids, {"gravel, reduced": FAR["gravel"], "tissue": SAMPLES["tissue"]}), 1, 1),
    "figures/levels": (levels, 3, 1),
    **{f"figures/{name}": (partial(orders, sample), 1, 1) for name, sample in TEXTURES.items()},
    "figures/alpha": (partial(thresholds, TEXTURES["brick"], 0, [{"alpha": 0.15, "preset": "paper"}]), 3, 1),
    "figures/beta": (partial(thresholds, TEXTURES["gravel"], 1, [{"alpha": one} for one in (1, 3, 10, np.inf)]), 3, 1),
    "figures/colour": (colours, 4, 1),
    "figures/solid": (partial(solids, {name: COLOUR[name] for name in ("granite", "green marble")}), 1, 1),
    "figures/mixtures": (palettes, 4, 1),
}
"""Name -> what yields the labels and pictures of a sheet, its columns, and the scale of its pictures."""


@common.command
def main(only="", out=common.DOCS, device=None):
    machine = common.opened(device)
    for name, (made, columns, scale) in common.chosen(MADE, only).items():
        common.sheet(out / f"{name}.png", [(*cell, "") for cell in made(machine)], columns, scale=scale)
        print(out / f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
