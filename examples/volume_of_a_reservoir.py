# SPDX-License-Identifier: BSD-3-Clause
"""
Uncertainty of a volume
=======================

From a training image and three wells to the volume that a well drains. The sheet has the map of the probability, the
vertical proportions beside the training image's, the volume connected to a well with P10, P50 and P90, and the standard
error of the map, with a line for the signature.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter

import simdtex
from simdtex import ensemble

REALISATIONS = 20
folder = Path(tempfile.mkdtemp(prefix="simdtex-"))

# The training image: bodies of sand in 8 layers of 0.5 m, cells of 25 x 25 m.
shape, origin, cell = (8, 24, 48), (1012.5, 2012.5, -3.75), (25.0, 25.0, 0.5)
noise = gaussian_filter(np.random.default_rng(1).standard_normal(shape), (1, 2, 4), mode="wrap")
training = (noise > np.quantile(noise, 0.7)).astype(np.uint8)

# The wells: what another reservoir of the kind has in three columns.
hidden = gaussian_filter(np.random.default_rng(2).standard_normal(shape), (1, 2, 4), mode="wrap")
with open(folder / "wells.csv", "w", encoding="utf-8") as file:
    file.write("x,y,z,facies\n")
    for row, col in (shape[1] // 2, shape[2] // 2), (shape[1] // 4, shape[2] // 3), (shape[1] * 3 // 4, shape[2] // 5):
        for layer, value in enumerate(hidden[:, row, col] > np.quantile(hidden, 0.7)):
            x, y, z = (first + step * k for first, step, k in zip(origin, cell, (col, row, layer), strict=True))
            file.write(f"{x},{y},{z},{value:d}\n")
well = origin[0] + cell[0] * (shape[2] // 3), origin[1] + cell[1] * (shape[1] // 4)

wells = folder / "wells.csv"
given = {"known": wells, "origin": origin, "cell": cell, "categorical": True, "order": 3, "rng": 1}
maps = simdtex.simulate(training, REALISATIONS, **given)
for axis in maps.dims[1:]:
    maps[axis].attrs["units"] = "m"

probability = ensemble.probability(maps, 1).mean("z", keep_attrs=True)
volume = ensemble.connected_volume(maps, 1, well)
p10, p50, p90 = volume.quantile([0.1, 0.5, 0.9]).values
shares = ensemble.vertical_proportions(maps).sel(category=1)
own = ensemble.vertical_proportions(training).sel(category=1).assign_coords(z=maps.z)
error = ensemble.standard_error(maps, 1)

figure, ((one, two), (three, four)) = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
probability.plot(ax=one)
one.plot(*well, "r^")
one.set(title="Mean over the layers, and the well", aspect=1)
shares.plot.line(y="z", ax=two, add_legend=False, color="tab:blue", alpha=0.4)
own.plot(y="z", ax=two, color="tab:orange", linestyle="--")
two.set(title="Share of sand (dashed: training image)", xlabel="share of the layer")
volume.plot.hist(ax=three)
three.locator_params(axis="x", nbins=5)
for value in (p10, p50, p90):
    three.axvline(value, color="tab:orange", linestyle="--")
three.set(title=f"P10 {p10:,.0f}, P50 {p50:,.0f}, P90 {p90:,.0f} m³", ylabel="realisations")
error.plot.line(ax=four, marker=".")
four.set(title=f"{float(error[-1]):.2f} after {len(maps)} realisations", ylim=(0, None))
about = f"simdtex {maps.attrs['version']}, seed {maps.attrs['seed']}, image {maps.attrs['training_image'][:12]}"
figure.supxlabel(f"{about}      Signed: ____________________", fontsize=9)
print(f"P10 {p10:,.0f}, P50 {p50:,.0f}, P90 {p90:,.0f} m³; the wells are in {folder}")
plt.show()
