# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the pages on multiresolution sampling and on pyramid matching.

    python benchmarks/pages.py [--only multires/edges,pyramid/solid] [--out docs] [--quick] [--device TEXT]

Writes a PNG file for each name, the same bytes every time. ``--quick`` divides sides and iterations by 4.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from math import inf

import common
import numpy as np
from skimage import data
from skimage.transform import resize

import simdtex
from simdtex.experiments.quality import seam
from simdtex.machine import Machine
from simdtex.methods.multires.analysis import pyramid
from simdtex.methods.multires.mend import mend
from simdtex.model.display import source_colours
from simdtex.model.stretched import TOP, Stretched
from simdtex.report.sheet import view

ALPHAS = (0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, inf)


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


def enlarged(picture, shape, step=None):
    """A decimated picture at a size, each of its pixels as a square of `step` pixels a side."""
    step, limits = step or shape[0] / len(picture), zip(shape, picture.shape[:2], strict=True)
    rows, cols = (np.minimum((np.arange(length) / step).astype(int), limit - 1) for length, limit in limits)
    return picture[rows[:, np.newaxis], cols]


def levels(runs):
    """G and L of the gravel, level by level."""
    gravel, machine = SAMPLES["gravel"], runs.machine
    planes = machine.put(Stretched(gravel[..., None]).planes)
    gaussian, laplacian = (
        [machine.get(band)[0] / TOP for band in bands] for bands in pyramid(machine, planes, 5, torus=True)
    )
    laplacian = [*(2 * band + 0.5 for band in laplacian[:-1]), gaussian[-1]]
    for name, values in ((name, one) for name, own in (("G", gaussian), ("L", laplacian)) for one in enumerate(own)):
        level, shown = values[0], np.round(np.clip(values[1], 0, 1) * 255).astype(np.uint8)
        label = f"{name}_{level}, {len(shown)} x {len(shown)}"
        yield label + (" = G_4" if (name, level) == ("L", 4) else ""), enlarged(shown, gravel.shape)


def sources(runs):
    """Source maps of the levels in false colours, at several thresholds."""
    gravel, side = runs.crop(SAMPLES["gravel"]), runs.small(160)
    for alpha in (0, 0.3, 1):
        image, output = runs.synth(SAMPLES["gravel"], 160, method="multires", alpha=alpha)
        for stage in (stage for stage in output.stages if stage.level in (5, 3, 2, 1, 0)):
            own = [-(-n // 2**stage.level) for n in gravel.shape]
            colours = enlarged(source_colours(stage.source, own), (side, side), 2**stage.level)
            yield f"alpha {alpha:g}, level {stage.level}", colours
        yield f"alpha {alpha:g}", image


def thresholds(runs):
    """One sample at many alphas, as in Figure 11 of the paper."""
    yield "the sample", runs.crop(SAMPLES["gravel"])
    for alpha in ALPHAS:
        seams = "cut" if alpha == inf else "blend"  # where all are strangers, a blend leaves no contrast
        image, output = runs.synth(SAMPLES["gravel"], 256, method="multires", alpha=alpha, seams=seams)
        label = "infinity" if alpha == inf else f"{alpha:g}"
        yield f"alpha {label}: {output.statistics['levels'][-1]['candidates']:.2f} candidates", image


def parities(runs):
    """The two parities at the same alphas."""
    for parity, alpha in product(("match", "free"), (0, 0.05, 0.2, 0.4)):
        options = {"alpha": alpha, "parity": parity, "seams": "cut"}
        yield f"{parity}, alpha {alpha:g}", runs.synth(SAMPLES["gravel"], 192, method="multires", **options)[0]


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


def iterations(runs):
    """What more iterations do."""
    for name, kind, count in product(("gravel", "fur"), ("steerable", "laplacian"), (1, 5, 20, 100)):
        options = {"pyramid": kind, "iterations": runs.small(count)}
        yield f"{kind}, {count}", runs.pyramid(SAMPLES[name], 144, **options)


def tried(option, chosen, runs):
    """Samples under the two values of an option."""
    values = {"color": ("decorrelate", "channels"), "edges": ("reflect", "wrap")}[option]
    for name, sample in chosen.items():
        yield name, runs.crop(sample)
        yield from ((f"{option}={value}", runs.pyramid(sample, 144, **{option: value})) for value in values)


COLOURED = {
    "tissue": data.immunohistochemistry()[330:410, 270:350],
    "fur": SAMPLES["fur"],
    "gravel as RGB": np.repeat(data.gravel()[:96, :96, None], 3, axis=2),
}
EDGED = {"brick": SAMPLES["brick"], "retina": reduced(data.retina(), 2)[330:426, 130:226]}


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


def solid_options(runs):
    """Two slices of a block made in each of the ways."""
    ways = [{"solids": way, "slices": own} for way, own in product(("average", "turns"), ("each", "together"))]
    for options in [*ways, {"pyramid": "laplacian"}]:
        block, output = runs.block(SAMPLES["tissue"], 64, **options)
        apart = np.mean(list(output.statistics["iterations"][-1]["distances"].values()))
        yield f"{', '.join(options.values())}: {apart:.3f}", block[len(block) // 2]
        yield "y-z", block[:, :, len(block) // 2]


MADE = {
    "multires/pyramid": (levels, 5, None),
    "multires/sources": (sources, 6, None),
    "multires/alpha": (thresholds, 4, None),
    "multires/parity": (parities, 4, None),
    "multires/edges": (mended, 4, None),
    "multires/seams": (joined, 3, None),
    "pyramid/iterations": (iterations, 4, 1),
    "pyramid/gallery-strong": (partial(gallery, STRONG), 4, 1),
    "pyramid/gallery-failures": (partial(gallery, FAILURES), 4, 1),
    "pyramid/colour": (partial(tried, "color", COLOURED), 3, 1),
    "pyramid/edges": (partial(tried, "edges", EDGED), 3, 1),
    "pyramid/mixtures": (mixtures, 4, 1),
    "pyramid/solid": (solids, 1, 1),
    "pyramid/solid-options": (solid_options, 4, None),
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
