# SPDX-License-Identifier: BSD-3-Clause
"""Every figure of the page on multiresolution sampling.

    python benchmarks/multires_figures.py [--out docs/multires] [--device TEXT] [--only filters,edges] [--quick]

Writes PNG files, the same bytes every time, and prints their names.
"""

from itertools import pairwise, product
from math import inf

import numpy as np
import samples
from figures import enlarged
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.patches import Patch, Polygon, Rectangle
from pyramid_figures import main, png

import simdtex
from simdtex.experiments.quality import seam
from simdtex.methods.multires.algorithm import tiled
from simdtex.methods.multires.analysis import pyramid
from simdtex.methods.multires.mend import mend
from simdtex.model.display import source_colours, temperature_colours
from simdtex.model.stretched import TOP, Stretched
from simdtex.ops.pyramids import UNIT_BITS, bank, filters
from simdtex.report.page import DPI, FAINT, INK, figure_png, new_figure
from simdtex.report.sheet import contact_sheet

ALPHAS = {0: (0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, inf), 1: (0.1, 0.2, 0.3, 0.4, 0.6, 1, 1.5)}
OWN, SIMILAR, FAILS, CANDIDATE = "#0072B2", "#8CC9A8", "#E07B4F", "#E69F00"
SIBLING, OTHER, UNSEEN, THIRD = "#A9D3EE", "#F8E3B5", "#ECECEA", "#CFE8DA"
SAMPLES = samples.grey() | samples.colour()
PERIODS = (8, 16, 32)  # of the grids whose lines show
CELL = 160  # side of an output that is shown level by level, pixels; 1.25 tiles


# ---------------------------------------------------------------- the first phase


def pyramids(machine, gravel):
    """G and L of the sample, level by level."""
    stretched = machine.put(Stretched(gravel[..., None]).planes)
    gaussian, laplacian = pyramid(machine, stretched, 5, torus=True)
    side = len(gravel)
    rows = {"G": [], "L": []}
    for level, (g, band) in enumerate(zip(gaussian, laplacian, strict=True)):
        low, last = machine.get(g)[0] / TOP, level == len(gaussian) - 1
        high = low if last else 2 * machine.get(band)[0] / TOP + 0.5
        for name, values in (("G", low), ("L", high)):
            picture = np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
            label = f"{name}_{level}, {len(values)} x {len(values)}"
            rows[name].append((label + (" = G_4" if last and name == "L" else ""), grown(picture, side)))
    return png(contact_sheet([*rows["G"], *rows["L"]], columns=len(gaussian)))


def grown(picture, side):
    return enlarged(picture, (side, side), side / len(picture))


def responses(machine, gravel):
    """The taps of the default bank, and G_1's responses to them."""
    settings = simdtex.methods.multires.Options()
    taps = bank(settings.orientations)
    stretched = machine.put(Stretched(gravel[..., None]).planes)
    gaussian, laplacian = pyramid(machine, stretched, 3, torus=True)
    features = machine.get(filters(machine, gaussian[1], laplacian[1], machine.put(taps), True))
    maps = np.moveaxis(features.reshape(*gaussian[1].shape[1:], -1), -1, 0)[1:]
    n = settings.orientations
    figure = new_figure(6.6, 7.0)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.03)
    axes = figure.subplots(4, n)
    for j, (tap, response) in enumerate(zip(taps, maps, strict=True)):
        above, below = axes[2 * (j // n) : 2 * (j // n) + 2, j % n]
        above.imshow(tap, cmap="RdBu_r", vmin=-(2**UNIT_BITS), vmax=2**UNIT_BITS)
        for (row, col), value in np.ndenumerate(tap):
            ink = "white" if abs(value) > 0.6 * 2**UNIT_BITS else INK
            above.text(col, row, f"{value / 2**UNIT_BITS:.2f}", ha="center", va="center", fontsize=8, color=ink)
        above.set_title(f"{('first', 'second')[j // n]} derivative, {180 * (j % n) // n}°", fontsize=9, color=INK)
        limit = 3 * response.std()
        below.imshow(response, cmap="gray", vmin=-limit, vmax=limit)
        for one in (above, below):
            one.set_xticks([])
            one.set_yticks([])
    return figure_png(figure)


# ---------------------------------------------------------------- parent structure and scan, drawn

SIDES = (8, 4, 2, 1)  # of the drawn levels
PIXEL = (5, 2)  # whose candidates are sought
COPIED = {3: (0, 0), 2: (1, 0), 1: (0, 1)}  # what its parents were copied from
FAILING = {2: {(0, 1), (1, 1)}, 1: {(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)}}


def scanned():
    """The nodes of the drawn pyramid in the order in which they are compared, and those of them that pass."""
    order, passing = [], set()

    def visit(level, row, col):
        order.append((level, row, col))
        if (row, col) in FAILING.get(level, ()):
            return
        passing.add((level, row, col))
        if level > 1:
            for child in range(4):
                visit(level - 1, 2 * row + child // 2, 2 * col + child % 2)

    visit(3, 0, 0)
    return order, passing


def place(level, row, col):
    """Where a corner of a level's grid stands in the drawing: grids lie one above another, seen from the side."""
    x, y = col * 2**level, row * 2**level
    return x + 0.55 * (8 - y), -0.42 * y + 4.6 * level


def middle(level, row, col):
    return place(level, row + 0.5, col + 0.5)


def cell(axes, level, row, col, **look):
    corners = [place(level, row + a, col + b) for a, b in ((0, 0), (0, 1), (1, 1), (1, 0))]
    axes.add_patch(Polygon(corners, closed=True, **({"edgecolor": FAINT, "linewidth": 0.6} | look)))


def join(axes, low, high, **look):
    (x, y), (p, q) = middle(*low), middle(*high)
    axes.plot([x, p], [y, q], zorder=4, **({"color": INK, "linewidth": 1.1} | look))


def parents(making):
    """A pixel with its parent structure, and the scan of the nodes for it."""
    figure = new_figure(9.2, 5.9)
    left, right = figure.subplots(1, 2)
    chain = [(level, PIXEL[0] >> level, PIXEL[1] >> level) for level in range(4)]
    for level, n in enumerate(SIDES):
        for row, col in np.ndindex(n, n):
            siblings = level == 0 and (row // 2, col // 2) == chain[1][1:]
            own = (level, row, col) in chain
            cell(left, level, row, col, facecolor=OWN if own else SIBLING if siblings else "white")
    for low, high in pairwise(chain):
        join(left, low, high, color=OWN, linewidth=1.6)

    order, passing = scanned()
    for level, n in enumerate(SIDES):
        for row, col in np.ndindex(n, n):
            node, parent = (level, row, col), (level + 1, row // 2, col // 2)
            if level == 0:
                match = (row % 2, col % 2) == (PIXEL[0] % 2, PIXEL[1] % 2)
                colour = UNSEEN if parent not in passing else CANDIDATE if match else OTHER
            elif node in order:
                colour = SIMILAR if node in passing else FAILS
            else:
                colour = UNSEEN
            cell(right, *node, facecolor=colour)
            if node in order:
                x, y = middle(*node)
                right.text(x, y, order.index(node) + 1, ha="center", va="center", fontsize=8, color=INK, zorder=6)
    for level, where in COPIED.items():
        cell(right, level, *where, facecolor="none", edgecolor=OWN, linewidth=2, zorder=5)
    for axes, title in ((left, "synthesis pyramid"), (right, "analysis pyramid")):
        axes.set_title(title, fontsize=11, fontweight="bold", color=INK)
        axes.set_aspect("equal")
        axes.set_xlim(-0.3, 12.7)
        axes.set_ylim(-3.5, 14)
        axes.axis("off")
        for level in range(4):
            x, y = place(level, 4 / 2**level, 0)
            axes.text(x - 0.6, y + 0.5, f"level {level}", fontsize=9, color=FAINT, ha="right", va="center")
    keys = [
        Patch(facecolor=OWN, label="a pixel and its parents"),
        Patch(facecolor=SIBLING, label="pixels with the same parents"),
        Patch(facecolor="none", edgecolor=OWN, linewidth=2, label="what the parents were copied from"),
        Patch(facecolor=SIMILAR, label="passes: its children come next"),
        Patch(facecolor=FAILS, label="fails"),
        Patch(facecolor=UNSEEN, label="never looked at"),
        Patch(facecolor=CANDIDATE, label="candidates"),
        Patch(facecolor=OTHER, label='candidates too with parity="free"'),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False, fontsize=9, labelcolor=INK)
    return figure_png(figure)


def tiles(making):
    """Parents in a row of an output of 12 pixels, its sample having 5."""
    shapes = [(1, 5), (1, 3), (1, 2), (1, 1)]
    figure = new_figure(8.4, 2.7)
    axes = figure.subplots()
    centre = {}
    for level, own in enumerate(shapes):
        _, cols = tiled((1, 12), (1, 5), own, 2**level)
        axes.text(-0.25, 1.5 * level + 0.4, f"level {level}", ha="right", va="center", fontsize=9, color=FAINT)
        for col in range(cols):
            tile, inside = divmod(col, own[1])
            left = 5 * tile + inside * 2**level
            right = min(left + 2**level, 5 * tile + 5, 12)
            look = {"facecolor": (SIBLING, OTHER, THIRD)[tile], "edgecolor": INK, "linewidth": 0.8}
            axes.add_patch(Rectangle((left + 0.06, 1.5 * level), right - left - 0.12, 0.8, **look))
            centre[level, col] = (left + right) / 2
            axes.text(centre[level, col], 1.5 * level + 0.4, inside, ha="center", va="center", fontsize=9, color=INK)
    for (level, col), x in centre.items():
        tile, inside = divmod(col, shapes[level][1])
        if level + 1 < len(shapes):
            parent = tile * shapes[level + 1][1] + inside // 2
            axes.plot([x, centre[level + 1, parent]], [1.5 * level + 0.8, 1.5 * level + 1.5], color=FAINT, linewidth=1)
    axes.set_xlim(-1.5, 12.1)
    axes.set_ylim(-0.1, 5.5)
    axes.axis("off")
    return figure_png(figure)


# ---------------------------------------------------------------- the second phase


def run(machine, sample, side, **options):
    axis = -1 if sample.ndim == 3 else None
    given = {"method": "multires", "channel_axis": axis, "rng": 1, "device": machine, "full_output": True}
    return simdtex.synthesize(sample, (side, side), **given, **options)


def mean_candidates(output):
    return output.statistics["levels"][-1]["candidates"]


def candidates(machine, gravel):
    """Pictures of the levels and how many candidates each pixel had."""
    _, output = run(machine, gravel, CELL, alpha=0.3)
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


def sources(machine, gravel):
    """Source maps of the levels in false colours, at several thresholds."""
    pictures = []
    for alpha in (0, 0.3, 1):
        image, output = run(machine, gravel, CELL, alpha=alpha)
        for stage in output.stages:
            if stage.level in (5, 3, 2, 1, 0):
                own = [-(-n // 2**stage.level) for n in gravel.shape]
                shown = enlarged(source_colours(stage.source, own), (CELL, CELL), 2**stage.level)
                pictures.append((f"alpha {alpha:g}, level {stage.level}", shown))
        pictures.append((f"alpha {alpha:g}", image))
    return png(contact_sheet(pictures, columns=6))


def series(machine, gravel, beta):
    """One sample under many alphas, as in Figures 11 and 12 of the paper."""
    pictures = [("the sample", gravel)]
    for alpha in ALPHAS[beta]:
        seams = "cut" if alpha == inf else "blend"  # where all are strangers, a blend leaves no contrast
        image, output = run(machine, gravel, 2 * len(gravel), alpha=alpha, beta=beta, seams=seams)
        if alpha == 0 and not (image == np.tile(mended(gravel), (2, 2))).all():
            raise AssertionError("alpha = 0 does not tile the sample")
        name = "infinity" if alpha == inf else f"{alpha:g}"
        pictures.append((f"alpha {name}: {mean_candidates(output):.2f} candidates", image))
    return png(contact_sheet(pictures, columns=4))


def mended(sample):
    """The sample as it wraps around."""
    planes = Stretched(sample.reshape(*sample.shape[:2], -1)).planes
    return sample.reshape(-1, *sample.shape[2:])[mend(planes)]


def edges(machine, collection):
    """Samples laid beside themselves, as they are and mended."""
    pictures = [
        (f"{name}, keep: seam {seam(one):.2f}", np.tile(one, (2, 2, 1)[: one.ndim])) for name, one in collection.items()
    ]
    for name, one in collection.items():
        pictures.append((f"{name}, mend: seam {seam(mended(one)):.2f}", np.tile(mended(one), (2, 2, 1)[: one.ndim])))
    return png(contact_sheet(pictures, columns=len(collection)))


def seams(machine, collection):
    """Textures at the same alpha, of the same places, whose bands are cut where they meet and fade into each other."""
    pictures = []
    for how in ("cut", "blend"):
        for name, one in collection.items():
            image, _ = run(machine, one, 2 * len(one), alpha=0.3, seams=how)
            pictures.append((f"{name}, {how}: lines {lines(image):.2f}", image))
    return png(contact_sheet(pictures, columns=len(collection)))


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


def parities(machine, gravel):
    """The two parities at the same alphas."""
    pictures = []
    for parity in ("match", "free"):
        for alpha in (0, 0.05, 0.2, 0.4):
            image, output = run(machine, gravel, 192, alpha=alpha, parity=parity, seams="cut")
            pictures.append((f"{parity}, alpha {alpha:g}: {mean_candidates(output):.2f} candidates", image))
    return png(contact_sheet(pictures, columns=4))


def of(figure, *names):
    """A figure of samples by name, on the machine."""

    def made(making):
        return figure(making.machine, {name: making.crop(SAMPLES[name]) for name in names})

    return made


def of_gravel(figure, *more):
    return of(lambda machine, chosen: figure(machine, *chosen.values(), *more), "gravel")


MADE = {
    "pyramid": of_gravel(pyramids),
    "filters": of_gravel(responses),
    "parents": parents,
    "tiles": tiles,
    "candidates": of_gravel(candidates),
    "sources": of_gravel(sources),
    "beta-0": of_gravel(series, 0),
    "beta-1": of_gravel(series, 1),
    "parity": of_gravel(parities),
    "edges": of(edges, "brick", "gravel", "tissue", "wood"),
    "seams": of(seams, "gravel", "brick", "tissue"),
}

if __name__ == "__main__":
    main(MADE, __doc__.splitlines()[0], "multires")
