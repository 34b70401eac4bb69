# SPDX-License-Identifier: BSD-3-Clause
"""
Texture by numbers
==================

Control with guides which material appears where. The sample is a pond of pebbles in grass. It is round, so it contains
banks in every direction. The labels of the output are a river.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter
from skimage import data
from skimage.transform import resize

import simdtex

grass = data.grass()[:160, :160, None] / 255 * (120, 190, 80)
pebbles = data.gravel()[:160, :160, None] / 255 * (255, 235, 205)
row, col = np.indices((160, 160)) / 160
pond = (np.hypot(row - 0.5, col - 0.5) < 0.36).astype(np.uint8)
sample = np.where(pond[..., None], pebbles, grass).astype(np.uint8)

row, col = np.indices((320, 320)) / 320
river = (abs(col - 0.5 - 0.25 * np.sin(2 * np.pi * row)) < 0.12 + 0.03 * np.cos(9 * row)).astype(np.uint8)
picture = simdtex.synthesize(sample, (320, 320), guide=(pond, river), boundary="open", rng=1, channel_axis=-1)
figure = simdtex.show(sample, pond * 255, river * 255, picture, titles=["sample", "its labels", "wanted", "river"])

# %%
# Guides may be numbers. Here they are the smoothed brightness of gravel and a photograph, whose tones are mapped to
# those of the gravel, so that each has a counterpart in the sample.

gravel = data.gravel()[:256, :256]
tone = gaussian_filter(gravel.astype(float), 2)
photograph = resize(data.camera(), (256, 256), anti_aliasing=True)
shares = np.linspace(0, 1, 65)
wanted = np.interp(photograph, np.quantile(photograph, shares), np.quantile(tone, shares))
portrait = simdtex.synthesize(gravel, (256, 256), guide=(tone, wanted), boundary="open", rng=1)
figure = simdtex.show(gravel, tone, wanted, portrait, titles=["gravel", "its tones", "wanted", "portrait"])
plt.show()
