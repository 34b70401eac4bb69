# SPDX-License-Identifier: BSD-3-Clause
"""Every figure of the page on pyramid matching.

    python benchmarks/pyramid_figures.py [--out docs/pyramid] [--device TEXT] [--only filters,solid] [--quick]

Writes PNG files, the same bytes every time, and oblique.csv, and prints their names and the figures that the page
quotes. ``--quick`` runs all of it on small sizes.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import common
import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from scipy.stats import wasserstein_distance
from skimage import data
from skimage.transform import resize
from subbands import decompose

import simdtex
from simdtex.experiments.quality import seam
from simdtex.machine import Machine
from simdtex.ops.steerable import filters
from simdtex.report.page import FAINT, INK, figure_png, new_figure, tidy
from simdtex.report.sheet import contact_sheet, view

COLOURS = ("#D55E00", "#0072B2", "#56B4E9", "#009E73", "#8A6D00", "#E69F00", "#CC79A7", "#000000")
LOOKS = dict(zip(("pixels", "high", "low", *(f"level {level}" for level in range(5))), COLOURS, strict=True))


def reduced(picture, factor):
    """A picture reduced, smoothed before."""
    shape = [round(n / factor) for n in picture.shape[:2]]
    return np.rint(resize(picture, shape, anti_aliasing=True, preserve_range=True)).astype(np.uint8)


def stretched(picture):
    """A grey picture over the whole range, but for one value in a thousand at each end."""
    low, high = np.quantile(picture, (0.001, 0.999))
    return np.rint(np.clip((picture - low) / (high - low), 0, 1) * 255).astype(np.uint8)


GRAVEL, FUR = data.gravel()[:128, :128], data.chelsea()[0:64, 170:234]
FAR = {"gravel": reduced(data.gravel(), 4), "grass": reduced(data.grass(), 4)}
WOOD, TISSUE = common.colour()["wood"], common.colour()["tissue"]
STRONG = {
    "gravel, reduced to 1/4": FAR["gravel"],
    "grass, reduced to 1/4": FAR["grass"],
    "the moon's ground, contrast raised": stretched(data.moon()[300:428, 20:148]),
    "a lawn, contrast raised": stretched(data.camera()[415:485, 155:225]),
    "fur": FUR,
    "wood": WOOD,
    "a blurred ground, contrast raised": stretched(data.cell()[300:428, 20:148]),
    "wood in the light": data.coffee()[310:374, 10:74],
}
"""Textures without structures beyond what histograms of subbands hold."""

FAILURES = {
    "quasi-periodic: brick": data.brick()[:128, :128],
    "a mosaic: gravel": GRAVEL,
    "a mosaic: coins": data.coins()[60:188, 60:188],
    "inhomogeneous: a lawn and a tripod": data.camera()[410:510, 150:260],
    "inhomogeneous: a margin without tissue": data.immunohistochemistry()[400:496, 80:176],
    "locally oriented: grass": data.grass()[:128, :128],
    "locally oriented: tissue": TISSUE,
    "locally oriented: hair": data.astronaut()[20:84, 190:254],
}
"""Textures with structures beyond them, and of what kind they are."""


def given(machine, sample):
    return {"channel_axis": common.axis(sample), "rng": 1, "device": machine, "full_output": True}


def run(machine, sample, side, **options):
    """An image of a side and the output of its run."""
    return simdtex.synthesize(sample, (side, side), **given(machine, sample) | options)


@dataclass
class Making:
    """Runs on a machine, of a `part` of the full size: sides and iterations are divided by it; ``out`` is a folder."""

    machine: Machine
    part: int
    out: Path

    def small(self, n):
        """A side, or a number of iterations."""
        return max(1, n // self.part)

    def crop(self, sample):
        return sample[: self.small(sample.shape[0]), : self.small(sample.shape[1])]

    def run(self, sample, side, **options):
        """An image of the method and the reports of its iterations."""
        image, output = run(self.machine, self.crop(sample), self.small(side), method="pyramid", **options)
        return image, output.statistics["iterations"]

    def mix(self, inputs, side, **options):
        pictures, options = [self.crop(one) for one in inputs], given(self.machine, inputs[0]) | options
        return simdtex.mix(pictures, (self.small(side),) * 2, **options)[0]

    def block(self, sample, side, **options):
        """A block and the reports of its iterations."""
        shape, options = (self.small(side),) * 3, given(self.machine, sample) | options
        block, output = simdtex.synthesize_solid(sample, shape, **options)
        return block, output.statistics["iterations"]

    def decompose(self, sample, levels, boundary="open"):
        options = {"boundary": boundary, "channel_axis": common.axis(sample), "device": self.machine}
        return decompose(sample, levels=levels, **options)

    @property
    def levels(self):
        return 3 if self.part == 1 else 1


def figures(made, folder):
    """A command that makes figures by name: functions of a `Making` that return a PNG."""

    def main(out=common.DOCS / folder, device=None, only="", quick=False):
        out.mkdir(parents=True, exist_ok=True)
        making = Making(common.opened(device), 4 if quick else 1, out)
        for name, make in common.chosen(made, only).items():
            path = out / f"{name}.png"
            path.write_bytes(make(making))
            print(f"{path}  {path.stat().st_size / 1000:.0f} kB", flush=True)

    return common.command(main)


def moved(report):
    """Mean distance of an iteration's histograms."""
    return float(np.mean(list(report["distances"].values())))


def enlarged(picture, shape, step=None):
    """A decimated picture at a size, each of its pixels as a square of `step` pixels a side without smoothing."""
    step, limits = step or shape[0] / len(picture), zip(shape, picture.shape[:2], strict=True)
    rows, cols = (np.minimum((np.arange(length) / step).astype(int), limit - 1) for length, limit in limits)
    return picture[rows[:, np.newaxis], cols]


# ---------------------------------------------------------------- the pyramid


def filter_bank(making):
    """The filters with four orientations, and their frequency responses."""
    taps = filters(4)
    named = {"H0": taps.high, "L0": taps.low, "L1": taps.down} | {f"B_{i}": b for i, b in enumerate(taps.bands)}
    figure = new_figure(9.2, 3.3)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02)
    for column, (name, tap) in enumerate(named.items(), 1):
        places = ((2, len(named), column + row * len(named)) for row in (0, 1))
        above, below = (figure.add_subplot(*place, xticks=[], yticks=[]) for place in places)
        limit = np.abs(tap).max()
        above.imshow(tap, cmap="RdBu_r", vmin=-limit, vmax=limit)
        size = f"{len(tap)} x {len(tap)}"
        above.set_title(f"{name}, {size}" if name[0] == "B" else f"{name}\n{size}", fontsize=9, color=INK)
        around = np.zeros((64, 64))
        around[: len(tap), : len(tap)] = tap
        shown = below.imshow(np.fft.fftshift(np.abs(np.fft.fft2(around))), cmap="gray", vmin=0, vmax=1)
    bar = figure.colorbar(shown, ax=figure.axes, fraction=0.015, pad=0.01)
    bar.ax.tick_params(labelsize=8)
    figure.axes[0].set_ylabel("taps", fontsize=9, color=INK)
    figure.axes[1].set_ylabel("response", fontsize=9, color=INK)
    return figure_png(figure)


def subbands(making):
    """A pyramid of gravel, level by level."""
    sample = data.gravel()[: making.small(96), : making.small(96)]
    pyramid = making.decompose(sample, making.levels, "torus")
    back = pyramid.collapse(device=making.machine)[..., 0]
    high, *bands, low = pyramid.subbands
    pictures = [
        ("sample", sample),
        ("high", signed(high[0, 0])),
        ("low", plain(low[0, 0] + pyramid.offset, sample)),
        ("collapsed", plain(back, sample)),
        ("error, 20 times", signed(20 * (back - sample), sample)),
    ]
    for level, own in enumerate(bands):
        below = making.decompose(sample, level, "torus")
        pictures.append((f"low-pass, level {level}", plain(below.subbands[-1][0, 0] + below.offset, sample)))
        pictures += [(f"level {level}, B_{i}", signed(band[0])) for i, band in enumerate(own)]
    return common.png(contact_sheet([(name, enlarged(one, sample.shape)) for name, one in pictures], columns=5))


def plain(values, like):
    return np.rint(np.clip(values, like.min(), like.max())).astype(np.uint8)


def signed(values, like=None):
    """Values around 0 as shades around grey, 3 standard deviations to each side."""
    limit = 3 * (values if like is None else like).std()
    return np.rint(np.clip(values / limit, -1, 1) * 127 + 128).astype(np.uint8)


# ---------------------------------------------------------------- runs


def convergence(making):
    """How far the histograms of each subband were from the sample's, iteration by iteration."""
    figure = new_figure(9.2, 3.9)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, sample) in zip(panels, {"gravel": GRAVEL, "fur": FUR}.items(), strict=True):
        _, reports = making.run(sample, 256, iterations=making.small(30))
        iteration = [report["iteration"] for report in reports]
        for band in ["pixels", *(n for n in reports[0]["distances"] if n != "pixels")]:
            ends = [report["distances"][band] for report in reports]
            style = {"color": LOOKS[band], "linewidth": 1.6, "linestyle": "--" if band == "pixels" else "-"}
            axes.plot(iteration, ends, label=band, **style)
        tidy(axes, name, "iteration", "distance, standard deviations" if name == "gravel" else "")
        axes.set_yscale("log")
        for k in (1, 2, 5, 10, 20, 30):
            if k <= len(reports):
                print(f"  {name}, iteration {k:2}: mean distance {moved(reports[k - 1]):.4f}")
    panels[0].legend(frameon=False, fontsize=8, labelcolor=INK, ncols=2)
    return figure_png(figure)


def iterations(making):
    """What more iterations do."""
    pictures = []
    for sample, kind, count in product((GRAVEL, FUR), ("steerable", "laplacian"), (1, 5, 20, 100)):
        image, _ = making.run(sample, 144, pyramid=kind, iterations=making.small(count))
        pictures.append((f"{kind}, {count}", image))
    return common.png(contact_sheet(pictures, columns=4, scale=1))


def gallery(chosen, making):
    pictures = []
    for name, sample in chosen.items():
        kind, _, what = name.rpartition(": ")
        pictures += [(what, making.crop(sample)), (kind, making.run(sample, 192)[0])]
    return common.png(contact_sheet(pictures, columns=4, scale=1))


def colour(making):
    """Decorrelated channels against the channels as they are."""
    tissue, grey = data.immunohistochemistry()[330:410, 270:350], np.repeat(data.gravel()[:96, :96, None], 3, axis=2)
    pictures = []
    for name, sample in {"tissue": tissue, "fur": FUR, "gravel as RGB": grey}.items():
        pictures.append((name, making.crop(sample)))
        known = cKDTree(np.unique(making.crop(sample).reshape(-1, 3), axis=0))
        for option in ("decorrelate", "channels"):
            image, _ = making.run(sample, 144, color=option)
            away = known.query(image.reshape(-1, 3).astype(float))[0].mean()
            print(f"  {name}, {option}: a pixel is {away:.2f} of 255 from the nearest colour of the sample")
            pictures.append((f"color={option}", image))
    return common.png(contact_sheet(pictures, columns=3, scale=1))


def edges(making):
    """The sample's border in its analysis: mirrored, or wrapped around."""
    pictures = []
    chosen = {"brick": data.brick()[:128, :128], "retina": reduced(data.retina(), 2)[330:426, 130:226]}
    for name, sample in chosen.items():
        pictures.append((name, making.crop(sample)))
        found = []
        for option, boundary in (("reflect", "open"), ("wrap", "torus")):
            pictures.append((f"edges={option}", making.run(sample, 144, edges=option)[0]))
            own = making.decompose(making.crop(sample), 1, boundary)
            found.append(np.array([band.std() for band in own.subbands[:2]]))
        high, level = found[1] / found[0]
        print(f"  {name}: wrapped, the standard deviation of high is {high:.3f} times, of level 0 {level:.3f} times")
    return common.png(contact_sheet(pictures, columns=3, scale=1))


def seams(making):
    """Outputs laid side by side with themselves, beside the sample."""
    pictures = []
    for name, sample in (STRONG | FAILURES).items():
        found = {}
        for side in (96, 91):
            images = [making.run(sample, side, rng=seed)[0] for seed in range(1, 6)]
            found[f"side {side}"] = [seam(image) for image in images]
            elsewhere = range(1, making.small(side), max(1, making.small(12)))
            moved_in = [np.roll(image, (k, k), (0, 1)) for image in images for k in elsewhere]
            found[f"lines inside, side {side}"] = [seam(image) for image in moved_in]
            if side == 91 and name.startswith(("gravel", "fur")):
                own = making.crop(sample)[: making.small(96), : making.small(96)]
                for label, picture in (("sample", own), ("output", images[0])):
                    tiled = np.tile(picture, (2, 2, 1)[: sample.ndim])
                    pictures.append((f"{label}, tiled: {seam(picture):.2f}", tiled))
        ends = "; ".join(f"{n} {np.mean(s):.3f} ({min(s):.3f} to {max(s):.3f})" for n, s in found.items())
        print(f"  {name}: gradient across the seam over that inside, 5 seeds: {ends}")
    return common.png(contact_sheet(pictures, columns=4, scale=1))


def match(making):
    """The histogram of an output's pixels, by rank and by tables."""
    sample = making.crop(GRAVEL)
    figure = new_figure(8.4, 3.6)
    axes = figure.subplots()
    own = np.bincount(sample.ravel(), minlength=256) / sample.size
    axes.fill_between(range(256), 100 * own, step="mid", color="#d9d7d0", label="sample")
    for option, look in (("lookup", COLOURS[0]), ("rank", COLOURS[1])):
        image, _ = making.run(GRAVEL, 256, match=option)
        made = np.bincount(image.ravel(), minlength=256) / image.size
        axes.step(range(256), 100 * made, where="mid", color=look, linewidth=1.1, label=f"match={option}")
        quantiles = np.abs(np.sort(image, axis=None).astype(int) - np.sort(sample, axis=None).repeat(4))
        bins, mean = np.ptp(sample) / 256, wasserstein_distance(image.ravel(), sample.ravel())
        print(f"  {option}: quantiles are off by {mean / bins:.2f} bins, at most by {quantiles.max() / bins:.0f}")
    tidy(axes, "", "grey level", "pixels, %")
    axes.legend(frameon=False, fontsize=9, labelcolor=INK)
    axes.tick_params(colors=FAINT)
    return figure_png(figure)


def mixtures(making):
    """Mixtures of two samples, and a picture to begin with."""
    wood, (gravel, grass) = [WOOD, data.immunohistochemistry()[250:346, 160:256]], [GRAVEL, FAR["grass"]]
    split = (2, 3) if making.part == 1 else (1, 0)
    start = resize(data.camera()[70:270, 120:320], (making.small(128),) * 2, anti_aliasing=True)
    ways = {
        "palette A, pattern B": (wood, {"palette": 0, "pattern": 1}),
        "palette B, pattern A": (wood, {"palette": 1, "pattern": 0}),
        "low C, high D, split 2": ([gravel, grass], {"low": 0, "high": 1, "split": split[0]}),
        "low D, high C, split 2": ([gravel, grass], {"low": 1, "high": 0, "split": split[0]}),
        **{f"{a} A + {b} B": (wood, {"average": [a, b]}) for a, b in ((3, 1), (1, 1), (1, 3))},
        "low C, high D, split 3": ([gravel, grass], {"low": 0, "high": 1, "split": split[1]}),
        "A, begun with a picture": (wood[:1], {"start": start, "iterations": making.small(5)}),
    }
    mixed = [(name, making.mix(inputs, 128, **options)) for name, (inputs, options) in ways.items()]
    named = {"A: wood": wood[0], "B: stroma": wood[1], "C: gravel": gravel, "D: grass, reduced": grass}
    own = [(name, making.crop(sample)) for name, sample in named.items()]
    return common.png(contact_sheet([*own[:2], *mixed[:2], *own[2:], *mixed[2:]], columns=4, scale=1))


# ---------------------------------------------------------------- solids

ISOTROPIC = {"gravel": FAR["gravel"], "tissue": TISSUE}
DIRECTIONS = {
    "x-y": ((0, 1, 0), (0, 0, 1)),
    "x-z": ((1, 0, 0), (0, 0, 1)),
    "y-z": ((1, 0, 0), (0, 1, 0)),
    "x-y, between slices": ((0, 1, 0), (0, 0, 1)),
    "45° about x": ((1, 1, 0), (0, 0, 1)),
    "45° about y": ((1, 0, 1), (0, 1, 0)),
    "45° about z": ((1, 0, 0), (0, 1, 1)),
    "across the diagonal": ((0, 1, -1), (2, -1, -1)),
}
"""Slices by name: where their rows and their columns go, (z, y, x)."""


def solid(making):
    """Two blocks as one sees them."""
    blocks = [making.block(making.crop(sample), 96)[0] for sample in ISOTROPIC.values()]
    return common.png(np.concatenate([view(block, size=max(96, making.small(288))) for block in blocks]))


def plane(volume, name, depth):
    """A square slice through a block that repeats, at some depth, by cubic splines where it misses the voxels."""
    down, across = (np.array(way) / np.linalg.norm(way) for way in DIRECTIONS[name])
    i, j = np.mgrid[: len(volume), : len(volume)]
    where = np.multiply.outer(down, i) + np.multiply.outer(across, j)
    where += (depth * np.abs(np.cross(down, across)))[:, None, None] + (0.5 if "between" in name else 0.0)
    channels = np.moveaxis(volume.reshape(*volume.shape[:3], -1), -1, 0)
    planes = [map_coordinates(one, where, output=np.float64, order=3, mode="grid-wrap") for one in channels]
    return np.squeeze(np.stack(planes, -1))


def bands_of(making, picture):
    """Values by statistic: pixels (channels, n) and each level's (bands, n), in the picture's unit."""
    pyramid = making.decompose(picture, making.levels)
    pyramid.subbands[-1] += pyramid.offset
    names = ["high", *(f"level {level}" for level in range(making.levels)), "low"]
    found = {"pixels": picture.reshape(-1, 1 if picture.ndim == 2 else picture.shape[-1]).T}
    return found | {n: b.reshape(-1, b.shape[-2] * b.shape[-1]) for n, b in zip(names, pyramid.subbands, strict=True)}


def apart(found, wanted):
    """W1 of each statistic in the sample's standard deviations, the mean of its bands."""
    return {
        name: np.mean([wasserstein_distance(a, b) / b.std() for a, b in zip(found[name], own, strict=True)])
        for name, own in wanted.items()
    }


def solid_options(making):
    """The ways to make a block, and slices of each."""
    pictures = []
    ways = [{"solids": way, "slices": own} for way, own in product(("average", "turns"), ("each", "together"))]
    for options in [*ways, {"pyramid": "laplacian"}]:
        volume, reports = making.block(making.crop(TISSUE), 64, **options)
        for number, direction in enumerate(("x-y", "y-z", "45° about x")):
            made = plane(volume, direction, len(volume) // 2)
            label = f"{', '.join(options.values())}: {moved(reports[-1]):.3f}" if number == 0 else direction
            pictures.append((label, np.rint(np.clip(made, 0, 255)).astype(np.uint8)))
    return common.png(contact_sheet(pictures, columns=6))


def oblique(making):
    """How far slices along the axes, and others, are from the sample."""
    rows = []
    figure = new_figure(9.6, 4.4)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, whole) in zip(panels, ISOTROPIC.items(), strict=True):
        sample = making.crop(whole)
        volume, _ = making.block(sample, 64)
        wanted, side = bands_of(making, sample), min(len(sample), len(volume))
        ends = (slice(side), slice(-side, None))
        kinds = {"the sample's corners": [sample[a, b] for a, b in product(ends, ends)]}
        kinds |= {n: [plane(volume, n, k) for k in range(0, len(volume), len(volume) // 8)] for n in DIRECTIONS}
        for number, (kind, pictures) in enumerate(kinds.items()):
            each = [apart(bands_of(making, picture), wanted) for picture in pictures]
            mean = {statistic: np.mean([one[statistic] for one in each]) for statistic in wanted}
            means = [np.mean(list(one.values())) for one in each]
            rows.append([name, kind, *(f"{v:.3f}" for v in (*mean.values(), np.mean(means), max(means)))])
            print(" ", *rows[-1])
            look = {"color": (*COLOURS, "#7A7A7A")[number], "linestyle": "-" if number < 4 else "--", "marker": "o"}
            axes.plot(list(mean), list(mean.values()), label=kind, linewidth=1.3, markersize=4, **look)
        tidy(axes, name, "", "W1, standard deviations" if name == "gravel" else "")
    panels[1].set_ylim(bottom=0)
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    common.write(making.out / "oblique.csv", ["sample", "slices", *wanted, "mean", "worst slice"], rows)
    return figure_png(figure)


MADE = {
    "filters": filter_bank,
    "subbands": subbands,
    "convergence": convergence,
    "iterations": iterations,
    "gallery-strong": partial(gallery, STRONG),
    "gallery-failures": partial(gallery, FAILURES),
    "colour": colour,
    "edges": edges,
    "seams": seams,
    "match": match,
    "mixtures": mixtures,
    "solid": solid,
    "solid-options": solid_options,
    "oblique": oblique,
}
main = figures(MADE, "pyramid")

if __name__ == "__main__":
    main()
