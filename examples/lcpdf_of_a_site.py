# SPDX-License-Identifier: BSD-3-Clause
"""
LCPDF of a site
===============

Compute the probability of each pixel given its neighbours, equation (8). Half of the picture is brick, like the sample,
and half is grass. The map shows -log P of every pixel: pixels of brick are more likely.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data

import simdtex

sample = data.brick()[:128, :128] // 16  # 16 grey levels
picture = np.hstack([data.brick()[-128:, -64:], data.grass()[:128, :64]]) // 16

sites = np.argwhere(np.ones(picture.shape, bool))
table = simdtex.lcpdf(picture, sample, sites, order=8, greys=16, boundary="open")
likely = table[np.arange(len(sites)), picture.ravel()].reshape(picture.shape)
surprise = -np.log(np.maximum(likely, 1e-6))
print(f"mean surprise: brick {surprise[:, :64].mean():.2f}, grass {surprise[:, 64:].mean():.2f}")

figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
left.imshow(picture, "gray")
left.set_title("brick and grass")
figure.colorbar(middle.imshow(surprise, "viridis"), ax=middle, label="-log P")
middle.set_title("surprise")
for row, col in ((64, 32), (64, 96)):
    right.step(np.arange(16), table[128 * row + col], where="mid", label=f"site ({row}, {col}): {picture[row, col]}")
right.set(title="LCPDF of two sites", xlabel="grey level", ylabel="probability")
right.legend()
plt.show()
