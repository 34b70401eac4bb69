# SPDX-License-Identifier: BSD-3-Clause
"""Simulates channels with and without hard data: prints what it takes, and how like the training image it is.

python benchmarks/simulation.py [--side 250] [-n 50] [--data 0 50 500] [--jobs N] [--data-weight 16]

    [--device TEXT] [--pictures DIR]

The training image is one of ``channels.py``; the data are read off another one, at random places. Times are of the
whole call after one that is not counted; the ratio of a run with data to one without is of single realisations in turn,
in one process, the median of nine.
"""

import argparse
import time
from pathlib import Path
from statistics import median

import numpy as np
from channels import channels

import simdtex
from simdtex.experiments.ensemble import summary
from simdtex.io.image import write


def hidden_map(side, seed):
    """The truth that data are read off."""
    return channels((side, side), 1000 + seed)


def hard_data(side, count, seed):
    """So many values of the hidden map, the rest masked; None for 0."""
    truth = hidden_map(side, seed)
    hidden = np.ones(truth.size, bool)
    hidden[np.random.default_rng(seed).choice(truth.size, count, replace=False)] = False
    return np.ma.array(truth, mask=hidden.reshape(truth.shape)) if count else None


def alone(image, known):
    """Data that no pixel beside them shares the category of."""
    around = np.pad(image, 1, mode="edge")
    beside = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    return int((~np.ma.getmaskarray(known) & ~np.any([one == image for one in beside], 0)).sum())


def ratios(image, side, counts, device, runs=9):
    """Seconds of a run with so many data over those of one without."""
    cases = {count: hard_data(side, count, 1) for count in counts}
    machine = simdtex.open_machine(device)

    def seconds(known, seed):
        began = time.perf_counter()
        simdtex.synthesize(
            image, (side, side), known=known, categorical=True, boundary="open", rng=seed, device=machine
        )
        return time.perf_counter() - began

    for known in cases.values():
        seconds(known, 0)
    taken = {count: [] for count in cases}
    for seed in range(1, runs + 1):
        for count, known in cases.items():
            taken[count].append(seconds(known, seed))
    return {count: (median(those), median(those) / median(taken[0])) for count, those in taken.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=250)
    parser.add_argument("-n", type=int, default=50)
    parser.add_argument("--data", type=int, nargs="+", default=[0, 50, 500])
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--data-weight", type=float, default=16)
    parser.add_argument("--device")
    parser.add_argument("--pictures", type=Path, help="a folder for the first realisations and the share of channels")
    options = parser.parse_args()
    side, image = options.side, channels((options.side, options.side), 1)
    apart = ratios(image, side, [0, *(count for count in options.data if count)], options.device)
    print("data  one run  ratio  all runs  share  dead ends  alone  misses  right  variety  likeness  ratio")
    truth = hidden_map(side, 1)
    for count in options.data:
        known = hard_data(side, count, 1)
        job = {"known": known, "categorical": True, "rng": 1, "device": options.device, "jobs": options.jobs}
        job["data_weight"] = options.data_weight
        simdtex.simulate(image, 2, shape=(side, side), **job)
        began = time.perf_counter()
        made = simdtex.simulate(image, options.n, shape=(side, side), **job).values
        seconds = time.perf_counter() - began
        row, col = np.nonzero(np.zeros((side, side), bool) if known is None else ~known.mask)
        data = np.stack([col, row, [] if known is None else known.data[row, col]], -1)
        found = summary(made, image, data=data if count else None)
        ends, own = found.dead_ends[1, :-1].mean(), found.dead_ends[1, -1]  # the training image comes last
        single = sum(alone(one, known) for one in made) / len(made) if count else 0
        misses, right = found.misses.sum() if count else 0, (made == truth).mean()
        print(
            f"{count:4} {apart[count][0]:7.3f}s {apart[count][1]:6.2f} {seconds:8.1f}s"
            f" {found.shares[1, :-1].mean():6.3f} {ends:5.2f}/{own:.2f} {single:6.1f} {misses:7.0f} {right:6.3f}"
            f" {found.anodi.variety:8.3f} {found.anodi.likeness:9.3f} {found.anodi.ratio:6.2f}"
        )
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            share = (made == 1).mean(0)
            shown = [np.rint(255 * one).astype(np.uint8) for one in (image, *made[:2], share)]
            gap = np.full((side, 6), 128, np.uint8)
            parts = [part for one in shown for part in (one, gap)][:-1]
            write(options.pictures / f"channels-{count}.png", np.hstack(parts))


if __name__ == "__main__":
    main()
