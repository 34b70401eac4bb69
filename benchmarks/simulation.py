# SPDX-License-Identifier: BSD-3-Clause
"""How like the training image realisations are, with and without hard and soft data.

    python benchmarks/simulation.py [--parts maps,border,places,volumes,soft]
                                    [--images channels,network,lenses,meanders] [--data 0,50,200,500] [--number 50]
                                    [--side N] [--options NAME=VALUE,...] [--out DIR] [--device TEXT]
    python benchmarks/simulation.py --parts reliability,likeness --data 0,20,60 --number 20 [--truths 30]
                                    [--walker CSV] [--snesim PROGRAM] ...

``--options`` are those of `simdtex.simulate` that differ from its defaults, ``--number`` is that of realisations, and
``--side`` makes other sizes. ``--out`` takes a table for each part.

maps     training images of channels, of a network of thin lines without ends, of lenses, and of thin meanders without
         ends; data are read off another one of the same kind, at random places. The row *others* is of five more of the
         same kind. ``--out`` also takes pictures: the training image, two realisations, and the share of category 1.
border   the share of category 1 by the distance from the border of the map, in pixels: 16 *others* of each kind of
         *maps*, and 16 realisations, also of a quarter of the side from a quarter of the training image.
places   the greatest |z| of the shares of category 1 in bands of 8 rows, bands of 8 columns, and the four corners (a
         quarter of a side), and how much they are off by: means of realisations of 128 x 128 from an image of twice the
         side, less the share of each realisation. A |z| of 3.0 is the 5 % limit of 16 bands, 2.5 of four corners. Rows
         are free realisations, those on a torus, and those with soft data of 0.5, and of 0.1 to 0.9 along the columns,
         where *pixels off by* is the root mean square difference, and *by chance* what independent draws give.
volumes  channels of elliptic cross section along x in 100 x 100 x 30 voxels, at random depths: the share of channels,
         the data missed, and the mean absolute differences, from the training image, of the indicator variograms and
         of the connectivity functions along z, y and x, lags up to a third of a side; *another* is one more draw.
soft     the shares of channels in 128 x 128 pixels, means of 8 realisations, by the weight of the soft data: where the
         same probability is asked everywhere, in four bands of a gradient from 0 to 1, and in 16 blocks of 32 x 32, by
         how much they differ from 0.1, 0.15 ... 0.85; and the dead ends and the js 4x4 of the second map. Weight 0 is a
         run without, and *proportions* are asked instead of the first four maps.

reliability  whether ensembles tell how uncertain they are. Truths are windows of 128 x 128 of images as of *maps*, of a
         ``volume``, and of Walker Lake (columns X, Y and V of ``--walker``: the upper three tenths of V), known at
         random wells. The training image is another part of the image, of which ten are drawn. *share in* and *area in*
         are how often P10 to P90 of an ensemble has the truth's share of category 1, and the connected area of up to 5
         wells, without wells that of the largest body; *exchangeable* is what draws of one law would have. *above .9*
         and *below .1* are how often the truth has category 1 where so many realisations have it. *within* and *truths*
         are deviations of the share in an ensemble, and among the truths. The windows of Walker Lake overlap.
likeness windows of the same images beside realisations without data: the variogram at three lags over the training
         image's, the mean difference of connectivity functions, dead ends, js 4x4, copies, and CPU seconds.

With ``--snesim`` both parts have rows of that program too: mps_snesim_tree of MPSlib (PyPI: scikit-mps).
"""

import os
from itertools import pairwise
from pathlib import Path

import common
import matplotlib.pyplot as plt
import numpy as np
import snesim as program_of_mpslib
from channels import Scene, channels
from scipy import ndimage
from scipy.spatial import KDTree

import simdtex
from simdtex.io import image as files
from simdtex.jobs.simulation.ensemble import channels as of_the_pages
from simdtex.jobs.simulation.ensemble import connectivity, reliability, summary, variogram
from simdtex.random import as_seed

SPECK = 16  # pixels of a body that is one, at most
OTHERS = 5
CELL = 1600  # pixels of a cell of the network, on average
LINE = 4  # width of its lines, pixels
STRETCH = 2  # cells are so many times as wide as high
SIZES = ((56, 10), (22, 7))  # lengths and heights of lenses, pixels
SHARE = 0.3  # of lenses, and of channels in a volume; half of it of meanders
FLAT, WEIGHTS = (0.1, 0.27, 0.5, 0.8), (0, 0.25, 1, 4)  # probabilities, and weights, of soft data
BLOCK, TOGETHER = 32, 8  # pixels of a side, and realisations
BAND = 8  # rows or columns
DISTANCES, EACH = (0, 3, 8, 16, 32, 1000), 16  # from the border, pixels, and realisations
SIDE, LARGE, DRAWN = 128, 5, 10  # of a truth, pixels; sides of a truth in a drawn image; and drawn images of a kind
LAYERS, SHALLOW = 12, 40  # of a volume, and the side of its truths
WELLS = 5  # whose connected areas count
LAGS = (1, 8, 16)


def network(shape, rng=None):
    """Make a network (rows, cols) uint8 of lines about 4 pixels wide, 1, of cells that are twice as wide as high."""
    draw = np.random.default_rng(rng)
    high = np.array([shape[0] * STRETCH, shape[1]])  # where cells are as high as wide
    least = np.sqrt(CELL * STRETCH) / 2  # between the middles of two cells, so that none is tiny
    middles = np.empty((0, 2))
    for one in draw.uniform(-60, high + 60, (20 * high.prod() // CELL, 2)):
        if not len(middles) or ((middles - one) ** 2).sum(1).min() > least**2:
            middles = np.vstack([middles, one])
    near, which = KDTree(middles).query(np.stack(np.indices(shape), -1) * (STRETCH, 1), 2)
    apart = middles[which[..., 1]] - middles[which[..., 0]]
    # the distance from the line between two middles, across it; the stretch makes it longer down
    across = (near[..., 1] ** 2 - near[..., 0] ** 2) / 2 / np.hypot(apart[..., 0] * STRETCH, apart[..., 1])
    return (across < LINE / 2).astype(np.uint8)


def lenses(shape, rng=None):
    """Make lenses (rows, cols) uint8 of two sizes, 1, that lie apart or run together, tilted by 20 degrees at most."""
    draw = np.random.default_rng(rng)
    image, (row, col) = np.zeros(shape, np.uint8), np.indices(shape)
    while image.mean() < SHARE:
        length, height = SIZES[draw.integers(2)]
        i, j, turn = *draw.uniform(-20, np.add(shape, 20)), np.radians(draw.uniform(-20, 20))
        along = (col - j) * np.cos(turn) + (row - i) * np.sin(turn)
        across = (row - i) * np.cos(turn) - (col - j) * np.sin(turn)
        image[(2 * along / length) ** 2 + (2 * across / height) ** 2 <= 1] = 1
    return image


def meanders(shape, rng=None):
    """Make thin sinuous lines (rows, cols) uint8, 1, about 4 pixels wide, that cross the image and never end."""
    scene = Scene(shape, as_seed(rng), LINE)
    while scene.pixels.mean() < SHARE / 2:
        scene.add_main()
    return scene.pixels


IMAGES = {"channels": channels, "network": network, "lenses": lenses, "meanders": meanders}


def hard_data(truth, number, seed):
    """So many values of the hidden map, the rest masked; None for 0."""
    hidden = np.ones(truth.size, bool)
    hidden[np.random.default_rng(seed).choice(truth.size, number, replace=False)] = False
    return np.ma.array(truth, mask=hidden.reshape(truth.shape)) if number else None


def specks(image):
    """Bodies of 16 pixels or less in 10,000 pixels."""
    sizes = np.bincount(ndimage.label(image)[0].ravel())[1:]
    return 1e4 * (sizes <= SPECK).sum() / image.size


def figures(made, image, truth, known):
    """The figures of realisations in a row."""
    row, col = ([], []) if known is None else np.nonzero(~known.mask)
    data = np.stack([col, row, truth[row, col]], -1) if known is not None else None
    found = summary(made, image, data=data)
    ends, anodi = found.dead_ends[1], found.anodi  # the training image comes last
    return [
        *(f"{found.shares[1, :-1].mean():.3f}", f"{ends[:-1].mean():.2f}", f"{ends[-1]:.2f}"),
        *(f"{found.components[1, :-1].mean():.2f}", f"{np.mean([specks(one) for one in made]):.2f}"),
        *(int(found.misses.sum()), f"{(made == truth).mean():.3f}", f"{anodi.by_level[0, 1]:.3f}"),
        *(f"{found.copied.mean():.2f}", f"{anodi.variety:.3f}", f"{anodi.likeness:.3f}", f"{anodi.ratio:.2f}"),
    ]


def sheet(image, made):
    """The training image, two realisations, and the share of category 1."""
    return beside((image, *made[:2], (made == 1).mean(0)))


def beside(pictures):
    """Pictures of values from 0 to 1 side by side."""
    shown = [np.rint(255 * one).astype(np.uint8) for one in pictures]
    gap = np.full((len(shown[0]), 6), 128, np.uint8)
    return np.hstack([part for one in shown for part in (one, gap)][:-1])


def maps(images, data, number, side, options, out):
    """Rows of the figures of maps."""
    shape = (side or 250,) * 2
    for name, draw in common.chosen(IMAGES, images).items():
        image, truth, *others = (draw(shape, seed) for seed in (1, 1001, *range(1002, 1002 + OTHERS)))
        yield [name, "others", *figures(np.stack(others), image, truth, None)]
        for count in data:
            known = hard_data(truth, count, 1)
            made = simdtex.simulate(image, number, shape=shape, known=known, **options).values
            yield [name, count, *figures(made, image, truth, known)]
            if out:
                files.write(out / f"{name}-{count}.png", sheet(image, made))


def border(images, _data, number, side, options, _out):
    """Rows of the share of category 1 by the distance from the border."""
    whole, number = side or 250, min(number, EACH)
    for name, draw in common.chosen(IMAGES, images).items():
        image = draw((whole, whole), 1)
        yield [name, "others", *_by_distance(np.stack([draw(image.shape, 1001 + k) for k in range(number)]))]
        for size, training in ((whole, image), (whole // 4, image[: whole // 2, : whole // 2])):
            made = simdtex.simulate(training, number, shape=(size, size), **options).values
            yield [name, size, *_by_distance(made)]


def _by_distance(made):
    row, col = np.indices(made.shape[1:])
    rows, cols = made.shape[1:]
    apart = np.minimum(np.minimum(row, rows - 1 - row), np.minimum(col, cols - 1 - col))
    bands = [made[:, (apart >= least) & (apart < most)] for least, most in pairwise(DISTANCES)]
    return [f"{one.mean():.3f}" if one.size else "" for one in bands]


def places(images, _data, number, side, options, _out):
    """Rows of how far the shares of category 1 depend on the place."""
    side = (side or 128) // BLOCK * BLOCK
    for name, draw in common.chosen({"pages": lambda *_: of_the_pages()[0]} | IMAGES, images or "pages").items():
        image = draw((2 * side, 2 * side), 1)
        slope = np.tile(np.linspace(0.1, 0.9, side), (side, 1))
        cases = {"free": {}, "torus": {"boundary": "torus"}, "0.5": np.full((side, side), 0.5), "0.1 to 0.9": slope}
        for case, given in cases.items():
            p = given if isinstance(given, np.ndarray) else None
            given = given if p is None else {"probabilities": np.stack([1 - p, p])}
            made = simdtex.simulate(image, number, shape=(side, side), **given, **options).values == 1
            mean, least = made.mean(0), number - 1
            pixels = ("", "") if p is None else (((mean - p) ** 2).mean(), (mean * (1 - mean)).mean() / least)
            shares = made.mean((1, 2))
            rest = made - shares[:, None, None] - (0 if p is None else p - p.mean())
            yield [
                *(name, case, f"{shares.mean():.3f}", f"{shares.std(ddof=1):.4f}"),
                *(text for parts in _parts(rest) for text in _greatest(parts)),
                *(one and f"{np.sqrt(one):.3f}" for one in pixels),
            ]


def _parts(rest):
    """Means (realisations, parts) over bands of rows, bands of columns, and corners."""
    n, rows, cols = rest.shape
    bands = rest.reshape(n, rows // BAND, -1).mean(2), rest.mean(1).reshape(n, -1, BAND).mean(2)
    corners = rest.reshape(n, 4, rows // 4, 4, cols // 4).mean((2, 4))[:, ::3, ::3]
    return *bands, corners.reshape(n, 4)


def _greatest(parts):
    mean = abs(parts.mean(0))
    return f"{(mean / parts.std(0, ddof=1)).max() * np.sqrt(len(parts)):.1f}", f"{mean.max():.3f}"


def model(shape, seed):
    """Sinuous channels in a volume (layers, rows, cols): 1 in channels, 0 elsewhere, uint8."""
    rng = np.random.default_rng(seed)
    layers, rows, cols = shape
    z, y, x = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij", sparse=True)
    found = np.zeros(shape, bool)
    while found.mean() < SHARE:
        half, thick = rng.uniform(4, 7), rng.uniform(2, 3.5)
        wave, swing = rng.uniform(40, 80), rng.uniform(4, 10)
        middle = rng.uniform(0, rows) + swing * np.sin(2 * np.pi * (x / wave + rng.uniform()))
        middle = middle + (x - cols / 2) * rng.normal(0, 0.1)
        depth = rng.uniform(0, layers)
        found |= ((y - middle) / half) ** 2 + ((z - depth) / thick) ** 2 < 1
    return found.astype(np.uint8)


def apart(volume, training):
    """Mean absolute differences of variograms and of connectivity functions, over the axes, as text."""
    most = [min(n, 90) // 3 for n in training.shape]
    curves = [abs(variogram(volume, a, m) - variogram(training, a, m))[1:].mean() for a, m in enumerate(most)]
    found, wanted = (connectivity(one, 1, min(most)).function for one in (volume, training))
    return f"{np.mean(curves):.4f}", f"{np.nanmean(abs(found - wanted)):.4f}"


def volumes(_images, _data, number, side, options, _out):
    """Rows of the figures of volumes, two realisations each."""
    shape = (3 * (side or 100) // 10, side or 100, side or 100)
    training, truth = model(shape, 1), model(shape, 2)
    for count in (0, 200):
        known = hard_data(truth, count, 3)
        for first in range(min(number, 2)):
            made = simdtex.simulate(training, 1, first=first, shape=shape, known=known, **options).values[0]
            missed = 0 if known is None else int((made != known).sum())
            yield [count, f"{made.mean():.3f}", f"{training.mean():.3f}", missed, *apart(made, training)]
    yield ["another", f"{truth.mean():.3f}", f"{training.mean():.3f}", "", *apart(truth, training)]


def soft(_images, _data, number, side, options, out):
    """Rows of the shares of channels, and of their patterns."""
    side, image = (side or 128) // BLOCK * BLOCK, of_the_pages()[0]
    many = (side // BLOCK) ** 2
    blocks = np.random.default_rng(3).permutation(np.linspace(0.1, 0.85, many)).reshape(side // BLOCK, -1)
    slope = np.repeat((np.arange(side) + 0.5)[:, None] / side, side, 1)
    pictures = []

    def made(p, **given):
        given |= {} if p is None else {"probabilities": np.stack([1 - p, p])}
        found = simdtex.simulate(image, min(number, TOGETHER), shape=(side, side), **given, **options).values
        pictures.append(found[0])
        return found

    for weight in WEIGHTS:
        given = {"soft_weight": weight}
        flat = [made(np.full((side, side), p) if weight else None, **given) for p in (FLAT if weight else FLAT[:1])]
        bands, off = [""] * 4, []
        if weight:
            bands = [f"{part.mean():.2f}" for part in np.split(made(slope, **given).mean(0), 4)]
            found = made(np.kron(blocks, np.ones((BLOCK, BLOCK))), **given).mean(0)
            off = abs(found.reshape(len(blocks), BLOCK, -1, BLOCK).mean((1, 3)) - blocks)
        yield [
            f"weight {weight:g}",
            *_shares(flat),
            *bands,
            *_offs(off),
            *_patterns(flat[min(1, len(flat) - 1)], image),
        ]
    flat = [made(None, proportions=(1 - p, p)) for p in FLAT]
    yield ["proportions", *_shares(flat), *[""] * 4, *_offs([]), *_patterns(flat[1], image)]
    if out:
        files.write(out / "soft.png", beside(pictures[7:13]))


def _shares(flat):
    return [f"{one.mean():.2f}" for one in flat] + [""] * (len(FLAT) - len(flat))


def _offs(off):
    return (f"{np.mean(off):.3f}", f"{np.max(off):.3f}") if len(off) else ("", "")


def _patterns(made, image):
    found = summary(made, image)
    return f"{found.dead_ends[1][:-1].mean():.2f}", f"{found.anodi.by_level[0, 1]:.3f}"


def shared(many, images):
    """The numbers of truths of so many images, as even as they can be; none is 0."""
    return [len(part) for part in np.array_split(np.arange(many), images) if len(part)]


def drawn(draw, side, many):
    """Yield pairs of a training image and its truths: the first 2 x 2 windows of a drawn image, and others of it."""
    windows = [(row, col) for row in range(LARGE) for col in range(LARGE) if max(row, col) > 1]
    for seed, here in enumerate(shared(many, DRAWN), 1):
        image, of_seed = draw((LARGE * side, LARGE * side), seed), np.random.default_rng(seed).permutation(windows)
        cut = [image[..., r * side : (r + 1) * side, c * side : (c + 1) * side] for r, c in of_seed[:here]]
        yield image[..., : 2 * side, : 2 * side], cut


def lake(path, side, many):
    """Yield pairs of a training image and its truths: the rest of Walker Lake beyond one of its sides, and windows."""
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars='"')
    x, y, v = (table[name] for name in "XYV")
    image = np.zeros((int(y.max()), int(x.max())), np.uint8)
    image[y.astype(int) - 1, x.astype(int) - 1] = v > np.quantile(v, 1 - SHARE)
    for turn, here in enumerate(shared(many, 4)):
        turned = np.rot90(image, turn)
        at = np.linspace(0, turned.shape[1] - side, here).astype(int)
        back = [np.rot90(turned[:side, col : col + side], -turn) for col in at]
        yield np.rot90(turned[side:], -turn), back


def cases(images, side, truths, walker):
    """Yield the name of an image, and its pairs of a training image and truths."""
    known = {name: lambda draw=draw: drawn(draw, side or SIDE, truths) for name, draw in IMAGES.items()}
    known["volume"] = lambda: drawn(lambda shape, seed: model((LAYERS, *shape), seed), SHALLOW, truths)
    if walker:
        known["walker"] = lambda: lake(walker, side or SIDE, truths)
    for name, pairs in common.chosen(known, images).items():
        yield name, [(np.ascontiguousarray(training), truths) for training, truths in pairs()]


def programs(options, snesim):
    """Functions (training, n, shape, known, seed) that return realisations, by name."""

    def own(training, n, shape, known, seed):
        return simdtex.simulate(training, n, shape=shape, known=known, **options | {"rng": seed}).values

    found = {"simdtex": own}
    if snesim:
        found["SNESIM"] = lambda *given: program_of_mpslib.simulate(snesim, *given)
    return found


def seconds():
    """CPU seconds of this process and of its children."""
    return sum(os.times()[:4])


def areas(image, known):
    """The cells of the body of each of the first wells in category 1; without wells those of the largest body."""
    labels, _ = ndimage.label(image == 1)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    if known is None:
        return [sizes.max()]
    return sizes[labels[np.nonzero(known.filled(0) == 1)]][:WELLS]


def within(made, truth):
    """Whether P10 to P90 of figures (realisations, ...) have the truth's."""
    low, high = np.quantile(made, (0.1, 0.9), axis=0)
    return np.ravel((low <= truth) & (truth <= high))


def reliable(images, data, number, side, options, out, truths, snesim, walker):
    """Rows of the coverage of intervals and of the reliability of probabilities."""
    exchangeable = 0.8 * (number - 1) / (number + 1)  # P10 lies .1 (n - 1) gaps above the least of n draws
    curves = {}
    for name, pairs in cases(images, side, truths, walker):
        among = np.std([truth.mean() for _, those in pairs for truth in those], ddof=1)
        for count in data:
            for program, make in programs(options, snesim).items():
                shares, bodies, p, true, spread, means, began = [], [], [], [], [], [], seconds()
                for training, those in pairs:
                    for truth in those:
                        known = hard_data(truth, count, seed := len(shares) + 1)
                        made = make(training, number, truth.shape, known, seed)
                        share = made.mean(tuple(range(1, made.ndim)))
                        shares += [*within(share, truth.mean())]
                        bodies += [*within([areas(one, known) for one in made], areas(truth, known))]
                        open_ = known.mask if known is not None else np.ones(truth.shape, bool)
                        p.append((made == 1).mean(0)[open_])
                        true.append(truth[open_])
                        spread.append(share.var(ddof=1))
                        means.append(share.mean() - truth.mean())
                each = (seconds() - began) / number / len(shares)
                p, true = np.concatenate(p), np.concatenate(true)
                curves[name, count, program] = reliability(p, true)
                ends = [f"{true[those].mean():.2f}" if those.any() else "" for those in (p > 0.9, p < 0.1)]
                yield [
                    *(name, count, program, f"{np.mean(shares):.2f}", f"{np.mean(bodies):.2f}", f"{exchangeable:.2f}"),
                    *(*ends, f"{np.sqrt(np.mean(spread)):.3f}", f"{among:.3f}", f"{np.mean(means):+.3f}"),
                    f"{each:.2f}",
                ]
    if out:
        diagram(curves).savefig(out / "reliability.png", dpi=100, bbox_inches="tight")


def diagram(curves):
    """A figure with a panel for each image of reliability diagrams, a colour for each program."""
    names, colours = list(dict.fromkeys(name for name, *_ in curves)), {"simdtex": "#0072B2", "SNESIM": "#D55E00"}
    across, down = min(3, len(names)), -(-len(names) // 3)
    size = (3.4 * across, 3.8 * down + 1)
    figure, grid = plt.subplots(down, across, figsize=size, squeeze=False, layout="constrained")
    for axes, name in zip(grid.ravel(), names, strict=False):
        axes.plot((0, 1), (0, 1), color="grey", linewidth=0.8)
        for (of, count, program), found in curves.items():
            if of == name:
                style = dict(zip(sorted({one for _, one, _ in curves}), (":", "--", "-", "-."), strict=False))[count]
                axes.plot(found.probability, found.frequency, style, marker=".", color=colours[program])
                axes.lines[-1].set_label(f"{program}, {count} wells")
        axes.set(title=name, xlabel="probability", ylabel="frequency in the truths", aspect=1)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=across, frameon=False)
    for axes in grid.ravel()[len(names) :]:
        axes.set_axis_off()
    return figure


def likeness(images, _data, number, side, options, _out, truths, snesim, walker):
    """Rows of the likeness of windows and of realisations without data, each with its own training image; of maps."""
    for name, pairs in cases(images or ",".join([*IMAGES, *(["walker"] if walker else [])]), side, truths, walker):
        each = -(-number // len(pairs))
        yield [name, "windows", *_like([(np.stack(those), training) for training, those in pairs]), ""]
        for program, make in programs(options, snesim).items():
            began = seconds()
            made = [(make(one, each, those[0].shape, None, k), one) for k, (one, those) in enumerate(pairs, 1)]
            yield [name, program, *_like(made), f"{(seconds() - began) / each / len(pairs):.2f}"]


def _like(pairs):
    """Figures of ensembles, each beside its training image, as means."""
    rows = []
    for made, training in pairs:
        found = summary(made, training)
        at_lags = found.variograms[:, 1][..., list(LAGS)]
        variograms = at_lags[:, :-1].mean((0, 1)) / at_lags[:, -1].mean(0)
        off = np.nanmean(found.connectivity[:, 1, :-1] - found.connectivity[:, 1, -1:])
        ends = found.dead_ends[1, :-1].mean(), found.dead_ends[1, -1]
        rows.append([*variograms, off, *ends, found.anodi.by_level[0, 1], np.nanmean(found.copied)])
    *middle, js, copied = np.mean(rows, 0)
    return [*(f"{one:.2f}" for one in middle), f"{js:.3f}", f"{copied:.2f}"]


OF_MAPS = "share|dead ends|in the image|bodies|specks|misses|right|js 4x4|copied|variety|likeness|ratio"
OF_ENSEMBLES = "image|wells|program|share in|area in|exchangeable|above .9|below .1|within|truths|share off|seconds"
OF_WINDOWS = (
    "image|program|variogram 1|variogram 8|variogram 16|connectivity|dead ends|in the image|js 4x4|copied|seconds"
)
BANDS = [f"band {p}" for p in (0.125, 0.375, 0.625, 0.875)]
OF_PLACES = [f"{part} {what}" for part in ("rows", "columns", "corners") for what in ("|z|", "off by")]
PARTS = {
    "maps": (maps, ["image", "data", *OF_MAPS.split("|")]),
    "border": (border, ["image", "side", *(f"from {least}" for least in DISTANCES[:-1])]),
    "places": (places, ["image", "asked", "share", "deviation", *OF_PLACES, "pixels off by", "by chance"]),
    "volumes": (volumes, ["data", "share", "wanted", "misses", "variograms", "connectivity"]),
    "reliability": (reliable, OF_ENSEMBLES.split("|")),
    "likeness": (likeness, OF_WINDOWS.split("|")),
    "soft": (soft, ["channels", *map(str, FLAT), *BANDS, "blocks off by", "at most", "dead ends", "js 4x4"]),
}


@common.command
def main(
    parts="",
    images="",
    data=(0, 50, 200, 500),
    number=50,
    side=int,
    options="",
    truths=30,
    snesim=Path,
    walker=Path,
    out=Path,
    device=None,
):
    given = {"categorical": True, "rng": 1, "device": common.opened(device)} | common.parsed(options)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    of_truths = {"truths": truths, "snesim": snesim, "walker": walker}
    for part, (rows, header) in common.chosen(PARTS, parts).items():
        more, found = of_truths if part in ("reliability", "likeness") else {}, []
        for row in rows(images, data, number, side, given, out, **more):
            print(*row, flush=True)  # a part may take hours
            found.append(row)
        common.table(part, header, found, out and out / f"simulation-{part}.csv")


if __name__ == "__main__":
    main()
