# SPDX-License-Identifier: BSD-3-Clause
"""Simulation in three dimensions: time, proportions, variograms and connectivity of channels in a volume.

    python benchmarks/volumes.py [--size 100x100x30] [--data 0,200] [--number 2] [--order 12] [--device TEXT]

The training image and the truth that data are read off are two draws of one model: sinuous channels of elliptic cross
section, along x, at random depths. Prints a line for each number of data and realisation: seconds, the share of
channels in it and in the training image, the data that it misses, and the mean absolute differences, from the training
image, of the indicator variograms along z, y and x and of the connectivity functions (lags up to a third of a side).
The line *truth* is what another draw of the model has.
"""

import common
import numpy as np

import simdtex
from simdtex.experiments.ensemble import connectivity, variogram

SHARE = 0.3


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


def figures(volume, training):
    """Mean absolute differences of variograms and of connectivity functions, over the axes, as text."""
    most = [min(n, 90) // 3 for n in training.shape]
    apart = [abs(variogram(volume, a, m) - variogram(training, a, m))[1:].mean() for a, m in enumerate(most)]
    found, wanted = (connectivity(one, 1, min(most)).function for one in (volume, training))
    return f"{np.mean(apart):10.4f}  {np.nanmean(abs(found - wanted)):10.4f}"


@common.command
def main(size="100x100x30", data="0,200", number=2, order=12, device=None):
    shape = tuple(int(side) for side in size.split("x"))[::-1]
    training, truth = model(shape, 1), model(shape, 2)
    print(f"device: {simdtex.open_machine(device).name}; {size}, order {order}")
    print("  data    time  share  wanted  misses  variograms  connectivity")
    for count in map(int, data.split(",")):
        hidden = np.ones(shape, bool)
        hidden.flat[np.random.default_rng(3).choice(hidden.size, count, replace=False)] = False
        given = {"known": np.ma.MaskedArray(truth, hidden)} if count else {"shape": shape}
        given |= {"categorical": True, "rng": 1, "order": order, "device": device}
        for first in range(number):
            found, seconds = common.timed(simdtex.simulate, training, 1, first=first, **given)
            made = found.values[0]
            share, missed = f"{made.mean():.3f}   {training.mean():.3f}", int((made != truth)[~hidden].sum())
            print(f"{count:6}  {seconds:5.1f}s  {share}  {missed:6}  {figures(made, training)}")
        print(f" truth          {truth.mean():.3f}   {training.mean():.3f}          {figures(truth, training)}")


if __name__ == "__main__":
    main()
