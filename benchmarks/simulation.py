# SPDX-License-Identifier: BSD-3-Clause
"""Simulates with and without hard data: prints what it takes, and how like the training image it is.

python benchmarks/simulation.py [--side 250] [-n 50] [--data 0 50 200 500] [--images channels network lenses] [--runs 9]

    [--options NAME=VALUE,NAME=VALUE] [--before NAME=VALUE,NAME=VALUE] [--jobs N] [--device TEXT] [--pictures DIR]

The training images are the channels of ``channels.py``, a network of thin lines without ends, and lenses; the data are
read off another one of the same kind, at random places. The row *others* is of five more of the same kind, and dead
ends of the training image stand behind the stroke. ``--options`` are those of `simdtex.simulate` that differ from its
defaults. The time is that of a single realisation, the median of ``--runs`` (0: no times); *ratio* is over that of one
without data, and *before* over that of one with the same data and the options ``--before``, all in turn in one process.
``--pictures`` is a folder for the first realisations and the share of channels.
"""

from dataclasses import asdict
from functools import partial
from itertools import count, product
from pathlib import Path
from statistics import median

import common
import numpy as np
from channels import channels
from scipy import ndimage
from scipy.spatial import KDTree

import simdtex
from simdtex.experiments.ensemble import summary
from simdtex.io import image as files
from simdtex.methods import mrf
from simdtex.options import resolve

SPECK = 16  # pixels of a body that is one, at most
OTHERS = 5
CELL = 1600  # pixels of a cell of the network, on average
LINE = 4  # width of its lines, pixels
STRETCH = 2  # cells are so many times as wide as high
SIZES = ((56, 10), (22, 7))  # lengths and heights of lenses, pixels
SHARE = 0.3  # of lenses


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


IMAGES = {"channels": channels, "network": network, "lenses": lenses}


def hard_data(truth, number, seed):
    """So many values of the hidden map, the rest masked; None for 0."""
    hidden = np.ones(truth.size, bool)
    hidden[np.random.default_rng(seed).choice(truth.size, number, replace=False)] = False
    return np.ma.array(truth, mask=hidden.reshape(truth.shape)) if number else None


def alone(image, known):
    """Data that no pixel beside them shares the category of."""
    around = np.pad(image, 1, mode="edge")
    beside = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    return int((~np.ma.getmaskarray(known) & ~np.any([one == image for one in beside], 0)).sum())


def specks(image):
    """Bodies of 16 pixels or less in 10,000 pixels."""
    sizes = np.bincount(ndimage.label(image)[0].ravel())[1:]
    return 1e4 * (sizes <= SPECK).sum() / image.size


def seconds(image, cases, settings, device, runs):
    """Seconds of a realisation: {(data, setting): median}, for data by their number and options by their name."""
    machine, jobs = simdtex.open_machine(device), {}
    for (number, known), (name, given) in product(cases.items(), settings.items()):
        options = asdict(resolve(mrf.Options, "simulate", {"categorical": True} | given))
        options |= {"known": known, "device": machine}
        seeds, job = count(), partial(common.timed, simdtex.synthesize, image, image.shape, **options)
        jobs[number, name] = lambda job=job, seeds=seeds: job(rng=next(seeds))[1]
    return {case: median(those) for case, those in common.in_turns(runs, jobs).items()}


HEAD = (
    "image      data    time ratio before share  dead ends bodies specks alone misses right js 4x4 copied variety"
    " likeness ratio"
)


def line(name, number, times, made, image, truth, known):
    """The figures of realisations in a row."""
    row, col = ([], []) if known is None else np.nonzero(~known.mask)
    data = np.stack([col, row, truth[row, col]], -1) if known is not None else None
    found = summary(made, image, data=data)
    ends, own = found.dead_ends[1, :-1].mean(), found.dead_ends[1, -1]  # the training image comes last
    single = 0.0 if known is None else sum(alone(one, known) for one in made) / len(made)
    return (
        f"{name:8} {number:>6} {times} {found.shares[1, :-1].mean():5.3f} {ends:5.2f}/{own:4.2f}"
        f" {found.components[1, :-1].mean():6.2f} {np.mean([specks(one) for one in made]):6.2f} {single:5.1f}"
        f" {found.misses.sum():6.0f} {(made == truth).mean():5.3f} {found.anodi.by_level[0, 1]:6.3f}"
        f" {found.copied.mean():6.2f} {found.anodi.variety:7.3f} {found.anodi.likeness:8.3f} {found.anodi.ratio:5.2f}"
    )


def sheet(image, made):
    """The training image, two realisations, and the share of category 1."""
    shown = [np.rint(255 * one).astype(np.uint8) for one in (image, *made[:2], (made == 1).mean(0))]
    gap = np.full((len(image), 6), 128, np.uint8)
    return np.hstack([part for one in shown for part in (one, gap)][:-1])


@common.command
def main(
    side=250,
    n=50,
    data=(0, 50, 200, 500),
    images=tuple(IMAGES),
    runs=9,
    jobs=int,
    options="",
    before=str,
    device=None,
    pictures=Path,
):
    given, shape = common.parsed(options), (side, side)
    settings = {"now": given} | ({} if before is None else {"before": common.parsed(before)})
    print(HEAD, flush=True)
    for name, draw in common.chosen(IMAGES, images).items():
        image, truth, *others = (draw(shape, seed) for seed in (1, 1001, *range(1002, 1002 + OTHERS)))
        print(line(name, "others", f"{'':20}", np.stack(others), image, truth, None), flush=True)
        cases = {number: hard_data(truth, number, 1) for number in dict.fromkeys([0, *data])}
        taken = seconds(image, cases, settings, device, runs) if runs else {}
        for number in data:
            job = {"known": cases[number], "categorical": True, "rng": 1, "device": device, "jobs": jobs}
            made = simdtex.simulate(image, n, shape=shape, **(job | given)).values
            now, without, other = (taken.get(case) for case in ((number, "now"), (0, "now"), (number, "before")))
            times = f"{now:6.3f}s {now / without:5.2f} " if now else f"{'':14}"
            times += f"{now / other:6.2f}" if other else f"{'':6}"
            print(line(name, number, times, made, image, truth, cases[number]), flush=True)
            if pictures:
                pictures.mkdir(parents=True, exist_ok=True)
                files.write(pictures / f"{name}-{number}.png", sheet(image, made))


if __name__ == "__main__":
    main()
