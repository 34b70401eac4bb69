# SPDX-License-Identifier: BSD-3-Clause
"""
Maps of a material
==================

Synthesise a texture with matching height and normal maps: ``python material_maps.py [FOLDER] [--size 256]``.

Here the maps are computed from the sample, because no measured ones are available. The source map arranges any map
that is aligned with the sample.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from skimage import data

import simdtex
from simdtex.io.image import write
from simdtex.model.source_map import apply_source_map, save_source_map

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the texture, twice that of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

sample = data.gravel()[: args.size // 2, : args.size // 2]
height = sample.astype(np.float64) / 255  # bright is high
down, right = np.gradient(8 * height)
normal = np.stack([-right, down, np.ones_like(height)], axis=-1)
normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
maps = {
    "height": np.round(height * 65535).astype(np.uint16),
    "normal": np.round((normal + 1) / 2 * 255).astype(np.uint8),
}

texture, output = simdtex.synthesize(sample, (args.size, args.size), rng=1, full_output=True)

write(folder / "texture.png", texture)
save_source_map(folder / "source.npz", output.source)
for name, values in maps.items():
    write(folder / f"{name}.png", apply_source_map(output.source, values, sample.shape))
print(f"texture.png, height.png, normal.png and source.npz are in {folder}")
