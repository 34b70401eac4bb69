# SPDX-License-Identifier: BSD-3-Clause
"""The sheets of 23 textures by the preset ``paper``, and their figures (docs/concepts/figures.rst).

    python benchmarks/textures.py FOLDER [--out docs/figures] [--device TEXT]

FOLDER has pictures of 128 to 159 pixels a side; gravel, brick and grass of scikit-image are added. A sheet shows each
sample above its output of 256x256 pixels. textures.csv has, for each texture and order, the difference of the means and
the quotient of the deviations of output and sample, the mean distance of a pixel from the median of its 8 neighbours
over the sample's, and that of sites of coarse levels (8 pixels apart) over that of all sites.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
import PIL.Image
from scipy import ndimage
from skimage import data

import simdtex

ORDERS = (8, 18)
SIDE, COLUMNS, GAP = 256, 6, 8
RING = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)


def specks(grey):
    """The distance of each pixel from the median of its 8 neighbours."""
    return np.abs(grey - ndimage.median_filter(grey, footprint=RING, mode="wrap"))


def figures(sample, output):
    """The four figures of a run; of colours the mean of the channels."""
    a, b = (picture.astype(float).reshape(*picture.shape[:2], -1).mean(-1) for picture in (sample, output))
    own = specks(b)
    return {
        "mean": (b.mean() - a.mean()) / a.std(),
        "deviation": b.std() / a.std(),
        "specks": own.mean() / specks(a).mean(),
        "coarse": own[::8, ::8].mean() / own.mean(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/figures"))
    parser.add_argument("--device")
    given = parser.parse_args()
    samples = {
        path.stem: np.asarray(PIL.Image.open(path).convert("RGB")) for path in sorted(given.folder.glob("*.png"))
    }
    samples |= {name: getattr(data, name)()[:128, :128] for name in ("gravel", "brick", "grass")}
    rows = []
    for order in ORDERS:
        cells = []
        for name, sample in samples.items():
            axis, how = (2 if sample.ndim > 2 else None), {"preset": "paper", "order": order, "rng": 1}
            output = simdtex.synthesize(sample, (SIDE, SIDE), channel_axis=axis, device=given.device, **how)
            rows.append({"texture": name, "order": order, **figures(sample, output)})
            cell = PIL.Image.new("RGB", (SIDE + GAP, 160 + SIDE + 2 * GAP), "white")
            cell.paste(PIL.Image.fromarray(sample), (0, 0))
            cell.paste(PIL.Image.fromarray(output), (0, 160 + GAP))
            cells.append(cell)
        width, height = cells[0].size
        sheet = PIL.Image.new("RGB", (COLUMNS * width, -(-len(cells) // COLUMNS) * height), "white")
        for n, cell in enumerate(cells):
            sheet.paste(cell, (n % COLUMNS * width, n // COLUMNS * height))
        sheet.save(given.out / f"textures-{order}.jpg", quality=85)
    pd.DataFrame(rows).to_csv(given.out / "textures.csv", index=False, float_format="%.3f")


if __name__ == "__main__":
    main()
