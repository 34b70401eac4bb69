# SPDX-License-Identifier: BSD-3-Clause
"""Every figure of the pages on pyramid matching.

    python benchmarks/pyramid_figures.py [--out docs/pyramid] [--device TEXT] [--only filters,colour] [--quick]

Writes PNG files, the same bytes every time, and prints their names and the figures that the pages quote. Those of solid
textures are made by pyramid_solids.py. ``--quick`` runs all of it on small sizes.
"""

import argparse
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
import PIL.Image
import samples
from figures import enlarged
from scipy.spatial import cKDTree
from scipy.stats import wasserstein_distance
from skimage import data
from skimage.transform import resize
from subbands import decompose

import simdtex
from simdtex.experiments.quality import seam
from simdtex.ops.steerable import filters
from simdtex.report.page import FAINT, INK, figure_png, new_figure, tidy
from simdtex.report.sheet import contact_sheet

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


def strong():
    """Textures without structures beyond what histograms of subbands hold."""
    return {
        "gravel, reduced to 1/4": reduced(data.gravel(), 4),
        "grass, reduced to 1/4": reduced(data.grass(), 4),
        "the moon's ground, contrast raised": stretched(data.moon()[300:428, 20:148]),
        "a lawn, contrast raised": stretched(data.camera()[415:485, 155:225]),
        "fur": data.chelsea()[0:64, 170:234],
        "wood": samples.colour()["wood"],
        "a blurred ground, contrast raised": stretched(data.cell()[300:428, 20:148]),
        "wood in the light": data.coffee()[310:374, 10:74],
    }


def failures():
    """Textures with structures beyond them, and of what kind they are."""
    return {
        "quasi-periodic: brick": data.brick()[:128, :128],
        "a mosaic: gravel": data.gravel()[:128, :128],
        "a mosaic: coins": data.coins()[60:188, 60:188],
        "inhomogeneous: a lawn and a tripod": data.camera()[410:510, 150:260],
        "inhomogeneous: a margin without tissue": data.immunohistochemistry()[400:496, 80:176],
        "locally oriented: grass": data.grass()[:128, :128],
        "locally oriented: tissue": samples.colour()["tissue"],
        "locally oriented: hair": data.astronaut()[20:84, 190:254],
    }


class Making:
    """Runs of the method on a machine, of a `part` of the full size.

    Parameters
    ----------
    machine : simdtex.machine.Machine
    part : int
        What sides and numbers of iterations are divided by.
    out : Path
        The folder of the results.
    """

    def __init__(self, machine, part, out):
        self.machine, self.part, self.out = machine, part, out

    def small(self, n):
        """A side, or a number of iterations."""
        return max(1, n // self.part)

    def crop(self, sample):
        return sample[: self.small(sample.shape[0]), : self.small(sample.shape[1])]

    def given(self, sample):
        return {"channel_axis": -1 if sample.ndim == 3 else None, "rng": 1, "device": self.machine, "full_output": True}

    def run(self, sample, side, **options):
        """An image and its statistics."""
        shape = (self.small(side),) * 2
        image, output = simdtex.synthesize(self.crop(sample), shape, method="pyramid", **self.given(sample) | options)
        return image, output.statistics

    def mix(self, inputs, side, **options):
        shape = (self.small(side),) * 2
        return simdtex.mix([self.crop(p) for p in inputs], shape, **self.given(inputs[0]) | options)[0]


def moved(statistics, iteration=-1):
    """Mean distance of an iteration's histograms."""
    return float(np.mean(list(statistics["iterations"][iteration]["distances"].values())))


def png(sheet):
    """A sheet as a PNG: in shades of grey where it has no colours, else of 256 colours."""
    picture = PIL.Image.fromarray(sheet)
    if (sheet == sheet[..., :1]).all():
        picture = picture.convert("L")
    elif len(np.unique(sheet.reshape(-1, 3), axis=0)) > 256:
        picture = picture.quantize(256, PIL.Image.Quantize.MEDIANCUT, dither=PIL.Image.Dither.NONE)
    buffer = BytesIO()
    picture.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


# ---------------------------------------------------------------- the pyramid


def filter_bank(making):
    """The filters with four orientations, and their frequency responses."""
    taps = filters(4)
    named = {"H0": taps.high, "L0": taps.low, "L1": taps.down} | {f"B_{i}": b for i, b in enumerate(taps.bands)}
    figure = new_figure(9.2, 3.3)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02)
    for column, (name, tap) in enumerate(named.items()):
        above, below = (figure.add_subplot(2, len(named), 1 + column + row * len(named)) for row in (0, 1))
        limit = np.abs(tap).max()
        above.imshow(tap, cmap="RdBu_r", vmin=-limit, vmax=limit)
        size = f"{len(tap)} x {len(tap)}"
        above.set_title(f"{name}, {size}" if name[0] == "B" else f"{name}\n{size}", fontsize=9, color=INK)
        shown = below.imshow(np.fft.fftshift(np.abs(response(tap, 64))), cmap="gray", vmin=0, vmax=1)
        for one in (above, below):
            one.set_xticks([])
            one.set_yticks([])
    bar = figure.colorbar(shown, ax=figure.axes, fraction=0.015, pad=0.01)
    bar.ax.tick_params(labelsize=8)
    figure.axes[0].set_ylabel("taps", fontsize=9, color=INK)
    figure.axes[1].set_ylabel("response", fontsize=9, color=INK)
    return figure_png(figure)


def response(tap, n):
    spread = np.zeros((n, n))
    reach = len(tap) // 2
    for (a, b), value in np.ndenumerate(tap):
        spread[(a - reach) % n, (b - reach) % n] += value
    return np.fft.fft2(spread)


def subbands(making):
    """A pyramid of gravel, level by level."""
    sample = data.gravel()[: making.small(96), : making.small(96)]
    levels = 3 if making.part == 1 else 1
    pyramid = decompose(sample, levels=levels, boundary="torus", device=making.machine)
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
        below = decompose(sample, levels=level, boundary="torus", device=making.machine)
        pictures.append((f"low-pass, level {level}", plain(below.subbands[-1][0, 0] + below.offset, sample)))
        pictures += [(f"level {level}, B_{i}", signed(band[0])) for i, band in enumerate(own)]
    side = sample.shape
    return png(contact_sheet([(n, enlarged(p, side, side[0] / len(p))) for n, p in pictures], columns=5))


def plain(values, like):
    return np.rint(np.clip(values, like.min(), like.max())).astype(np.uint8)


def signed(values, like=None):
    """Values around 0 as shades around grey, 3 standard deviations to each side."""
    limit = 3 * (values if like is None else like).std()
    return np.rint(np.clip(values / limit, -1, 1) * 127 + 128).astype(np.uint8)


# ---------------------------------------------------------------- iterations


def convergence(making):
    """How far the histograms of each subband were from the sample's, iteration by iteration."""
    chosen = {"gravel": data.gravel()[:128, :128], "fur": data.chelsea()[0:64, 170:234]}
    figure = new_figure(9.2, 3.9)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, sample) in zip(panels, chosen.items(), strict=True):
        _, statistics = making.run(sample, 256, iterations=making.small(30))
        reports = statistics["iterations"]
        iteration = [report["iteration"] for report in reports]
        names = ["pixels", *(n for n in reports[0]["distances"] if n != "pixels")]
        for band in names:
            ends = [report["distances"][band] for report in reports]
            style = {"color": LOOKS[band], "linewidth": 1.6, "linestyle": "--" if band == "pixels" else "-"}
            axes.plot(iteration, ends, label=band, **style)
        tidy(axes, name, "iteration", "distance, standard deviations" if name == "gravel" else "")
        axes.set_yscale("log")
        for k in (1, 2, 5, 10, 20, 30):
            if k <= len(reports):
                print(f"  {name}, iteration {k:2}: mean distance {moved(statistics, k - 1):.4f}")
    panels[0].legend(frameon=False, fontsize=8, labelcolor=INK, ncols=2)
    return figure_png(figure)


def iterations(making):
    """What more iterations do."""
    chosen = {"gravel": data.gravel()[:128, :128], "fur": data.chelsea()[0:64, 170:234]}
    pictures = []
    for sample in chosen.values():
        for kind in ("steerable", "laplacian"):
            for count in (1, 5, 20, 100):
                image, _ = making.run(sample, 144, pyramid=kind, iterations=making.small(count))
                pictures.append((f"{kind}, {count}", image))
    return png(contact_sheet(pictures, columns=4, scale=1))


# ---------------------------------------------------------------- galleries


def gallery(chosen, making):
    pictures = []
    for name, sample in chosen().items():
        image, _ = making.run(sample, 192)
        kind, _, what = name.rpartition(": ")
        pictures += [(what, making.crop(sample)), (kind, image)]
    return png(contact_sheet(pictures, columns=4, scale=1))


def colour(making):
    """Decorrelated channels against the channels as they are."""
    chosen = {
        "tissue": data.immunohistochemistry()[330:410, 270:350],
        "fur": data.chelsea()[0:64, 170:234],
        "gravel as RGB": np.repeat(data.gravel()[:96, :96, None], 3, axis=2),
    }
    pictures = []
    for name, sample in chosen.items():
        pictures.append((name, making.crop(sample)))
        known = cKDTree(np.unique(making.crop(sample).reshape(-1, 3), axis=0))
        for option in ("decorrelate", "channels"):
            image, _ = making.run(sample, 144, color=option)
            away = known.query(image.reshape(-1, 3).astype(float))[0].mean()
            print(f"  {name}, {option}: a pixel is {away:.2f} of 255 from the nearest colour of the sample")
            pictures.append((f"color={option}", image))
    return png(contact_sheet(pictures, columns=3, scale=1))


def edges(making):
    """The sample's border in its analysis: mirrored, or wrapped around."""
    chosen = {"brick": data.brick()[:128, :128], "retina": reduced(data.retina(), 2)[330:426, 130:226]}
    pictures = []
    for name, sample in chosen.items():
        pictures.append((name, making.crop(sample)))
        found = {}
        for option, boundary in (("reflect", "open"), ("wrap", "torus")):
            image, _ = making.run(sample, 144, edges=option)
            pictures.append((f"edges={option}", image))
            axis = -1 if sample.ndim == 3 else None
            own = decompose(making.crop(sample), levels=1, boundary=boundary, channel_axis=axis, device=making.machine)
            found[option] = [band.std() for band in own.subbands[:2]]
        more = [wrap / reflect for wrap, reflect in zip(found["wrap"], found["reflect"], strict=True)]
        print(
            f"  {name}: wrapped, the standard deviation of high is {more[0]:.3f} times, of level 0 {more[1]:.3f} times"
        )
    return png(contact_sheet(pictures, columns=3, scale=1))


def seams(making):
    """Outputs laid side by side with themselves, beside the sample."""
    pictures = []
    for name, sample in (strong() | failures()).items():
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
        figures = "; ".join(f"{n} {np.mean(s):.3f} ({min(s):.3f} to {max(s):.3f})" for n, s in found.items())
        print(f"  {name}: gradient across the seam over that inside, 5 seeds: {figures}")
    return png(contact_sheet(pictures, columns=4, scale=1))


def match(making):
    """The histogram of an output's pixels, by rank and by tables."""
    sample = making.crop(data.gravel()[:128, :128])
    own = np.bincount(sample.ravel(), minlength=256) / sample.size
    figure = new_figure(8.4, 3.6)
    axes = figure.subplots()
    axes.fill_between(range(256), 100 * own, step="mid", color="#d9d7d0", label="sample")
    for option, look in (("lookup", COLOURS[0]), ("rank", COLOURS[1])):
        image, _ = making.run(data.gravel()[:128, :128], 256, match=option)
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
    a, b = samples.colour()["wood"], data.immunohistochemistry()[250:346, 160:256]
    c, d = data.gravel()[:128, :128], reduced(data.grass(), 4)
    names = "A B"
    pictures = [("A: wood", making.crop(a)), ("B: stroma", making.crop(b))]
    for palette, pattern in ((0, 1), (1, 0)):
        made = making.mix([a, b], 128, palette=palette, pattern=pattern)
        pictures.append((f"palette {names[2 * palette]}, pattern {names[2 * pattern]}", made))
    pictures += [("C: gravel", making.crop(c)), ("D: grass, reduced", making.crop(d))]
    for low, high in ((0, 1), (1, 0)):
        made = making.mix([c, d], 128, low=low, high=high, split=2 if making.part == 1 else 1)
        pictures.append((f"low {'CD'[low]}, high {'CD'[high]}, split 2", made))
    for first, second in ((3, 1), (1, 1), (1, 3)):
        made = making.mix([a, b], 128, average=[first, second])
        pictures.append((f"{first} A + {second} B", made))
    made = making.mix([c, d], 128, low=0, high=1, split=3 if making.part == 1 else 0)
    pictures.append(("low C, high D, split 3", made))
    side = making.small(128)
    start = resize(data.camera()[70:270, 120:320], (side, side), anti_aliasing=True)
    made = simdtex.mix([making.crop(a)], (side, side), start=start, iterations=making.small(5), **making.given(a))[0]
    pictures.append(("A, begun with a picture", made))
    return png(contact_sheet(pictures, columns=4, scale=1))


MADE = {
    "filters": filter_bank,
    "subbands": subbands,
    "convergence": convergence,
    "iterations": iterations,
    "gallery-strong": partial(gallery, strong),
    "gallery-failures": partial(gallery, failures),
    "colour": colour,
    "edges": edges,
    "seams": seams,
    "match": match,
    "mixtures": mixtures,
}


def main(made, about, folder="pyramid"):
    """Make figures by name: functions of a `Making` that return a PNG."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "docs" / folder)
    parser.add_argument("--device")
    parser.add_argument("--only", default="", help="figures to make, by name, separated by commas")
    parser.add_argument("--quick", action="store_true", help="small sizes")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    making = Making(simdtex.open_machine(options.device), 4 if options.quick else 1, options.out)
    print(f"device: {making.machine.name}")
    for name in options.only.split(",") if options.only else made:
        path = options.out / f"{name}.png"
        path.write_bytes(made[name](making))
        print(f"{path}  {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main(MADE, __doc__.splitlines()[0])
