# SPDX-License-Identifier: BSD-3-Clause
"""
Levels, sweeps and temperature
==============================

A callback keeps the picture and the temperatures after some sweeps. Neighbours with temperature 1 do not count in
equation (12), those with 0 fully. The coarsest level decides the arrangement, and the finer ones add detail.
"""

import matplotlib.pyplot as plt
from skimage import data

import simdtex

stages = {}


def watch(progress):
    if progress.stage and progress.sweep in (1, 4):
        stages[f"level {progress.level}, sweep {progress.sweep}"] = progress.image(), progress.temperature()


sample = data.immunohistochemistry()[150:278, 100:228]
texture, output = simdtex.synthesize(sample, (192, 192), rng=1, channel_axis=-1, callback=watch, full_output=True)
for level in output.statistics["levels"]:
    print(f"level {level['level']}: {level['rows']} x {level['cols']} sites, {level['sweeps']} sweeps")

figure, axes = plt.subplots(2, len(stages), figsize=(2 * len(stages), 4.4), layout="constrained")
for (title, (picture, temperature)), (above, below) in zip(stages.items(), axes.T, strict=True):
    above.set_title(title, fontsize=9)
    above.imshow(picture)
    drawn = below.imshow(temperature, "inferno", vmin=0, vmax=1)
    above.set_axis_off(), below.set_axis_off()
figure.colorbar(drawn, ax=axes[1], label="temperature")
plt.show()
