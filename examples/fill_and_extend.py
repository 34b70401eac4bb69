# SPDX-License-Identifier: BSD-3-Clause
"""
Filling holes and extending a picture
=====================================

Fill holes in a picture, and extend it to the right. The given pixels do not change.
"""

import matplotlib.pyplot as plt
import numpy as np
from skimage import data, draw

import simdtex

picture = data.immunohistochemistry()[300:460, 40:200]
hole = np.zeros(picture.shape[:2], bool)
hole[draw.ellipse(55, 55, 20, 32)] = True
hole[draw.line(90, 90, 150, 155)] = True

filled = simdtex.fill(picture, hole, rng=1, channel_axis=-1)
wider = simdtex.extend(picture, right=80, rng=1, channel_axis=-1)
assert (filled[~hole] == picture[~hole]).all()
assert (wider[:, :160] == picture).all()

shown = np.where(hole[..., None], 255, picture).astype(np.uint8)
figure = simdtex.show(shown, filled, wider, titles=["holes", "filled", "80 pixels wider"])

# %%
# `simdtex.extend` with ``seamless`` replaces a band along the edges, so that the picture tiles. The figure ``seam`` is
# the step across the seam as a multiple of the steps between neighbouring pixels.

tile = simdtex.extend(picture, seamless=True, rng=1, channel_axis=-1)
for label, one in (("before", picture), ("after", tile)):
    print(f"seam {label}: {simdtex.quality.seam(one):.2f}")
figure = simdtex.show(picture, tile, titles=["as it is, 3 x 3", "seamless, 3 x 3"], tiled=True)
plt.show()
