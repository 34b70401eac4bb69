# SPDX-License-Identifier: BSD-3-Clause
"""
Pyramid matching: flat, solid and mixed
=======================================

The method ``pyramid`` matches the histograms of all subbands. Noise becomes grain in a few iterations. Gravel is
reduced, so that no stone is larger than the filters.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data
from skimage.transform import downscale_local_mean

import simdtex

far = downscale_local_mean(data.gravel(), (4, 4))
stone = np.stack([far, far**1.1 / 1.9, far**1.2 / 3.6], axis=-1).clip(0, 255).astype(np.uint8)
stages = {"sample": stone}


def keep(progress):
    if progress.stage:
        stages[progress.doing] = progress.image()


simdtex.synthesize(stone, (192, 192), method="pyramid", rng=1, channel_axis=-1, callback=keep)
figure = simdtex.show(*list(stages.values())[:4], titles=list(stages)[:4])

# %%
# A block of the same grain, of which three slices are shown, and the grain in the colours of wood.

block = simdtex.synthesize_solid(stone, (64, 64, 64), rng=1, channel_axis=-1)
wood = data.coffee()[266:362, 486:582]
mixed = simdtex.mix([wood, stone], (128, 128), palette=0, pattern=1, rng=1, channel_axis=-1)
figure = simdtex.show(block[32], block[:, 32], block[:, :, 32], wood, mixed, titles=["z", "y", "x", "wood", "mixed"])
plt.show()
