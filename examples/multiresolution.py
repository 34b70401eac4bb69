# SPDX-License-Identifier: BSD-3-Clause
"""
Multiresolution sampling
========================

The method ``multires`` exchanges places whose features differ by less than the threshold ``alpha``. A small threshold
copies whole regions of the sample, a large one breaks its structure.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data

import simdtex

sample = np.round(data.gravel()[:128, :128, None] / 255 * (255, 215, 170)).astype(np.uint8)
pictures = {"sample": sample}
for alpha in (0, 0.2, 0.3, 0.4):
    given = {"method": "multires", "alpha": alpha, "rng": 1, "channel_axis": -1}
    texture, output = simdtex.synthesize(sample, (256, 256), full_output=True, **given)
    print(f"alpha {alpha}: {output.statistics['levels'][-1]['candidates']:.2f} candidates at the finest level")
    pictures[f"alpha {alpha}"] = texture

figure = simdtex.show(*pictures.values(), titles=list(pictures))
plt.show()
