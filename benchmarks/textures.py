# SPDX-License-Identifier: BSD-3-Clause
"""The sheets of 23 textures by the preset ``paper``, and their figures (docs/concepts/figures.rst).

    python benchmarks/textures.py FOLDER [--out docs/figures] [--device TEXT]

FOLDER has PNG pictures of 128 to 159 pixels a side; gravel, brick and grass of scikit-image are added. A sheet shows
each sample above its output of 256x256 pixels. textures.csv has, for each texture and order, the difference of the
means and the quotient of the deviations of output and sample, the mean distance of a pixel from the median of its 8
neighbours over the sample's, and that of sites of coarse levels (8 pixels apart) over that of all sites.
"""

import numpy as np
import PIL.Image
from common import DOCS, axis, chosen, command, folder, grey, opened, table
from scipy import ndimage

import simdtex

ORDERS = (8, 18)
SIDE, COLUMNS, GAP = 256, 6, 8
RING = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)


def specks(picture):
    """The distance of each pixel from the median of its 8 neighbours."""
    return np.abs(picture - ndimage.median_filter(picture, footprint=RING, mode="wrap"))


def figures(sample, output):
    """The four figures of a run; of colours the mean of the channels."""
    a, b = (picture.astype(float).reshape(*picture.shape[:2], -1).mean(-1) for picture in (sample, output))
    own = specks(b)
    return (
        (b.mean() - a.mean()) / a.std(),
        b.std() / a.std(),
        own.mean() / specks(a).mean(),
        own[::8, ::8].mean() / own.mean(),
    )


@command
def main(path, out=DOCS / "figures", device=str):
    machine, rows = opened(device), []
    samples = folder(path, "*.png") | chosen(grey(), ["gravel", "brick", "grass"])
    for order in ORDERS:
        cells = []
        for name, sample in samples.items():
            how = {"preset": "paper", "order": order, "rng": 1, "device": machine}
            output = simdtex.synthesize(sample, (SIDE, SIDE), channel_axis=axis(sample), **how)
            rows.append((name, order, *(f"{one:.3f}" for one in figures(sample, output))))
            cell = PIL.Image.new("RGB", (SIDE + GAP, 160 + SIDE + 2 * GAP), "white")
            cell.paste(PIL.Image.fromarray(sample), (0, 0))
            cell.paste(PIL.Image.fromarray(output), (0, 160 + GAP))
            cells.append(cell)
        width, height = cells[0].size
        sheet = PIL.Image.new("RGB", (COLUMNS * width, -(-len(cells) // COLUMNS) * height), "white")
        for n, cell in enumerate(cells):
            sheet.paste(cell, (n % COLUMNS * width, n // COLUMNS * height))
        sheet.save(out / f"textures-{order}.jpg", quality=85)
    header = ("texture", "order", "mean", "deviation", "specks", "coarse")
    table("The preset paper, 128 to 256", header, rows, out / "textures.csv")


if __name__ == "__main__":
    main()
