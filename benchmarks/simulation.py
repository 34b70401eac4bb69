# SPDX-License-Identifier: BSD-3-Clause
"""Simulates with and without hard data: prints what it takes, and how like the training image it is.

python benchmarks/simulation.py [--side 250] [-n 50] [--data 0 50 200 500] [--images channels network lenses] [--runs 9]

    [--options NAME=VALUE,NAME=VALUE] [--before NAME=VALUE,NAME=VALUE] [--jobs N] [--device TEXT] [--pictures DIR]

The training images are those of ``training.py``; the data are read off another one of the same kind, at random places.
The row *others* is of five more of the same kind, and dead ends of the training image stand behind the stroke.
``--options`` are those of `simdtex.simulate` that differ from its defaults. The time is that of a single realisation,
the median of ``--runs`` (0: no times); *ratio* is over that of one without data, and *before* over that of one with the
same data and the options ``--before``, all in turn in one process.
"""

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from statistics import median

import numpy as np
from over_folder import parsed
from scipy import ndimage
from training import IMAGES

import simdtex
from simdtex.experiments.ensemble import summary
from simdtex.io.image import write
from simdtex.methods import mrf
from simdtex.options import resolve

SPECK = 16  # pixels of a body that is one, at most
OTHERS = 5


def hard_data(truth, count, seed):
    """So many values of the hidden map, the rest masked; None for 0."""
    hidden = np.ones(truth.size, bool)
    hidden[np.random.default_rng(seed).choice(truth.size, count, replace=False)] = False
    return np.ma.array(truth, mask=hidden.reshape(truth.shape)) if count else None


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
    machine, taken = simdtex.open_machine(device), {}
    settings = {
        name: asdict(resolve(mrf.Options, "simulate", {"categorical": True} | given))
        for name, given in settings.items()
    }
    for seed in range(runs + 1):  # the first is not counted
        for count, known in cases.items():
            for name, options in settings.items():
                began = time.perf_counter()
                simdtex.synthesize(image, image.shape, known=known, rng=seed, device=machine, **options)
                taken.setdefault((count, name), []).append(time.perf_counter() - began)
    return {case: median(those[1:]) for case, those in taken.items()}


HEAD = (
    "image      data    time ratio before share  dead ends bodies specks alone misses right js 4x4 copied variety"
    " likeness ratio"
)


def line(name, count, times, made, image, truth, known):
    """The figures of realisations in a row."""
    row, col = ([], []) if known is None else np.nonzero(~known.mask)
    data = np.stack([col, row, truth[row, col]], -1) if known is not None else None
    found = summary(made, image, data=data)
    ends, own = found.dead_ends[1, :-1].mean(), found.dead_ends[1, -1]  # the training image comes last
    single = 0.0 if known is None else sum(alone(one, known) for one in made) / len(made)
    return (
        f"{name:8} {count:>6} {times} {found.shares[1, :-1].mean():5.3f} {ends:5.2f}/{own:4.2f}"
        f" {found.components[1, :-1].mean():6.2f} {np.mean([specks(one) for one in made]):6.2f} {single:5.1f}"
        f" {found.misses.sum():6.0f} {(made == truth).mean():5.3f} {found.anodi.by_level[0, 1]:6.3f}"
        f" {found.copied.mean():6.2f} {found.anodi.variety:7.3f} {found.anodi.likeness:8.3f} {found.anodi.ratio:5.2f}"
    )


def sheet(image, made):
    """The training image, two realisations, and the share of category 1."""
    shown = [np.rint(255 * one).astype(np.uint8) for one in (image, *made[:2], (made == 1).mean(0))]
    gap = np.full((len(image), 6), 128, np.uint8)
    return np.hstack([part for one in shown for part in (one, gap)][:-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=250)
    parser.add_argument("-n", type=int, default=50)
    parser.add_argument("--data", type=int, nargs="+", default=[0, 50, 200, 500])
    parser.add_argument("--images", nargs="+", default=list(IMAGES), choices=list(IMAGES))
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--options", type=parsed, default={})
    parser.add_argument("--before", type=parsed)
    parser.add_argument("--device")
    parser.add_argument("--pictures", type=Path, help="a folder for the first realisations and the share of channels")
    options = parser.parse_args()
    shape = (options.side, options.side)
    settings = {"now": options.options} | ({} if options.before is None else {"before": options.before})
    print(HEAD, flush=True)
    for name in options.images:
        image, truth = IMAGES[name](shape, 1), IMAGES[name](shape, 1001)
        others = np.stack([IMAGES[name](shape, 1002 + k) for k in range(OTHERS)])
        print(line(name, "others", f"{'':20}", others, image, truth, None), flush=True)
        cases = {count: hard_data(truth, count, 1) for count in dict.fromkeys([0, *options.data])}
        taken = seconds(image, cases, settings, options.device, options.runs) if options.runs else {}
        for count in options.data:
            job = {"known": cases[count], "categorical": True, "rng": 1, "device": options.device, "jobs": options.jobs}
            made = simdtex.simulate(image, options.n, shape=shape, **(job | options.options)).values
            now, without, before = (taken.get(case) for case in ((count, "now"), (0, "now"), (count, "before")))
            times = f"{now:6.3f}s {now / without:5.2f} " if now else f"{'':14}"
            times += f"{now / before:6.2f}" if before else f"{'':6}"
            print(line(name, count, times, made, image, truth, cases[count]), flush=True)
            if options.pictures:
                options.pictures.mkdir(parents=True, exist_ok=True)
                write(options.pictures / f"{name}-{count}.png", sheet(image, made))


if __name__ == "__main__":
    main()
