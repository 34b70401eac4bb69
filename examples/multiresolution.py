# SPDX-License-Identifier: BSD-3-Clause
"""
Multiresolution sampling
========================

Compare thresholds of the method ``multires`` on gravel: ``python multiresolution.py [FOLDER] [--size 256]``.

The threshold alpha is the largest difference of two places that may be exchanged. sheet.png shows its effect.
candidates.png shows the number of candidates of each pixel at each level: brighter means more.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from skimage import data

import simdtex
from simdtex.io.image import write
from simdtex.model.display import source_colours, temperature_colours
from simdtex.report.sheet import contact_sheet, magnified

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the textures, twice that of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

shape = (args.size, args.size)
gravel = data.gravel()[: args.size // 2, : args.size // 2]
pictures = [("the sample", gravel)]
for alpha in (0, 0.1, 0.2, 0.3, 0.4):
    texture, output = simdtex.synthesize(gravel, shape, method="multires", alpha=alpha, rng=1, full_output=True)
    finest = output.statistics["levels"][-1]
    compared = f"{finest['compared']:.0f} of {finest['nodes']} nodes compared"
    print(f"alpha {alpha:4}: {finest['candidates']:.2f} candidates at the finest level, {compared}")
    pictures.append((f"alpha {alpha:g}", texture))
contact_sheet(pictures, folder / "sheet.png", columns=3)

# Show the last texture level by level; brightness is the logarithm of the number of candidates.
most = np.log(max(2, max(stage.candidates.max() for stage in output.stages)))
maps = [
    (f"level {stage.level}", magnified(temperature_colours(np.log(stage.candidates) / most), 2**stage.level))
    for stage in output.stages
]
contact_sheet(maps, folder / "candidates.png", columns=4)

# Show in false colours where each of its pixels is from.
write(folder / "source.png", source_colours(output.source, gravel.shape))
print(f"sheet.png, candidates.png and source.png are in {folder}")
