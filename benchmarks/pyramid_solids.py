# SPDX-License-Identifier: BSD-3-Clause
"""Every figure of the page on solid textures.

    python benchmarks/pyramid_solids.py [--out docs/pyramid] [--device TEXT] [--only solid] [--quick]

Writes PNG files, the same bytes every time, and oblique.csv, and prints their names and the figures that the page
quotes. ``--quick`` runs all of it on small sizes.
"""

import numpy as np
import samples
import tables
from pyramid_figures import COLOURS, main, moved, png, reduced
from scipy.ndimage import map_coordinates
from scipy.stats import wasserstein_distance
from skimage import data
from subbands import decompose

import simdtex
from simdtex.report.page import figure_png, new_figure, tidy
from simdtex.report.sheet import contact_sheet, view


def isotropic(making):
    """Samples that look alike in every direction."""
    chosen = {"gravel": reduced(data.gravel(), 4), "tissue": samples.colour()["tissue"]}
    return {name: making.crop(sample) for name, sample in chosen.items()}


def block(making, sample, side, **options):
    shape = (making.small(side),) * 3
    return simdtex.synthesize_solid(sample, shape, **making.given(sample) | options)


def solid(making):
    """Two blocks as one sees them."""
    sheets = []
    for sample in isotropic(making).values():
        volume, _ = block(making, sample, 96)
        sheets.append(view(volume, size=max(96, making.small(192))))
    return png(np.concatenate(sheets))


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


def plane(volume, name, depth):
    """A square slice through a block that repeats, at some depth, by cubic splines where it misses the voxels."""
    down, across = (np.array(way) / np.linalg.norm(way) for way in DIRECTIONS[name])
    i, j = np.mgrid[: len(volume), : len(volume)]
    where = np.multiply.outer(down, i) + np.multiply.outer(across, j)
    where += (depth * np.abs(np.cross(down, across)))[:, None, None]
    where += 0.5 if "between" in name else 0.0
    planes = [
        map_coordinates(one, where, output=np.float64, order=3, mode="grid-wrap")
        for one in np.moveaxis(volume.reshape(*volume.shape[:3], -1), -1, 0)
    ]
    return np.squeeze(np.stack(planes, -1))


def bands_of(making, picture):
    """Values by statistic: pixels (channels, n) and each level's (bands, n), in the picture's unit."""
    levels = 3 if making.part == 1 else 1
    axis = -1 if picture.ndim == 3 else None
    pyramid = decompose(picture, levels=levels, channel_axis=axis, device=making.machine)
    pyramid.subbands[-1] += pyramid.offset
    names = ["high", *(f"level {level}" for level in range(levels)), "low"]
    found = {"pixels": np.moveaxis(picture.reshape(-1, 1 if axis is None else picture.shape[-1]), -1, 0)}
    return found | {n: b.reshape(-1, b.shape[-2] * b.shape[-1]) for n, b in zip(names, pyramid.subbands, strict=True)}


def apart(found, wanted):
    """W1 of each statistic in the sample's standard deviations, the mean of its bands."""
    return {
        name: np.mean([wasserstein_distance(a, b) / b.std() for a, b in zip(found[name], own, strict=True)])
        for name, own in wanted.items()
    }


def solid_options(making):
    """The ways to make a block, and slices of each."""
    sample = isotropic(making)["tissue"]
    pictures = []
    ways = [{"solids": solids, "slices": own} for solids in ("average", "turns") for own in ("each", "together")]
    for options in [*ways, {"pyramid": "laplacian"}]:
        volume, output = block(making, sample, 64, **options)
        name = ", ".join(options.values())
        for number, direction in enumerate(("x-y", "y-z", "45° about x")):
            made = plane(volume, direction, len(volume) // 2)
            label = f"{name}: {moved(output.statistics):.3f}" if number == 0 else direction
            pictures.append((label, np.rint(np.clip(made, 0, 255)).astype(np.uint8)))
    return png(contact_sheet(pictures, columns=6))


def oblique(making):
    """How far slices along the axes, and others, are from the sample."""
    lines = []
    figure = new_figure(9.6, 4.4)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, sample) in zip(panels, isotropic(making).items(), strict=True):
        volume, _ = block(making, sample, 64)
        wanted, side = bands_of(making, sample), min(len(sample), len(volume))
        corners = [sample[a, b] for a in (slice(side), slice(-side, None)) for b in (slice(side), slice(-side, None))]
        kinds = {"the sample's corners": corners}
        kinds |= {n: [plane(volume, n, k) for k in range(0, len(volume), len(volume) // 8)] for n in DIRECTIONS}
        for number, (kind, pictures) in enumerate(kinds.items()):
            each = [apart(bands_of(making, picture), wanted) for picture in pictures]
            mean = {statistic: np.mean([one[statistic] for one in each]) for statistic in wanted}
            means = [np.mean(list(one.values())) for one in each]
            lines.append([name, kind, *(f"{v:.3f}" for v in (*mean.values(), np.mean(means), max(means)))])
            print(" ", *lines[-1])
            look = {"color": (*COLOURS, "#7A7A7A")[number], "linestyle": "-" if number < 4 else "--", "marker": "o"}
            axes.plot(list(mean), list(mean.values()), label=kind, linewidth=1.3, markersize=4, **look)
        tidy(axes, name, "", "W1, standard deviations" if name == "gravel" else "")
    panels[1].set_ylim(bottom=0)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9
    )
    tables.write(making.out / "oblique.csv", ["sample", "slices", *wanted, "mean", "worst slice"], lines)
    return figure_png(figure)


if __name__ == "__main__":
    main({"solid": solid, "solid-options": solid_options, "oblique": oblique}, __doc__.splitlines()[0])
