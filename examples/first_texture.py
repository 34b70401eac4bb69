# SPDX-License-Identifier: BSD-3-Clause
"""
First texture
=============

Make a texture of twice the size from a picture of stained tissue, 160 x 160. The output tiles.
"""

import matplotlib.pyplot as plt
from skimage import data

import simdtex

sample = data.immunohistochemistry()[150:310, 100:260]
texture = simdtex.synthesize(sample, (320, 320), rng=1, channel_axis=-1)

figure = simdtex.show(sample, texture, titles=["sample", "texture"])
plt.show()
