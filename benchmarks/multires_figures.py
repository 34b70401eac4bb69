# SPDX-License-Identifier: BSD-3-Clause
"""Every picture of results on the page on multiresolution sampling.

    python benchmarks/multires_figures.py [--out docs/multires] [--device TEXT] [--only filters,edges] [--quick]

Writes PNG files, the same bytes every time, and prints their names.
"""

from functools import partial
from itertools import product
from math import inf

import common
import numpy as np
from matplotlib.colors import ListedColormap, LogNorm
from pyramid_figures import enlarged, figures, run

import simdtex
from simdtex.experiments.quality import seam
from simdtex.methods.multires.analysis import pyramid
from simdtex.methods.multires.mend import mend
from simdtex.model.display import source_colours, temperature_colours
from simdtex.model.stretched import TOP, Stretched
from simdtex.ops.pyramids import UNIT_BITS, bank, filters
from simdtex.report.page import DPI, INK, figure_png, new_figure
from simdtex.report.sheet import contact_sheet

ALPHAS = {0: (0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, inf), 1: (0.1, 0.2, 0.3, 0.4, 0.6, 1, 1.5)}
PERIODS = (8, 16, 32)  # of the grids whose lines show
CELL = 160  # side of an output that is shown level by level, pixels; 1.25 tiles


def made(making, sample, side, **options):
    """An image of the method and its output; the side is the same for small samples."""
    return run(making.machine, sample, side, method="multires", **options)


def levels(making, sample, count):
    """The levels G and L of a sample."""
    return pyramid(making.machine, making.machine.put(Stretched(sample[..., None]).planes), count, torus=True)


def pyramids(making, gravel):
    """G and L of the sample, level by level."""
    gaussian, laplacian = levels(making, gravel, 5)
    rows = {"G": [], "L": []}
    for level, (g, band) in enumerate(zip(gaussian, laplacian, strict=True)):
        low, last = making.machine.get(g)[0] / TOP, level == len(gaussian) - 1
        high = low if last else 2 * making.machine.get(band)[0] / TOP + 0.5
        for name, values in (("G", low), ("L", high)):
            picture = np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
            label = f"{name}_{level}, {len(values)} x {len(values)}"
            rows[name].append((label + (" = G_4" if last and name == "L" else ""), enlarged(picture, gravel.shape)))
    return common.png(contact_sheet([*rows["G"], *rows["L"]], columns=len(gaussian)))


def responses(making, gravel):
    """The taps of the default bank, and G_1's responses to them."""
    n, machine = simdtex.methods.multires.Options().orientations, making.machine
    taps = bank(n)
    gaussian, laplacian = levels(making, gravel, 3)
    features = machine.get(filters(machine, gaussian[1], laplacian[1], machine.put(taps), True))
    maps = np.moveaxis(features.reshape(*gaussian[1].shape[1:], -1), -1, 0)[1:]
    figure = new_figure(6.6, 7.0)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.03)
    axes = figure.subplots(4, n, subplot_kw={"xticks": [], "yticks": []})
    for j, (tap, response) in enumerate(zip(taps, maps, strict=True)):
        above, below = axes[2 * (j // n) : 2 * (j // n) + 2, j % n]
        above.imshow(tap, cmap="RdBu_r", vmin=-(2**UNIT_BITS), vmax=2**UNIT_BITS)
        for (row, col), value in np.ndenumerate(tap):
            ink = "white" if abs(value) > 0.6 * 2**UNIT_BITS else INK
            above.text(col, row, f"{value / 2**UNIT_BITS:.2f}", ha="center", va="center", fontsize=8, color=ink)
        above.set_title(f"{('first', 'second')[j // n]} derivative, {180 * (j % n) // n}°", fontsize=9, color=INK)
        limit = 3 * response.std()
        below.imshow(response, cmap="gray", vmin=-limit, vmax=limit)
    return figure_png(figure)


def mean_candidates(output):
    return f"{output.statistics['levels'][-1]['candidates']:.2f} candidates"


def candidates(making, gravel):
    """Pictures of the levels and how many candidates each pixel had."""
    _, output = made(making, gravel, CELL, alpha=0.3)
    stages = [stage for stage in output.stages if stage.level < 6]
    most = max(stage.candidates.max() for stage in stages)
    colours = ListedColormap(temperature_colours(np.linspace(0, 1, 256)) / 255)
    gap, strip, scale = 8, 20, 46
    width, height = gap + len(stages) * (CELL + gap), 2 * (strip + CELL) + gap + scale
    figure = new_figure(width / DPI, height / DPI)
    figure.set_layout_engine("none")
    for column, stage in enumerate(stages):
        x = gap + column * (CELL + gap)
        counts = stage.candidates
        for row, values in enumerate((stage.image, counts)):
            bottom = height - (row + 1) * (strip + CELL)
            axes = figure.add_axes((x / width, bottom / height, CELL / width, CELL / height))
            look = {"cmap": colours, "norm": LogNorm(1, most)} if row else {"cmap": "gray", "vmin": 0, "vmax": 255}
            shown = axes.imshow(values, interpolation="nearest", **look)
            axes.axis("off")
            label = f"mean {counts.mean():.2f}, most {counts.max()}" if row else f"level {stage.level}"
            figure.text(x / width, (bottom + CELL + 5) / height, label, fontsize=7, color=INK)
    bar = figure.add_axes((0.3, 28 / height, 0.4, 9 / height))
    ticks = [2**k for k in range(int(np.log2(most)) + 1)]
    figure.colorbar(shown, cax=bar, orientation="horizontal", ticks=ticks, format="{x:.0f}")
    bar.minorticks_off()
    bar.tick_params(labelsize=6.5, length=2, pad=1, colors=INK)
    figure.text(0.29, 28 / height, "candidates", fontsize=7, color=INK, ha="right")
    return figure_png(figure)


def sources(making, gravel):
    """Source maps of the levels in false colours, at several thresholds."""
    pictures = []
    for alpha in (0, 0.3, 1):
        image, output = made(making, gravel, CELL, alpha=alpha)
        for stage in output.stages:
            if stage.level in (5, 3, 2, 1, 0):
                own = [-(-n // 2**stage.level) for n in gravel.shape]
                shown = enlarged(source_colours(stage.source, own), (CELL, CELL), 2**stage.level)
                pictures.append((f"alpha {alpha:g}, level {stage.level}", shown))
        pictures.append((f"alpha {alpha:g}", image))
    return common.png(contact_sheet(pictures, columns=6))


def series(beta, making, gravel):
    """One sample under many alphas, as in Figures 11 and 12 of the paper."""
    pictures = [("the sample", gravel)]
    for alpha in ALPHAS[beta]:
        seams = "cut" if alpha == inf else "blend"  # where all are strangers, a blend leaves no contrast
        image, output = made(making, gravel, 2 * len(gravel), alpha=alpha, beta=beta, seams=seams)
        if alpha == 0 and not (image == np.tile(mended(gravel), (2, 2))).all():
            raise AssertionError("alpha = 0 does not tile the sample")
        pictures.append((f"alpha {'infinity' if alpha == inf else f'{alpha:g}'}: {mean_candidates(output)}", image))
    return common.png(contact_sheet(pictures, columns=4))


def mended(sample):
    """The sample as it wraps around."""
    planes = Stretched(sample.reshape(*sample.shape[:2], -1)).planes
    return sample.reshape(-1, *sample.shape[2:])[mend(planes)]


def edges(making, **collection):
    """Samples laid beside themselves, as they are and mended."""
    pictures = []
    for how, change in (("keep", np.asarray), ("mend", mended)):
        for name, sample in collection.items():
            one = change(sample)
            pictures.append((f"{name}, {how}: seam {seam(one):.2f}", np.tile(one, (2, 2, 1)[: one.ndim])))
    return common.png(contact_sheet(pictures, columns=len(collection)))


def seams(making, **collection):
    """Textures at the same alpha, of the same places, whose bands are cut where they meet and fade into each other."""
    pictures = []
    for how, (name, one) in product(("cut", "blend"), collection.items()):
        image, _ = made(making, one, 2 * len(one), alpha=0.3, seams=how)
        pictures.append((f"{name}, {how}: lines {lines(image):.2f}", image))
    return common.png(contact_sheet(pictures, columns=len(collection)))


def lines(picture):
    """The mean absolute difference across the lines of the coarser grids, over that across all other lines.

    A line of a grid is at a multiple of its period, 8, 16 or 32; the mean is over these three and both directions. It
    is about 1 where no line of a grid shows.
    """
    ratios = []
    for axis, period in product((0, 1), PERIODS):
        across = abs(np.diff(np.moveaxis(picture.astype(float), axis, 0), axis=0))
        across = across.reshape(len(across), -1).mean(1)
        at = np.arange(1, len(across) + 1) % period == 0
        ratios.append(across[at].mean() / across[~at].mean())
    return float(np.mean(ratios))


def parities(making, gravel):
    """The two parities at the same alphas."""
    pictures = []
    for parity, alpha in product(("match", "free"), (0, 0.05, 0.2, 0.4)):
        image, output = made(making, gravel, 192, alpha=alpha, parity=parity, seams="cut")
        pictures.append((f"{parity}, alpha {alpha:g}: {mean_candidates(output)}", image))
    return common.png(contact_sheet(pictures, columns=4))


def of(figure, *names):
    """A figure of samples by name."""
    known = common.grey() | common.colour()
    return lambda making: figure(making, **{name: making.crop(known[name]) for name in names})


MADE = {
    "pyramid": of(pyramids, "gravel"),
    "filters": of(responses, "gravel"),
    "candidates": of(candidates, "gravel"),
    "sources": of(sources, "gravel"),
    "beta-0": of(partial(series, 0), "gravel"),
    "beta-1": of(partial(series, 1), "gravel"),
    "parity": of(parities, "gravel"),
    "edges": of(edges, "brick", "gravel", "tissue", "wood"),
    "seams": of(seams, "gravel", "brick", "tissue"),
}
main = figures(MADE, "multires")

if __name__ == "__main__":
    main()
