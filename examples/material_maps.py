# SPDX-License-Identifier: BSD-3-Clause
"""
Maps of a material
==================

Make more of a material: the colour decides the arrangement, and its source map arranges the normals alike. Here they
are computed from the sample, because no measured ones are available.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data

import simdtex
from simdtex.model.display import source_colours
from simdtex.model.source_map import apply_source_map

height = data.gravel()[:128, :128] / 255  # bright is high
down, right = np.gradient(8 * height)
normal = np.stack([-right, down, np.ones_like(height)], axis=-1)
normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
albedo = np.round(height[..., None] * (255, 215, 170)).astype(np.uint8)
normal = np.round((normal + 1) / 2 * 255).astype(np.uint8)

texture, output = simdtex.synthesize(albedo, (256, 256), rng=1, channel_axis=-1, full_output=True)
normals = apply_source_map(output.source, normal, height.shape)

figure = simdtex.show(albedo, normal, titles=["albedo", "normals"])
origins = source_colours(output.source, height.shape)  # each colour is a position in the sample
more = simdtex.show(texture, normals, origins, titles=["albedo", "normals", "source map"])
plt.show()
