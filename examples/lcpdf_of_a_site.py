# SPDX-License-Identifier: BSD-3-Clause
"""
LCPDF of a site
===============

Compute the probability of each pixel of a picture given its neighbours:
``python lcpdf_of_a_site.py [FOLDER] [--size 128]``.

Half of the picture is grass, like the sample, and half is gravel. Pixels of grass tend to be more likely. surprise.png
shows -log P of every pixel: dark pixels are likely.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from skimage import data

import simdtex
from simdtex.io.image import write

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=128, help="side of the picture and of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

size = args.size
sample = data.grass()[:size, :size] // 16  # 16 grey levels
picture = np.hstack([data.grass()[-size:, : size // 2], data.gravel()[:size, : size - size // 2]]) // 16

row, col = size // 2, size // 4
site = simdtex.lcpdf(picture, sample, [(row, col)], order=8, greys=16)[0]
print(f"site ({row}, {col}) is {picture[row, col]}; its LCPDF over the 16 levels:")
print(" ".join(f"{p:.3f}" for p in site))

sites = np.argwhere(np.ones(picture.shape, bool))
table = simdtex.lcpdf(picture, sample, sites, order=8, greys=16, boundary="open")
likely = table[np.arange(len(sites)), picture.ravel()].reshape(picture.shape)
surprise = -np.log(np.maximum(likely, 1e-6))
print(f"mean surprise: grass {surprise[:, : size // 2].mean():.2f}, gravel {surprise[:, size // 2 :].mean():.2f}")

write(folder / "picture.png", (picture * 17).astype(np.uint8))
write(folder / "surprise.png", np.round(surprise / surprise.max() * 255).astype(np.uint8))
print(f"picture.png and surprise.png are in {folder}")
