# SPDX-License-Identifier: BSD-3-Clause
"""
First texture
=============

Synthesise brick from a sample of brick: ``python first_texture.py [FOLDER] [--size 256]``.
"""

import argparse
import tempfile
from pathlib import Path

from skimage import data

import simdtex
from simdtex.io.image import write

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the texture, twice that of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

sample = data.brick()[: args.size // 2, : args.size // 2]
texture = simdtex.synthesize(sample, (args.size, args.size), rng=1)

write(folder / "sample.png", sample)
write(folder / "texture.png", texture)
print(f"sample.png and texture.png are in {folder}")
# sphinx_gallery_thumbnail_number = 2
