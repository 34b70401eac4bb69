# SPDX-License-Identifier: BSD-3-Clause
"""
Levels, sweeps and temperature
==============================

Save the picture and the temperatures after every sweep of a run:
``python stages_and_temperature.py [FOLDER] [--size 256]``.
"""

import argparse
import tempfile
from pathlib import Path

from skimage import data

import simdtex
from simdtex.io.image import read
from simdtex.report.sheet import StageWriter, contact_sheet

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", nargs="?", type=Path, help="where to write; by default a new temporary folder")
parser.add_argument("--size", type=int, default=256, help="side of the texture, twice that of the sample")
args = parser.parse_args()
folder = args.folder or Path(tempfile.mkdtemp(prefix="simdtex-"))
folder.mkdir(exist_ok=True)

writer = StageWriter(folder / "stages")  # pictures and temperatures of every sweep


def watch(progress: simdtex.Progress) -> None:
    writer(progress)
    if progress.stage:
        hot = progress.temperature().max()
        print(f"level {progress.level}, sweep {progress.sweep:2} ({progress.phase}): hottest site {hot:.3f}")


sample = data.grass()[: args.size // 2, : args.size // 2]
texture, output = simdtex.synthesize(sample, (args.size, args.size), order=8, rng=1, callback=watch, full_output=True)

for level in output.statistics["levels"]:
    print(f"level {level['level']}: {level['rows']} x {level['cols']} sites, {level['sweeps']} sweeps")
last = {path.stem.partition("-")[0]: path for path in sorted((folder / "stages").glob("level*.png"))}  # of each level
contact_sheet([(level, read(path).pixels) for level, path in reversed(last.items())], folder / "sheet.png")
print(f"sheet.png and stages are in {folder}")
